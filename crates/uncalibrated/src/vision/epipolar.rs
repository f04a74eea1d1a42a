//! The fundamental matrix of a pair, and the cases that leave it open.

use nalgebra::{Matrix2, Matrix3, Point2, Vector2};
use opencv::calib3d::{self, FM_8POINT, FM_LMEDS, FM_RANSAC};
use opencv::core::{Mat, MatTraitConst, MatTraitConstManual};
use serde::{Deserialize, Serialize};

use super::Correspondence;
use super::cv::{self, OpenCvError};
use super::eight_point::{RansacOptions, ransac_eight_point};
use crate::options::{CoplanarPairs, EpipolarOptions, Estimator};

/// Fewer points leave an exact fit with nothing to check it by.
const REQUIRED: usize = 8;
/// Below this many points OpenCV's RANSAC silently becomes LMedS.
const RANSAC_REQUIRED: usize = 15;
/// Points within this distance of one line are collinear, px (root mean square).
const COLLINEAR_PX: f64 = 0.5;
/// Matches that one homography explains within this are coplanar, px (root mean
/// square): corners are found to whole pixels, which alone makes 0.6.
const COPLANAR_PX: f64 = 0.75;
/// OpenCV's homography of all points alike.
const LEAST_SQUARES: i32 = 0;

/// The estimator that ran, which is not always the one asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EstimatorRun {
    /// RANSAC over 7-point samples.
    Ransac,
    /// Least median of squares over 7-point samples.
    Lmeds,
    /// RANSAC over 8-point samples.
    EightPointRansac,
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
    /// The estimator that ran.
    pub estimator: EstimatorRun,
    /// How well one plane explains the agreeing correspondences: root mean
    /// square distance of right points from where the best homography moves the
    /// left ones, px.
    pub plane_spread_px: Option<f64>,
}

impl EpipolarGeometry {
    /// Whether all agreeing correspondences fit one plane, which leaves the
    /// geometry open.
    pub fn is_coplanar(&self) -> bool {
        self.plane_spread_px.is_some_and(|spread_px| spread_px < COPLANAR_PX)
    }

    /// Those of the estimate's `correspondences` that agree with it.
    pub fn agreeing(
        &self,
        correspondences: &[Correspondence],
    ) -> impl Iterator<Item = Correspondence> {
        let flagged = correspondences.iter().zip(&self.inliers);
        flagged.filter(|(_, inlier)| **inlier).map(|(found, _)| *found)
    }

    /// How many correspondences agree.
    pub fn inlier_count(&self) -> usize {
        self.inliers.iter().filter(|&&inlier| inlier).count()
    }
}

/// Why a pair has no epipolar geometry to rely on.
#[derive(Clone, Debug, PartialEq, Serialize, thiserror::Error)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum EpipolarError {
    /// Too few matches, or too few that agree, to check an estimate by.
    #[error("{found} matches; at least {required} are needed")]
    TooFewCorrespondences {
        /// How many there are.
        found: usize,
        /// The fewest that are taken.
        required: usize,
    },
    /// The matches lie on one line, which determines no geometry.
    #[error("all {found} matches lie on one line of a view, within {spread_px:.2} px")]
    Collinear {
        /// How many there are.
        found: usize,
        /// Root mean square distance from that line, px.
        spread_px: f64,
    },
    /// The matches fit one plane, which leaves the geometry open.
    #[error(
        "all {found} agreeing matches fit one plane, within {spread_px:.2} px, which leaves the epipolar geometry open"
    )]
    Coplanar {
        /// How many there are.
        found: usize,
        /// Root mean square distance from the best homography, px.
        spread_px: f64,
    },
    /// The estimator found nothing.
    #[error("no fundamental matrix fits the {found} matches")]
    NoEstimate {
        /// How many matches it was given.
        found: usize,
    },
    /// Half of the matches or more contradict the estimate.
    #[error("only {inliers} of {found} matches agree; robust estimates need more than half")]
    MostlyOutliers {
        /// How many agree.
        inliers: usize,
        /// How many there are.
        found: usize,
    },
    /// OpenCV refused a call.
    #[error(transparent)]
    OpenCv(#[from] OpenCvError),
}

/// Estimates the fundamental matrix of two views.
///
/// * `correspondences`: n ≥ 8 pairs x ↔ x', left ↔ right, pixels.
/// * `options.max_error_px`: inlier threshold, distance to the epipolar line,
///   pixels (RANSAC alone).
/// * `seed`: of 8-point RANSAC's samples; OpenCV's come from a fixed seed.
///
/// With fewer than 15 correspondences OpenCV runs LMedS when asked for RANSAC;
/// [`EpipolarGeometry::estimator`] tells.
///
/// # Errors
/// The degenerate cases by name, see [`EpipolarError`].
///
/// # Source
/// Hartley & Zisserman, Multiple View Geometry, 2nd ed., §11; Arys 2020, §3.4.
pub fn estimate_fundamental(
    correspondences: &[Correspondence],
    options: &EpipolarOptions,
    seed: u64,
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
    let (fundamental, inliers) = match estimator {
        EstimatorRun::EightPointRansac => by_eight_points(correspondences, options, seed),
        _ => by_opencv(correspondences, estimator, options)?,
    };
    let usable = fundamental.filter(|f| f.iter().all(|value| value.is_finite()) && f.norm() > 0.0);
    let Some(fundamental) = usable else {
        return Err(match homography_spread(correspondences)? {
            Some(spread_px) if spread_px < COPLANAR_PX => {
                EpipolarError::Coplanar { found, spread_px }
            }
            _ => EpipolarError::NoEstimate { found },
        });
    };
    let geometry = EpipolarGeometry { fundamental, inliers, estimator, plane_spread_px: None };
    let inliers = geometry.inlier_count();
    if inliers * 2 <= found {
        return Err(EpipolarError::MostlyOutliers { inliers, found });
    }
    if inliers < REQUIRED {
        return Err(EpipolarError::TooFewCorrespondences { found: inliers, required: REQUIRED });
    }
    let agreeing: Vec<_> = geometry.agreeing(correspondences).collect();
    let plane_spread_px = homography_spread(&agreeing)?;
    let geometry = EpipolarGeometry { plane_spread_px, ..geometry };
    match plane_spread_px {
        Some(spread_px) if geometry.is_coplanar() && options.coplanar == CoplanarPairs::Refuse => {
            Err(EpipolarError::Coplanar { found: inliers, spread_px })
        }
        _ => Ok(geometry),
    }
}

fn estimator_run(asked: Estimator, found: usize) -> EstimatorRun {
    match asked {
        Estimator::Ransac if found >= RANSAC_REQUIRED => EstimatorRun::Ransac,
        Estimator::Ransac | Estimator::Lmeds => EstimatorRun::Lmeds,
        Estimator::EightPointRansac => EstimatorRun::EightPointRansac,
        Estimator::EightPoint => EstimatorRun::EightPoint,
    }
}

fn by_eight_points(
    correspondences: &[Correspondence],
    options: &EpipolarOptions,
    seed: u64,
) -> (Option<Matrix3<f64>>, Vec<bool>) {
    let ransac = RansacOptions {
        max_error_px: options.max_error_px,
        confidence: options.confidence,
        max_iterations: options.max_iterations,
        seed,
    };
    let Some((f, inliers)) = ransac_eight_point(correspondences, &ransac) else {
        return (None, vec![false; correspondences.len()]);
    };
    let last = f[(2, 2)];
    let scaled = if last.abs() > f64::from(f32::EPSILON) { f / last } else { f };
    (Some(scaled), inliers)
}

fn by_opencv(
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
        EstimatorRun::EightPoint | EstimatorRun::EightPointRansac => FM_8POINT,
    };
    let mut mask = Mat::default();
    let fundamental = calib3d::find_fundamental_mat(
        &left,
        &right,
        method,
        options.max_error_px,
        options.confidence,
        options.max_iterations as i32,
        &mut mask,
    )?;
    let inliers = if mask.total() == correspondences.len() {
        mask.data_typed::<u8>()?.iter().map(|&flag| flag != 0).collect()
    } else {
        vec![false; correspondences.len()]
    };
    Ok((cv::matrix(&fundamental)?, inliers))
}

/// Root mean square distance of right points from where the best homography
/// moves the left ones, px; `None` if there is no homography.
fn homography_spread(correspondences: &[Correspondence]) -> Result<Option<f64>, OpenCvError> {
    let left = cv::points(correspondences.iter().map(|c| c.left));
    let right = cv::points(correspondences.iter().map(|c| c.right));
    let homography =
        calib3d::find_homography(&left, &right, &mut Mat::default(), LEAST_SQUARES, 0.0)?;
    let Some(homography) = cv::matrix(&homography)? else { return Ok(None) };
    let squares: f64 = correspondences
        .iter()
        .map(|c| (homography.transform_point(&c.left) - c.right).norm_squared())
        .sum();
    Ok(Some((squares / correspondences.len() as f64).sqrt()))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::{mean_distance, sampson_distance_px2};
    use nalgebra::Point3;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const ALL: [Estimator; 4] =
        [Estimator::Ransac, Estimator::EightPointRansac, Estimator::Lmeds, Estimator::EightPoint];

    /// Points before two perspective cameras, as seen by both; the last
    /// `outliers` are matched with anything.
    fn scene(count: usize, outliers: usize, noise_px: f64) -> Vec<Correspondence> {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let (sin, cos) = 0.2_f64.sin_cos();
        (0..count)
            .map(|i| {
                let p = Point3::new(
                    rng.random_range(-1.0..1.0),
                    rng.random_range(-1.0..1.0),
                    rng.random_range(4.0..7.0),
                );
                let q = Point3::new(
                    p.x * cos + p.z * sin - 0.8,
                    p.y + 0.1,
                    p.z * cos - p.x * sin + 0.2,
                );
                let mut noise = || rng.random_range(-1.0..=1.0) * noise_px;
                let mut seen = |p: Point3<f64>| {
                    Point2::new(
                        480.0 + 900.0 * p.x / p.z + noise(),
                        270.0 + 900.0 * p.y / p.z + noise(),
                    )
                };
                let (left, right) = (seen(p), seen(q));
                if i + outliers < count {
                    return Correspondence { left, right };
                }
                let anywhere =
                    Point2::new(rng.random_range(0.0..960.0), rng.random_range(0.0..540.0));
                Correspondence { left, right: anywhere }
            })
            .collect()
    }

    fn sampson(geometry: &EpipolarGeometry, points: &[Correspondence]) -> f64 {
        let pairs = points.iter().map(|c| (c.left, c.right));
        mean_distance(&geometry.fundamental, pairs, sampson_distance_px2).unwrap()
    }

    fn options(estimator: Estimator) -> EpipolarOptions {
        EpipolarOptions { estimator, ..EpipolarOptions::default() }
    }

    #[test]
    fn exact_matches_are_explained_exactly_by_every_estimator() {
        let points = scene(60, 0, 0.0);
        for estimator in ALL {
            let geometry = estimate_fundamental(&points, &options(estimator), 3).unwrap();
            assert_eq!(geometry.inlier_count(), 60, "{estimator:?}");
            // OpenCV rounds coordinates to single precision, 3e-5 px here.
            let error = sampson(&geometry, &points).sqrt();
            assert!(error < 1e-3, "{estimator:?}: {error}");
        }
    }

    /// A level pair whose coordinates single precision holds exactly.
    #[test]
    fn a_known_matrix_comes_back() {
        let points: Vec<_> = scene(60, 0, 0.0)
            .iter()
            .map(|c| {
                let eighth = |value: f64| (value * 8.0).round() / 8.0;
                let y = eighth(c.left.y);
                let point = |x: f64| Point2::new(eighth(x), y);
                Correspondence { left: point(c.left.x), right: point(c.right.x) }
            })
            .collect();
        let truth: Matrix3<f64> = Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0);
        for estimator in ALL {
            let geometry = estimate_fundamental(&points, &options(estimator), 3).unwrap();
            let f: Matrix3<f64> = geometry.fundamental;
            let unit: Matrix3<f64> = f * (truth.norm() / f.norm());
            let off = (unit - truth).norm().min((unit + truth).norm());
            assert!(off < 1e-6, "{estimator:?}: {off}");
            assert!(sampson(&geometry, &points).sqrt() < 1e-6, "{estimator:?}");
        }
    }

    #[test]
    fn finds_the_inliers_among_thirty_percent_outliers() {
        let points = scene(200, 60, 0.3);
        for estimator in [Estimator::Ransac, Estimator::EightPointRansac, Estimator::Lmeds] {
            let geometry = estimate_fundamental(&points, &options(estimator), 3).unwrap();
            let kept = geometry.inliers[..140].iter().filter(|&&inlier| inlier).count();
            let wrong = geometry.inliers[140..].iter().filter(|&&inlier| inlier).count();
            assert!(kept > 133, "{estimator:?} kept {kept} of 140");
            assert!(wrong < 6, "{estimator:?} took {wrong} of 60 outliers");
        }
    }

    #[test]
    fn says_that_few_points_were_left_to_lmeds() {
        let run = |count| {
            let points = scene(count, 0, 0.1);
            estimate_fundamental(&points, &options(Estimator::Ransac), 3).unwrap().estimator
        };
        assert_eq!(run(14), EstimatorRun::Lmeds);
        assert_eq!(run(15), EstimatorRun::Ransac);
    }

    #[test]
    fn names_degenerate_matches() {
        let estimate = |points: &[Correspondence]| {
            estimate_fundamental(points, &options(Estimator::Ransac), 3).unwrap_err()
        };
        assert_eq!(
            estimate(&scene(7, 0, 0.0)),
            EpipolarError::TooFewCorrespondences { found: 7, required: 8 }
        );
        let mut line = scene(20, 0, 0.0);
        for (i, c) in line.iter_mut().enumerate() {
            c.left = Point2::new(10.0 + 7.0 * i as f64, 20.0 + 3.0 * i as f64);
        }
        assert!(matches!(estimate(&line), EpipolarError::Collinear { found: 20, .. }));
        let same = vec![scene(1, 0, 0.0)[0]; 20];
        assert!(matches!(estimate(&same), EpipolarError::Collinear { found: 20, .. }));
        let noise = scene(100, 100, 0.0);
        assert!(matches!(estimate(&noise), EpipolarError::MostlyOutliers { found: 100, .. }));
    }

    /// A plane seen twice, found to whole pixels.
    #[test]
    fn names_coplanar_matches() {
        let plane: Vec<_> = scene(40, 0, 0.0)
            .iter()
            .map(|c| {
                let x = 0.9 * c.left.x + 0.1 * c.left.y + 12.0;
                let y = 0.05 * c.left.x + 1.02 * c.left.y;
                let whole = |p: Point2<f64>| Point2::new(p.x.round(), p.y.round());
                Correspondence { left: whole(c.left), right: whole(Point2::new(x, y)) }
            })
            .collect();
        for estimator in ALL {
            let found = estimate_fundamental(&plane, &options(estimator), 3);
            assert!(
                matches!(
                    found,
                    Err(EpipolarError::Coplanar { .. } | EpipolarError::MostlyOutliers { .. })
                ),
                "{estimator:?}: {found:?}"
            );
        }
        let used = EpipolarOptions { coplanar: CoplanarPairs::Use, ..options(Estimator::Ransac) };
        assert!(estimate_fundamental(&plane, &used, 3).unwrap().is_coplanar());
        let solid = estimate_fundamental(&scene(40, 0, 0.0), &used, 3).unwrap();
        assert!(!solid.is_coplanar());
    }
}
