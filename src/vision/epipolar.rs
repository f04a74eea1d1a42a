use nalgebra::{Matrix2, Matrix3, Point2, Vector2};
use opencv::calib3d::{self, FM_8POINT, FM_LMEDS, FM_RANSAC};
use opencv::core::{Mat, MatTraitConst, MatTraitConstManual};
use serde::{Deserialize, Serialize};

use super::Correspondence;
use super::cv::{self, OpenCvError};
use crate::options::{EpipolarOptions, Estimator};

/// Fewer points leave an exact fit with nothing to check it by.
const REQUIRED: usize = 8;
/// Below this many points OpenCV's RANSAC silently becomes LMedS.
const RANSAC_REQUIRED: usize = 15;
/// Points within this distance of one line are collinear, px (root mean square).
const COLLINEAR_PX: f64 = 0.5;

/// The estimator that ran, which is not always the one asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EstimatorRun {
    /// RANSAC over 7-point samples.
    Ransac,
    /// Least median of squares over 7-point samples.
    Lmeds,
    /// Normalised 8-point over all points.
    EightPoint,
}

/// A fundamental matrix and the correspondences that agree with it.
#[derive(Clone, Debug, PartialEq)]
pub struct EpipolarGeometry {
    /// `F` with `x'ᵀ F x = 0`, x left and x' right, scaled as OpenCV does
    /// (F₃₃ = 1 where it is not negligible).
    pub fundamental: Matrix3<f64>,
    /// One flag a correspondence.
    pub inliers: Vec<bool>,
    pub estimator: EstimatorRun,
}

impl EpipolarGeometry {
    pub fn inlier_count(&self) -> usize {
        self.inliers.iter().filter(|&&inlier| inlier).count()
    }
}

/// Why a pair has no epipolar geometry to rely on.
#[derive(Clone, Debug, PartialEq, Serialize, thiserror::Error)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum EpipolarError {
    #[error("{found} matches; at least {required} are needed")]
    TooFewCorrespondences { found: usize, required: usize },
    #[error("all {found} matches lie on one line of a view, within {spread_px:.2} px")]
    Collinear { found: usize, spread_px: f64 },
    #[error("no fundamental matrix fits the {found} matches")]
    NoEstimate { found: usize },
    #[error("only {inliers} of {found} matches agree; robust estimates need more than half")]
    MostlyOutliers { inliers: usize, found: usize },
    #[error(transparent)]
    OpenCv(#[from] OpenCvError),
}

/// Estimates the fundamental matrix of two views.
///
/// * `correspondences`: n ≥ 8 pairs x ↔ x', left ↔ right, pixels.
/// * `options.max_error_px`: inlier threshold, distance to the epipolar line,
///   pixels (RANSAC alone).
///
/// With fewer than 15 correspondences OpenCV runs LMedS when asked for RANSAC;
/// [`EpipolarGeometry::estimator`] tells. Its samples come from a fixed seed.
///
/// # Errors
/// The degenerate cases by name, see [`EpipolarError`].
///
/// # Source
/// Hartley & Zisserman, Multiple View Geometry, 2nd ed., §11; Arys 2020, §3.4.
pub fn estimate_fundamental(
    correspondences: &[Correspondence],
    options: &EpipolarOptions,
) -> Result<EpipolarGeometry, EpipolarError> {
    let found = correspondences.len();
    if found < REQUIRED {
        return Err(EpipolarError::TooFewCorrespondences { found, required: REQUIRED });
    }
    let spread_px = line_spread(correspondences.iter().map(|c| c.left))
        .min(line_spread(correspondences.iter().map(|c| c.right)));
    if spread_px < COLLINEAR_PX {
        return Err(EpipolarError::Collinear { found, spread_px });
    }
    let estimator = estimator_run(options.estimator, found);
    let (fundamental, inliers) = find(correspondences, estimator, options)?;
    let fundamental = fundamental
        .filter(|f| f.iter().all(|value| value.is_finite()) && f.norm() > 0.0)
        .ok_or(EpipolarError::NoEstimate { found })?;
    let geometry = EpipolarGeometry { fundamental, inliers, estimator };
    let inliers = geometry.inlier_count();
    if inliers * 2 <= found {
        return Err(EpipolarError::MostlyOutliers { inliers, found });
    }
    if inliers < REQUIRED {
        return Err(EpipolarError::TooFewCorrespondences { found: inliers, required: REQUIRED });
    }
    Ok(geometry)
}

fn estimator_run(asked: Estimator, found: usize) -> EstimatorRun {
    match asked {
        Estimator::Ransac if found >= RANSAC_REQUIRED => EstimatorRun::Ransac,
        Estimator::Ransac | Estimator::Lmeds => EstimatorRun::Lmeds,
        Estimator::EightPoint => EstimatorRun::EightPoint,
    }
}

fn find(
    correspondences: &[Correspondence],
    estimator: EstimatorRun,
    options: &EpipolarOptions,
) -> Result<(Option<Matrix3<f64>>, Vec<bool>), OpenCvError> {
    cv::single_threaded();
    let left = cv::points(correspondences.iter().map(|c| c.left));
    let right = cv::points(correspondences.iter().map(|c| c.right));
    let method = match estimator {
        EstimatorRun::Ransac => FM_RANSAC,
        EstimatorRun::Lmeds => FM_LMEDS,
        EstimatorRun::EightPoint => FM_8POINT,
    };
    let mut mask = Mat::default();
    let fundamental = calib3d::find_fundamental_mat_1(
        &left,
        &right,
        method,
        options.max_error_px,
        options.confidence,
        &mut mask,
    )?;
    let inliers = if mask.total() == correspondences.len() {
        mask.data_typed::<u8>()?.iter().map(|&flag| flag != 0).collect()
    } else {
        vec![false; correspondences.len()]
    };
    Ok((cv::matrix(&fundamental)?, inliers))
}

/// Root mean square distance of points from their best line, px.
fn line_spread(points: impl Iterator<Item = Point2<f64>> + Clone) -> f64 {
    let count = points.clone().count().max(1) as f64;
    let mean = points.clone().map(|p| p.coords).sum::<Vector2<f64>>() / count;
    let covariance: Matrix2<f64> =
        points.map(|p| (p.coords - mean) * (p.coords - mean).transpose()).sum::<Matrix2<f64>>()
            / count;
    covariance.symmetric_eigenvalues().min().max(0.0).sqrt()
}
