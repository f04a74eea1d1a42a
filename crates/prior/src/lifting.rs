//! Features of the views at the voxels.

use rayon::prelude::*;

use super::Grid;
use super::network::FEATURES;
use super::sampling::UP;

/// Depths and places are told in this many voxels.
const UNIT: f32 = 32.0;
/// Channels that tell the hull and the place.
pub(crate) const EXTRAS: usize = 16;

/// What the volume network reads, each channel by Y, X, Z.
pub(crate) struct Lifted {
    /// Per view and channel.
    pub features: Vec<f32>,
    /// Per view depth, its square, sine and cosine of the azimuth, by Y and X.
    pub position: Vec<f32>,
    /// The hull at twice the grid, the place, the number of views.
    pub extra: Vec<f32>,
}

/// A column of the grid in one view: the lower of two columns and the share of
/// the upper; the depth.
#[derive(Clone, Copy)]
struct Seen {
    column: isize,
    share: f32,
    depth: f32,
}

/// Where the view at `azimuth_rad` shows each column of voxels, by Y and X.
///
/// * `fine`: voxels are divided into so many along each axis.
fn seen(grid: &Grid, azimuth_rad: f64, fine: usize) -> Vec<Seen> {
    let (sine, cosine) = azimuth_rad.sin_cos();
    let [nx, ny, _] = grid.size;
    let half = grid.view_columns() as f64 / 2.0;
    let at = |index: usize, count: usize| (index as f64 + 0.5) / fine as f64 - count as f64 / 2.0;
    let columns = (0..ny * fine).flat_map(|j| (0..nx * fine).map(move |i| (i, j)));
    columns
        .map(|(i, j)| {
            let (x, y) = (at(i, nx), at(j, ny));
            let column = (x * cosine + y * sine + half) * fine as f64 - 0.5;
            let low = column.floor();
            Seen {
                column: low as isize,
                share: (column - low) as f32,
                depth: (y * cosine - x * sine) as f32 / UNIT,
            }
        })
        .collect()
}

impl Seen {
    /// The two columns with their weights, of `count`; nothing beyond.
    fn weights(self, count: usize) -> impl Iterator<Item = (usize, f32)> {
        let both = [(self.column, 1.0 - self.share), (self.column + 1, self.share)];
        both.into_iter()
            .filter(move |&(column, _)| column >= 0 && (column as usize) < count)
            .map(|(column, weight)| (column as usize, weight))
    }
}

/// Lifts the features of each view, and what the volume is told besides.
///
/// * `features`: per view, by channel, row and column of voxels.
/// * `masks`: per view, the filled outline as sampled.
pub(crate) fn lifted(
    features: &[Vec<f32>],
    azimuths_rad: &[f64],
    masks: &[&[f32]],
    grid: &Grid,
) -> Lifted {
    let [nx, ny, nz] = grid.size;
    let columns = grid.view_columns();
    let mut lifted = vec![0.0; features.len() * FEATURES * grid.voxels()];
    let mut position = Vec::with_capacity(features.len() * 4 * nx * ny);
    for (view, (features, &azimuth)) in features.iter().zip(azimuths_rad).enumerate() {
        let places = seen(grid, azimuth, 1);
        let (sine, cosine) = azimuth.sin_cos();
        position.extend(places.iter().map(|place| place.depth));
        position.extend(places.iter().map(|place| place.depth * place.depth));
        position.extend(std::iter::repeat_n(sine as f32, nx * ny));
        position.extend(std::iter::repeat_n(cosine as f32, nx * ny));
        let own = view * FEATURES * grid.voxels()..(view + 1) * FEATURES * grid.voxels();
        lifted[own].par_chunks_exact_mut(grid.voxels()).enumerate().for_each(|(channel, out)| {
            let plane = &features[channel * nz * columns..(channel + 1) * nz * columns];
            // By column first, so that a voxel column is one run.
            let mut turned = vec![0.0; nz * columns];
            for (z, row) in plane.chunks_exact(columns).enumerate() {
                row.iter().enumerate().for_each(|(x, &value)| turned[x * nz + z] = value);
            }
            for (out, place) in out.chunks_exact_mut(nz).zip(&places) {
                for (column, weight) in place.weights(columns) {
                    let source = &turned[column * nz..(column + 1) * nz];
                    out.iter_mut().zip(source).for_each(|(out, value)| *out += value * weight);
                }
            }
        });
    }
    let extra = extras(&hull(azimuths_rad, masks, grid), azimuths_rad.len(), grid);
    Lifted { features: lifted, position, extra }
}

/// How far each place at twice the grid is inside all outlines, by Z (downward), Y, X.
fn hull(azimuths_rad: &[f64], masks: &[&[f32]], grid: &Grid) -> Vec<f32> {
    let [nx, ny, nz] = grid.size.map(|side| 2 * side);
    let columns = 2 * grid.view_columns();
    let places: Vec<Vec<Seen>> =
        azimuths_rad.iter().map(|&azimuth| seen(grid, azimuth, 2)).collect();
    let coarse: Vec<Vec<f32>> = masks.iter().map(|mask| halved(mask, columns)).collect();
    let mut hull = vec![1.0_f32; nx * ny * nz];
    hull.par_chunks_exact_mut(nx * ny).enumerate().for_each(|(z, plane)| {
        for (places, coarse) in places.iter().zip(&coarse) {
            let row = &coarse[z * columns..(z + 1) * columns];
            for (out, place) in plane.iter_mut().zip(places) {
                let value: f32 = place.weights(columns).map(|(x, weight)| row[x] * weight).sum();
                *out = out.min(value);
            }
        }
    });
    hull
}

/// The means of `UP / 2` by as many pixels, `columns` a row.
fn halved(mask: &[f32], columns: usize) -> Vec<f32> {
    const SIDE: usize = UP / 2;
    let width = columns * SIDE;
    let rows = mask.len() / width / SIDE;
    let at = |x: usize, y: usize| -> f32 {
        let rows = (0..SIDE).map(|dy| (y * SIDE + dy) * width + x * SIDE);
        rows.map(|start| mask[start..start + SIDE].iter().sum::<f32>()).sum()
    };
    let places = (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y)));
    places.map(|(x, y)| at(x, y) / (SIDE * SIDE) as f32).collect()
}

fn extras(hull: &[f32], views: usize, grid: &Grid) -> Vec<f32> {
    let [nx, ny, nz] = grid.size;
    let voxels = grid.voxels();
    let mut extra = vec![0.0; EXTRAS * voxels];
    extra.par_chunks_exact_mut(voxels).enumerate().for_each(|(channel, out)| {
        for (index, value) in out.iter_mut().enumerate() {
            let (z, x, y) = (index % nz, index / nz % nx, index / nz / nx);
            let across = (x as f32 + 0.5 - nx as f32 / 2.0) / UNIT;
            let away = (y as f32 + 0.5 - ny as f32 / 2.0) / UNIT;
            *value = match channel {
                0..8 => {
                    let [dy, dx, dz] = [channel >> 2 & 1, channel >> 1 & 1, channel & 1];
                    hull[((2 * z + dz) * 2 * ny + 2 * y + dy) * 2 * nx + 2 * x + dx]
                }
                8 => -1.0 + 2.0 * z as f32 / (nz - 1) as f32,
                9 => across,
                10 => away,
                11 => across.hypot(away),
                12 => views as f32 / 8.0,
                13 => 1.0 / views as f32,
                _ => 0.0,
            };
        }
    });
    extra
}
