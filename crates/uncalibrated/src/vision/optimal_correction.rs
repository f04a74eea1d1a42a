//! The optimal correction of a correspondence, the gold standard of epipolar
//! errors.
//!
//! `F` as in [`epipolar_metrics`](super::epipolar_metrics).

use nalgebra::{Matrix3, Point2, Vector3};

/// The pair nearest to a measured correspondence that satisfies `F` exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OptimalCorrection {
    /// In the left view, px.
    pub left: Point2<f64>,
    /// In the right view, px.
    pub right: Point2<f64>,
    /// Squared distances of both points to their measurements, summed, px².
    pub reprojection_error_px2: f64,
}

/// Corrects a correspondence by the optimal (maximum likelihood) method.
///
/// Among all pairs with `x̂'ᵀ F x̂ = 0`, finds the one that minimises
/// `d(x, x̂)² + d(x', x̂')²`: the epipolar lines are parametrised by one number,
/// in which the cost's stationary points are the roots of a sextic.
///
/// * `f`: rank 2, any scale. Epipoles may be at infinity (affine cameras).
///
/// `None` when `f` has rank below 2 or something is not finite.
///
/// # Source
/// Hartley & Sturm 1997; Hartley & Zisserman, 2nd ed., §12.5, algorithm 12.1.
pub fn optimal_correction(
    f: &Matrix3<f64>,
    left: Point2<f64>,
    right: Point2<f64>,
) -> Option<OptimalCorrection> {
    let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
    if !(finite(f.as_slice()) && finite(left.coords.as_slice()) && finite(right.coords.as_slice()))
    {
        return None;
    }
    let f = f.try_normalize(0.0)?;
    let at_origin = translation(right).transpose() * f * translation(left);
    let at_origin = at_origin.try_normalize(0.0)?;
    let left_epipole = null_vector(&at_origin)?;
    let right_epipole = null_vector(&at_origin.transpose())?;
    let (Some(left_turn), Some(right_turn)) =
        (turn_to_x_axis(&left_epipole), turn_to_x_axis(&right_epipole))
    else {
        // A measurement on its epipole lies on every epipolar line already.
        return Some(OptimalCorrection { left, right, reprojection_error_px2: 0.0 });
    };
    let cost = CorrectionCost::new(&at_origin, left_turn, right_turn);
    let (t, u) = cost.minimum()?;
    let (left_line, right_line) = cost.lines(t, u);
    let left = left + nearest_to_origin(left_turn.rotation.transpose() * left_line)?;
    let right = right + nearest_to_origin(right_turn.rotation.transpose() * right_line)?;
    Some(OptimalCorrection { left, right, reprojection_error_px2: cost.at(t, u) })
}

/// The reprojection error by optimal correction, px²; NaN where
/// [`optimal_correction`] has none.
pub fn reprojection_error_px2(f: &Matrix3<f64>, left: Point2<f64>, right: Point2<f64>) -> f64 {
    optimal_correction(f, left, right).map_or(f64::NAN, |found| found.reprojection_error_px2)
}

fn translation(to: Point2<f64>) -> Matrix3<f64> {
    Matrix3::new_translation(&to.coords)
}

/// The right null vector of a rank-2 matrix, from the rows that differ most:
/// more accurate than an SVD when entries span many orders of magnitude.
/// `None` when all rows are parallel to within rounding.
pub(super) fn null_vector(matrix: &Matrix3<f64>) -> Option<Vector3<f64>> {
    let [one, two, three] = [0, 1, 2].map(|index| matrix.row(index).transpose());
    let (normal, scale) = [(one, two), (one, three), (two, three)]
        .map(|(a, b)| (a.cross(&b), a.norm() * b.norm()))
        .into_iter()
        .max_by(|a, b| a.0.norm_squared().total_cmp(&b.0.norm_squared()))?;
    normal.try_normalize(1e-14 * scale)
}

/// The rotation about the origin that puts an epipole at `(1, 0, e₃)`.
#[derive(Clone, Copy)]
struct EpipoleTurn {
    rotation: Matrix3<f64>,
    e3: f64,
}

/// `None` if the epipole is at the origin.
fn turn_to_x_axis(epipole: &Vector3<f64>) -> Option<EpipoleTurn> {
    let planar = epipole.xy().norm();
    (planar > 1e-12).then(|| {
        let e = epipole / planar;
        let rotation = Matrix3::new(e.x, e.y, 0.0, -e.y, e.x, 0.0, 0.0, 0.0, 1.0);
        EpipoleTurn { rotation, e3: e.z }
    })
}

/// The point of a line nearest to the origin, as an offset from it.
fn nearest_to_origin(line: Vector3<f64>) -> Option<nalgebra::Vector2<f64>> {
    let norm_squared = line.xy().norm_squared();
    (norm_squared > 0.0).then(|| line.xy() * (-line.z / norm_squared))
}

/// The cost of algorithm 12.1 along the pencil of epipolar lines, in the
/// homogeneous parameter `t : u` so that the line at `t = ∞` is like any other.
struct CorrectionCost {
    a: f64,
    b: f64,
    c: f64,
    d: f64,
    left_e3: f64,
    right_e3: f64,
}

impl CorrectionCost {
    fn new(at_origin: &Matrix3<f64>, left: EpipoleTurn, right: EpipoleTurn) -> Self {
        let turned = right.rotation * at_origin * left.rotation.transpose();
        Self {
            a: turned[(1, 1)],
            b: turned[(1, 2)],
            c: turned[(2, 1)],
            d: turned[(2, 2)],
            left_e3: left.e3,
            right_e3: right.e3,
        }
    }

    /// Sum of squared distances of the two origins to the lines of `t : u`.
    fn at(&self, t: f64, u: f64) -> f64 {
        let (numerator, denominator) = (self.c * t + self.d * u, self.a * t + self.b * u);
        let left = t.powi(2) / (u.powi(2) + (self.left_e3 * t).powi(2));
        let right = numerator.powi(2) / (denominator.powi(2) + (self.right_e3 * numerator).powi(2));
        left + right
    }

    /// The lines in the turned frames: through `(1, 0, e₃)` and `(0, t, u)`,
    /// and its image under `F`.
    fn lines(&self, t: f64, u: f64) -> (Vector3<f64>, Vector3<f64>) {
        let (numerator, denominator) = (self.c * t + self.d * u, self.a * t + self.b * u);
        (
            Vector3::new(t * self.left_e3, u, -t),
            Vector3::new(-self.right_e3 * numerator, denominator, numerator),
        )
    }

    /// The stationary points' sextic, coefficients of `t⁰ … t⁶`.
    fn sextic(&self) -> Vec<f64> {
        let p = [self.b, self.a];
        let q = [self.d, self.c];
        let p2 = product(&p, &p);
        let q2: Vec<f64> =
            product(&q, &q).iter().map(|value| value * self.right_e3.powi(2)).collect();
        let sum: Vec<f64> = p2.iter().zip(&q2).map(|(one, other)| one + other).collect();
        let first = product(&[0.0, 1.0], &product(&sum, &sum));
        let scale = [1.0, 0.0, self.left_e3.powi(2)];
        let second = product(&product(&scale, &scale), &product(&p, &q));
        let determinant = self.a * self.d - self.b * self.c;
        (0..7)
            .map(|power| {
                first.get(power).unwrap_or(&0.0) - determinant * second.get(power).unwrap_or(&0.0)
            })
            .collect()
    }

    /// The `t : u` of least cost among the stationary points, zero and infinity.
    fn minimum(&self) -> Option<(f64, f64)> {
        let sextic = self.sextic();
        let reversed: Vec<f64> = sextic.iter().rev().copied().collect();
        let finite = stationary_candidates(&sextic).into_iter().map(|t| (t, 1.0));
        let beyond_one = stationary_candidates(&reversed).into_iter().map(|u| (1.0, u));
        finite
            .chain(beyond_one)
            .filter(|&(t, u)| self.at(t, u).is_finite())
            .min_by(|one, other| self.at(one.0, one.1).total_cmp(&self.at(other.0, other.1)))
    }
}

fn product(one: &[f64], other: &[f64]) -> Vec<f64> {
    let mut result = vec![0.0; one.len() + other.len() - 1];
    for (i, x) in one.iter().enumerate() {
        for (j, y) in other.iter().enumerate() {
            result[i + j] += x * y;
        }
    }
    result
}

/// The real roots in [-1, 1] of a polynomial (coefficients from the constant
/// up), with its own stationary points, the ends and zero among them: a
/// candidate too many costs nothing, a double root missed would.
fn stationary_candidates(polynomial: &[f64]) -> Vec<f64> {
    if polynomial.len() < 2 {
        return vec![-1.0, 0.0, 1.0];
    }
    let derivative: Vec<f64> =
        polynomial.iter().enumerate().skip(1).map(|(power, value)| power as f64 * value).collect();
    let splits = stationary_candidates(&derivative);
    let roots: Vec<f64> =
        splits.windows(2).filter_map(|ends| bisect(polynomial, ends[0], ends[1])).collect();
    let mut all = [splits, roots].concat();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

fn evaluate(polynomial: &[f64], at: f64) -> f64 {
    polynomial.iter().rev().fold(0.0, |sum, coefficient| sum * at + coefficient)
}

/// The root between two points of different sign, to the last bit or 2⁻¹²⁸.
fn bisect(polynomial: &[f64], mut low: f64, mut high: f64) -> Option<f64> {
    let (at_low, at_high) = (evaluate(polynomial, low), evaluate(polynomial, high));
    if at_low == 0.0 || at_high == 0.0 || (at_low < 0.0) == (at_high < 0.0) {
        return None;
    }
    for _ in 0..128 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if (evaluate(polynomial, middle) < 0.0) == (at_low < 0.0) {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(0.5 * (low + high))
}
