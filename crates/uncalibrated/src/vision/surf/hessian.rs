//! SURF's keypoints: maxima of the Hessian's determinant over place and scale.

use nalgebra::{Matrix3, Vector3};

use super::integral::IntegralImage;
use super::{SurfKeypoint, SurfOptions};

/// Side of the smallest filter, px, and its growth a layer in the first octave.
const FIRST_SIZE: i64 = 9;
const SIZE_STEP: i64 = 6;

/// A box of a filter 9 px wide: left, top, right, bottom, weight.
type FilterBox = (i64, i64, i64, i64, f32);

const D_XX: [FilterBox; 3] = [(0, 2, 3, 7, 1.0), (3, 2, 6, 7, -2.0), (6, 2, 9, 7, 1.0)];
const D_YY: [FilterBox; 3] = [(2, 0, 7, 3, 1.0), (2, 3, 7, 6, -2.0), (2, 6, 7, 9, 1.0)];
const D_XY: [FilterBox; 4] =
    [(1, 1, 4, 4, 1.0), (5, 1, 8, 4, -1.0), (1, 5, 4, 8, -1.0), (5, 5, 8, 8, 1.0)];

/// Balances Dxy for being approximated by boxes: 0.9² (Bay et al., §3.2).
const D_XY_WEIGHT: f32 = 0.81;

/// Determinant and trace of the Hessian by box filters of `size` px whose top
/// left corner is at `(left, top)`; the filter must lie within the picture.
///
/// Every box's sum is divided by its area.
pub(super) fn response_at(integral: &IntegralImage, left: i64, top: i64, size: i64) -> (f32, f32) {
    // Filters grow in proportion, rounded to whole pixels.
    let grown = |at: i64| (2 * at * size + FIRST_SIZE) / (2 * FIRST_SIZE);
    let apply = |boxes: &[FilterBox]| -> f32 {
        boxes
            .iter()
            .map(|&(l, t, r, b, weight)| {
                let (l, t) = (left + grown(l), top + grown(t));
                weight * integral.mean(l, t, left + grown(r), top + grown(b))
            })
            .sum()
    };
    let (xx, yy, xy) = (apply(&D_XX), apply(&D_YY), apply(&D_XY));
    (xx * yy - D_XY_WEIGHT * xy * xy, xx + yy)
}

/// Responses of one filter size on the sampling grid of its octave.
///
/// Sample `(i, j)` belongs to the filter whose top left corner is `margin`
/// samples up and left of it, so that the layers of an octave line up.
struct Layer {
    size: i64,
    step: i64,
    columns: i64,
    /// Samples between the grid's border and the first filter that fits.
    margin: i64,
    determinants: Vec<f32>,
}

impl Layer {
    fn new(integral: &IntegralImage, size: i64, step: i64) -> Self {
        let (columns, rows) = (integral.width() / step, integral.height() / step);
        let margin = size / 2 / step;
        let mut layer = Self {
            size,
            step,
            columns,
            margin,
            determinants: vec![f32::NEG_INFINITY; (columns * rows) as usize],
        };
        for row in margin..rows {
            for column in margin..columns {
                let (left, top) = layer.corner(column, row);
                if left + size <= integral.width() && top + size <= integral.height() {
                    let (determinant, _) = response_at(integral, left, top, size);
                    layer.determinants[(row * columns + column) as usize] = determinant;
                }
            }
        }
        layer
    }

    fn corner(&self, column: i64, row: i64) -> (i64, i64) {
        ((column - self.margin) * self.step, (row - self.margin) * self.step)
    }

    fn at(&self, column: i64, row: i64) -> f32 {
        self.determinants[(row * self.columns + column) as usize]
    }
}

/// Blobs over all octaves, strongest first, without orientation.
pub(super) fn blobs(integral: &IntegralImage, options: &SurfOptions) -> Vec<SurfKeypoint> {
    let mut keypoints = Vec::new();
    let shortest = integral.width().min(integral.height());
    for octave in 0..options.octaves.min(32) {
        let step = 1_i64 << octave;
        if FIRST_SIZE * step > shortest {
            break;
        }
        // Larger filters than the picture respond nowhere.
        let fitting = (shortest / step - FIRST_SIZE) / SIZE_STEP + 1;
        let layers = (i64::from(options.octave_layers) + 2).min(fitting);
        let layer =
            |index: i64| Layer::new(integral, (FIRST_SIZE + SIZE_STEP * index) * step, step);
        if layers < 3 {
            continue;
        }
        let mut three = [layer(0), layer(1), layer(2)];
        maxima(integral, &three, options, &mut keypoints);
        for index in 3..layers {
            three.rotate_left(1);
            three[2] = layer(index);
            maxima(integral, &three, options, &mut keypoints);
        }
    }
    keypoints.sort_by(|one, other| {
        let place = |k: &SurfKeypoint| [k.size, k.y, k.x];
        other.response.total_cmp(&one.response).then_with(|| {
            place(one).partial_cmp(&place(other)).unwrap_or(std::cmp::Ordering::Equal)
        })
    });
    keypoints
}

/// Adds the maxima of the middle layer over all 26 neighbours.
fn maxima(
    integral: &IntegralImage,
    three: &[Layer; 3],
    options: &SurfOptions,
    keypoints: &mut Vec<SurfKeypoint>,
) {
    let [_, middle, above] = three;
    let rows = integral.height() / middle.step;
    // Where the largest filter fits with all of its neighbours.
    let margin = above.margin + 1;
    for row in margin..rows - margin {
        for column in margin..middle.columns - margin {
            let value = middle.at(column, row);
            if f64::from(value) > options.hessian_threshold && is_maximum(three, column, row) {
                keypoints.extend(keypoint(integral, three, column, row));
            }
        }
    }
}

fn is_maximum(three: &[Layer; 3], column: i64, row: i64) -> bool {
    let value = three[1].at(column, row);
    three.iter().enumerate().all(|(depth, layer)| {
        (-1..=1).all(|dy| {
            (-1..=1)
                .all(|dx| (depth, dx, dy) == (1, 0, 0) || layer.at(column + dx, row + dy) < value)
        })
    })
}

/// Refines a maximum in position and scale; `None` if the refined place is
/// not next to the sample.
fn keypoint(
    integral: &IntegralImage,
    three: &[Layer; 3],
    column: i64,
    row: i64,
) -> Option<SurfKeypoint> {
    let middle = &three[1];
    let offset =
        refine(|dx, dy, ds| f64::from(three[(1 + ds) as usize].at(column + dx, row + dy)))?;
    let (left, top) = middle.corner(column, row);
    let centre = |corner: i64| corner as f64 + (middle.size - 1) as f64 / 2.0;
    let layer_step = (middle.size - three[0].size) as f64;
    let (_, trace) = response_at(integral, left, top, middle.size);
    Some(SurfKeypoint {
        x: (centre(left) + offset.x * middle.step as f64) as f32,
        y: (centre(top) + offset.y * middle.step as f64) as f32,
        size: (middle.size as f64 + offset.z * layer_step) as f32,
        angle_deg: None,
        response: middle.at(column, row),
        laplacian_sign: if trace > 0.0 { 1 } else { -1 },
        octave: middle.step.trailing_zeros() as u8,
    })
}

/// The maximum of the quadratic through 3×3×3 samples, in samples from the
/// middle (Brown & Lowe 2002); `None` if it is a sample or more away.
fn refine(at: impl Fn(i64, i64, i64) -> f64) -> Option<Vector3<f64>> {
    let unit = |axis: usize| [0, 1, 2].map(|other| i64::from(other == axis));
    let along = |axis: usize, sign: i64| {
        let [x, y, s] = unit(axis).map(|value| sign * value);
        at(x, y, s)
    };
    let gradient = Vector3::from_fn(|axis, _| (along(axis, 1) - along(axis, -1)) / 2.0);
    let hessian = Matrix3::from_fn(|one, other| {
        if one == other {
            return along(one, 1) - 2.0 * at(0, 0, 0) + along(one, -1);
        }
        let corner = |a: i64, b: i64| {
            let [x, y, s] = [0, 1, 2].map(|axis| a * unit(one)[axis] + b * unit(other)[axis]);
            at(x, y, s)
        };
        (corner(1, 1) - corner(1, -1) - corner(-1, 1) + corner(-1, -1)) / 4.0
    });
    let offset = hessian.lu().solve(&-gradient)?;
    // Also false where a neighbour had no value.
    offset.iter().all(|value| value.abs() <= 1.0).then_some(offset)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quadratic_is_refined_exactly() {
        let peak = Vector3::new(0.3, -0.2, 0.45);
        let at = |x: i64, y: i64, s: i64| {
            let d = Vector3::new(x as f64, y as f64, s as f64) - peak;
            7.0 - d.x * d.x - 2.0 * d.y * d.y - 0.5 * d.z * d.z - 0.6 * d.x * d.y + 0.2 * d.y * d.z
        };
        assert!((refine(at).unwrap() - peak).norm() < 1e-12);
    }

    #[test]
    fn a_peak_elsewhere_is_refused() {
        assert_eq!(refine(|x, _, _| -(x as f64 - 1.5).powi(2)), None);
        assert_eq!(refine(|_, _, _| f64::NEG_INFINITY), None);
    }
}
