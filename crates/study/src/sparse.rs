//! Pairs as far as their rectification, under varied options.

use rayon::prelude::*;

use super::input::StudySheet;
use super::table::{Cell, Table};
use evaluation::mean;
use uncalibrated::Options;
use uncalibrated::vision::EstimatorRun;
use uncalibrated::{PairMetrics, pair_metrics, probe_pair};

/// Options under a name in each of the sweep's columns.
#[derive(Clone, Debug)]
pub(super) struct Setting {
    pub labels: Vec<String>,
    pub options: Options,
}

/// Both pairs of all sheets under all settings.
#[derive(Clone, Debug)]
pub(super) struct Sweep {
    /// What the labels of settings are.
    pub columns: Vec<String>,
    pub labels: Vec<Vec<String>>,
    pub sheets: Vec<String>,
    /// By setting, then sheet.
    pairs: Vec<[PairMetrics; 2]>,
}

/// The metrics of the dissertation's tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Metric {
    SampsonAll,
    SampsonInliers,
    Eigenvalue,
    Outliers,
    Orthogonality,
    AspectRatio,
}

impl Metric {
    pub(crate) const ALL: [Self; 6] = [
        Self::SampsonAll,
        Self::SampsonInliers,
        Self::Eigenvalue,
        Self::Outliers,
        Self::Orthogonality,
        Self::AspectRatio,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::SampsonAll => "MSD all (px²)",
            Self::SampsonInliers => "MSD inliers (px²)",
            Self::Eigenvalue => "SEV",
            Self::Outliers => "outlier ratio",
            Self::Orthogonality => "Eo deviation",
            Self::AspectRatio => "Ea deviation",
        }
    }

    fn of_pair(self, pair: &PairMetrics) -> Option<f64> {
        match self {
            Self::SampsonAll => pair.mean_sampson_all.map(|mean| mean.px2),
            Self::SampsonInliers => pair.mean_sampson_inliers.map(|mean| mean.px2),
            Self::Eigenvalue => pair.smallest_absolute_eigenvalue,
            Self::Outliers => pair.outlier_ratio,
            Self::Orthogonality => {
                pair.distortion.as_ref().map(|found| found.mean_orthogonality_deviation)
            }
            Self::AspectRatio => {
                pair.distortion.as_ref().map(|found| found.mean_aspect_ratio_deviation)
            }
        }
    }
}

/// Runs all settings on all sheets, in parallel; `on_unit` after each sheet's.
pub(super) fn sweep(
    sheets: &[StudySheet],
    columns: &[&str],
    settings: &[Setting],
    on_unit: &(dyn Fn() + Sync),
) -> Sweep {
    let pairs = (0..settings.len() * sheets.len())
        .into_par_iter()
        .with_max_len(1)
        .map(|index| {
            let (setting, sheet) = (index / sheets.len(), index % sheets.len());
            let pairs = measure(&sheets[sheet], &settings[setting].options);
            on_unit();
            pairs
        })
        .collect();
    Sweep {
        columns: columns.iter().map(|&name| name.to_owned()).collect(),
        labels: settings.iter().map(|setting| setting.labels.clone()).collect(),
        sheets: sheets.iter().map(|sheet| sheet.name.clone()).collect(),
        pairs,
    }
}

fn measure(sheet: &StudySheet, options: &Options) -> [PairMetrics; 2] {
    let [before, middle, after] = &sheet.views;
    let (width_px, height_px) = middle.image.dimensions();
    [[before, middle], [middle, after]].map(|views| {
        let pair = probe_pair(views, options);
        pair_metrics(&pair, f64::from(width_px), f64::from(height_px))
    })
}

impl Sweep {
    fn pairs_of(&self, setting: usize, sheet: usize) -> &[PairMetrics; 2] {
        &self.pairs[setting * self.sheets.len() + sheet]
    }

    /// The mean over a sheet's pairs that have the figure.
    pub(crate) fn of_sheet(&self, metric: Metric, setting: usize, sheet: usize) -> Option<f64> {
        mean(self.pairs_of(setting, sheet).iter().filter_map(|pair| metric.of_pair(pair)))
    }

    /// The mean of the sheets' means.
    pub(crate) fn mean_of_sheets(&self, metric: Metric, setting: usize) -> Option<f64> {
        mean((0..self.sheets.len()).filter_map(|sheet| self.of_sheet(metric, setting, sheet)))
    }

    /// The median of the sheets' means.
    pub(crate) fn median_of_sheets(&self, metric: Metric, setting: usize) -> Option<f64> {
        let sheets = 0..self.sheets.len();
        let mut values: Vec<f64> =
            sheets.filter_map(|sheet| self.of_sheet(metric, setting, sheet)).collect();
        values.sort_by(f64::total_cmp);
        median_of_sorted(&values)
    }

    /// Pairs that came as far as their rectification, and all.
    pub(crate) fn usable(
        &self,
        setting: usize,
        sheets: impl Iterator<Item = usize>,
    ) -> (usize, usize) {
        let pairs: Vec<_> = sheets.flat_map(|sheet| self.pairs_of(setting, sheet)).collect();
        (pairs.iter().filter(|pair| pair.usable).count(), pairs.len())
    }

    /// Rejected and all matches, the mean over a sheet's pairs.
    pub(crate) fn matches(&self, setting: usize, sheet: usize) -> (f64, f64) {
        let pairs = self.pairs_of(setting, sheet);
        let of = |count: fn(&PairMetrics) -> usize| {
            pairs.iter().map(|pair| count(pair) as f64).sum::<f64>() / 2.0
        };
        (of(|pair| pair.matches - pair.inliers), of(|pair| pair.matches))
    }

    /// The row of this setting; each pair with everything measured of it.
    pub(crate) fn table(&self) -> Table {
        let fixed = ["sheet", "pair", "failure", "estimator", "keypoints_left", "keypoints_right"];
        let counted = ["matches", "inliers"];
        let metrics = [
            "msd_all_px2",
            "msd_inliers_px2",
            "sev",
            "outlier_ratio",
            "eo_deviation",
            "ea_deviation",
        ];
        let names = fixed.iter().chain(&counted).chain(&metrics).map(|&name| name.to_owned());
        let mut table = Table::new(self.columns.iter().cloned().chain(names));
        for (setting, labels) in self.labels.iter().enumerate() {
            for (sheet, name) in self.sheets.iter().enumerate() {
                for pair in self.pairs_of(setting, sheet) {
                    table.push(pair_row(labels, name, pair));
                }
            }
        }
        table
    }
}

fn pair_row(labels: &[String], sheet: &str, pair: &PairMetrics) -> Vec<Cell> {
    let mut row: Vec<Cell> = labels.iter().map(|label| label.as_str().into()).collect();
    row.extend([
        sheet.into(),
        pair.pair.to_string().into(),
        pair.failure_detail.clone().into(),
        pair.estimator.map(estimator_name).into(),
        pair.keypoints_left.into(),
        pair.keypoints_right.into(),
        pair.matches.into(),
        pair.inliers.into(),
    ]);
    row.extend(Metric::ALL.map(|metric| Cell::from(metric.of_pair(pair))));
    row
}

fn estimator_name(estimator: EstimatorRun) -> String {
    let name = serde_json::to_value(estimator).ok();
    name.and_then(|name| name.as_str().map(str::to_owned)).unwrap_or_default()
}

/// The middle one, or the mean of the two in the middle.
pub(super) fn median_of_sorted(values: &[f64]) -> Option<f64> {
    let (low, high) = (values.get((values.len().max(1) - 1) / 2)?, values.get(values.len() / 2)?);
    Some((low + high) / 2.0)
}
