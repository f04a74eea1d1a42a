//! How well correspondences and a fundamental matrix agree.
//!
//! Throughout, `F` maps left points to right epipolar lines, `x'ᵀ F x = 0`
//! with `x` left and `x'` right, in pixels. Only a ratio of powers of `F`
//! enters the distances, so its scale does not matter there.

use nalgebra::linalg::{Schur, balancing};
use nalgebra::{Matrix3, Point2, Vector3};

/// Rounds of the eigenvalue iteration before giving up; a 3×3 takes a handful.
const EIGENVALUE_ROUNDS: usize = 1000;

/// The Sampson distance of one correspondence, px².
///
/// `(x'ᵀFx)² / ((Fx)₁² + (Fx)₂² + (Fᵀx')₁² + (Fᵀx')₂²)`, the first-order
/// reprojection error; OpenCV's `sampsonDistance`. Zero where both points are
/// epipoles, as every line through them is epipolar.
///
/// # Source
/// Hartley & Zisserman, 2nd ed., §11.4.3 (11.9); Arys 2020, §2.2.4.
pub fn sampson_distance_px2(f: &Matrix3<f64>, left: Point2<f64>, right: Point2<f64>) -> f64 {
    let (right_line, left_line, residual) = epipolar_lines(f, left, right);
    square_ratio(residual, right_line.xy().norm_squared() + left_line.xy().norm_squared())
}

/// The squared distances of both points to their epipolar lines, summed, px².
///
/// Infinite when a point lies off its line and that line is the line at
/// infinity.
///
/// # Source
/// Hartley & Zisserman, 2nd ed., §11.4.3 (11.10).
pub fn symmetric_epipolar_distance_px2(
    f: &Matrix3<f64>,
    left: Point2<f64>,
    right: Point2<f64>,
) -> f64 {
    let (right_line, left_line, residual) = epipolar_lines(f, left, right);
    square_ratio(residual, right_line.xy().norm_squared())
        + square_ratio(residual, left_line.xy().norm_squared())
}

/// The mean of `distance` over `correspondences`, `None` when there are none.
///
/// With [`sampson_distance_px2`] this is the mean Sampson distance (MSD).
pub fn mean_distance(
    f: &Matrix3<f64>,
    correspondences: impl IntoIterator<Item = (Point2<f64>, Point2<f64>)>,
    distance: impl Fn(&Matrix3<f64>, Point2<f64>, Point2<f64>) -> f64,
) -> Option<f64> {
    let (sum, count) =
        correspondences.into_iter().fold((0.0, 0_usize), |(sum, count), (left, right)| {
            (sum + distance(f, left, right), count + 1)
        });
    (count > 0).then(|| sum / count as f64)
}

/// The smallest absolute eigenvalue (SEV) of `f`, scaled to `F₃₃ = 1` as
/// OpenCV returns it: how far `f` is from singular.
///
/// A general real matrix can have a complex pair; the modulus counts then.
/// A matrix with negligible `F₃₃` cannot be scaled so and is taken with unit
/// norm instead. `None` when `f` is zero or not finite.
///
/// A fundamental matrix of the 7-point method is singular by construction, so
/// its value is rounding noise.
///
/// # Source
/// Arys 2020, §2.2.4.
pub fn smallest_absolute_eigenvalue(f: &Matrix3<f64>) -> Option<f64> {
    let unit = f.try_normalize(0.0).filter(|unit| unit.iter().all(|value| value.is_finite()))?;
    let f33 = unit[(2, 2)];
    let mut scaled = if f33.abs() > f64::from(f32::EPSILON) { unit / f33 } else { unit };
    // Entries of F span many orders of magnitude: even them out first.
    balancing::balance_parlett_reinsch(&mut scaled);
    let schur = Schur::try_new(scaled, f64::EPSILON, EIGENVALUE_ROUNDS)?;
    schur.complex_eigenvalues().iter().map(|value| value.norm()).reduce(f64::min)
}

/// `Fx`, `Fᵀx'` and `x'ᵀFx`.
fn epipolar_lines(
    f: &Matrix3<f64>,
    left: Point2<f64>,
    right: Point2<f64>,
) -> (Vector3<f64>, Vector3<f64>, f64) {
    let (left, right) = (left.to_homogeneous(), right.to_homogeneous());
    let right_line = f * left;
    (right_line, f.tr_mul(&right), right.dot(&right_line))
}

fn square_ratio(residual: f64, denominator: f64) -> f64 {
    if residual == 0.0 { 0.0 } else { residual * residual / denominator }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::optimal_correction::{
        null_vector, optimal_correction, reprojection_error_px2,
    };
    use nalgebra::{Matrix3x4, Point3, Rotation3, Vector2};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn perspective_camera(yaw_deg: f64, centre: Point3<f64>) -> Matrix3x4<f64> {
        let rotation = Rotation3::from_euler_angles(0.05, yaw_deg.to_radians(), -0.02);
        let k = Matrix3::new(800.0, 0.0, 480.0, 0.0, 800.0, 270.0, 0.0, 0.0, 1.0);
        let mut pose = Matrix3x4::zeros();
        pose.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation.matrix());
        pose.set_column(3, &-(rotation * centre.coords));
        k * pose
    }

    /// The orthographic turntable camera of a view, px of a 960×540 sheet.
    fn turntable_camera(azimuth_deg: f64, roll_deg: f64) -> Matrix3x4<f64> {
        let (sin, cos) = azimuth_deg.to_radians().sin_cos();
        let flat = Matrix3x4::new(
            131.5 * cos,
            131.5 * sin,
            0.0,
            480.0,
            0.0,
            0.0,
            -131.5,
            270.0,
            0.0,
            0.0,
            0.0,
            1.0,
        );
        Matrix3::new_rotation(roll_deg.to_radians()) * flat
    }

    /// `F` of two cameras from the minors of their matrices (H&Z table 17.1).
    fn fundamental(left: &Matrix3x4<f64>, right: &Matrix3x4<f64>) -> Matrix3<f64> {
        let rows = |camera: &Matrix3x4<f64>, i: usize| {
            [camera.row((i + 1) % 3).into_owned(), camera.row((i + 2) % 3).into_owned()]
        };
        Matrix3::from_fn(|j, i| {
            let ([a, b], [c, d]) = (rows(left, i), rows(right, j));
            nalgebra::Matrix4::from_rows(&[a, b, c, d]).determinant()
        })
    }

    fn project(camera: &Matrix3x4<f64>, point: &Point3<f64>) -> Point2<f64> {
        Point2::from_homogeneous(camera * point.to_homogeneous()).unwrap()
    }

    type Pairs = Vec<(Point2<f64>, Point2<f64>)>;

    fn scene(left: &Matrix3x4<f64>, right: &Matrix3x4<f64>) -> Pairs {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        (0..50)
            .map(|_| {
                let mut coordinate = || random.random_range(-1.5..1.5);
                let point = Point3::new(coordinate(), coordinate(), coordinate());
                (project(left, &point), project(right, &point))
            })
            .collect()
    }

    fn perspective_pair() -> (Matrix3<f64>, Pairs) {
        let left = perspective_camera(0.0, Point3::new(-0.7, 0.1, -6.0));
        let right = perspective_camera(-9.0, Point3::new(0.9, -0.2, -6.3));
        (fundamental(&left, &right), scene(&left, &right))
    }

    fn affine_pair() -> (Matrix3<f64>, Pairs) {
        let (left, right) = (turntable_camera(40.0, 0.0), turntable_camera(45.0, 3.0));
        (fundamental(&left, &right), scene(&left, &right))
    }

    fn nudged(pairs: &Pairs, by_px: f64) -> Pairs {
        let mut random = ChaCha8Rng::seed_from_u64(8);
        let mut nudge = |point: Point2<f64>| {
            point + Vector2::from_fn(|_, _| random.random_range(-by_px..by_px))
        };
        pairs.iter().map(|&(left, right)| (nudge(left), nudge(right))).collect()
    }

    #[test]
    fn exact_correspondences_have_no_error_by_any_measure() {
        for (f, pairs) in [perspective_pair(), affine_pair()] {
            for (left, right) in pairs {
                assert!(sampson_distance_px2(&f, left, right) < 1e-12);
                assert!(symmetric_epipolar_distance_px2(&f, left, right) < 1e-12);
                assert!(reprojection_error_px2(&f, left, right) < 1e-12);
            }
        }
    }

    /// With `F` of a pure sideways shift, lines are rows: a difference of
    /// 3 px between rows is 9/2 (Sampson, optimal) and 9 + 9 px².
    #[test]
    fn rows_three_px_apart_by_hand() {
        let f = Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, -2.0, 0.0, 2.0, 0.0);
        let (left, right) = (Point2::new(10.0, 20.0), Point2::new(35.0, 23.0));
        assert!((sampson_distance_px2(&f, left, right) - 4.5).abs() < 1e-12);
        assert!((symmetric_epipolar_distance_px2(&f, left, right) - 18.0).abs() < 1e-12);
        let corrected = optimal_correction(&f, left, right).unwrap();
        assert!((corrected.reprojection_error_px2 - 4.5).abs() < 1e-12);
        assert!((corrected.left - Point2::new(10.0, 21.5)).norm() < 1e-12);
        assert!((corrected.right - Point2::new(35.0, 21.5)).norm() < 1e-12);
    }

    #[test]
    fn the_correction_satisfies_the_constraint_at_the_stated_distance() {
        for (f, pairs) in [perspective_pair(), affine_pair()] {
            for (left, right) in nudged(&pairs, 4.0) {
                let found = optimal_correction(&f, left, right).unwrap();
                assert!(sampson_distance_px2(&f, found.left, found.right) < 1e-16);
                let moved =
                    (found.left - left).norm_squared() + (found.right - right).norm_squared();
                assert!((moved - found.reprojection_error_px2).abs() < 1e-9 * moved.max(1.0));
            }
        }
    }

    /// The optimum can be no worse than any epipolar line tried by hand.
    #[test]
    fn no_other_epipolar_line_is_nearer() {
        let (f, pairs) = perspective_pair();
        let epipole = null_vector(&f).unwrap();
        for (left, right) in nudged(&pairs, 8.0) {
            let best = reprojection_error_px2(&f, left, right);
            for step in 0..720 {
                let (sin, cos) = (f64::from(step) * 0.25).to_radians().sin_cos();
                let near = left + Vector2::new(cos, sin) * 6.0;
                let left_line = epipole.cross(&near.to_homogeneous());
                let right_line = f * near.to_homogeneous();
                let distance = |line: Vector3<f64>, point: Point2<f64>| {
                    line.dot(&point.to_homogeneous()).powi(2) / line.xy().norm_squared()
                };
                assert!(best <= distance(left_line, left) + distance(right_line, right) + 1e-9);
            }
        }
    }

    #[test]
    fn sampson_approximates_the_reprojection_error() {
        for (f, pairs) in [perspective_pair(), affine_pair()] {
            for (left, right) in nudged(&pairs, 1.0) {
                let (first_order, optimal) = (
                    sampson_distance_px2(&f, left, right),
                    reprojection_error_px2(&f, left, right),
                );
                assert!((first_order - optimal).abs() <= 0.01 * optimal + 1e-9);
            }
        }
    }

    #[test]
    fn a_point_on_its_epipole_needs_no_correction() {
        let (f, _) = perspective_pair();
        let epipole = Point2::from_homogeneous(null_vector(&f).unwrap()).unwrap();
        let error = reprojection_error_px2(&f, epipole, Point2::new(5.0, 5.0));
        assert!(error < 1e-12, "{error}");
    }

    #[test]
    fn the_mean_is_over_all_pairs_and_absent_without_any() {
        let f = Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0);
        let at = |y: f64| (Point2::new(0.0, 0.0), Point2::new(0.0, y));
        let mean = mean_distance(&f, [at(2.0), at(4.0)], sampson_distance_px2);
        assert_eq!(mean, Some(5.0));
        assert_eq!(mean_distance(&f, [], sampson_distance_px2), None);
    }

    #[test]
    fn smallest_eigenvalue_of_known_matrices() {
        let diagonal = Matrix3::from_diagonal(&Vector3::new(6.0, -1.0, 2.0));
        assert!((smallest_absolute_eigenvalue(&diagonal).unwrap() - 0.5).abs() < 1e-12);
        // Eigenvalues 1 and ±0.3i: the modulus of the pair is the smallest.
        let turning = Matrix3::new(0.0, -0.3, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0, 1.0);
        assert!((smallest_absolute_eigenvalue(&turning).unwrap() - 0.3).abs() < 1e-12);
    }

    #[test]
    fn a_rank_two_matrix_has_a_zero_eigenvalue() {
        let rank_two = Matrix3::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0);
        assert!(smallest_absolute_eigenvalue(&rank_two).unwrap() < 1e-15);
        for (f, _) in [perspective_pair(), affine_pair()] {
            assert!(smallest_absolute_eigenvalue(&f).unwrap() < 1e-12);
        }
    }

    #[test]
    fn useless_matrices_are_refused() {
        let origin = Point2::origin();
        let rank_one = Matrix3::new(1.0, 2.0, 3.0, 2.0, 4.0, 6.0, 3.0, 6.0, 9.0);
        assert_eq!(smallest_absolute_eigenvalue(&Matrix3::zeros()), None);
        assert_eq!(smallest_absolute_eigenvalue(&Matrix3::repeat(f64::NAN)), None);
        assert_eq!(optimal_correction(&Matrix3::zeros(), origin, origin), None);
        assert_eq!(optimal_correction(&rank_one, origin, origin), None);
        assert_eq!(optimal_correction(&Matrix3::repeat(f64::NAN), origin, origin), None);
        let (f, _) = affine_pair();
        assert_eq!(optimal_correction(&f, Point2::new(f64::NAN, 0.0), origin), None);
    }
}
