//! Round forms inside convex sections: what no drawing says is sharp is round.

use nalgebra::Point2;

use super::section::Section;

/// The weight of a rounded corner's curve over that of the ellipse.
const FULLNESS: f64 = 0.9;
/// Turns sharper than this are rounded as this one, so that curves stay finite.
const MAX_TURNING_RAD: f64 = 3.0;
/// Points per radian of turning on a rounded corner.
const POINTS_PER_RADIAN: f64 = 6.0;

/// The outline of `section` with every corner that is not `sharp` replaced by
/// a rational quadratic Bézier curve between its edges' touch points.
///
/// The result lies inside the section and touches every edge, so that every
/// silhouette is kept. A sharp corner stays, with its edges up to the touch
/// points.
pub(super) fn rounded(section: &Section, sharp: &[bool]) -> Vec<Point2<f64>> {
    let n = section.len();
    let touches: Vec<Point2<f64>> = (0..n).map(|i| touch_point(section, i)).collect();
    let mut outline = Vec::with_capacity(n * 8);
    for corner in 0..n {
        let before = touches[(corner + n - 1) % n];
        outline.push(before);
        if sharp[corner] {
            outline.push(section.corners[corner]);
        } else {
            curve(&mut outline, section, corner, before, touches[corner]);
        }
    }
    outline
}

/// Where the rounded outline touches edge `i`: nearer to the end that turns
/// less, as on an ellipse that touches its neighbours too.
fn touch_point(section: &Section, i: usize) -> Point2<f64> {
    let n = section.len();
    let next = (i + 1) % n;
    let half_tangent =
        |corner: usize| (section.turning_rad(corner).min(MAX_TURNING_RAD) / 2.0).tan();
    let (from, to) = (half_tangent(i), half_tangent(next));
    let share = if from + to < 1e-9 { 0.5 } else { from / (from + to) };
    section.corners[i] + (section.corners[next] - section.corners[i]) * share
}

fn curve(
    outline: &mut Vec<Point2<f64>>,
    section: &Section,
    corner: usize,
    from: Point2<f64>,
    to: Point2<f64>,
) {
    let turning = section.turning_rad(corner);
    let weight = FULLNESS * (turning.min(MAX_TURNING_RAD) / 2.0).cos().max(0.05);
    let apex = section.corners[corner];
    let steps = (turning * POINTS_PER_RADIAN).ceil().clamp(2.0, 16.0) as usize;
    for step in 1..steps {
        let t = step as f64 / steps as f64;
        let (b0, b1, b2) = ((1.0 - t) * (1.0 - t), 2.0 * weight * t * (1.0 - t), t * t);
        let sum = from.coords * b0 + apex.coords * b1 + to.coords * b2;
        outline.push(Point2::from(sum / (b0 + b1 + b2)));
    }
}
