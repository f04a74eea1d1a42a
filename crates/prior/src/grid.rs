//! The voxels that hold the subject.

use rayon::prelude::*;

use super::PriorInput;
use super::sampling::bilinear;

/// Voxels of the grid, about.
pub(crate) const BUDGET: f64 = 64.0 * 64.0 * 64.0;
/// The share of the grid's side that the hull fills.
const FILL: f64 = 0.93;
/// The longest and the shortest side, voxels. Sides are multiples of `STEP`,
/// for the networks halve them three times.
const LONGEST: usize = 96;
const SHORTEST: usize = 16;
const STEP: usize = 8;
/// The hull is found on so many columns and rows, and in so many slices.
const PROBES: usize = 128;
const SLICES: usize = 96;

/// Voxels about the hull of the drawings; logits come at twice as many.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// The middle, X, Y and Z in the turntable frame, px.
    pub centre: [f64; 3],
    /// From voxel to voxel, px.
    pub pitch_px: f64,
    /// Voxels along X, Y and Z.
    pub size: [usize; 3],
}

impl Grid {
    /// The grid of about so many voxels about what is inside all outlines;
    /// `None` if nothing is.
    pub(crate) fn around(input: &PriorInput<'_>, voxels: f64) -> Option<Self> {
        let (low, high) = hull_box(input)?;
        Some(Self::fitted(low, high, voxels))
    }

    fn fitted(low: [f64; 3], high: [f64; 3], budget: f64) -> Self {
        let extent: [f64; 3] = std::array::from_fn(|axis| (high[axis] - low[axis]) / FILL);
        let mut pitch = (extent.iter().product::<f64>() / budget).cbrt();
        let sides = |pitch: f64| {
            extent.map(|side| {
                let steps = (side / pitch / STEP as f64).ceil() as usize;
                (steps * STEP).max(SHORTEST)
            })
        };
        let size = loop {
            let size = sides(pitch);
            let voxels = size.iter().product::<usize>() as f64;
            if voxels <= budget * 1.05 && size.iter().all(|&side| side <= LONGEST) {
                break size;
            }
            pitch *= 1.01;
        };
        let tightest = |axis: usize| extent[axis] / size[axis] as f64;
        Self {
            centre: std::array::from_fn(|axis| (low[axis] + high[axis]) / 2.0),
            pitch_px: (0..3).map(tightest).fold(0.0, f64::max),
            size,
        }
    }

    /// Columns of a view of the grid, voxels: its diagonal, whatever the azimuth.
    pub(crate) fn view_columns(&self) -> usize {
        let diagonal = (self.size[0] as f64).hypot(self.size[1] as f64);
        (diagonal / STEP as f64).ceil() as usize * STEP
    }

    /// Where the middle of the grid is seen at `azimuth_rad`, px from the axis.
    pub(crate) fn column_of_centre(&self, azimuth_rad: f64) -> f64 {
        self.centre[0] * azimuth_rad.cos() + self.centre[1] * azimuth_rad.sin()
    }
}

/// The box of what is inside all outlines, px.
fn hull_box(input: &PriorInput<'_>) -> Option<([f64; 3], [f64; 3])> {
    let (width, height) = input.size;
    let inside = |row: usize| {
        let pixels = row * width..(row + 1) * width;
        input.views.iter().any(|view| view.mask[pixels.clone()].iter().any(|&value| value > 0.5))
    };
    let first = (0..height).find(|&row| inside(row))?;
    let last = (0..height).rev().find(|&row| inside(row))?;
    let (low_z, high_z) =
        (input.origin_row_px - last as f64 - 1.0, input.origin_row_px - first as f64);
    let directions: Vec<(f64, f64)> =
        input.views.iter().map(|view| view.azimuth_rad.sin_cos()).collect();
    let [first_x, last_x, first_y, last_y] = footprint(input, &directions)?;
    let steps = [last_x - first_x, last_y - first_y].map(|side| side / PROBES as f64);
    let x_at = |index: usize| first_x + (index as f64 + 0.5) * steps[0];
    let y_at = |index: usize| first_y + (index as f64 + 0.5) * steps[1];
    let ranges: Vec<[usize; 4]> = (0..SLICES)
        .into_par_iter()
        .filter_map(|slice| {
            let z = low_z + (high_z - low_z) * slice as f64 / (SLICES - 1) as f64;
            let row = input.origin_row_px - z;
            let mut range = [usize::MAX, 0, usize::MAX, 0];
            for j in 0..PROBES {
                for i in 0..PROBES {
                    let shown =
                        input.views.iter().zip(&directions).all(|(view, (sine, cosine))| {
                            let column = x_at(i) * cosine + y_at(j) * sine + input.axis_px;
                            bilinear(view.mask, input.size, column, row) > 0.5
                        });
                    if shown {
                        range =
                            [range[0].min(i), range[1].max(i), range[2].min(j), range[3].max(j)];
                    }
                }
            }
            (range[0] != usize::MAX).then_some(range)
        })
        .collect();
    let range = ranges
        .into_iter()
        .reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].max(b[3])])?;
    let [half_x, half_y] = steps.map(|step| step / 2.0);
    let low = [x_at(range[0]) - half_x, y_at(range[2]) - half_y, low_z];
    Some((low, [x_at(range[1]) + half_x, y_at(range[3]) + half_y, high_z]))
}

/// The box about where all views' outlines may meet, whatever the height: the least and most X
/// and Y, px. However thin a subject is, it fills much of that.
fn footprint(input: &PriorInput<'_>, directions: &[(f64, f64)]) -> Option<[f64; 4]> {
    let (width, height) = input.size;
    let half = width.max(height) as f64;
    let inside = |value: &f32| *value > 0.5;
    let ends_of_row =
        |row: &[f32]| Some((row.iter().position(inside)?, row.iter().rposition(inside)?));
    let mut corners = vec![[-half, -half], [half, -half], [half, half], [-half, half]];
    for (view, &(sine, cosine)) in input.views.iter().zip(directions) {
        let rows = view.mask.chunks_exact(width).filter_map(ends_of_row);
        let (first, last) = rows.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
        let (first, last) = (first as f64 - input.axis_px, last as f64 + 1.0 - input.axis_px);
        corners = clipped(&corners, |[x, y]| x * cosine + y * sine - first);
        corners = clipped(&corners, |[x, y]| last - x * cosine - y * sine);
    }
    if let (Some(half), [(sine, cosine), ..]) = (input.half_depth_px, directions) {
        corners = clipped(&corners, |[x, y]| half - x * sine + y * cosine);
        corners = clipped(&corners, |[x, y]| half + x * sine - y * cosine);
    }
    corners
        .iter()
        .map(|&[x, y]| [x, x, y, y])
        .reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].max(b[3])])
}

/// What of a convex polygon lies where `distance` to a line is not negative.
///
/// # Source
/// Sutherland & Hodgman 1974, Reentrant polygon clipping.
fn clipped(corners: &[[f64; 2]], distance: impl Fn([f64; 2]) -> f64) -> Vec<[f64; 2]> {
    let mut kept = Vec::with_capacity(corners.len() + 1);
    for (index, &to) in corners.iter().enumerate() {
        let from = corners[(index + corners.len() - 1) % corners.len()];
        let (before, after) = (distance(from), distance(to));
        if (before < 0.0) != (after < 0.0) {
            let share = before / (before - after);
            kept.push([0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * share));
        }
        if after >= 0.0 {
            kept.push(to);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_standing_figure_gets_a_standing_grid() {
        let grid = Grid::fitted([-50.0, -30.0, 0.0], [50.0, 30.0, 200.0], BUDGET);
        assert_eq!(grid.size[2], LONGEST);
        assert!(grid.size.iter().all(|side| side % STEP == 0));
        assert!(grid.size[2] as f64 * grid.pitch_px >= 200.0 / FILL - 1e-9);
    }

    #[test]
    fn a_thin_plate_keeps_the_shortest_side() {
        let grid = Grid::fitted([-50.0, -1.0, -50.0], [50.0, 1.0, 50.0], BUDGET);
        assert_eq!(grid.size[1], SHORTEST);
    }

    #[test]
    fn a_blade_seen_edge_on_is_found() {
        let (width, height) = (1200, 40);
        let strip = |half: usize| -> Vec<f32> {
            let column = |index: usize| (index % width).abs_diff(width / 2);
            (0..width * height).map(|index| f32::from(u8::from(column(index) < half))).collect()
        };
        let (broad, edge) = (strip(550), strip(3));
        let ink = vec![0.0; width * height];
        let view = |degrees: f64, mask| crate::PriorView {
            azimuth_rad: degrees.to_radians(),
            mask,
            ink: &ink,
        };
        let input = PriorInput {
            views: vec![view(0.0, &broad), view(90.0, &edge)],
            size: (width, height),
            axis_px: 600.0,
            origin_row_px: 20.0,
            half_depth_px: None,
        };
        let (low, high) = hull_box(&input).unwrap();
        assert!(
            (low[0] + 550.0).abs() < 10.0 && (high[0] - 550.0).abs() < 10.0,
            "{low:?} {high:?}"
        );
        assert!((low[1] + 3.0).abs() < 1.5 && (high[1] - 3.0).abs() < 1.5, "{low:?} {high:?}");
    }
}
