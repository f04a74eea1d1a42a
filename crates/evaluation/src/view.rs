//! A view's disparity or depth against its truth, pixel by pixel.

use image::{GrayImage, Luma};
use serde::Serialize;

use super::grey::{GreyBad2, grey_bad2};
use super::statistics::{best_constant_bad_share, pearson_correlation, range, share};
use picture::FloatImage;

/// The pair in whose disparity errors are counted: a view and its neighbour
/// this many degrees on, the spacing of the dissertation's sheets.
pub const REFERENCE_PAIR_DEG: f64 = 5.0;

/// An error over this is bad (Middlebury's bad 2.0).
pub(super) const BAD_OVER: f64 = 2.0;

/// What is known of a view: nearness a pixel, larger is nearer, NaN outside
/// the truth's mask.
#[derive(Clone, Debug, PartialEq)]
pub enum ViewTruth {
    /// Disparity of the 5-degree pair, px, 0 at the axis plane.
    Metric(FloatImage),
    /// Known up to scale and offset only, such as an 8-bit ramp.
    Relative(FloatImage),
}

/// Whether any pixel has a true value.
pub fn has_values(truth: &ViewTruth) -> bool {
    truth.values().iter().any(|value| value.is_finite())
}

/// The subject's mask by the truth: 255 where there is a true value.
pub fn true_mask(truth: &ViewTruth) -> GrayImage {
    let values = truth.values();
    GrayImage::from_fn(values.width(), values.height(), |x, y| {
        Luma([if values.get_pixel(x, y).0[0].is_finite() { 255 } else { 0 }])
    })
}

impl ViewTruth {
    fn values(&self) -> &FloatImage {
        match self {
            Self::Metric(values) | Self::Relative(values) => values,
        }
    }
}

/// A view's disparity or depth against the truth, over the truth's mask.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewReport {
    /// Pixels that have truth.
    pub truth_pixels: usize,
    /// The share of them that have a value.
    pub coverage: f64,
    /// Pearson's over pixels that have both, nearer being larger; negative
    /// when front and back are swapped. Absent where either is constant.
    pub correlation: Option<f64>,
    /// Absent when the truth is relative.
    pub bad2_px: Option<PxBad2>,
    /// Bad 2.0 in grey levels of the maps stretched to 8 bits.
    pub bad2_grey: GreyBad2,
    /// Mean absolute depth error over pixels that have both, as a share of the
    /// truth's depth range. Absent when the truth is relative or flat, or no
    /// pixel has both.
    pub depth_error_over_range: Option<f64>,
}

/// Shares of the truth's pixels off by more than 2.0 px in the 5-degree
/// pair's disparity; a missing value is bad.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PxBad2 {
    /// Nothing fitted.
    pub honest: f64,
    /// What the constant map that suits most pixels would score.
    pub best_constant: f64,
}

/// Why a view cannot be measured.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ViewEvaluationError {
    /// The map and its truth are not of one size.
    #[error("the truth is {truth_width}x{truth_height}, the view {width}x{height}")]
    SizeMismatch {
        /// Of the map, px.
        width: u32,
        /// Of the map, px.
        height: u32,
        /// Of the truth, px.
        truth_width: u32,
        /// Of the truth, px.
        truth_height: u32,
    },
    /// The truth is missing (NaN) everywhere.
    #[error("no pixel has a true value")]
    EmptyTruth,
}

/// The disparity of the 5-degree pair that depth has: `-d sin 5°`, px.
///
/// * `depth_px`: depth from the axis plane, growing away from the camera, in
///   sheet pixels; NaN where missing.
///
/// The mean of the maps towards both neighbours at ±5 degrees, in which the
/// part that depends on the pixel's column cancels. A difference of two such
/// maps is the difference of either pair's disparities.
pub fn disparity_from_depth(depth_px: &FloatImage) -> FloatImage {
    scaled(depth_px, -REFERENCE_PAIR_DEG.to_radians().sin())
}

/// Brings a view's disparity to the 5-degree pair's, [`disparity_from_depth`].
///
/// * `disparity_px`: the mean of the view's maps towards its neighbours,
///   nearer being larger in each, as stereo matchers give it.
/// * `pair_degs`: the signed angles to those neighbours.
///
/// A point at column x from the axis, the picture's middle, and at depth d has
/// `±x (1 - cos t) - d sin |t|` towards the view at t, the sign being t's. What
/// depends on the column is taken off, the rest scaled.
pub fn disparity_from_pairs(disparity_px: &FloatImage, pair_degs: &[f64]) -> FloatImage {
    let mean = |of: &dyn Fn(f64) -> f64| {
        pair_degs.iter().map(|t| of(t.to_radians())).sum::<f64>() / pair_degs.len() as f64
    };
    let per_column = mean(&|t| t.signum() * (1.0 - t.cos()));
    let scale = REFERENCE_PAIR_DEG.to_radians().sin() / mean(&|t| t.abs().sin());
    let middle = f64::from(disparity_px.width()) / 2.0;
    let mut map = disparity_px.clone();
    for (column, _, Luma([value])) in map.enumerate_pixels_mut() {
        let x = f64::from(column) + 0.5 - middle;
        *value = ((f64::from(*value) - x * per_column) * scale) as f32;
    }
    map
}

fn scaled(map: &FloatImage, factor: f64) -> FloatImage {
    let mut map = map.clone();
    for Luma([value]) in map.pixels_mut() {
        *value = (f64::from(*value) * factor) as f32;
    }
    map
}

/// Measures a view.
///
/// * `disparity_px`: of the 5-degree pair, nearer is larger, NaN where missing
///   (infinite counts as missing); see [`disparity_from_depth`].
///
/// # Errors
/// [`ViewEvaluationError`] if the sizes differ or no pixel has truth.
pub fn evaluate_view(
    disparity_px: &FloatImage,
    truth: &ViewTruth,
) -> Result<ViewReport, ViewEvaluationError> {
    let samples = samples(disparity_px, truth.values())?;
    let both: Vec<(f64, f64)> =
        samples.iter().filter_map(|(ours, truth)| ours.map(|ours| (ours, *truth))).collect();
    let metric = matches!(truth, ViewTruth::Metric(_));
    Ok(ViewReport {
        truth_pixels: samples.len(),
        coverage: share(both.len(), samples.len()),
        correlation: pearson_correlation(&both),
        bad2_px: metric.then(|| px_bad2(&samples)),
        bad2_grey: grey_bad2(&samples),
        depth_error_over_range: metric.then(|| error_over_range(&samples, &both)).flatten(),
    })
}

/// Ours, where there is a value, and the truth, for every pixel of its mask.
fn samples(
    ours: &FloatImage,
    truth: &FloatImage,
) -> Result<Vec<(Option<f64>, f64)>, ViewEvaluationError> {
    let ((width, height), (truth_width, truth_height)) = (ours.dimensions(), truth.dimensions());
    if (width, height) != (truth_width, truth_height) {
        return Err(ViewEvaluationError::SizeMismatch { width, height, truth_width, truth_height });
    }
    let samples: Vec<_> = ours
        .iter()
        .zip(truth.iter())
        .filter(|(_, truth)| truth.is_finite())
        .map(|(&ours, &truth)| (ours.is_finite().then(|| f64::from(ours)), f64::from(truth)))
        .collect();
    if samples.is_empty() { Err(ViewEvaluationError::EmptyTruth) } else { Ok(samples) }
}

fn px_bad2(samples: &[(Option<f64>, f64)]) -> PxBad2 {
    let bad = samples
        .iter()
        .filter(|(ours, truth)| ours.is_none_or(|ours| (ours - truth).abs() > BAD_OVER))
        .count();
    let mut truths: Vec<f64> = samples.iter().map(|sample| sample.1).collect();
    PxBad2 {
        honest: share(bad, samples.len()),
        best_constant: best_constant_bad_share(&mut truths, BAD_OVER),
    }
}

/// Disparity is depth times a constant here, so the ratio is that of depths.
fn error_over_range(samples: &[(Option<f64>, f64)], both: &[(f64, f64)]) -> Option<f64> {
    let (low, high) = range(samples.iter().map(|sample| sample.1))?;
    let sum: f64 = both.iter().map(|(ours, truth)| (ours - truth).abs()).sum();
    (high > low && !both.is_empty()).then(|| sum / both.len() as f64 / (high - low))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: f32 = f32::NAN;

    fn map(width: u32, values: &[f32]) -> FloatImage {
        FloatImage::from_raw(width, values.len() as u32 / width, values.to_vec()).unwrap()
    }

    #[test]
    fn every_figure_of_a_small_view() {
        let truth = ViewTruth::Metric(map(3, &[0.0, 4.0, 10.0, NONE, 6.0, 20.0]));
        // Off by 2 (good), 2.5 (bad), 0, no truth, missing (bad), -1.
        let ours = map(3, &[2.0, 6.5, 10.0, 99.0, NONE, 19.0]);
        let report = evaluate_view(&ours, &truth).unwrap();
        assert_eq!(report.truth_pixels, 5);
        assert!((report.coverage - 0.8).abs() < 1e-12);
        let bad = report.bad2_px.unwrap();
        assert!((bad.honest - 0.4).abs() < 1e-12);
        // {4, 6} or {6, 10} or {0, 4} within a window of 4: three are bad.
        assert!((bad.best_constant - 0.6).abs() < 1e-12);
        let error = report.depth_error_over_range.unwrap();
        assert!((error - (2.0 + 2.5 + 0.0 + 1.0) / 4.0 / 20.0).abs() < 1e-12);
        let correlation = report.correlation.unwrap();
        let expected =
            pearson_correlation(&[(2.0, 0.0), (6.5, 4.0), (10.0, 10.0), (19.0, 20.0)]).unwrap();
        assert!((correlation - expected).abs() < 1e-12);
    }

    #[test]
    fn the_truth_itself_is_perfect_and_its_mirror_inverted() {
        let values = map(2, &[-3.0, 1.0, 8.0, 2.5]);
        let truth = ViewTruth::Metric(values.clone());
        let report = evaluate_view(&values, &truth).unwrap();
        assert_eq!(report.bad2_px.unwrap().honest, 0.0);
        assert_eq!(report.depth_error_over_range, Some(0.0));
        assert!((report.correlation.unwrap() - 1.0).abs() < 1e-12);
        let swapped = evaluate_view(&scaled(&values, -1.0), &truth).unwrap();
        assert!((swapped.correlation.unwrap() + 1.0).abs() < 1e-12);
    }

    #[test]
    fn an_empty_result_is_all_bad_without_correlation() {
        let truth = ViewTruth::Metric(map(2, &[1.0, 2.0]));
        let report = evaluate_view(&map(2, &[NONE, f32::INFINITY]), &truth).unwrap();
        assert_eq!((report.coverage, report.correlation), (0.0, None));
        assert_eq!(report.bad2_px.unwrap().honest, 1.0);
        assert_eq!(report.depth_error_over_range, None);
    }

    #[test]
    fn relative_or_flat_truth_leaves_figures_out() {
        let values = map(2, &[1.0, 2.0]);
        let report = evaluate_view(&values, &ViewTruth::Relative(values.clone())).unwrap();
        assert_eq!((report.bad2_px, report.depth_error_over_range), (None, None));
        assert!((report.correlation.unwrap() - 1.0).abs() < 1e-12);
        let flat = ViewTruth::Metric(map(2, &[3.0, 3.0]));
        let report = evaluate_view(&values, &flat).unwrap();
        assert_eq!((report.correlation, report.depth_error_over_range), (None, None));
        assert_eq!(report.bad2_px.unwrap(), PxBad2 { honest: 0.0, best_constant: 0.0 });
    }

    #[test]
    fn units_come_to_the_five_degree_pair() {
        let sin = 5.0_f64.to_radians().sin();
        let near = disparity_from_depth(&map(1, &[-100.0, NONE]));
        assert!((f64::from(near.as_raw()[0]) - 100.0 * sin).abs() < 1e-5);
        assert!(near.as_raw()[1].is_nan());
        // One column: it is on the axis.
        let wide = disparity_from_pairs(&map(1, &[10.0]), &[15.0]);
        let expected = 10.0 * sin / 15.0_f64.to_radians().sin();
        assert!((f64::from(wide.as_raw()[0]) - expected).abs() < 1e-5);
    }

    /// Points at columns x and depths d, seen from views before and ahead.
    #[test]
    fn the_column_s_part_goes_from_one_sided_and_uneven_pairs() {
        let (x, d) = ([-1.0, 0.0, 1.0], [40.0_f64, -30.0, 7.0]);
        let towards = |i: usize, t_deg: f64| {
            let t = t_deg.to_radians();
            t.signum() * x[i] * (1.0 - t.cos()) - d[i] * t.abs().sin()
        };
        for degs in [&[15.0][..], &[-10.0], &[5.0, -5.0], &[5.0, -20.0]] {
            let mean = |i| degs.iter().map(|t| towards(i, *t)).sum::<f64>() / degs.len() as f64;
            let values: Vec<f32> = (0..3).map(|i| mean(i) as f32).collect();
            let found = disparity_from_pairs(&map(3, &values), degs);
            for (found, d) in found.iter().zip(d) {
                let expected = -d * 5.0_f64.to_radians().sin();
                assert!((f64::from(*found) - expected).abs() < 1e-4, "{degs:?}: {found}");
            }
        }
    }

    #[test]
    fn sizes_and_empty_truth_are_named() {
        let truth = ViewTruth::Metric(map(2, &[1.0, 2.0]));
        let error = evaluate_view(&map(1, &[1.0, 2.0]), &truth).unwrap_err();
        assert!(matches!(error, ViewEvaluationError::SizeMismatch { truth_width: 2, .. }));
        let empty = ViewTruth::Metric(map(1, &[NONE]));
        let error = evaluate_view(&map(1, &[1.0]), &empty).unwrap_err();
        assert_eq!(error, ViewEvaluationError::EmptyTruth);
    }
}
