//! Tests of whole drafts by the method `uncalibrated`.

use std::collections::BTreeMap;
use std::io::{Cursor, Read, Write};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use image::{GrayImage, ImageFormat, Luma};
use imageproc::drawing::draw_line_segment_mut;
use serde_json::{Value, json};

use super::*;
use artifacts::{Artifact, ArtifactName, ArtifactWriter};
use progress::{Progress, Silent};
use sheet::ViewDocument;

const WIDTH: u32 = 240;
const HEIGHT: u32 = 180;

pub(super) type Files = BTreeMap<String, Vec<u8>>;

/// Edges of a box about the turntable axis, turned by `turn_deg`.
fn box_edges(half: [f64; 3], centre: [f64; 3], turn_deg: f64) -> Vec<[[f64; 3]; 2]> {
    let (sin, cos) = turn_deg.to_radians().sin_cos();
    let corner = |i: usize| {
        let at = |axis: usize| if i >> axis & 1 == 1 { half[axis] } else { -half[axis] };
        let (x, y) = (at(0) + centre[0], at(1) + centre[1]);
        [x * cos - y * sin, x * sin + y * cos, at(2) + centre[2]]
    };
    (0..8)
        .flat_map(|i| [0, 1, 2].map(|axis| (i, i | 1 << axis)))
        .filter(|(a, b)| a != b)
        .map(|(a, b)| [corner(a), corner(b)])
        .collect()
}

/// A wire model of stacked boxes as the turntable's camera sees it.
fn drawing(azimuth_deg: f64) -> GrayImage {
    let (sin, cos) = azimuth_deg.to_radians().sin_cos();
    let project = |p: [f64; 3]| {
        let x = p[0] * cos + p[1] * sin + f64::from(WIDTH) / 2.0;
        (x as f32, (f64::from(HEIGHT) / 2.0 - p[2]) as f32)
    };
    let mut image = GrayImage::from_pixel(WIDTH, HEIGHT, Luma([255]));
    let boxes = [
        box_edges([70.0, 45.0, 25.0], [0.0, 0.0, -60.0], 10.0),
        box_edges([40.0, 55.0, 20.0], [15.0, -5.0, -10.0], 35.0),
        box_edges([25.0, 20.0, 30.0], [-10.0, 10.0, 45.0], -20.0),
        box_edges([60.0, 8.0, 6.0], [0.0, -20.0, 25.0], 5.0),
    ];
    for [a, b] in boxes.concat() {
        let ((ax, ay), (bx, by)) = (project(a), project(b));
        for shift in [0.0, 1.0] {
            draw_line_segment_mut(&mut image, (ax + shift, ay), (bx + shift, by), Luma([0]));
            draw_line_segment_mut(&mut image, (ax, ay + shift), (bx, by + shift), Luma([0]));
        }
    }
    image
}

pub(super) fn png(image: &GrayImage) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, ImageFormat::Png).unwrap();
    bytes.into_inner()
}

pub(super) fn sheet_of(
    drawings: impl IntoIterator<Item = (f64, GrayImage)>,
) -> (SheetDocument, Files) {
    let mut document = SheetDocument::default();
    let mut files = Files::new();
    for (azimuth_deg, image) in drawings {
        let name = format!("{azimuth_deg}.png");
        files.insert(name.clone(), png(&image));
        document.views.push(ViewDocument { image: name, azimuth_deg, ..Default::default() });
    }
    document.options = Some(json!({
        "method": "uncalibrated",
        "disparity": {"block_size": 15, "min_disparity_px": -16},
        "merge": {"iterations": 40},
    }));
    (document, files)
}

pub(super) fn sheet(azimuths: &[f64]) -> (SheetDocument, Files) {
    sheet_of(azimuths.iter().map(|&azimuth| (azimuth, drawing(azimuth))))
}

pub(super) fn run(
    document: &SheetDocument,
    files: &Files,
    threads: usize,
    observer: &dyn Observer,
) -> Result<(Summary, Vec<Artifact>), DraftError> {
    let mut kept = Kept::default();
    let read = |name: &str| files.get(name).cloned().ok_or(io::ErrorKind::NotFound.into());
    let limits = DraftLimits::default();
    let summary = produce(document, &read, &limits, threads, observer, &mut kept)?;
    let artifacts = std::mem::take(&mut *kept.0.lock().unwrap());
    Ok((summary, artifacts))
}

/// Artifacts in the order they were finished.
#[derive(Clone, Default)]
struct Kept(Arc<Mutex<Vec<Artifact>>>);

struct Growing {
    name: ArtifactName,
    bytes: Vec<u8>,
    kept: Kept,
}

impl ArtifactSink for Kept {
    fn put(&mut self, artifact: Artifact) -> io::Result<()> {
        self.0.lock().unwrap().push(artifact);
        Ok(())
    }

    fn create(&mut self, name: ArtifactName) -> io::Result<Box<dyn ArtifactWriter>> {
        Ok(Box::new(Growing { name, bytes: Vec::new(), kept: self.clone() }))
    }
}

impl Write for Growing {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.bytes.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl ArtifactWriter for Growing {
    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.kept.put(Artifact::new(self.name, self.bytes))
    }
}

pub(super) fn input_error(document: &SheetDocument, files: &Files) -> (&'static str, String) {
    match run(document, files, 2, &Silent) {
        Err(DraftError::Input { code, detail }) => (code.name(), detail),
        other => panic!("expected an input error, got {other:?}"),
    }
}

pub(super) fn metrics(artifacts: &[Artifact]) -> Value {
    let found = artifacts.iter().find(|artifact| artifact.name == "metrics.json").unwrap();
    serde_json::from_slice(&found.bytes).unwrap()
}

pub(super) fn without_timings(artifacts: Vec<Artifact>) -> Vec<Artifact> {
    artifacts.into_iter().filter(|artifact| artifact.name != "timings.json").collect()
}

#[test]
fn a_sheet_becomes_every_artifact() {
    let (document, files) = sheet(&[0.0, 5.0, 10.0, 60.0]);
    let (summary, artifacts) = run(&document, &files, 2, &Silent).unwrap();
    let names: Vec<_> = artifacts.iter().map(|artifact| artifact.name.clone()).collect();
    assert_eq!(summary.artifacts, names);
    assert_eq!((summary.views, summary.pairs, summary.usable_pairs), (4, 2, 2));
    for expected in [
        "views/0/disparity.png",
        "views/5/disparity.pfm",
        "views/5/drawing.png",
        "views/5/depth.png",
        "views/10/depth.pfm",
        "pairs/0-5/matches.png",
        "pairs/0-5/matches.json",
        "pairs/5-10/rectified.png",
        "cloud.ply",
        "hull.glb",
        "thumbnail.png",
        "metrics.json",
        "bundle.zip",
        "timings.json",
    ] {
        assert!(names.iter().any(|name| name == expected), "{expected} is missing: {names:?}");
    }
    let metrics = metrics(&artifacts);
    assert_eq!(metrics["skipped_pairs"][0]["pair"], "10-60");
    assert_eq!(metrics["skipped_pairs"][1]["angle_deg"], 300.0);
    let absent = metrics["absent_artifacts"].as_array().unwrap();
    assert!(absent.iter().any(|entry| entry["name"] == "views/60/depth.png"), "{absent:?}");
    for pair in metrics["pairs"].as_array().unwrap() {
        assert!(pair["mean_sampson_inliers"]["px2"].as_f64().unwrap() < 4.0);
        assert!(pair["outlier_ratio"].as_f64().unwrap() < 0.5);
        assert!(pair["distortion"]["mean_aspect_ratio_deviation"].is_number());
    }
}

#[test]
fn the_bundle_holds_all_but_itself_and_the_timings() {
    let (document, files) = sheet(&[0.0, 5.0, 10.0]);
    let (_, artifacts) = run(&document, &files, 2, &Silent).unwrap();
    let bundle = artifacts.iter().find(|artifact| artifact.name == "bundle.zip").unwrap();
    let mut archive = zip::ZipArchive::new(Cursor::new(&bundle.bytes)).unwrap();
    let apart = ["bundle.zip", "timings.json"];
    let others: Vec<_> =
        artifacts.iter().filter(|artifact| !apart.contains(&artifact.name.as_str())).collect();
    assert_eq!(archive.len(), others.len());
    for artifact in others {
        let mut bytes = Vec::new();
        archive.by_name(&artifact.name).unwrap().read_to_end(&mut bytes).unwrap();
        assert!(bytes == artifact.bytes, "{} differs", artifact.name);
    }
}

#[test]
fn neither_threads_nor_the_order_of_views_change_a_byte() {
    let (mut document, files) = sheet(&[350.0, 355.0, 0.0, 5.0]);
    let one = without_timings(run(&document, &files, 1, &Silent).unwrap().1);
    let four = without_timings(run(&document, &files, 4, &Silent).unwrap().1);
    assert!(one == four, "the number of threads matters");
    document.views.swap(0, 2);
    document.views.swap(1, 3);
    let permuted = without_timings(run(&document, &files, 2, &Silent).unwrap().1);
    assert!(one == permuted, "the order of the views matters");
}

#[test]
fn affine_depth_is_another_relation_over_the_same_disparity() {
    let (mut document, files) = sheet(&[0.0, 5.0, 10.0]);
    let (_, inverse) = run(&document, &files, 2, &Silent).unwrap();
    ::options::merge(document.options.as_mut().unwrap(), json!({"cloud": {"depth": "affine"}}));
    let (_, affine) = run(&document, &files, 2, &Silent).unwrap();
    let bytes = |artifacts: &[Artifact], name: &str| {
        artifacts.iter().find(|artifact| artifact.name == name).unwrap().bytes.clone()
    };
    let (same, other) = ("views/5/disparity.pfm", "views/5/depth.pfm");
    assert!(bytes(&inverse, same) == bytes(&affine, same));
    assert!(bytes(&inverse, other) != bytes(&affine, other));
}

#[derive(Default)]
pub(super) struct Watcher {
    pub fractions: Mutex<Vec<f64>>,
    pub cancel_after: Option<usize>,
    pub asked: AtomicUsize,
}

impl Observer for Watcher {
    fn progress(&self, progress: Progress) {
        assert!(progress.done <= progress.total);
        self.fractions.lock().unwrap().push(progress.fraction);
    }

    fn is_cancelled(&self) -> bool {
        let seen = self.fractions.lock().unwrap().len();
        self.asked.fetch_add(1, Ordering::Relaxed);
        self.cancel_after.is_some_and(|limit| seen >= limit)
    }
}

#[test]
fn progress_rises_to_one() {
    let (document, files) = sheet(&[0.0, 5.0, 10.0]);
    let watcher = Watcher::default();
    run(&document, &files, 2, &watcher).unwrap();
    let fractions = watcher.fractions.into_inner().unwrap();
    assert!(fractions.windows(2).all(|pair| pair[0] <= pair[1]), "{fractions:?}");
    assert!((fractions[fractions.len() - 1] - 1.0).abs() < 1e-12);
}

#[test]
fn cancelling_stops_at_the_next_unit() {
    let (document, files) = sheet(&[0.0, 5.0, 10.0, 15.0]);
    let whole = Watcher::default();
    run(&document, &files, 1, &whole).unwrap();
    let steps = whole.fractions.into_inner().unwrap().len();
    for cancel_after in [1, 9, steps - 2] {
        let watcher = Watcher { cancel_after: Some(cancel_after), ..Watcher::default() };
        let error = run(&document, &files, 1, &watcher).unwrap_err();
        assert!(matches!(error, DraftError::Cancelled(_)), "{error}");
        let seen = watcher.fractions.into_inner().unwrap().len();
        assert!(seen <= cancel_after + 1, "{seen} steps after cancelling at {cancel_after}");
    }
}

#[test]
fn blank_drawings_have_no_usable_pair() {
    let blank = GrayImage::from_pixel(WIDTH, HEIGHT, Luma([255]));
    let (document, files) = sheet_of([0.0, 5.0, 10.0].map(|azimuth| (azimuth, blank.clone())));
    let (code, detail) = input_error(&document, &files);
    assert_eq!(code, "no_usable_pair");
    assert!(detail.contains("0-5: epipolar geometry: 0 matches; at least 8"), "{detail}");
    assert!(detail.contains("10-0: 350 degrees apart"), "{detail}");
}

#[test]
fn one_bad_view_costs_only_its_pairs() {
    let (document, files) = sheet_of([0.0, 5.0, 10.0, 15.0].map(|azimuth| match azimuth {
        15.0 => (azimuth, GrayImage::from_pixel(WIDTH, HEIGHT, Luma([255]))),
        _ => (azimuth, drawing(azimuth)),
    }));
    let (summary, artifacts) = run(&document, &files, 2, &Silent).unwrap();
    assert_eq!((summary.pairs, summary.usable_pairs), (3, 2));
    let failure = &metrics(&artifacts)["pairs"][2]["failure"];
    assert_eq!(failure["stage"], "epipolar_geometry");
    assert_eq!(failure["code"], "too_few_correspondences");
    assert_eq!((&failure["found"], &failure["required"]), (&json!(0), &json!(8)));
    assert!(artifacts.iter().any(|a| a.name == "pairs/10-15/matches.json"));
    assert!(!artifacts.iter().any(|a| a.name == "pairs/10-15/rectified.png"));
}

#[test]
fn later_tries_are_reported_when_the_threshold_is_out_of_reach() {
    let (mut document, files) = sheet(&[0.0, 5.0, 10.0]);
    let never = json!({"epipolar": {"tries": 3, "max_mean_sampson_px2": 0.0}});
    ::options::merge(document.options.as_mut().unwrap(), never);
    let (summary, artifacts) = run(&document, &files, 2, &Silent).unwrap();
    let metrics = metrics(&artifacts);
    let tries = metrics["pairs"][0]["tries"].as_array().unwrap();
    assert_eq!(tries.len(), 3);
    let best = tries
        .iter()
        .filter_map(|attempt| attempt["mean_sampson_px2"].as_f64())
        .fold(f64::INFINITY, f64::min);
    assert_eq!(metrics["pairs"][0]["mean_sampson_inliers"]["px2"], json!(best));
    assert!(summary.warnings.iter().any(|w| w.contains("none of 3 tries")), "{summary:?}");
}

#[test]
fn unsuitable_sheets_are_refused_with_a_reason() {
    let (document, files) = sheet(&[0.0, 5.0]);
    assert_eq!(input_error(&document, &files).0, "too_few_views");

    let (mut document, mut files) = sheet(&[0.0, 5.0, 10.0]);
    files.insert("5.png".to_owned(), png(&GrayImage::new(WIDTH, HEIGHT - 1)));
    assert_eq!(input_error(&document, &files).0, "sizes_differ");

    files.insert("5.png".to_owned(), files["0.png"][..200].to_vec());
    let (code, detail) = input_error(&document, &files);
    assert_eq!(code, "invalid_image");
    assert!(detail.contains("5.png"), "{detail}");

    files.remove("5.png");
    assert!(matches!(run(&document, &files, 1, &Silent), Err(DraftError::Io(_))));

    document.options = Some(json!({"method": "uncalibrated", "disparity": {"block_size": 4}}));
    assert_eq!(input_error(&document, &files).0, "invalid_options");

    let (mut document, files) = sheet(&[0.0, 5.0, 10.0]);
    document.views[2].azimuth_deg = 365.0;
    assert_eq!(input_error(&document, &files).0, "invalid_sheet");
    document.views[2].azimuth_deg = f64::NAN;
    assert_eq!(input_error(&document, &files).0, "invalid_azimuth");
}
