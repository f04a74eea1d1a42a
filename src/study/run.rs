use rayon::prelude::*;

use super::dense::{
    Bad2, BlockRow, DepthReports, Map, RectifiedSheet, Try, best, rectify_all, search, sweep_blocks,
};
use super::document;
use super::input::StudySheet;
use super::plots::PlotError;
use super::protocol::{Protocol, descriptor_name, detector_name};
use super::sparse::{Setting, Sweep, sweep};
use crate::evaluation::ViewReport;
use crate::options::{DetectionOptions, DisparityOptions, Options};

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
    pub name: String,
    pub text: String,
}

/// How often [`Study::run`] will say that a unit is done.
pub fn units(protocol: &Protocol, sheets: usize, wider: usize) -> usize {
    let settings = protocol.combinations.len()
        + 2
        + protocol.thresholds_px.len()
        + protocol.confidences.len()
        + protocol.block_sizes.len()
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
        let blocks = sweep_blocks(&rectified, &base.disparity, &protocol.block_sizes, on_unit);
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
    /// [`PlotError`] if a plot cannot be drawn.
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
