//! The similarity that brings one point cloud to another, outliers left out.

use nalgebra::{Matrix3, Point3, Rotation3, Similarity3, Translation3, UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// Points a similarity is determined by.
const REQUIRED: usize = 3;
/// Points this much thinner across than along are collinear.
const COLLINEAR_RATIO: f64 = 1e-6;

/// A similarity and the points that agree with it.
#[derive(Clone, Debug, PartialEq)]
pub struct SimilarityFit {
    /// Scale, rotation and shift that bring the source to the target.
    pub target_from_source: Similarity3<f64>,
    /// One flag a pair of points.
    pub inliers: Vec<bool>,
    /// Root mean square distance of the inliers, in the target's unit.
    pub rms_error: f64,
}

/// Why two clouds could not be brought together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, thiserror::Error)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum SimilarityError {
    /// Too few points are in both clouds.
    #[error("{found} shared points; at least {required} are needed")]
    TooFewPoints {
        /// How many are.
        found: usize,
        /// The fewest that determine a similarity.
        required: usize,
    },
    /// The shared points lie on one line, which leaves the rotation open.
    #[error("all {found} shared points are collinear")]
    Collinear {
        /// How many there are.
        found: usize,
    },
    /// Too few shared points agree on one similarity.
    #[error("only {agreeing} of {found} shared points agree on a similarity")]
    NoConsensus {
        /// The most that agree.
        agreeing: usize,
        /// How many there are.
        found: usize,
    },
}

/// The similarity that maps `source` to `target` with the least squared error;
/// `None` for fewer than three points, collinear or not finite ones.
///
/// # Source
/// Umeyama, Least-squares estimation of transformation parameters between two
/// point patterns, 1991.
pub fn umeyama(source: &[Point3<f64>], target: &[Point3<f64>]) -> Option<Similarity3<f64>> {
    let count = source.len().min(target.len());
    if count < REQUIRED {
        return None;
    }
    let (source, target) = (&source[..count], &target[..count]);
    let (source_mean, target_mean) = (mean(source), mean(target));
    let mut covariance = Matrix3::zeros();
    let mut scatter = Matrix3::zeros();
    for (s, t) in source.iter().zip(target) {
        let (s, t) = (s.coords - source_mean, t.coords - target_mean);
        covariance += t * s.transpose();
        scatter += s * s.transpose();
    }
    if !covariance.iter().chain(scatter.iter()).all(|value| value.is_finite()) {
        return None;
    }
    if is_collinear(&scatter) {
        return None;
    }
    let svd = covariance.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let mirror = Vector3::new(1.0, 1.0, (u.determinant() * v_t.determinant()).signum());
    let rotation = u * Matrix3::from_diagonal(&mirror) * v_t;
    let scale = svd.singular_values.dot(&mirror) / scatter.trace();
    if !(scale.is_finite() && scale > f64::EPSILON) {
        return None;
    }
    let rotation =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    let translation = target_mean - scale * (rotation * source_mean);
    Some(Similarity3::from_parts(Translation3::from(translation), rotation, scale))
}

/// The similarity that most pairs `source[i]`, `target[i]` agree with.
///
/// Samples of three pairs are drawn from `seed`; the winner is refitted to all
/// that agree with it within `max_error`, in the target's unit.
///
/// # Errors
/// [`SimilarityError`]; with more than three pairs at least four must agree.
///
/// # Source
/// Fischler & Bolles 1981 over [`umeyama`]; Arys 2020, §3.7.
pub fn robust_similarity(
    source: &[Point3<f64>],
    target: &[Point3<f64>],
    max_error: f64,
    iterations: u32,
    seed: u64,
) -> Result<SimilarityFit, SimilarityError> {
    let found = source.len().min(target.len());
    if found < REQUIRED {
        return Err(SimilarityError::TooFewPoints { found, required: REQUIRED });
    }
    let (source, target) = (&source[..found], &target[..found]);
    if umeyama(source, target).is_none() {
        return Err(SimilarityError::Collinear { found });
    }
    let best = best_sample(source, target, max_error, iterations, seed);
    let required = if found > REQUIRED { REQUIRED + 1 } else { REQUIRED };
    let agreeing = best.iter().filter(|&&inlier| inlier).count();
    let fit = if agreeing >= required { refit(source, target, best, max_error) } else { None };
    fit.ok_or(SimilarityError::NoConsensus { agreeing, found })
}

fn best_sample(
    source: &[Point3<f64>],
    target: &[Point3<f64>],
    max_error: f64,
    iterations: u32,
    seed: u64,
) -> Vec<bool> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut best = (0, f64::INFINITY, vec![false; source.len()]);
    for _ in 0..iterations {
        let sample = index::sample(&mut rng, source.len(), REQUIRED).into_vec();
        let pick = |points: &[Point3<f64>]| [0, 1, 2].map(|k| points[sample[k]]);
        let Some(candidate) = umeyama(&pick(source), &pick(target)) else { continue };
        let (inliers, squared_error) = agreeing(&candidate, source, target, max_error);
        let count = inliers.iter().filter(|&&inlier| inlier).count();
        if count > best.0 || (count == best.0 && squared_error < best.1) {
            best = (count, squared_error, inliers);
        }
    }
    best.2
}

/// Fits to the agreeing points, and once more to those that agree with that.
fn refit(
    source: &[Point3<f64>],
    target: &[Point3<f64>],
    mut inliers: Vec<bool>,
    max_error: f64,
) -> Option<SimilarityFit> {
    let mut fit = None;
    for _ in 0..2 {
        let chosen = |points: &[Point3<f64>]| -> Vec<_> {
            points.iter().zip(&inliers).filter(|(_, keep)| **keep).map(|(p, _)| *p).collect()
        };
        let Some(refined) = umeyama(&chosen(source), &chosen(target)) else { break };
        let (agreed, squared_error) = agreeing(&refined, source, target, max_error);
        let count = agreed.iter().filter(|&&inlier| inlier).count();
        if count < REQUIRED {
            break;
        }
        inliers.clone_from(&agreed);
        fit = Some(SimilarityFit {
            target_from_source: refined,
            inliers: agreed,
            rms_error: (squared_error / count as f64).sqrt(),
        });
    }
    fit
}

/// Which points agree, and the sum of their squared errors.
fn agreeing(
    target_from_source: &Similarity3<f64>,
    source: &[Point3<f64>],
    target: &[Point3<f64>],
    max_error: f64,
) -> (Vec<bool>, f64) {
    let mut sum = 0.0;
    let inliers = source
        .iter()
        .zip(target)
        .map(|(s, t)| {
            let squared = (target_from_source * s - t).norm_squared();
            let inlier = squared <= max_error * max_error;
            sum += if inlier { squared } else { 0.0 };
            inlier
        })
        .collect();
    (inliers, sum)
}

fn mean(points: &[Point3<f64>]) -> Vector3<f64> {
    points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / points.len() as f64
}

fn is_collinear(scatter: &Matrix3<f64>) -> bool {
    let mut spread = scatter.symmetric_eigenvalues();
    spread.as_mut_slice().sort_by(f64::total_cmp);
    spread[1].is_nan() || spread[1] <= COLLINEAR_RATIO * COLLINEAR_RATIO * spread[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng;

    fn truth() -> Similarity3<f64> {
        Similarity3::new(Vector3::new(40.0, -7.0, 300.0), Vector3::new(0.2, -0.5, 1.1), 1.7)
    }

    fn cloud(count: usize, rng: &mut ChaCha8Rng) -> Vec<Point3<f64>> {
        (0..count)
            .map(|_| Point3::from(Vector3::from_fn(|_, _| rng.random_range(-99.0..99.0))))
            .collect()
    }

    #[test]
    fn three_points_determine_it() {
        let source =
            [Point3::new(0.0, 0.0, 0.0), Point3::new(5.0, 1.0, 0.0), Point3::new(0.0, 9.0, 2.0)];
        let target = source.map(|p| truth() * p);
        let fit = robust_similarity(&source, &target, 0.1, 10, 0).unwrap();
        assert!((fit.target_from_source.to_homogeneous() - truth().to_homogeneous()).norm() < 1e-9);
    }

    #[test]
    fn survives_thirty_percent_outliers_and_noise() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let source = cloud(100, &mut rng);
        let target: Vec<_> = source
            .iter()
            .enumerate()
            .map(|(i, p)| {
                let noise = if i % 10 < 3 { 500.0 } else { 0.5 };
                truth() * p + Vector3::from_fn(|_, _| rng.random_range(-noise..noise))
            })
            .collect();
        let fit = robust_similarity(&source, &target, 3.0, 500, 1).unwrap();
        let agreeing = fit.inliers.iter().filter(|&&inlier| inlier).count();
        assert!((70..=71).contains(&agreeing), "{agreeing} agree");
        assert!(fit.rms_error < 0.6, "{}", fit.rms_error);
        assert!((fit.target_from_source.scaling() / truth().scaling() - 1.0).abs() < 3e-3);
        let turn = fit.target_from_source.isometry.rotation.angle_to(&truth().isometry.rotation);
        assert!(turn < 3e-3, "{turn}");
    }

    #[test]
    fn mirrored_points_are_rotated_not_mirrored() {
        let source = cloud(20, &mut ChaCha8Rng::seed_from_u64(3));
        let target: Vec<_> = source.iter().map(|p| Point3::new(-p.x, p.y, p.z)).collect();
        let fitted = umeyama(&source, &target).unwrap();
        assert!(fitted.isometry.rotation.to_rotation_matrix().matrix().determinant() > 0.0);
    }

    #[test]
    fn names_degenerate_input() {
        let line: Vec<_> =
            (0..9).map(|i| Point3::new(f64::from(i), 2.0 * f64::from(i), 1.0)).collect();
        assert_eq!(
            robust_similarity(&line, &line, 1.0, 10, 0),
            Err(SimilarityError::Collinear { found: 9 })
        );
        assert_eq!(
            robust_similarity(&line[..2], &line[..2], 1.0, 10, 0),
            Err(SimilarityError::TooFewPoints { found: 2, required: 3 })
        );
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let (a, b) = (cloud(30, &mut rng), cloud(30, &mut rng));
        assert!(matches!(
            robust_similarity(&a, &b, 0.01, 200, 0),
            Err(SimilarityError::NoConsensus { found: 30, .. })
        ));
    }

    /// Everything that clouds hold at their worst: an answer or a name for why not.
    #[test]
    fn coplanar_duplicate_and_absurd_points_never_crash() {
        let flat: Vec<_> = (0..40)
            .map(|i| Point3::new(f64::from(i % 8) * 9.0, 5.0, f64::from(i / 8) * 11.0))
            .collect();
        let moved: Vec<_> = flat.iter().map(|p| p * 2.0 + Vector3::new(3.0, -4.0, 5.0)).collect();
        let fit = robust_similarity(&flat, &moved, 0.5, 100, 1).unwrap();
        assert!((fit.target_from_source.scaling() - 2.0).abs() < 1e-9);
        let twice = [flat.clone(), flat.clone()].concat();
        assert!(robust_similarity(&twice, &[moved.clone(), moved].concat(), 0.5, 100, 1).is_ok());
        for bad in [f64::NAN, f64::INFINITY, 1e300, -1e160] {
            let mut spoiled = flat.clone();
            spoiled[7].y = bad;
            if let Ok(fit) = robust_similarity(&spoiled, &flat, 0.5, 200, 1) {
                assert!(fit.rms_error.is_finite() && !fit.inliers[7], "{bad}");
            }
        }
    }
}
