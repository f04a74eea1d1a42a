//! The reconstruction in numbers, as served. Coordinates are in the sheet frame
//! (pixel centres at half integers).

use nalgebra::{Matrix3, Point2, Vector2};
use serde::Serialize;

use super::correspond::TryReport;
use super::edit::EditReport;
use super::merge::MergeLink;
use super::pair::{PairFailure, PairResult};
use super::pairs::{PairName, SkippedPair};
use super::reconstruct::Reconstruction;
use crate::vision::{
    Correspondence, EpipolarGeometry, EstimatorRun, PairDistortion, mean_distance,
    reprojection_error_px2, sampson_distance_px2, smallest_absolute_eigenvalue,
    symmetric_epipolar_distance_px2,
};
use frames::Azimuth;
use picture::{FloatImage, ValueRange};

/// One view in numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewMetrics {
    /// The view's azimuth, degrees in [0, 360).
    pub azimuth_deg: f64,
    /// Keypoints found by the options as given.
    pub keypoints: usize,
    /// Share of pixels that have a disparity.
    pub disparity_coverage: f64,
    /// Smallest and largest disparity, px; `None` without any.
    pub disparity_range_px: Option<ValueRange>,
    /// Share of pixels that have a depth.
    pub depth_coverage: f64,
    /// Smallest and largest depth, px; `None` without any.
    pub depth_range_px: Option<ValueRange>,
    /// Whether its cloud is part of the merged cloud.
    pub merged: bool,
}

/// A mean of squared distances, and its root.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeanSquare {
    pub px2: f64,
    /// Root of the mean, px.
    pub root_px: f64,
}

/// How far matches are from the epipolar geometry, each measure in the mean.
#[derive(Clone, Copy)]
struct EpipolarErrors {
    sampson: Option<MeanSquare>,
    symmetric_epipolar: Option<MeanSquare>,
    reprojection: Option<MeanSquare>,
}

impl EpipolarErrors {
    fn of(geometry: &EpipolarGeometry, matches: &[Correspondence]) -> Self {
        let mean = |distance: fn(&Matrix3<f64>, Point2<f64>, Point2<f64>) -> f64| {
            let points = matches.iter().map(|c| (c.left, c.right));
            let px2 = mean_distance(&geometry.fundamental, points, distance)?;
            px2.is_finite().then(|| MeanSquare { px2, root_px: px2.sqrt() })
        };
        Self {
            sampson: mean(sampson_distance_px2),
            symmetric_epipolar: mean(symmetric_epipolar_distance_px2),
            reprojection: mean(reprojection_error_px2),
        }
    }
}

/// One pair in numbers: the five metrics of Arys 2020, §3.4, §3.5.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PairMetrics {
    /// Azimuths of its two views.
    pub pair: PairName,
    /// From left to right, degrees.
    pub angle_deg: f64,
    /// Whether it has disparity maps.
    pub usable: bool,
    /// What went wrong; `None` if it is usable.
    pub failure: Option<PairFailure>,
    /// The same for people.
    pub failure_detail: Option<String>,
    /// Keypoints found in the left view.
    pub keypoints_left: usize,
    /// Keypoints found in the right view.
    pub keypoints_right: usize,
    /// All matches, agreeing or not.
    pub matches: usize,
    /// What was done to the automatic matches, if a person corrected them.
    pub corrected_matches: Option<EditReport>,
    /// Matches that agree with the fundamental matrix.
    pub inliers: usize,
    /// Matches that the estimator rejected over all matches.
    pub outlier_ratio: Option<f64>,
    /// The estimator that ran.
    pub estimator: Option<EstimatorRun>,
    /// Sampson distance over all matches; `None` without an estimate.
    pub mean_sampson_all: Option<MeanSquare>,
    /// Sampson distance over the inliers alone.
    pub mean_sampson_inliers: Option<MeanSquare>,
    /// Squared distances of both points to their epipolar lines, summed.
    pub symmetric_epipolar_all: Option<MeanSquare>,
    /// The same over the inliers alone.
    pub symmetric_epipolar_inliers: Option<MeanSquare>,
    /// Squared distances of both points to the nearest pair that agrees
    /// exactly, summed (Hartley & Sturm 1997).
    pub reprojection_all: Option<MeanSquare>,
    /// The same over the inliers alone.
    pub reprojection_inliers: Option<MeanSquare>,
    /// Root mean square distance of right points from where the best homography
    /// moves the left ones, px: near 0 when the inliers all lie in one plane,
    /// which leaves the geometry open.
    pub plane_spread_px: Option<f64>,
    /// Smallest absolute eigenvalue of F, scaled as OpenCV does.
    pub smallest_absolute_eigenvalue: Option<f64>,
    /// Orthogonality and aspect ratio of both rectifying homographies.
    pub distortion: Option<PairDistortion>,
    /// F with `x'ᵀ F x = 0`, row by row, sheet frame, F₃₃ = 1 if not negligible.
    pub fundamental: Option<[[f64; 3]; 3]>,
    /// Rows of the homography, sheet frame to rectified frame.
    pub rectified_from_left: Option<[[f64; 3]; 3]>,
    /// The same for the right view.
    pub rectified_from_right: Option<[[f64; 3]; 3]>,
    /// Every try at its geometry, in order.
    pub tries: Vec<TryReport>,
    /// The number of the try that went on.
    pub chosen_try: u32,
}

/// Means over the usable pairs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeanMetrics {
    /// How many pairs are usable; each mean is over those that have the figure.
    pub pairs: usize,
    /// Sampson distance over the inliers, px².
    pub mean_sampson_inliers_px2: Option<f64>,
    /// Sampson distance over all matches, px².
    pub mean_sampson_all_px2: Option<f64>,
    /// Symmetric epipolar distance over the inliers, px².
    pub symmetric_epipolar_inliers_px2: Option<f64>,
    /// Reprojection error over the inliers, px².
    pub reprojection_inliers_px2: Option<f64>,
    /// Of the fundamental matrices; ideally 0.
    pub smallest_absolute_eigenvalue: Option<f64>,
    /// Matches that the estimator rejected over all matches.
    pub outlier_ratio: Option<f64>,
    /// Eo's relative deviation from 90 degrees.
    pub orthogonality_deviation: Option<f64>,
    /// Ea's deviation from 1.
    pub aspect_ratio_deviation: Option<f64>,
}

/// The hull in numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HullReport {
    /// Cloud points that could be corners.
    pub candidates: usize,
    /// Corners of the hull; 0 without one.
    pub vertices: usize,
    /// Faces of the hull; 0 without one.
    pub triangles: usize,
    /// Volume, px³; `None` without a hull.
    pub volume_px3: Option<f64>,
    /// Why there is no hull.
    pub failure: Option<String>,
}

/// The whole reconstruction in numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Metrics {
    /// By rising azimuth.
    pub views: Vec<ViewMetrics>,
    /// Neighbours that were worked on, failed ones too.
    pub pairs: Vec<PairMetrics>,
    /// Neighbours too far apart to be worked on.
    pub skipped_pairs: Vec<SkippedPair>,
    /// The pairs' figures in the mean.
    pub mean_of_usable_pairs: MeanMetrics,
    /// How neighbouring clouds were joined.
    pub merge_links: Vec<MergeLink>,
    /// The convex hull of the merged cloud.
    pub hull: HullReport,
    /// What a person should look at, in sentences.
    pub warnings: Vec<String>,
}

/// Measures a reconstruction of views of `width_px` by `height_px`.
pub fn measure(reconstruction: &Reconstruction, width_px: u32, height_px: u32) -> Metrics {
    let pairs: Vec<_> = reconstruction
        .pairs
        .iter()
        .map(|pair| pair_metrics(pair, f64::from(width_px), f64::from(height_px)))
        .collect();
    Metrics {
        views: (0..reconstruction.views.len()).map(|i| view_metrics(reconstruction, i)).collect(),
        mean_of_usable_pairs: mean_metrics(&pairs),
        pairs,
        skipped_pairs: reconstruction.skipped_pairs.clone(),
        merge_links: reconstruction.merged.links.clone(),
        hull: hull_report(reconstruction),
        warnings: warnings(reconstruction),
    }
}

fn view_metrics(reconstruction: &Reconstruction, index: usize) -> ViewMetrics {
    let view = &reconstruction.views[index];
    ViewMetrics {
        azimuth_deg: view.azimuth.degrees(),
        keypoints: view.keypoints,
        disparity_coverage: coverage(view.disparity.as_ref()),
        disparity_range_px: view.disparity.as_ref().and_then(ValueRange::of),
        depth_coverage: coverage(view.depth.as_ref()),
        depth_range_px: view.depth.as_ref().and_then(ValueRange::of),
        merged: reconstruction.merged.views.iter().any(|(merged, _)| *merged == index),
    }
}

fn coverage(map: Option<&FloatImage>) -> f64 {
    let Some(map) = map.filter(|map| !map.is_empty()) else { return 0.0 };
    map.iter().filter(|value| value.is_finite()).count() as f64 / map.len() as f64
}

/// Measures one pair of views of `width_px` by `height_px`.
pub fn pair_metrics(pair: &PairResult, width_px: f64, height_px: f64) -> PairMetrics {
    let geometry = pair.geometry();
    let inliers = pair.inliers();
    let outlier_ratio = geometry
        .filter(|_| !pair.matches.is_empty())
        .map(|_| 1.0 - inliers.len() as f64 / pair.matches.len() as f64);
    let all: Vec<_> = pair.matches.iter().map(|found| found.points).collect();
    let of_all = geometry.map(|g| EpipolarErrors::of(g, &all));
    let of_inliers = geometry.map(|g| EpipolarErrors::of(g, &inliers));
    let rectification = pair.rectification();
    let homography = |h: &Matrix3<f64>| rows(&in_sheet_frame(h));
    PairMetrics {
        pair: pair.name,
        angle_deg: pair.angle_deg,
        usable: rectification.is_some(),
        failure: pair.failure().cloned(),
        failure_detail: pair.failure().map(ToString::to_string),
        keypoints_left: pair.keypoints_left,
        keypoints_right: pair.keypoints_right,
        matches: pair.matches.len(),
        corrected_matches: pair.edit,
        inliers: inliers.len(),
        outlier_ratio,
        estimator: geometry.map(|g| g.estimator),
        mean_sampson_all: of_all.and_then(|e| e.sampson),
        mean_sampson_inliers: of_inliers.and_then(|e| e.sampson),
        symmetric_epipolar_all: of_all.and_then(|e| e.symmetric_epipolar),
        symmetric_epipolar_inliers: of_inliers.and_then(|e| e.symmetric_epipolar),
        reprojection_all: of_all.and_then(|e| e.reprojection),
        reprojection_inliers: of_inliers.and_then(|e| e.reprojection),
        plane_spread_px: geometry.and_then(|g| g.plane_spread_px),
        smallest_absolute_eigenvalue: geometry
            .and_then(|g| smallest_absolute_eigenvalue(&g.fundamental)),
        distortion: rectification.and_then(|r| {
            PairDistortion::of(&r.rectified_from_left, &r.rectified_from_right, width_px, height_px)
        }),
        fundamental: geometry.map(|g| rows(&fundamental_in_sheet_frame(&g.fundamental))),
        rectified_from_left: rectification.map(|r| homography(&r.rectified_from_left)),
        rectified_from_right: rectification.map(|r| homography(&r.rectified_from_right)),
        tries: pair.tries.clone(),
        chosen_try: pair.chosen_try,
    }
}

/// From OpenCV's pixels to the sheet frame.
fn sheet_from_opencv() -> Matrix3<f64> {
    Matrix3::new_translation(&Vector2::new(0.5, 0.5))
}

fn opencv_from_sheet() -> Matrix3<f64> {
    Matrix3::new_translation(&Vector2::new(-0.5, -0.5))
}

fn in_sheet_frame(homography: &Matrix3<f64>) -> Matrix3<f64> {
    sheet_from_opencv() * homography * opencv_from_sheet()
}

fn fundamental_in_sheet_frame(fundamental: &Matrix3<f64>) -> Matrix3<f64> {
    let moved = opencv_from_sheet().transpose() * fundamental * opencv_from_sheet();
    let last = moved[(2, 2)];
    if last.abs() > f64::EPSILON * moved.norm() { moved / last } else { moved }
}

fn rows(matrix: &Matrix3<f64>) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|row| [0, 1, 2].map(|column| matrix[(row, column)]))
}

fn mean_metrics(pairs: &[PairMetrics]) -> MeanMetrics {
    let usable: Vec<_> = pairs.iter().filter(|pair| pair.usable).collect();
    let mean = |of: &dyn Fn(&PairMetrics) -> Option<f64>| {
        let values: Vec<f64> = usable.iter().filter_map(|pair| of(pair)).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    MeanMetrics {
        pairs: usable.len(),
        mean_sampson_inliers_px2: mean(&|p| p.mean_sampson_inliers.map(|m| m.px2)),
        mean_sampson_all_px2: mean(&|p| p.mean_sampson_all.map(|m| m.px2)),
        symmetric_epipolar_inliers_px2: mean(&|p| p.symmetric_epipolar_inliers.map(|m| m.px2)),
        reprojection_inliers_px2: mean(&|p| p.reprojection_inliers.map(|m| m.px2)),
        smallest_absolute_eigenvalue: mean(&|p| p.smallest_absolute_eigenvalue),
        outlier_ratio: mean(&|p| p.outlier_ratio),
        orthogonality_deviation: mean(&|p| {
            p.distortion.as_ref().map(|d| d.mean_orthogonality_deviation)
        }),
        aspect_ratio_deviation: mean(&|p| {
            p.distortion.as_ref().map(|d| d.mean_aspect_ratio_deviation)
        }),
    }
}

fn hull_report(reconstruction: &Reconstruction) -> HullReport {
    let mesh = reconstruction.hull.as_ref();
    HullReport {
        candidates: reconstruction.hull_candidates,
        vertices: mesh.map_or(0, |mesh| mesh.positions.len()),
        triangles: mesh.map_or(0, |mesh| mesh.triangles.len()),
        volume_px3: mesh.ok().map(mesh::Mesh::signed_volume),
        failure: mesh.err().map(ToString::to_string),
    }
}

fn warnings(reconstruction: &Reconstruction) -> Vec<String> {
    let mut warnings = Vec::new();
    for pair in &reconstruction.pairs {
        pair_warnings(pair, &mut warnings);
    }
    let left_out: Vec<Azimuth> = reconstruction
        .views
        .iter()
        .enumerate()
        .filter(|(index, _)| reconstruction.merged.views.iter().all(|(view, _)| view != index))
        .map(|(_, view)| view.azimuth)
        .collect();
    if !left_out.is_empty() {
        let names: Vec<_> = left_out.iter().map(ToString::to_string).collect();
        warnings.push(format!(
            "views {} are not in the merged cloud: no chain of similarities joins them",
            names.join(", ")
        ));
    }
    if let Err(error) = &reconstruction.hull {
        warnings.push(format!("no hull: {error}"));
    }
    warnings
}

fn pair_warnings(pair: &PairResult, warnings: &mut Vec<String>) {
    let name = pair.name;
    if let Some(failure) = pair.failure() {
        warnings.push(format!("pair {name} is not used: {failure}"));
    } else if pair.geometry().is_some_and(EpipolarGeometry::is_coplanar) {
        warnings.push(format!(
            "pair {name}: all matches fit one plane, which leaves the epipolar geometry open"
        ));
    }
    let tried = pair.tries.len();
    if tried > 1 && pair.tries.iter().all(|attempt| !attempt.passed) {
        warnings.push(format!(
            "pair {name}: none of {tried} tries passed the mean Sampson threshold; the best is used"
        ));
    }
    if let Some(EditReport::Changed { not_found: missing @ 1.., .. }) = pair.edit {
        warnings.push(format!("pair {name}: {missing} matches to remove were not found"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn matrices_move_to_the_sheet_frame() {
        let f = Matrix3::new(1e-6, -2e-5, 0.01, 3e-5, 2e-6, -0.02, -0.015, 0.025, 1.0);
        let moved = fundamental_in_sheet_frame(&f);
        let (left, right) = (Vector3::new(10.0, 20.0, 1.0), Vector3::new(14.0, 19.0, 1.0));
        let half = Vector3::new(0.5, 0.5, 0.0);
        let before = (right.transpose() * f * left)[0];
        let after = ((right + half).transpose() * moved * (left + half))[0];
        let scale = (opencv_from_sheet().transpose() * f * opencv_from_sheet())[(2, 2)];
        assert!((after * scale - before).abs() < 1e-12);

        let h = Matrix3::new(1.1, 0.1, 5.0, -0.1, 0.9, 2.0, 1e-4, 2e-4, 1.0);
        let point = Point2::new(7.0, 9.0);
        let expected = h.transform_point(&point) + Vector2::new(0.5, 0.5);
        let got = in_sheet_frame(&h).transform_point(&(point + Vector2::new(0.5, 0.5)));
        assert!((got - expected).norm() < 1e-12);
    }

    #[test]
    fn ranges_skip_what_is_missing() {
        let map = FloatImage::from_raw(4, 1, vec![f32::NAN, 2.0, -1.0, f32::INFINITY]).unwrap();
        assert_eq!(ValueRange::of(&map), Some(ValueRange { min: -1.0, max: 2.0 }));
        assert_eq!(ValueRange::of(&FloatImage::from_pixel(2, 2, image::Luma([f32::NAN]))), None);
        assert_eq!(coverage(Some(&map)), 0.5);
    }
}
