//! Depth maps carve the solid slice by slice.

use nalgebra::Point2;

use super::carving::CarvingView;
use super::smoothing::{binomial, within_slice};
use crate::surface::field::{Lattice, Plane};

/// How far from a depth map's surface it has a say, as a share of the solid's
/// longest side: about the error of depth from lines.
const REACH: f64 = 0.02;
/// The silhouettes' own surface counts as much as this many depth maps seen face on.
const PRIOR_WEIGHT: f64 = 0.5;

/// How far from a depth map's surface it has a say, px.
pub(super) fn reach_px(lattice: &Lattice) -> f64 {
    let longest = lattice.nodes.iter().copied().max().unwrap_or(1) as f64 * lattice.pitch_px;
    REACH * longest
}

/// By how much the depth maps change the signed distances of `prior` inside
/// `hull`, px, in the hull's window; smoothed within the slice.
///
/// Signed distances, cut off at [`reach_px`], are averaged, the silhouettes' own
/// among them.
///
/// # Source
/// Curless & Levoy 1996, A volumetric method for building complex models from
/// range images.
pub(super) fn corrections(
    prior: &Plane,
    hull: &Plane,
    lattice: &Lattice,
    row: usize,
    views: &[CarvingView],
) -> Plane {
    let reach_px = reach_px(lattice);
    let limit = lattice.truncation_px();
    let mut found = Plane { values: vec![0.0; hull.values.len()], ..hull.clone() };
    for (index, value) in found.values.iter_mut().enumerate() {
        let bound = f64::from(hull.values[index]);
        if bound <= 0.0 {
            continue;
        }
        let (i, j) = hull.node(index);
        let point = Point2::new(lattice.x(i), lattice.y(j));
        let prior = f64::from(prior.at(i, j, -limit as f32)).clamp(-reach_px, reach_px);
        let (mut sum, mut weights) = (prior * PRIOR_WEIGHT, PRIOR_WEIGHT);
        for (distance, weight) in views.iter().filter_map(|view| view.vote(&point, row, reach_px)) {
            sum += distance * weight;
            weights += weight;
        }
        *value = ((sum / weights).min(bound).clamp(-limit, limit) - prior) as f32;
    }
    within_slice(&found)
}

/// Adds the corrections of a slice, averaged with those below and above, to
/// `plane`, which takes the window of `hull`; nowhere beyond `hull`.
///
/// Single maps are wrong in places: what slices and nodes around do not share
/// would be pits in the surface.
pub(super) fn correct(
    plane: &mut Plane,
    hull: &Plane,
    [below, here, above]: [&Plane; 3],
    lattice: &Lattice,
) {
    let (limit, reach_px) = (lattice.truncation_px() as f32, reach_px(lattice) as f32);
    let mut corrected = Plane { creases: std::mem::take(&mut plane.creases), ..hull.clone() };
    for (index, value) in corrected.values.iter_mut().enumerate().filter(|(_, v)| **v > 0.0) {
        let (i, j) = hull.node(index);
        let own = here.values[index];
        let change = binomial(below.at(i, j, own), own, above.at(i, j, own));
        let prior = plane.at(i, j, -limit).clamp(-reach_px, reach_px);
        *value = (prior + change).min(*value).clamp(-limit, limit);
    }
    *plane = corrected;
}
