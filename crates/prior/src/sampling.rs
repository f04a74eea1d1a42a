//! Drawings at the resolution that the network is trained for.

use super::tensor::Tensor;
use super::{Grid, PriorInput, PriorView};

/// Pixels of a sampled drawing a voxel.
pub(crate) const UP: usize = 4;
/// Samples a pixel along each axis.
const SAMPLES: usize = 3;

/// One view about the grid: ink, then mask, row by row.
pub(crate) struct Sampled {
    columns: usize,
    rows: usize,
    values: Vec<f32>,
}

impl Sampled {
    /// Ink and mask of a pixel side by side.
    pub(crate) fn as_tensor(&self) -> Tensor {
        let (ink, mask) = self.values.split_at(self.columns * self.rows);
        Tensor {
            size: [1, self.rows, self.columns],
            channels: 2,
            values: ink.iter().zip(mask).flat_map(|(&ink, &mask)| [ink, mask]).collect(),
        }
    }

    /// The filled outline alone.
    pub(crate) fn mask(&self) -> &[f32] {
        &self.values[self.columns * self.rows..]
    }
}

/// Samples both channels of `view` about `grid`.
pub(crate) fn sampled(input: &PriorInput<'_>, view: &PriorView<'_>, grid: &Grid) -> Sampled {
    let (columns, rows) = (grid.view_columns() * UP, grid.size[2] * UP);
    let pitch = grid.pitch_px / UP as f64;
    let first_column =
        input.axis_px + grid.column_of_centre(view.azimuth_rad) - columns as f64 / 2.0 * pitch;
    let first_row = input.origin_row_px - grid.centre[2] - rows as f64 / 2.0 * pitch;
    let across = taps(columns, first_column, pitch, input.size.0);
    let down = taps(rows, first_row, pitch, input.size.1);
    let mut values = Vec::with_capacity(2 * columns * rows);
    for image in [view.ink, view.mask] {
        values.extend(resampled(image, input.size.0, &across, &down));
    }
    Sampled { columns, rows, values }
}

/// Per output, source indices and their weights.
type Taps = Vec<Vec<(usize, f32)>>;

/// `count` outputs `pitch` apart from `first` on, each the mean of a few linear
/// samples of a source of `length`, which is 0 beyond its ends.
fn taps(count: usize, first: f64, pitch: f64, length: usize) -> Taps {
    let weight = 1.0 / SAMPLES as f32;
    let of_output = |output: usize| {
        let mut taps: Vec<(usize, f32)> = Vec::new();
        for sample in 0..SAMPLES {
            let share = (sample as f64 + 0.5) / SAMPLES as f64;
            let at = first + (output as f64 + share) * pitch - 0.5;
            let low = at.floor();
            let high_share = (at - low) as f32;
            for (index, share) in [(low, 1.0 - high_share), (low + 1.0, high_share)] {
                if index >= 0.0 && index < length as f64 && share > 0.0 {
                    taps.push((index as usize, share * weight));
                }
            }
        }
        taps
    };
    (0..count).map(of_output).collect()
}

fn resampled(image: &[f32], width: usize, across: &Taps, down: &Taps) -> Vec<f32> {
    let narrow: Vec<f32> = image
        .chunks_exact(width)
        .flat_map(|row| {
            across.iter().map(|taps| taps.iter().map(|&(x, weight)| row[x] * weight).sum::<f32>())
        })
        .collect();
    let columns = across.len();
    let mut out = vec![0.0; columns * down.len()];
    for (row, taps) in out.chunks_exact_mut(columns).zip(down) {
        for &(y, weight) in taps {
            let source = &narrow[y * columns..(y + 1) * columns];
            row.iter_mut().zip(source).for_each(|(out, value)| *out += value * weight);
        }
    }
    out
}

/// The value at a point, pixels' centres at halves; 0 outside.
pub(crate) fn bilinear(image: &[f32], (width, height): (usize, usize), x: f64, y: f64) -> f32 {
    let (x, y) = (x - 0.5, y - 0.5);
    let (left, upper) = (x.floor(), y.floor());
    let at = |x: f64, y: f64| {
        let inside = x >= 0.0 && y >= 0.0 && x < width as f64 && y < height as f64;
        if inside { image[y as usize * width + x as usize] } else { 0.0 }
    };
    let (s, t) = ((x - left) as f32, (y - upper) as f32);
    let above = at(left, upper) * (1.0 - s) + at(left + 1.0, upper) * s;
    let below = at(left, upper + 1.0) * (1.0 - s) + at(left + 1.0, upper + 1.0) * s;
    above * (1.0 - t) + below * t
}
