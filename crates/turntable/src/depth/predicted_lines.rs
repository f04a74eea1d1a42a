//! Lines whose depth only neighbouring views know.
//!
//! A line that several views follow is predicted in the next view too. Where
//! a drawn line is there but was matched with nothing, or with a line that
//! lies behind the predicted one (seen along its side, a box has its near and
//! its far edge in one line), the prediction is taken over.

use super::contours::Contours;
use super::filters::running_median;
use super::lines::{LineDepths, LineView, along_chains, angle_between};

/// How far a predicted line may be beside the drawn one, px.
const MISS_PX: f64 = 1.2;
const MISS_PER_SLOPE_PX: f64 = 0.5;
/// Lines flatter than this are not points in a row, columns per row.
const MAX_SLOPE: f64 = 4.0;
const MAX_RUN_PX: u32 = 14;
/// A nearer line takes a crossing over if it is nearer by this, units.
const NEARER: f64 = 25.0;
/// Views on either side that lines are taken from.
const STEPS: usize = 2;
const REACH_DEG: f64 = 20.5;

/// A line of another view as it appears in this one.
#[derive(Clone, Copy)]
pub(super) struct Prediction {
    pub depth_px: f64,
    rho_px: f64,
    rho_sigma_px: f64,
    rho_is_tracked: bool,
}

/// Fills the gaps of view `index` from its neighbours' lines, and puts nearer
/// lines in the place of farther ones where a view has neighbours on one side only.
pub(super) fn adopted(views: &[LineView<'_>], lines: &[LineDepths], index: usize) -> LineDepths {
    let mut own = lines[index].clone();
    let view = &views[index];
    let unit = view.bounds.unit_px;
    let one_sided = view.before.is_none() || view.after.is_none();
    let found = supported(view.contours, nearest_predictions(views, lines, index), unit);
    let depth: Vec<f64> =
        found.iter().map(|found| found.map_or(f64::NAN, |found| found.depth_px)).collect();
    let depth = along_chains(view.contours, &depth, 2.0, unit);
    for (k, found) in found.iter().enumerate() {
        let Some(found) = found.filter(|_| !depth[k].is_nan()) else { continue };
        let is_nearer = one_sided && depth[k] < own.depth_px[k] - NEARER * unit;
        if own.depth_px[k].is_nan() || is_nearer {
            own.depth_px[k] = depth[k];
            own.rho_px[k] = found.rho_px;
            own.rho_sigma_px[k] = found.rho_sigma_px;
            own.rho_is_tracked[k] = found.rho_is_tracked;
        }
    }
    own
}

/// Per crossing the nearest of the neighbours' lines that fall on it.
fn nearest_predictions(
    views: &[LineView<'_>],
    lines: &[LineDepths],
    index: usize,
) -> Vec<Option<Prediction>> {
    let contours = views[index].contours;
    let mut nearest: Vec<Option<Prediction>> = vec![None; contours.crossings.len()];
    for other in within_reach(views, index) {
        let angle = angle_between(views[other].azimuth_rad, views[index].azimuth_rad);
        let crossings = views[other].contours.crossings.iter();
        for (from, crossing) in crossings.enumerate() {
            let flat = crossing.slope.abs() > MAX_SLOPE || crossing.run_px() > MAX_RUN_PX;
            if flat || lines[other].depth_px[from].is_nan() {
                continue;
            }
            let (column, predicted) = predict(&lines[other], from, crossing.x_px, angle);
            let Some(at) = crossing_at(contours, crossing.y, column) else { continue };
            let slot = &mut nearest[at];
            if slot.is_none_or(|slot| predicted.depth_px < slot.depth_px) {
                *slot = Some(predicted);
            }
        }
    }
    nearest
}

/// The neighbours of a view and theirs, on either side.
fn within_reach(views: &[LineView<'_>], index: usize) -> Vec<usize> {
    let mut found = Vec::new();
    for step in [|view: &LineView<'_>| view.before, |view: &LineView<'_>| view.after] {
        let mut here = index;
        for _ in 0..STEPS {
            let Some(next) = step(&views[here]) else { break };
            let angle = angle_between(views[index].azimuth_rad, views[next].azimuth_rad);
            if next == index || found.contains(&next) || angle.to_degrees().abs() > REACH_DEG {
                break;
            }
            found.push(next);
            here = next;
        }
    }
    found
}

/// Column and depth of a line in the view `angle` further on: the envelope of
/// its horizontal section's tangents.
pub(super) fn predict(lines: &LineDepths, from: usize, x_px: f64, angle: f64) -> (f64, Prediction) {
    let (sine, cosine) = angle.sin_cos();
    let (depth, rho) = (lines.depth_px[from], lines.rho_px[from]);
    let bend = if rho.is_nan() { 0.0 } else { rho };
    let predicted = Prediction {
        depth_px: depth * cosine - x_px * sine + bend * sine,
        rho_px: rho,
        rho_sigma_px: lines.rho_sigma_px[from],
        rho_is_tracked: lines.rho_is_tracked[from],
    };
    (x_px * cosine + depth * sine + bend * (1.0 - cosine), predicted)
}

pub(super) fn crossing_at(contours: &Contours, y: u32, column: f64) -> Option<usize> {
    let miss = |index: usize| {
        let crossing = &contours.crossings[index];
        (crossing.x_px - column).abs() / (MISS_PX + MISS_PER_SLOPE_PX * crossing.slope.abs())
    };
    let nearest = contours.in_row(y).min_by(|&a, &b| miss(a).total_cmp(&miss(b)))?;
    (miss(nearest) <= 1.0).then_some(nearest)
}

/// Keeps what most of the crossings around agree with along the chain.
fn supported(
    contours: &Contours,
    mut found: Vec<Option<Prediction>>,
    unit_px: f64,
) -> Vec<Option<Prediction>> {
    const HALF: usize = 6;
    const SPREAD: f64 = 12.0;
    let mut keep = vec![false; found.len()];
    for chain in &contours.chains {
        let depth: Vec<f64> = chain
            .iter()
            .map(|&index| found[index as usize].map_or(f64::NAN, |found| found.depth_px))
            .collect();
        let middle = running_median(&depth, HALF);
        for (k, &index) in chain.iter().enumerate() {
            let around = k.saturating_sub(HALF)..(k + HALF + 1).min(chain.len());
            let agree = |depth: &&f64| (**depth - middle[k]).abs() < SPREAD * unit_px;
            let count = depth[around.clone()].iter().filter(agree).count();
            keep[index as usize] = agree(&&depth[k]) && 2 * count > around.len() && count >= 4;
        }
    }
    for (found, keep) in found.iter_mut().zip(keep) {
        *found = found.filter(|_| keep);
    }
    found
}
