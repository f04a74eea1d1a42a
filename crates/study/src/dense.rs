//! Disparity of the middle views, under varied options, against the truth.

use rayon::prelude::*;

use super::input::StudySheet;
use super::protocol::Blocks;
use evaluation::{ViewReport, disparity_from_depth, disparity_from_pairs, evaluate_view};
use picture::FloatImage;
use uncalibrated::Options;
use uncalibrated::options::DisparityOptions;
use uncalibrated::vision::{PartneredMap, Rectification, affine_depth, inverse_depth, mean_map};
use uncalibrated::{
    DisparityGrid, DisparityTry, PairFailure, Side, best_try, probe_map, probe_pair,
    search_disparity,
};

/// A sheet whose two pairs went as far as their rectification, or why not.
pub(super) struct RectifiedSheet<'a> {
    pub sheet: &'a StudySheet,
    /// The pair before the middle view and the one after it.
    pairs: Result<[Rectification; 2], String>,
}

/// Which of the middle view's maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Map {
    /// Of the pair whose left view it is.
    Left,
    /// Of the pair whose right view it is.
    Right,
    /// The mean of both; where one is missing, the other.
    Mean,
}

impl Map {
    pub(crate) const ALL: [Self; 3] = [Self::Left, Self::Right, Self::Mean];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
            Self::Mean => "mean",
        }
    }
}

/// The maps of one middle view under one set of options.
pub(super) struct MiddleMaps {
    left: FloatImage,
    right: FloatImage,
    spacing_deg: f64,
}

impl<'a> RectifiedSheet<'a> {
    pub(crate) fn new(sheet: &'a StudySheet, options: &Options) -> Self {
        let [before, middle, after] = &sheet.views;
        let rectify = |views| {
            let pair = probe_pair(views, options);
            let failure = || pair.failure().map(|f| f.to_string()).unwrap_or_default();
            pair.rectification().cloned().ok_or_else(|| format!("{}: {}", pair.name, failure()))
        };
        let pairs = rectify([before, middle])
            .and_then(|one| rectify([middle, after]).map(|other| [one, other]));
        Self { sheet, pairs }
    }

    pub(crate) fn maps(&self, options: &DisparityOptions) -> Result<MiddleMaps, String> {
        Ok(MiddleMaps {
            left: self.map(Side::Left, options)?,
            right: self.map(Side::Right, options)?,
            spacing_deg: self.sheet.spacing_deg,
        })
    }

    /// The middle view's map as the pair's left or right view.
    fn map(&self, side: Side, options: &DisparityOptions) -> Result<FloatImage, String> {
        let [before, middle, after] = self.sheet.views.each_ref().map(|view| &view.image);
        let [pair_before, pair_after] = self.pairs.as_ref().map_err(Clone::clone)?;
        let map = match side {
            Side::Left => probe_map([middle, after], pair_after, side, options),
            Side::Right => probe_map([before, middle], pair_before, side, options),
        };
        map.map_err(|failure| failure.to_string())
    }

    /// Measures a disparity map of the middle view.
    pub(crate) fn evaluate(&self, map: Map, maps: &MiddleMaps) -> Result<ViewReport, String> {
        self.report(&maps.five_degree(map))
    }

    /// Measures the depth that the mean map gives by the dissertation's
    /// inverse and by the affine relation.
    pub(crate) fn evaluate_depths(&self, maps: &MiddleMaps, options: &Options) -> DepthReports {
        let mean = maps.mean();
        let spacing_rad = self.sheet.spacing_deg.to_radians();
        let inverse = inverse_depth(&mean, options.cloud.inverse_scale_px2);
        let affine = affine_depth(&[
            PartneredMap { disparity: &maps.left, to_partner_rad: spacing_rad },
            PartneredMap { disparity: &maps.right, to_partner_rad: -spacing_rad },
        ]);
        let report = |depth: &FloatImage| self.report(&disparity_from_depth(depth)).ok();
        DepthReports { inverse: report(&inverse), affine: report(&affine) }
    }

    fn report(&self, five_degree: &FloatImage) -> Result<ViewReport, String> {
        evaluate_view(five_degree, &self.sheet.truth).map_err(|error| error.to_string())
    }
}

/// How well depth fits, by both relations.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct DepthReports {
    pub inverse: Option<ViewReport>,
    pub affine: Option<ViewReport>,
}

impl MiddleMaps {
    fn mean(&self) -> FloatImage {
        mean_map(self.left.clone(), &self.right)
    }

    fn five_degree(&self, map: Map) -> FloatImage {
        let spacing = self.spacing_deg;
        match map {
            Map::Left => disparity_from_pairs(&self.left, &[spacing]),
            Map::Right => disparity_from_pairs(&self.right, &[-spacing]),
            Map::Mean => disparity_from_pairs(&self.mean(), &[spacing, -spacing]),
        }
    }
}

/// All sheets' pairs, rectified with the base options.
pub(super) fn rectify_all<'a>(
    sheets: &'a [StudySheet],
    options: &Options,
) -> Vec<RectifiedSheet<'a>> {
    let sheets = sheets.par_iter().with_max_len(1);
    sheets.map(|sheet| RectifiedSheet::new(sheet, options)).collect()
}

/// The mean map of one sheet at one block size, or of several fused.
pub(super) struct BlockRow {
    pub blocks: Blocks,
    /// Index of the sheet.
    pub sheet: usize,
    pub report: Result<ViewReport, String>,
}

/// Figure 4.6: the mean map over block sizes, by setting and sheet.
pub(super) fn sweep_blocks(
    sheets: &[RectifiedSheet<'_>],
    options: &DisparityOptions,
    settings: &[Blocks],
    on_unit: &(dyn Fn() + Sync),
) -> Vec<BlockRow> {
    (0..settings.len() * sheets.len())
        .into_par_iter()
        .with_max_len(1)
        .map(|index| {
            let (blocks, sheet) = (&settings[index / sheets.len()], index % sheets.len());
            let rectified = &sheets[sheet];
            let maps = rectified.maps(&blocks.options(options));
            let report = maps.and_then(|maps| rectified.evaluate(Map::Mean, &maps));
            on_unit();
            BlockRow { blocks: blocks.clone(), sheet, report }
        })
        .collect()
}

/// A point of the search of table 4.8, measured on the left map.
pub(super) type Try = DisparityTry<Result<ViewReport, String>>;

/// Table 4.8: every point of the grid on one sheet, by block size, then least
/// disparity.
///
/// The left map alone is measured, as one map costs half of two.
pub(super) fn search(
    sheet: &RectifiedSheet<'_>,
    options: &DisparityOptions,
    grid: &DisparityGrid,
    on_unit: &(dyn Fn() + Sync),
) -> Vec<Try> {
    let [_, middle, after] = &sheet.sheet.views;
    let spacing = sheet.sheet.spacing_deg;
    let measure = |map: Result<FloatImage, String>| {
        let report = map.and_then(|map| sheet.report(&disparity_from_pairs(&map, &[spacing])));
        on_unit();
        report
    };
    match &sheet.pairs {
        Ok([_, pair]) => {
            let measure =
                |map: Result<_, PairFailure>| measure(map.map_err(|failure| failure.to_string()));
            search_disparity([&middle.image, &after.image], pair, options, grid, measure)
        }
        Err(told) => grid
            .points()
            .map(|(block_size, min_disparity_px)| {
                let measured = measure(Err(told.clone()));
                Try { min_disparity_px, block_size, measured }
            })
            .collect(),
    }
}

/// By which of bad2.0's readings the best try is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Bad2 {
    /// In px of the 5-degree pair's disparity, nothing fitted.
    Px,
    /// In grey levels of both maps stretched to 8 bits.
    Grey,
    /// The same as the dissertation lists it: what is too bright never counts.
    GreyListed,
}

impl Bad2 {
    pub(crate) const ALL: [Self; 3] = [Self::Px, Self::Grey, Self::GreyListed];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Px => "px",
            Self::Grey => "grey",
            Self::GreyListed => "grey as listed",
        }
    }

    pub(crate) fn of(self, report: &ViewReport) -> Option<f64> {
        match self {
            Self::Px => report.bad2_px.map(|bad| bad.honest),
            Self::Grey => Some(report.bad2_grey.honest),
            Self::GreyListed => Some(report.bad2_grey.as_listed),
        }
    }
}

/// The try with the least bad2.0; among equals the first.
pub(super) fn best(tries: &[Try], bad2: Bad2) -> Option<&Try> {
    best_try(tries, |report| bad2.of(report.as_ref().ok()?))
}
