//! Depth that no drawing shows: views along one line, front and back say, bound a
//! subject to the sides alone. How deep it is is guessed from how broad it is.

use std::f64::consts::FRAC_PI_2;

use image::{GrayImage, Luma};
use imageproc::distance_transform::euclidean_squared_distance_transform;
use nalgebra::Point2;

use super::outline::Outline;
use crate::surface::field::{Field, Lattice, Plane};

/// The subject is taken to lie within so many radii of the widest circle in its
/// outline to either side of the axis.
const REACH: f64 = 2.0;
/// What the squared height's second derivatives add up to, but for the sign: a disc
/// becomes a ball, a strip a tube a little deeper than broad.
const CURVATURE: f64 = 4.0;
/// Rounds of relaxation, and how far each goes.
const ROUNDS: usize = 400;
const RELAXATION: f64 = 1.9;

/// What a view from the side is taken to show: as far from the axis as the subject
/// may reach, in every row.
///
/// * `boxy`: the subject is made of flat walls, and as deep as it is broad.
pub(super) fn side(front: &Outline, boxy: bool) -> Outline {
    let half_px = if boxy { 1.0 } else { REACH } * widest_radius_px(front);
    let of_row = |row: &Vec<(f64, f64)>| row.first().map(|_| (-half_px, half_px));
    Outline {
        azimuth_rad: front.azimuth_rad + FRAC_PI_2,
        rows: front.rows.iter().map(|row| of_row(row).into_iter().collect()).collect(),
    }
}

/// The radius of the widest circle in the outline, px.
fn widest_radius_px(front: &Outline) -> f64 {
    let Some((low, high)) = front.column_range() else { return 0.0 };
    let width = (high - low).ceil() as u32 + 2;
    let paper = GrayImage::from_fn(width, front.rows.len() as u32 + 2, |x, y| {
        let column = low + f64::from(x) - 0.5;
        let row = (y as usize).checked_sub(1).map_or(&[][..], |y| front.row(y));
        Luma([if covers(row, column) { 0 } else { 255 }])
    });
    euclidean_squared_distance_transform(&paper).pixels().map(|p| p[0]).fold(0.0, f64::max).sqrt()
}

fn covers(row: &[(f64, f64)], column: f64) -> bool {
    row.iter().any(|&(low, high)| low <= column && column < high)
}

/// The outline swollen to both sides of the plane through the axis, as a balloon.
///
/// * `rows`: the row of the drawing that each slice of `lattice` is cut in.
pub(super) fn inflated(front: &Outline, lattice: &Lattice, rows: &[usize]) -> Field {
    let swelling = Swelling::new(front, lattice, rows);
    let toward = front.toward_camera();
    let limit = lattice.truncation_px();
    let [columns, depths, _] = lattice.nodes;
    let plane = |k: usize| {
        let value = |index: usize| {
            let node = Point2::new(lattice.x(index % columns), lattice.y(index / columns));
            let depth_px = toward.dot(&node.coords);
            let (squared, slope) = swelling.at(front.column(&node), k);
            // First order: the difference over the length of its gradient.
            let steepness = slope.hypot(2.0 * depth_px).max(lattice.pitch_px);
            ((squared - depth_px * depth_px) / steepness).clamp(-limit, limit) as f32
        };
        Plane {
            first: [0, 0],
            size: [columns, depths],
            values: (0..columns * depths).map(value).collect(),
            creases: Vec::new(),
        }
    };
    use rayon::prelude::*;
    Field { lattice: *lattice, planes: (0..rows.len()).into_par_iter().map(plane).collect() }
}

/// Squared heights over the plane through the axis, px^2: what a membrane over the
/// outline is, evenly pressed.
struct Swelling {
    low_px: f64,
    pitch_px: f64,
    columns: usize,
    /// Slices bottom to top, columns from left to right.
    squared: Vec<f64>,
}

impl Swelling {
    fn new(front: &Outline, lattice: &Lattice, rows: &[usize]) -> Self {
        let pitch_px = lattice.pitch_px;
        let (low, high) = front.column_range().unwrap_or((0.0, 0.0));
        let low_px = low - pitch_px;
        let columns = ((high - low) / pitch_px).ceil() as usize + 3;
        let covered: Vec<bool> = rows
            .iter()
            .flat_map(|&row| (0..columns).map(move |i| (row, low_px + i as f64 * pitch_px)))
            .map(|(row, column)| covers(front.row(row), column))
            .collect();
        let mut squared = vec![0.0; covered.len()];
        let pressure = CURVATURE * pitch_px * pitch_px;
        for _ in 0..ROUNDS {
            for index in (0..covered.len()).filter(|&index| covered[index]) {
                // Columns beyond the outline are never covered, slices may end in it.
                let below = index.checked_sub(columns).map_or(0.0, |below| squared[below]);
                let above = squared.get(index + columns).copied().unwrap_or(0.0);
                let sum = squared[index - 1] + squared[index + 1] + below + above;
                let own = &mut squared[index];
                *own += RELAXATION * ((sum + pressure) / 4.0 - *own);
            }
        }
        Self { low_px, pitch_px, columns, squared }
    }

    /// The squared height at a column of slice `k`, px^2, and how steep it is there, px.
    fn at(&self, column_px: f64, k: usize) -> (f64, f64) {
        let place =
            ((column_px - self.low_px) / self.pitch_px).clamp(0.0, (self.columns - 1) as f64);
        let (left, share) = ((place as usize).min(self.columns - 2), place.fract());
        let value = |k: usize| {
            let row = self.squared.get(k * self.columns..(k + 1) * self.columns).unwrap_or(&[]);
            let at = |i: usize| row.get(i).copied().unwrap_or(0.0);
            (at(left) * (1.0 - share) + at(left + 1) * share, at(left + 1) - at(left))
        };
        let (here, across) = value(k);
        let below = k.checked_sub(1).map_or(0.0, |k| value(k).0);
        let up = (value(k + 1).0 - below) / 2.0;
        (here, across.hypot(up) / self.pitch_px)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    const RADIUS: f64 = 20.0;

    fn disc() -> Outline {
        let half = |y: usize| RADIUS * RADIUS - (y as f64 + 0.5 - 30.0).powi(2);
        let row = |y| (half(y) > 0.0).then(|| (-half(y).sqrt(), half(y).sqrt()));
        Outline { azimuth_rad: 0.0, rows: (0..60).map(|y| row(y).into_iter().collect()).collect() }
    }

    #[test]
    fn a_disc_becomes_a_ball() {
        let front = disc();
        assert!((widest_radius_px(&front) - RADIUS).abs() < 1.0);
        let side = side(&front, false);
        assert_eq!(side.row(0), []);
        assert!((side.row(30)[0].1 - REACH * RADIUS).abs() < 2.0);
        let nodes = [61, 61, 40];
        let lattice = Lattice { origin: Point3::new(-30.0, -30.0, 0.0), pitch_px: 1.0, nodes };
        let rows: Vec<usize> = (0..40).map(|k| 49 - k).collect();
        let field = inflated(&front, &lattice, &rows);
        for (k, plane) in field.planes.iter().enumerate() {
            for (index, value) in plane.values.iter().enumerate() {
                let (i, j) = plane.node(index);
                let height = k as f64 + 0.5 - 20.0;
                let from_centre =
                    (lattice.x(i).powi(2) + lattice.y(j).powi(2) + height * height).sqrt();
                if (from_centre - RADIUS).abs() > 2.0 {
                    assert_eq!(*value > 0.0, from_centre < RADIUS, "{i} {j} {k}: {from_centre}");
                }
            }
        }
    }
}
