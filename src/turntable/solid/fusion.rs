//! Depth maps carve the solid slice by slice.

use nalgebra::Point2;

use super::carving::CarvingView;
use super::field::{Lattice, Plane};
use super::outline::Outline;

/// How far from a depth map's surface it has a say, as a share of the solid's
/// longest side: about the error of depth from lines.
const REACH: f64 = 0.02;
/// The silhouettes' own surface counts as much as this many depth maps seen face on.
const PRIOR_WEIGHT: f64 = 0.5;

/// How far from a depth map's surface it has a say, px.
pub fn reach_px(lattice: &Lattice) -> f64 {
    let longest = lattice.nodes.iter().copied().max().unwrap_or(1) as f64 * lattice.pitch_px;
    REACH * longest
}

/// Moves the surface of `plane` to where the depth maps agree it is, nowhere
/// beyond `hull`.
///
/// Truncated signed distances are averaged, the silhouettes' own among them.
///
/// # Source
/// Curless & Levoy 1996, A volumetric method for building complex models from
/// range images.
pub fn carve(
    plane: &mut Plane,
    hull: &Plane,
    lattice: &Lattice,
    row: usize,
    views: &[CarvingView],
) {
    let reach_px = reach_px(lattice);
    let limit = lattice.truncation_px();
    let outside = -limit as f32;
    let mut carved = hull.clone();
    carved.creases = std::mem::take(&mut plane.creases);
    for j in 0..hull.size[1] {
        for i in 0..hull.size[0] {
            let index = j * hull.size[0] + i;
            let bound = f64::from(hull.values[index]);
            if bound <= 0.0 {
                continue;
            }
            let (i, j) = (hull.first[0] + i, hull.first[1] + j);
            let point = Point2::new(lattice.x(i), lattice.y(j));
            let prior = f64::from(plane.at(i, j, outside));
            let (mut sum, mut weights) = (prior * PRIOR_WEIGHT, PRIOR_WEIGHT);
            for (distance, weight) in
                views.iter().filter_map(|view| view.vote(&point, row, reach_px))
            {
                sum += distance * weight;
                weights += weight;
            }
            carved.values[index] = (sum / weights).min(bound).clamp(-limit, limit) as f32;
        }
    }
    *plane = carved;
}

/// Lines of sight that meet the hull but no longer the solid get back what is
/// most likely there: every silhouette has something behind it.
///
/// `plane` is what [`carve`] made of `hull`: their windows are one.
pub fn restore_silhouettes(
    plane: &mut Plane,
    hull: &Plane,
    lattice: &Lattice,
    directions: &[Outline],
) {
    /// How far inside a restored ray's best node is, share of the pitch.
    const DEPTH: f32 = 0.3;
    let half = lattice.origin.x.abs() + lattice.origin.y.abs() + lattice.pitch_px;
    let bins = (2.0 * half / lattice.pitch_px).ceil() as usize + 1;
    let depth = DEPTH * lattice.pitch_px as f32;
    let inside: Vec<(usize, Point2<f64>)> = (0..hull.values.len())
        .filter(|&index| hull.values[index] > 0.0)
        .map(|index| {
            let (i, j) = (index % hull.size[0], index / hull.size[0]);
            (index, Point2::new(lattice.x(hull.first[0] + i), lattice.y(hull.first[1] + j)))
        })
        .collect();
    for direction in directions {
        let bin = |point: &Point2<f64>| {
            (((direction.column(point) + half) / lattice.pitch_px) as usize).min(bins - 1)
        };
        let mut best = vec![f32::NEG_INFINITY; bins];
        for (index, point) in &inside {
            let best = &mut best[bin(point)];
            *best = best.max(plane.values[*index]);
        }
        for (index, point) in &inside {
            let best = best[bin(point)];
            if best < depth {
                let lifted = plane.values[*index] + depth - best;
                plane.values[*index] = lifted.min(hull.values[*index]);
            }
        }
    }
}
