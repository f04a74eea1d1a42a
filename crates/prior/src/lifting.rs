//! Features of the views at the voxels.

use std::array;

use rayon::prelude::*;

use super::Grid;
use super::network::{FEATURES, Fusion};
use super::sampling::UP;
use super::tensor::Tensor;

/// Depths and places are told in this many voxels.
const UNIT: f32 = 32.0;
/// Channels that tell the hull and the place.
const EXTRAS: usize = 16;

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

/// Lifts the features of each view to the voxels and joins them: what the
/// volume network reads, by Y, X and Z (downward).
///
/// * `features`: per view, by row and column of voxels.
/// * `masks`: per view, the filled outline as sampled.
pub(crate) fn joined(
    fusion: &Fusion,
    features: &[Tensor],
    azimuths_rad: &[f64],
    masks: &[&[f32]],
    grid: &Grid,
) -> Tensor {
    let [nx, ny, nz] = grid.size;
    let places: Vec<Vec<Seen>> =
        azimuths_rad.iter().map(|&azimuth| seen(grid, azimuth, 1)).collect();
    let hull = hull(azimuths_rad, masks, grid);
    let mut out = Tensor::zeros([ny, nx, nz], fusion.joined.outputs());
    let length = out.row_length();
    let room = || Room::new(nz, features.len());
    out.values.par_chunks_exact_mut(length).enumerate().for_each_init(
        room,
        |room, (index, out)| {
            let views = features.iter().zip(azimuths_rad).zip(&places).zip(&mut room.views);
            for (((features, &azimuth), places), own) in views {
                of_view(fusion, features, azimuth, places[index], &mut room.lifted, own);
            }
            let told = [index % nx, index / nx];
            for (z, joined) in room.joined.chunks_exact_mut(2 * FEATURES + EXTRAS).enumerate() {
                let (learned, extra) = joined.split_at_mut(2 * FEATURES);
                let (mean, most) = learned.split_at_mut(FEATURES);
                fused(fusion, &room.views, z, &mut room.shares, mean, most);
                extra.copy_from_slice(&extras(&hull, features.len(), grid, told, z));
            }
            fusion.joined.pointwise(&room.joined, true, out);
        },
    );
    out
}

/// What the columns of voxels of one thread share.
struct Room {
    lifted: Vec<f32>,
    /// Per view its features, by Z.
    views: Vec<Vec<f32>>,
    shares: Vec<f32>,
    joined: Vec<f32>,
}

impl Room {
    fn new(voxels: usize, views: usize) -> Self {
        let own = vec![0.0; voxels * FEATURES];
        Self {
            lifted: own.clone(),
            views: vec![own; views],
            shares: vec![0.0; views],
            joined: vec![0.0; voxels * (2 * FEATURES + EXTRAS)],
        }
    }
}

/// Mixed features of one view along a column of voxels.
fn of_view(
    fusion: &Fusion,
    features: &Tensor,
    azimuth_rad: f64,
    seen: Seen,
    lifted: &mut [f32],
    mixed: &mut [f32],
) {
    let columns = features.size[2];
    let (sine, cosine) = azimuth_rad.sin_cos();
    let known = [seen.depth, seen.depth * seen.depth, sine as f32, cosine as f32];
    let position: [f32; FEATURES] = array::from_fn(|feature| {
        let weights = &fusion.position[feature * known.len()..][..known.len()];
        weights.iter().zip(known).fold(0.0, |sum, (weight, value)| value.mul_add(*weight, sum))
    });
    lifted.fill(0.0);
    for (z, lifted) in lifted.chunks_exact_mut(FEATURES).enumerate() {
        let row = features.row(0, z);
        for (column, weight) in seen.weights(columns) {
            let source = &row[column * FEATURES..][..FEATURES];
            lifted.iter_mut().zip(source).for_each(|(own, value)| *own += value * weight);
        }
        lifted.iter_mut().zip(position).for_each(|(own, value)| *own = (*own + value).max(0.0));
    }
    fusion.mix.pointwise(lifted, true, mixed);
}

/// The mean of the views' features by their scores, and the largest of each.
///
/// * `shares`: room for one value a view.
fn fused(
    fusion: &Fusion,
    views: &[Vec<f32>],
    z: usize,
    shares: &mut [f32],
    mean: &mut [f32],
    most: &mut [f32],
) {
    let own = |view: usize| &views[view][z * FEATURES..][..FEATURES];
    let (weights, bias) = &fusion.score;
    for (view, score) in shares.iter_mut().enumerate() {
        let products = own(view).iter().zip(weights);
        *score = products.fold(*bias, |sum, (value, weight)| value.mul_add(*weight, sum));
    }
    let highest = shares.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    shares.iter_mut().for_each(|score| *score = libm::expf(*score - highest));
    let all: f32 = shares.iter().sum();
    mean.fill(0.0);
    most.fill(f32::NEG_INFINITY);
    for (view, share) in shares.iter().enumerate() {
        let share = share / all;
        for ((mean, most), value) in mean.iter_mut().zip(&mut *most).zip(own(view)) {
            *mean += value * share;
            *most = most.max(*value);
        }
    }
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

/// What the volume is told of a voxel besides: the hull at twice the grid, the
/// place, the number of views.
fn extras(hull: &[f32], views: usize, grid: &Grid, [x, y]: [usize; 2], z: usize) -> [f32; EXTRAS] {
    let [nx, ny, nz] = grid.size;
    let across = (x as f32 + 0.5 - nx as f32 / 2.0) / UNIT;
    let away = (y as f32 + 0.5 - ny as f32 / 2.0) / UNIT;
    array::from_fn(|channel| match channel {
        0..8 => {
            let [dy, dx, dz] = [channel >> 2 & 1, channel >> 1 & 1, channel & 1];
            hull[((2 * z + dz) * 2 * ny + 2 * y + dy) * 2 * nx + 2 * x + dx]
        }
        8 => -1.0 + 2.0 * z as f32 / (nz - 1) as f32,
        9 => across,
        10 => away,
        11 => libm::hypotf(across, away),
        12 => views as f32 / 8.0,
        13 => 1.0 / views as f32,
        _ => 0.0,
    })
}
