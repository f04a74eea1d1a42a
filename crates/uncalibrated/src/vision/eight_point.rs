//! The normalised 8-point algorithm, alone and in a RANSAC loop.
//!
//! `F` as in [`epipolar_metrics`](super::epipolar_metrics).

use nalgebra::{DMatrix, Matrix3, Point2, Vector3};
use rand::SeedableRng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;

use super::Correspondence;

/// Correspondences that determine `F` linearly.
pub(super) const SAMPLE: usize = 8;
/// Rounds of refitting the winner to all that agree with it.
const REFITS: usize = 5;
/// Equations this much weaker than the strongest are no equations.
const RANK_RATIO: f64 = 1e-10;

/// When a correspondence agrees, and how long samples are drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct RansacOptions {
    /// Distance of both points to their epipolar lines, px.
    pub max_error_px: f64,
    /// That one sample was free of outliers, as a share.
    pub confidence: f64,
    pub max_iterations: u32,
    pub seed: u64,
}

/// The rank-2 `F` of least algebraic error in normalised coordinates, of unit
/// norm.
///
/// `None` for fewer than eight correspondences, and for such as leave a choice
/// of matrices: repeated, collinear or coplanar ones.
///
/// # Source
/// Hartley, In defense of the eight-point algorithm, 1997; Hartley & Zisserman,
/// 2nd ed., algorithm 11.1.
pub(super) fn eight_point(correspondences: &[Correspondence]) -> Option<Matrix3<f64>> {
    if correspondences.len() < SAMPLE {
        return None;
    }
    let left_norm = normalisation(correspondences.iter().map(|c| c.left))?;
    let right_norm = normalisation(correspondences.iter().map(|c| c.right))?;
    let equations = equations(correspondences, &left_norm, &right_norm);
    let svd = equations.svd(false, true);
    let v_t = svd.v_t?;
    let mut order: Vec<usize> = (0..svd.singular_values.len()).collect();
    order.sort_by(|&a, &b| svd.singular_values[b].total_cmp(&svd.singular_values[a]));
    let [strongest, .., last_but_one, last] = order.as_slice() else { return None };
    let weakest = svd.singular_values[*last_but_one];
    let is_determined = weakest > RANK_RATIO * svd.singular_values[*strongest];
    if !is_determined {
        return None;
    }
    let solution = Matrix3::from_row_iterator(v_t.row(*last).iter().copied());
    let normalised = rank_two(&solution)?;
    (right_norm.transpose() * normalised * left_norm).try_normalize(0.0)
}

/// The `F` that most correspondences agree with, from samples of eight drawn
/// from `options.seed`, refitted to them; and who agrees.
///
/// `None` if no sample gave a matrix.
///
/// # Source
/// Fischler & Bolles 1981; Hartley & Zisserman, 2nd ed., algorithm 11.4.
pub(super) fn ransac_eight_point(
    correspondences: &[Correspondence],
    options: &RansacOptions,
) -> Option<(Matrix3<f64>, Vec<bool>)> {
    let found = correspondences.len();
    if found < SAMPLE {
        return None;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let mut best: Option<Consensus> = None;
    let mut iterations = options.max_iterations;
    let mut done = 0;
    while done < iterations {
        done += 1;
        let sample: Vec<_> = index::sample(&mut rng, found, SAMPLE)
            .iter()
            .map(|chosen| correspondences[chosen])
            .collect();
        let Some(f) = eight_point(&sample) else { continue };
        let consensus = Consensus::of(f, correspondences, options.max_error_px);
        if best.as_ref().is_none_or(|best| consensus.agreeing > best.agreeing) {
            let share = consensus.agreeing as f64 / found as f64;
            iterations = iterations.min(enough_iterations(share, options));
            best = Some(consensus);
        }
    }
    best.map(|best| refit(best, correspondences, options.max_error_px))
        .map(|best| (best.fundamental, best.inliers))
}

/// A matrix and who agrees with it.
struct Consensus {
    fundamental: Matrix3<f64>,
    inliers: Vec<bool>,
    agreeing: usize,
}

impl Consensus {
    fn of(fundamental: Matrix3<f64>, correspondences: &[Correspondence], max_error: f64) -> Self {
        let limit = max_error * max_error;
        let inliers: Vec<_> =
            correspondences.iter().map(|c| worse_distance_px2(&fundamental, c) <= limit).collect();
        let agreeing = inliers.iter().filter(|&&inlier| inlier).count();
        Self { fundamental, inliers, agreeing }
    }
}

/// Fits the winner to all that agree, as long as no fewer do.
fn refit(mut best: Consensus, correspondences: &[Correspondence], max_error: f64) -> Consensus {
    for _ in 0..REFITS {
        let flagged = correspondences.iter().zip(&best.inliers);
        let agreeing: Vec<_> = flagged.filter(|(_, inlier)| **inlier).map(|(c, _)| *c).collect();
        let Some(f) = eight_point(&agreeing) else { break };
        let next = Consensus::of(f, correspondences, max_error);
        if next.agreeing < best.agreeing {
            break;
        }
        let settled = next.inliers == best.inliers;
        best = next;
        if settled {
            break;
        }
    }
    best
}

/// Draws after which a sample without outliers is as likely as asked for.
fn enough_iterations(inlier_share: f64, options: &RansacOptions) -> u32 {
    let clean = inlier_share.powi(SAMPLE as i32);
    if clean >= 1.0 {
        return 1;
    }
    let needed = (1.0 - options.confidence).ln() / (1.0 - clean).ln();
    if needed.is_finite() { needed.ceil().max(1.0) as u32 } else { u32::MAX }
}

/// The larger of both points' squared distances to their epipolar lines, as
/// OpenCV's estimators count, px².
fn worse_distance_px2(f: &Matrix3<f64>, c: &Correspondence) -> f64 {
    let (left, right) = (c.left.to_homogeneous(), c.right.to_homogeneous());
    let right_line = f * left;
    let left_line = f.tr_mul(&right);
    let residual = right.dot(&right_line);
    let narrower = right_line.xy().norm_squared().min(left_line.xy().norm_squared());
    if residual == 0.0 { 0.0 } else { residual * residual / narrower }
}

/// Moves points to the origin, a root of two away from it in the mean.
fn normalisation(points: impl Iterator<Item = Point2<f64>> + Clone) -> Option<Matrix3<f64>> {
    let count = points.clone().count() as f64;
    let mean = points.clone().map(|p| p.coords).sum::<nalgebra::Vector2<f64>>() / count;
    let distance = points.map(|p| (p.coords - mean).norm()).sum::<f64>() / count;
    let scale = 2.0_f64.sqrt() / distance;
    scale.is_finite().then(|| {
        Matrix3::new(scale, 0.0, -scale * mean.x, 0.0, scale, -scale * mean.y, 0.0, 0.0, 1.0)
    })
}

/// A row `x' ⊗ x` each; padded, so that the null space is part of the SVD.
fn equations(
    correspondences: &[Correspondence],
    left_norm: &Matrix3<f64>,
    right_norm: &Matrix3<f64>,
) -> DMatrix<f64> {
    let rows: Vec<(Vector3<f64>, Vector3<f64>)> = correspondences
        .iter()
        .map(|c| (left_norm * c.left.to_homogeneous(), right_norm * c.right.to_homogeneous()))
        .collect();
    DMatrix::from_fn(rows.len().max(9), 9, |row, column| {
        rows.get(row).map_or(0.0, |(left, right)| right[column / 3] * left[column % 3])
    })
}

fn rank_two(f: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let mut svd = f.try_svd(true, true, f64::EPSILON, 1000)?;
    let weakest = svd.singular_values.imin();
    svd.singular_values[weakest] = 0.0;
    svd.recompose().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::sampson_distance_px2;
    use nalgebra::{Point3, Vector2};
    use rand::Rng;

    const OPTIONS: RansacOptions =
        RansacOptions { max_error_px: 2.0, confidence: 0.99, max_iterations: 2000, seed: 5 };

    /// Points of a turntable 10 degrees apart, seen orthographically; the last
    /// `outliers` are matched with anything.
    fn turntable(count: usize, outliers: usize, noise_px: f64) -> Vec<Correspondence> {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let (sin, cos) = 10.0_f64.to_radians().sin_cos();
        (0..count)
            .map(|i| {
                let mut at = || rng.random_range(-150.0..150.0);
                let p = Point3::new(at(), at(), at());
                let mut seen = |x: f64, y: f64| {
                    let mut noise = || rng.random_range(-1.0..=1.0) * noise_px;
                    Point2::new(200.0 + x + noise(), 180.0 + y + noise())
                };
                let left = seen(p.x, -p.z);
                let right = seen(p.x * cos + p.y * sin, -p.z + 0.1 * p.x);
                let stray = i + outliers >= count;
                let elsewhere = Vector2::new(0.0, if stray { 40.0 + i as f64 } else { 0.0 });
                Correspondence { left, right: right + elsewhere }
            })
            .collect()
    }

    #[test]
    fn exact_points_give_exact_epipolar_lines() {
        let points = turntable(30, 0, 0.0);
        for used in [8, 9, 30] {
            let f = eight_point(&points[..used]).unwrap();
            let worst = points.iter().map(|c| sampson_distance_px2(&f, c.left, c.right).sqrt());
            let worst = worst.fold(0.0, f64::max);
            assert!(worst < 1e-6, "{used} points: {worst} px");
            assert!(f.determinant().abs() < 1e-12);
        }
    }

    #[test]
    fn ransac_keeps_the_inliers_and_drops_the_outliers() {
        let points = turntable(100, 30, 0.3);
        let (_, inliers) = ransac_eight_point(&points, &OPTIONS).unwrap();
        let kept = inliers[..70].iter().filter(|&&inlier| inlier).count();
        let wrong = inliers[70..].iter().filter(|&&inlier| inlier).count();
        assert!(kept > 66, "kept {kept} of 70");
        assert!(wrong < 3, "took {wrong} of 30 outliers");
    }

    #[test]
    fn a_seed_gives_one_result_and_few_draws_may_give_none() {
        let points = turntable(60, 20, 0.5);
        let first = ransac_eight_point(&points, &OPTIONS);
        assert_eq!(ransac_eight_point(&points, &OPTIONS), first);
        let none = RansacOptions { max_iterations: 0, ..OPTIONS };
        assert_eq!(ransac_eight_point(&points, &none), None);
        assert_eq!(ransac_eight_point(&points[..7], &OPTIONS), None);
    }

    #[test]
    fn points_that_leave_a_choice_give_nothing() {
        let same = vec![turntable(1, 0, 0.0)[0]; 12];
        assert_eq!(eight_point(&same), None);
        let flat: Vec<_> = turntable(20, 0, 0.0)
            .iter()
            .map(|c| Correspondence { left: c.left, right: c.left * 0.9 })
            .collect();
        assert_eq!(eight_point(&flat), None);
        assert_eq!(ransac_eight_point(&flat, &OPTIONS), None);
    }
}
