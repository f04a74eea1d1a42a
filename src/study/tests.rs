use std::sync::atomic::{AtomicUsize, Ordering};

use image::GrayImage;

use super::*;
use crate::draw::{DrawOptions, Drawer, PreparedModel};
use crate::evaluation::{ViewTruth, disparity_from_depth};
use crate::models::ProceduralModel;
use crate::options::{Descriptor, Detector, Options};
use crate::pipeline::DisparityGrid;
use crate::sheet::{Azimuth, View};

fn view(azimuth_deg: f64, image: GrayImage) -> View {
    let azimuth = Azimuth::from_degrees(azimuth_deg).unwrap();
    View { azimuth, elevation_deg: 0.0, image, mask: None }
}

/// The dude, drawn small.
fn drawn() -> StudySheet {
    let model = PreparedModel::new(&ProceduralModel::from_name("dude").unwrap().build()).unwrap();
    let options = DrawOptions { width_px: 320, height_px: 180, ..DrawOptions::default() };
    let drawer = Drawer::new(&model, &options).unwrap();
    let views = [40.0, 45.0, 50.0]
        .map(|degrees| drawer.draw_view(Azimuth::from_degrees(degrees).unwrap()).unwrap());
    let mut depth_px = views[1].truth.depth.clone();
    let per_unit = options.pixels_per_unit();
    for value in depth_px.iter_mut() {
        *value = ((f64::from(*value) - options.distance) * per_unit) as f32;
    }
    let views = views.map(|drawn| view(drawn.azimuth.degrees(), drawn.image.to_luma8()));
    StudySheet {
        name: "dude".to_owned(),
        spacing_deg: 5.0,
        views,
        truth: ViewTruth::Metric(disparity_from_depth(&depth_px)),
    }
}

/// Nothing is found on it.
fn blank() -> StudySheet {
    let dude = drawn();
    let paper = GrayImage::from_pixel(320, 180, image::Luma([255]));
    let views = dude.views.each_ref().map(|v| view(v.azimuth.degrees(), paper.clone()));
    StudySheet { name: "blank".to_owned(), views, ..dude }
}

fn small() -> Protocol {
    Protocol {
        base: Options::default(),
        combinations: vec![
            (Detector::Harris, Descriptor::Orb),
            (Detector::Fast, Descriptor::Orb),
            (Detector::Sift, Descriptor::Orb),
        ],
        thresholds_px: vec![1.0, 2.0],
        confidences: vec![0.9, 0.99],
        block_sizes: vec![5, 15],
        grid: DisparityGrid { min_disparities_px: vec![0, -8], block_sizes: vec![15] },
    }
}

fn named<'a>(files: &'a [StudyFile], name: &str) -> &'a str {
    &files.iter().find(|file| file.name == name).unwrap().text
}

#[test]
fn every_row_is_there_failures_too_whatever_the_threads() {
    let sheets = [blank(), drawn()];
    let done = AtomicUsize::new(0);
    let count = || {
        done.fetch_add(1, Ordering::Relaxed);
    };
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Study::run(&sheets, &sheets[..1], &small(), &count).files().unwrap())
    };
    let files = on(2);
    assert_eq!(done.load(Ordering::Relaxed), units(&small(), 2, 1));
    assert_eq!(files, on(1));

    let rows = |name: &str| named(&files, name).lines().count() - 1;
    assert_eq!(rows("table_4_2.csv"), 3);
    assert_eq!(rows("table_4_2_pairs.csv"), 3 * 2 * 2);
    assert_eq!(rows("table_4_4_pairs.csv"), 2 * 2 * 2);
    assert_eq!(rows("figure_4_6.csv"), 2 * 2);
    assert_eq!(rows("figure_4_8.csv"), 2 * 3);
    // Three readings of bad2.0 on three sheets, and two points of the grid.
    assert_eq!(rows("table_4_7.csv"), 3 * 3);
    assert_eq!(rows("table_4_8_grid.csv"), 3 * 2);

    let pairs = named(&files, "table_4_2_pairs.csv");
    let refused = |line: &&str| line.contains("SIFT,ORB") && line.contains("cannot take");
    assert_eq!(pairs.lines().filter(refused).count(), 4);
    assert!(pairs.lines().any(|l| l.starts_with("Harris,ORB,blank") && l.contains("at least")));
    let report = named(&files, "report.md");
    assert!(report.contains("2 of 2") && report.contains("rank correlation"), "{report}");
    for file in &files {
        assert!(!file.text.is_empty(), "{} is empty", file.name);
    }
}

#[test]
fn the_drawn_dude_has_figures_beside_the_published() {
    let sheets = [drawn()];
    let protocol = Protocol { combinations: small().combinations[..1].into(), ..small() };
    let files = Study::run(&sheets, &[], &protocol, &|| ()).files().unwrap();
    let table = named(&files, "table_4_2.csv");
    let row: Vec<_> = table.lines().nth(1).unwrap().split(',').collect();
    assert_eq!(&row[..3], ["Harris", "ORB", "0.1"]);
    // One sheet: its figures are the mean's.
    assert_eq!(row[3], row[4]);
    assert!(row[3].parse::<f64>().unwrap() >= 0.0);
    let whole = named(&files, "table_4_7.csv");
    let first = whole.lines().nth(1).unwrap();
    assert!(first.starts_with("dude,5,Dude,0.31,0.49,px,15,"), "{first}");
    let maps = named(&files, "figure_4_8.csv");
    assert!(maps.contains("dude,left,0.49,0.4,"), "{maps}");
}
