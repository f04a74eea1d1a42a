//! Runs the study's sweeps and searches on all sheets.

use rayon::prelude::*;

use super::dense::{
    Bad2, BlockRow, DepthReports, Map, RectifiedSheet, Try, best, rectify_all, search, sweep_blocks,
};
use super::document;
use super::input::StudySheet;
use super::plots::PlotError;
use super::protocol::{Protocol, descriptor_name, detector_name};
use super::sparse::{Setting, Sweep, sweep};
use evaluation::ViewReport;
use uncalibrated::Options;
use uncalibrated::options::{DetectionOptions, DisparityOptions};

/// Everything the study found out.
pub struct Study {
    pub(super) protocol: Protocol,
    /// Names and spacings, degrees.
    pub(super) sheets: Vec<(String, f64)>,
    /// Tables 4.1 and 4.2.
    pub(super) features: Sweep,
    /// Table 4.4: on, off.
    pub(super) cross_check: Sweep,
    /// Figure 4.3a.
    pub(super) thresholds: Sweep,
    /// Figure 4.3b.
    pub(super) confidences: Sweep,
    /// Figure 4.6.
    pub(super) blocks: Vec<BlockRow>,
    /// Figure 4.8, by sheet.
    pub(super) maps: Vec<MapsRow>,
    /// Tables 4.7 and 4.8; the sheets, then those at a wider spacing.
    pub(super) searches: Vec<Search>,
}

/// The three maps of one middle view at the base options.
pub(super) struct MapsRow {
    pub maps: [(Map, Result<ViewReport, String>); 3],
    pub depths: Option<DepthReports>,
}

/// The search on one sheet.
pub(super) struct Search {
    pub name: String,
    pub spacing_deg: f64,
    pub tries: Vec<Try>,
    /// One for each reading of bad2.0; absent if nothing could be measured.
    pub best: Vec<(Bad2, Option<BestTry>)>,
}

/// A chosen try, and the mean map under its options.
pub(super) struct BestTry {
    pub block_size: i32,
    pub min_disparity_px: i32,
    pub mean: Result<ViewReport, String>,
    pub depths: Option<DepthReports>,
}

/// A file of the study.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StudyFile {
    /// Path in the study's folder.
    pub name: String,
    /// The whole content.
    pub text: String,
}

/// How often [`Study::run`] will say that a unit is done.
pub fn units(protocol: &Protocol, sheets: usize, wider: usize) -> usize {
    let settings = protocol.combinations.len()
        + 2
        + protocol.thresholds_px.len()
        + protocol.confidences.len()
        + protocol.blocks().len()
        + 1;
    let grid = protocol.grid.block_sizes.len() * protocol.grid.min_disparities_px.len();
    settings * sheets + grid * (sheets + wider)
}

impl Study {
    /// Runs the protocol on the current thread pool; the result does not
    /// depend on it.
    ///
    /// * `wider`: sheets at a wider spacing, for table 4.7 alone.
    /// * `on_unit`: called from any thread, [`units`] times.
    pub fn run(
        sheets: &[StudySheet],
        wider: &[StudySheet],
        protocol: &Protocol,
        on_unit: &(dyn Fn() + Sync),
    ) -> Self {
        let base = &protocol.base;
        let rectified = rectify_all(sheets, base);
        let wide = rectify_all(wider, base);
        let blocks = sweep_blocks(&rectified, &base.disparity, &protocol.blocks(), on_unit);
        let maps = rectified
            .par_iter()
            .with_max_len(1)
            .map(|sheet| {
                let row = maps_row(sheet, base);
                on_unit();
                row
            })
            .collect();
        Self {
            protocol: protocol.clone(),
            sheets: sheets.iter().map(|sheet| (sheet.name.clone(), sheet.spacing_deg)).collect(),
            features: features(sheets, protocol, on_unit),
            cross_check: cross_check(sheets, protocol, on_unit),
            thresholds: thresholds(sheets, protocol, on_unit),
            confidences: confidences(sheets, protocol, on_unit),
            blocks,
            maps,
            searches: rectified
                .iter()
                .chain(&wide)
                .map(|sheet| searched(sheet, protocol, on_unit))
                .collect(),
        }
    }

    /// The report, its plots and its tables.
    ///
    /// # Errors
    /// `PlotError` if a plot cannot be drawn.
    pub fn files(&self) -> Result<Vec<StudyFile>, PlotError> {
        document::files(self)
    }
}

fn features(sheets: &[StudySheet], protocol: &Protocol, on_unit: &(dyn Fn() + Sync)) -> Sweep {
    let setting = |&(detector, descriptor): &_| Setting {
        labels: vec![detector_name(detector).to_owned(), descriptor_name(descriptor).to_owned()],
        options: Options {
            detection: DetectionOptions { detector, descriptor, ..protocol.base.detection.clone() },
            ..protocol.base.clone()
        },
    };
    let settings: Vec<_> = protocol.combinations.iter().map(setting).collect();
    sweep(sheets, &["detector", "descriptor"], &settings, on_unit)
}

fn cross_check(sheets: &[StudySheet], protocol: &Protocol, on_unit: &(dyn Fn() + Sync)) -> Sweep {
    let settings = [true, false].map(|on| {
        let mut options = protocol.base.clone();
        options.matching.cross_check = on;
        Setting { labels: vec![if on { "on" } else { "off" }.to_owned()], options }
    });
    sweep(sheets, &["cross_check"], &settings, on_unit)
}

fn thresholds(sheets: &[StudySheet], protocol: &Protocol, on_unit: &(dyn Fn() + Sync)) -> Sweep {
    let setting = |&max_error_px: &f64| {
        let mut options = protocol.base.clone();
        options.epipolar.max_error_px = max_error_px;
        Setting { labels: vec![max_error_px.to_string()], options }
    };
    let settings: Vec<_> = protocol.thresholds_px.iter().map(setting).collect();
    sweep(sheets, &["threshold_px"], &settings, on_unit)
}

fn confidences(sheets: &[StudySheet], protocol: &Protocol, on_unit: &(dyn Fn() + Sync)) -> Sweep {
    let setting = |&confidence: &f64| {
        let mut options = protocol.base.clone();
        options.epipolar.confidence = confidence;
        Setting { labels: vec![confidence.to_string()], options }
    };
    let settings: Vec<_> = protocol.confidences.iter().map(setting).collect();
    sweep(sheets, &["confidence"], &settings, on_unit)
}

fn maps_row(sheet: &RectifiedSheet<'_>, options: &Options) -> MapsRow {
    let maps = sheet.maps(&options.disparity);
    let report = |map| {
        let maps = maps.as_ref().map_err(Clone::clone)?;
        sheet.evaluate(map, maps)
    };
    let depths = maps.as_ref().ok().map(|maps| sheet.evaluate_depths(maps, options));
    MapsRow { maps: Map::ALL.map(|map| (map, report(map))), depths }
}

fn searched(
    sheet: &RectifiedSheet<'_>,
    protocol: &Protocol,
    on_unit: &(dyn Fn() + Sync),
) -> Search {
    let base = &protocol.base;
    let tries = search(sheet, &base.disparity, &protocol.grid, on_unit);
    let under = |found: &Try| {
        let (block_size, min_disparity_px) = (found.block_size, found.min_disparity_px);
        let options = DisparityOptions { block_size, min_disparity_px, ..base.disparity.clone() };
        let maps = sheet.maps(&options);
        let depths = maps.as_ref().ok().map(|maps| sheet.evaluate_depths(maps, base));
        let mean = maps.and_then(|maps| sheet.evaluate(Map::Mean, &maps));
        BestTry { block_size, min_disparity_px, mean, depths }
    };
    let best = Bad2::ALL.map(|bad2| (bad2, best(&tries, bad2).map(under)));
    Search {
        name: sheet.sheet.name.clone(),
        spacing_deg: sheet.sheet.spacing_deg,
        tries,
        best: best.into(),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use image::GrayImage;

    use super::*;
    use drawing::{DrawOptions, Drawer, PreparedModel};
    use evaluation::{ViewTruth, disparity_from_depth};
    use frames::Azimuth;
    use mesh::builtin::ProceduralModel;
    use sheet::View;
    use uncalibrated::DisparityGrid;
    use uncalibrated::Options;
    use uncalibrated::options::{Descriptor, Detector};

    fn view(azimuth_deg: f64, image: GrayImage) -> View {
        let azimuth = Azimuth::from_degrees(azimuth_deg).unwrap();
        View::level(azimuth, image, None)
    }

    /// The dude, drawn small.
    fn drawn() -> StudySheet {
        let model =
            PreparedModel::new(&ProceduralModel::from_name("dude").unwrap().build()).unwrap();
        let options = DrawOptions { width_px: 320, height_px: 180, ..DrawOptions::default() };
        let drawer = Drawer::new(&model, &options).unwrap();
        let views = [40.0, 45.0, 50.0].map(|degrees| {
            drawer.draw_view(Azimuth::from_degrees(degrees).unwrap().into()).unwrap()
        });
        let mut depth_px = views[1].truth.depth.clone();
        let per_unit = options.pixels_per_unit();
        for value in depth_px.iter_mut() {
            *value = ((f64::from(*value) - options.distance) * per_unit) as f32;
        }
        let views =
            views.map(|drawn| view(drawn.viewpoint.azimuth.degrees(), drawn.image.to_luma8()));
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
            fusions: vec![vec![5, 15]],
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
        assert_eq!(rows("figure_4_6.csv"), 3 * 2);
        assert_eq!(rows("figure_4_8.csv"), 2 * 3);
        // Three readings of bad2.0 on three sheets, and two points of the grid.
        assert_eq!(rows("table_4_7.csv"), 3 * 3);
        assert_eq!(rows("table_4_8_grid.csv"), 3 * 2);

        let pairs = named(&files, "table_4_2_pairs.csv");
        let refused = |line: &&str| line.contains("SIFT,ORB") && line.contains("cannot take");
        assert_eq!(pairs.lines().filter(refused).count(), 4);
        assert!(pairs.lines().any(|l| l.starts_with("Harris,ORB,blank") && l.contains("at least")));
        let report = named(&files, "report.md");
        // A fused map is not that of the base's single block size.
        let drawn: Vec<_> = named(&files, "figure_4_6.csv")
            .lines()
            .filter(|line| line.contains(",dude,"))
            .map(|line| line.split_once(",dude,").unwrap().1.to_owned())
            .collect();
        assert!(drawn[2] != drawn[0] && drawn[2] != drawn[1], "{drawn:?}");
        let base = DisparityOptions::default().block_size;
        assert!(!small().block_sizes.contains(&base));
        let alone = Protocol { block_sizes: vec![base], fusions: Vec::new(), ..small() };
        let alone = Study::run(&sheets, &[], &alone, &|| ()).files().unwrap();
        assert!(!named(&alone, "figure_4_6.csv").contains(&drawn[2]));
        assert!(report.contains("| 5+15 |") && report.contains("Fusion against"), "{report}");
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
}
