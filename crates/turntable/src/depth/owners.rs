//! Which side of each line the surface that it bounds is on.
//!
//! The outline knows. An inner line's curvature tells where it is significant.
//! The rest is released ([`super::border_side`]). What stays undecided is a crease
//! with surface on both sides.

use super::blocks::Blocks;
use super::border_side::release;
use super::contours::{Contours, Crossing};
use super::filters::median;
use super::graph::{Cuts, HORIZONTAL_RUN_PX, Owner, PixelGraph};
use super::lines::LineDepths;

/// The owner of every crossing's line, `None` for creases, and the silhouette
/// cut accordingly.
pub(super) fn owners(
    graph: &PixelGraph,
    contours: &Contours,
    lines: &LineDepths,
    unit_px: f64,
) -> (Vec<Option<Owner>>, Blocks) {
    let mut owners = outline_owners(contours);
    let mut undecided = Vec::new();
    for chain in contours.chains.iter().filter(|chain| chain.len() >= 3) {
        let inner: Vec<u32> =
            chain.iter().copied().filter(|&index| owners[index as usize].is_none()).collect();
        if inner.is_empty() {
            continue;
        }
        match outline_majority(chain, &owners).or_else(|| curvature_owner(&inner, lines, unit_px)) {
            Some(owner) => inner.iter().for_each(|&index| owners[index as usize] = Some(owner)),
            None => undecided.push(inner),
        }
    }
    let blocks = release(graph, contours, lines, unit_px, undecided, &mut owners);
    (owners, blocks)
}

/// The owners of the outline's crossings, `None` inside.
fn outline_owners(contours: &Contours) -> Vec<Option<Owner>> {
    contours.crossings.iter().map(outline_owner).collect()
}

fn outline_owner(crossing: &Crossing) -> Option<Owner> {
    match (crossing.outside_left, crossing.outside_right) {
        (true, false) => Some(Owner::Right),
        (false, true) => Some(Owner::Left),
        _ => None,
    }
}

/// A chain that is partly outline goes on inside with the same owner.
fn outline_majority(chain: &[u32], owners: &[Option<Owner>]) -> Option<Owner> {
    let count = |owner| chain.iter().filter(|&&i| owners[i as usize] == Some(owner)).count();
    let (left, right) = (count(Owner::Left), count(Owner::Right));
    let clear = left.max(right) >= 6 && left.max(right) > 4 * left.min(right);
    clear.then_some(if right > left { Owner::Right } else { Owner::Left })
}

/// The sign of the curvature: a left contour's is negative, its owner right.
fn curvature_owner(inner: &[u32], lines: &LineDepths, unit_px: f64) -> Option<Owner> {
    let of_sign = |rho: f64| if rho < 0.0 { Owner::Right } else { Owner::Left };
    let rho = |index: u32| lines.rho_px[index as usize];
    let sigma = |index: u32| lines.rho_sigma_px[index as usize];
    let tracked = |index: &u32| lines.rho_is_tracked[*index as usize];
    let mut wide: Vec<u32> = inner.iter().copied().filter(tracked).collect();
    if wide.len() >= 8 {
        let middle = median(&mut wide.iter().map(|&index| rho(index)).collect::<Vec<_>>());
        let spread = median(&mut wide.iter().map(|&index| sigma(index)).collect::<Vec<_>>());
        if middle.abs() > 3.0 * spread.max(4.0) {
            return Some(of_sign(middle));
        }
    }
    wide = inner.iter().copied().filter(|i| !tracked(i) && !rho(*i).is_nan()).collect();
    if wide.len() < 6 {
        return None;
    }
    let weight = |index: u32| sigma(index).powi(-2);
    let total: f64 = wide.iter().map(|&index| weight(index)).sum();
    let mean = wide.iter().map(|&index| weight(index) * rho(index)).sum::<f64>() / total;
    let spread = median(&mut wide.iter().map(|&index| sigma(index)).collect::<Vec<_>>());
    let significant = mean.abs() > 2.5 * spread.max(12.0) && mean.abs() > 25.0 * unit_px;
    significant.then(|| of_sign(mean))
}

/// Whether a chain's slope hardly changes.
pub(super) fn is_straight(contours: &Contours, chain: &[u32]) -> bool {
    const MAX_CHANGE: f64 = 0.12;
    if chain.len() <= 8 {
        return false;
    }
    let slopes = || chain[2..chain.len() - 2].iter().map(|&i| contours.crossings[i as usize].slope);
    slopes().fold(f64::MIN, f64::max) - slopes().fold(f64::MAX, f64::min) < MAX_CHANGE
}

/// How far a crossing's depth counts: little on slanted lines, not at all on
/// lines along the row, whose crossings are not points of the line.
pub(super) fn line_weight(crossing: &Crossing) -> f64 {
    const MAX_SLOPE: f64 = 8.0;
    let slope = crossing.slope.abs();
    let along_row = crossing.run_px() >= 4 * HORIZONTAL_RUN_PX;
    if slope >= MAX_SLOPE || along_row { 0.0 } else { 1.0 / (1.0 + slope * slope) }
}

/// Cuts along all inner lines whose owner is known.
pub(super) fn cut_inner(
    cuts: &mut Cuts,
    graph: &PixelGraph,
    contours: &Contours,
    owners: &[Option<Owner>],
    label: u16,
) {
    let inner_owner = |index: u32| {
        let inner = !contours.crossings[index as usize].on_outline();
        owners[index as usize].filter(|_| inner)
    };
    for chain in &contours.chains {
        for part in chain.chunk_by(|&a, &b| inner_owner(a) == inner_owner(b)) {
            if let Some(owner) = inner_owner(part[0]) {
                cuts.along(graph, contours, part, owner, label);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT_PX: f64 = 1.0;

    #[test]
    fn a_sure_curvature_tells_the_owner() {
        let mut lines = LineDepths::unknown(12);
        let inner: Vec<u32> = (0..12).collect();
        lines.rho_px.fill(-60.0);
        lines.rho_sigma_px.fill(5.0);
        lines.rho_is_tracked.fill(true);
        assert_eq!(curvature_owner(&inner, &lines, UNIT_PX), Some(Owner::Right));
        lines.rho_sigma_px.fill(40.0);
        assert_eq!(curvature_owner(&inner, &lines, UNIT_PX), None);
    }
}
