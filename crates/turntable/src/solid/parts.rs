//! Parts that stand before others are as deep as their lines say.
//!
//! An arm beside a body has an outline of its own in the front view, but in the
//! side view it lies before the body, and the hull makes it as deep as that.
//! The lines drawn on the body there are the arm's.

use super::branches::{Branch, branches};
use super::crease::{InkEvidence, Slice};
use super::outline::{Outline, difference, length};
use super::section::Section;

/// A part must be so many slices high.
const MIN_SLICES: usize = 4;
/// The share of a part's slices in which larger parts are behind the same outline.
const MIN_SHARING: f64 = 0.6;
/// The share of a part's slices in which it must stand before the others.
const MIN_FRONT: f64 = 0.8;
/// Lines closer to the part's ends are the ends' own, px.
const END_MARGIN_PX: f64 = 4.0;
/// Narrower pairs of lines bound nothing, px.
const MIN_WIDTH_PX: f64 = 2.0;
/// The most lines that are considered in one slice.
const MAX_LINES: usize = 10;
/// What a part costs that is e times deeper or flatter than wide.
const SHAPE_COST: f64 = 0.5;
/// What a slice without lines costs.
const MISS_COST: f64 = 0.6;
/// The most slices without lines in a row.
const MAX_MISSES: usize = 8;
/// What a jump of the part's end costs, per pitch beyond [`FREE_SLOPE`].
const JUMP_COST: f64 = 0.14;
/// How far a part's end moves freely from slice to slice, pitches.
const FREE_SLOPE: f64 = 0.8;
/// The share of a part's slices that must have lines.
const MIN_FOUND: f64 = 0.6;
/// The share of those in which a line is not the hull's own end.
const MIN_INNER: f64 = 0.3;
/// What a part hangs on keeps at least this share of what lies on it.
const MIN_HOLD: f64 = 0.5;
/// What of a silhouette may be left without anything behind it, px a slice.
const MAX_UNCOVERED_PX: f64 = 1.5;
/// The share of slices that may have to stay as they are.
const MAX_KEPT: f64 = 0.2;

/// Cuts parts to the lines that bound them; returns how many were cut.
///
/// * `directions`: what bounds the sections.
/// * `drawings`: what shows lines.
///
/// Every silhouette stays covered.
pub(super) fn cut_parts(
    slices: &mut [Slice],
    directions: &[Outline],
    drawings: &[InkEvidence],
    pitch_px: f64,
) -> usize {
    let mut branches = branches(slices, directions);
    branches.retain(|branch| branch.len() >= MIN_SLICES);
    let volume = |branch: &Branch| -> f64 {
        branch.iter().map(|&(k, s)| slices[k].sections[s].area_px2()).sum()
    };
    branches.sort_by(|a, b| volume(a).total_cmp(&volume(b)));
    let mut count = 0;
    for branch in &branches {
        for (index, direction) in directions.iter().enumerate() {
            if !shares_outline(slices, branch, index) {
                continue;
            }
            let found = drawings
                .iter()
                .filter(|drawing| drawing.outline.is_parallel_to(direction))
                .filter(|drawing| stands_in_front(slices, branch, index, drawing))
                .find_map(|drawing| {
                    let ranges = bounding_lines(slices, branch, drawing, pitch_px)?;
                    Some((ranges, drawing.outline.right().dot(&direction.right()) < 0.0))
                });
            if let Some((mut ranges, opposite)) = found {
                if opposite {
                    ranges.iter_mut().for_each(|(low, high)| (*low, *high) = (-*high, -*low));
                }
                count += usize::from(cut(slices, branch, directions, index, &ranges));
            }
        }
    }
    count
}

/// The sections of a slice that lie behind one interval of a direction.
fn sharing<'a>(
    slice: &'a Slice,
    index: usize,
    direction: usize,
) -> impl Iterator<Item = (usize, &'a Section)> + 'a {
    let interval = slice.sections[index].intervals[direction];
    let others = slice.sections.iter().enumerate();
    others
        .filter(move |(other, section)| *other != index && section.intervals[direction] == interval)
}

/// Whether larger parts are behind the same outline in most slices.
fn shares_outline(slices: &[Slice], branch: &Branch, direction: usize) -> bool {
    let behind_larger = |&&(k, s): &&(usize, usize)| {
        let own = slices[k].sections[s].area_px2();
        sharing(&slices[k], s, direction).any(|(_, other)| other.area_px2() > own)
    };
    branch.iter().filter(behind_larger).count() as f64 >= MIN_SHARING * branch.len() as f64
}

fn stands_in_front(
    slices: &[Slice],
    branch: &Branch,
    direction: usize,
    drawing: &InkEvidence,
) -> bool {
    let toward = drawing.outline.toward_camera();
    let nearness = |section: &Section| toward.dot(&section.centre().coords);
    let first = |&&(k, s): &&(usize, usize)| {
        let own = nearness(&slices[k].sections[s]);
        sharing(&slices[k], s, direction).all(|(_, other)| nearness(other) < own)
    };
    branch.iter().filter(first).count() as f64 >= MIN_FRONT * branch.len() as f64
}

/// A pair of lines that may bound a part in one slice.
#[derive(Clone, Copy)]
struct Pair {
    low: f64,
    high: f64,
    /// Whether one of them is not the hull's own end.
    inner: bool,
    shape_cost: f64,
    /// Cheapest way here: cost, and (steps back, pair) before.
    cost: f64,
    from: Option<(usize, usize)>,
}

/// The columns of the pair of lines, per section of the branch, that runs along
/// it most smoothly and bounds a part about as deep as it is wide.
fn bounding_lines(
    slices: &[Slice],
    branch: &Branch,
    drawing: &InkEvidence,
    pitch_px: f64,
) -> Option<Vec<(f64, f64)>> {
    let mut steps: Vec<Vec<Pair>> =
        branch.iter().map(|&(k, s)| pairs_of(&slices[k], s, drawing)).collect();
    for step in 0..steps.len() {
        let (before, rest) = steps.split_at_mut(step);
        for pair in &mut rest[0] {
            let (cost, from) = cheapest(before, pair, pitch_px);
            pair.cost = cost + pair.shape_cost;
            pair.from = from;
        }
    }
    let path = traced(&steps)?;
    let inner = path.iter().filter(|(step, pair)| steps[*step][*pair].inner).count();
    if (path.len() as f64) < MIN_FOUND * branch.len() as f64
        || (inner as f64) < MIN_INNER * path.len() as f64
    {
        return None;
    }
    Some(interpolated(&steps, &path))
}

/// Pairs of lines, and of the section's ends, in one slice.
fn pairs_of(slice: &Slice, index: usize, drawing: &InkEvidence) -> Vec<Pair> {
    let section = &slice.sections[index];
    let (low, high) = section.extent_along(&drawing.outline.right());
    let width = section.extent_along(&drawing.outline.toward_camera());
    let width = (width.1 - width.0).max(MIN_WIDTH_PX);
    let mut columns = vec![low];
    let lines = drawing.lines_between(low + END_MARGIN_PX, high - END_MARGIN_PX, slice.row);
    columns.extend(lines.into_iter().take(MAX_LINES));
    columns.push(high);
    let last = columns.len() - 1;
    let mut pairs = Vec::new();
    for (a, &low) in columns.iter().enumerate() {
        for (b, &high) in columns.iter().enumerate().skip(a + 1) {
            if high - low > MIN_WIDTH_PX {
                let shape_cost = SHAPE_COST * ((high - low) / width).ln().abs();
                let inner = a > 0 || b < last;
                pairs.push(Pair { low, high, inner, shape_cost, cost: 0.0, from: None });
            }
        }
    }
    pairs
}

fn cheapest(before: &[Vec<Pair>], pair: &Pair, pitch_px: f64) -> (f64, Option<(usize, usize)>) {
    let mut best = (MISS_COST * before.len() as f64, None);
    for back in 1..=before.len().min(MAX_MISSES) {
        let misses = MISS_COST * (back - 1) as f64;
        for (index, other) in before[before.len() - back].iter().enumerate() {
            let jump = |a: f64, b: f64| {
                ((a - b).abs() / pitch_px - FREE_SLOPE * back as f64).max(0.0) * JUMP_COST
            };
            let cost =
                other.cost + misses + jump(pair.low, other.low) + jump(pair.high, other.high);
            if cost < best.0 {
                best = (cost, Some((back, index)));
            }
        }
    }
    best
}

/// The cheapest path, upward: (step, pair).
fn traced(steps: &[Vec<Pair>]) -> Option<Vec<(usize, usize)>> {
    let ends = steps.iter().enumerate().rev().take(MAX_MISSES).flat_map(|(step, pairs)| {
        let misses = MISS_COST * (steps.len() - 1 - step) as f64;
        pairs.iter().enumerate().map(move |(index, pair)| (pair.cost + misses, step, index))
    });
    let (_, step, index) = ends.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let mut path = vec![(step, index)];
    let mut at = (step, index);
    while let Some((back, index)) = steps[at.0][at.1].from {
        at = (at.0 - back, index);
        path.push(at);
    }
    path.reverse();
    Some(path)
}

/// The path's columns, straight between its steps and constant beyond them.
fn interpolated(steps: &[Vec<Pair>], path: &[(usize, usize)]) -> Vec<(f64, f64)> {
    let range = |&(step, pair): &(usize, usize)| (steps[step][pair].low, steps[step][pair].high);
    (0..steps.len())
        .map(|step| {
            let next = path.partition_point(|(at, _)| *at < step);
            match (path.get(next.wrapping_sub(1)), path.get(next)) {
                (Some(before), Some(after)) => {
                    let share = (step - before.0) as f64 / (after.0 - before.0) as f64;
                    let (a, b) = (range(before), range(after));
                    (a.0 + (b.0 - a.0) * share, a.1 + (b.1 - a.1) * share)
                }
                (Some(only), None) | (None, Some(only)) => range(only),
                (None, None) => (f64::NEG_INFINITY, f64::INFINITY),
            }
        })
        .collect()
}

/// Narrows the branch's sections to `ranges`, unless that uncovers silhouettes or leaves what
/// it ended at hanging: a thigh is not a cape, though the cape covers it.
fn cut(
    slices: &mut [Slice],
    branch: &Branch,
    directions: &[Outline],
    direction: usize,
    ranges: &[(f64, f64)],
) -> bool {
    let narrowed: Vec<Option<Section>> = branch
        .iter()
        .zip(ranges)
        .map(|(&(k, s), range)| {
            let section =
                slices[k].sections[s].narrowed(&directions[direction], direction, *range)?;
            let lost = uncovered_px(&slices[k], s, &section, directions);
            (lost <= MAX_UNCOVERED_PX).then_some(section)
        })
        .collect();
    let kept = narrowed.iter().filter(|section| section.is_none()).count();
    if kept as f64 > MAX_KEPT * branch.len() as f64 {
        return false;
    }
    // Beyond slices that stay as they are, what counts is what is left behind them.
    let ends = [
        (branch.first(), narrowed.iter().flatten().next()),
        (branch.last(), narrowed.iter().flatten().next_back()),
    ];
    let holds_on = |end: (Option<&(usize, usize)>, Option<&Section>)| match end {
        (Some(&at), Some(section)) => keeps_neighbours(slices, at, section, directions),
        _ => true,
    };
    if !ends.into_iter().all(holds_on) {
        return false;
    }
    for (&(k, s), section) in branch.iter().zip(narrowed) {
        if let Some(section) = section {
            slices[k].sections[s] = section;
        }
    }
    true
}

/// Whether all that touches a section from above or below keeps [`MIN_HOLD`] of what it touches in
/// its slice if that becomes `narrowed`.
fn keeps_neighbours(
    slices: &[Slice],
    (k, index): (usize, usize),
    narrowed: &Section,
    directions: &[Outline],
) -> bool {
    let own = &slices[k].sections;
    let neighbours = [k.checked_sub(1), Some(k + 1)].into_iter().flatten();
    neighbours.filter_map(|k| slices.get(k)).flat_map(|slice| &slice.sections).all(|other| {
        let before = hold(&own[index], other, directions);
        let mut after = own.iter().enumerate();
        before <= 0.0
            || after.any(|(at, own)| {
                let own = if at == index { narrowed } else { own };
                hold(own, other, directions) > MIN_HOLD * before
            })
    })
}

/// The least share, over all directions, of the narrower of two sections that lies on the other.
fn hold(a: &Section, b: &Section, directions: &[Outline]) -> f64 {
    let shares = directions.iter().map(|direction| {
        let right = direction.right();
        let (a, b) = (a.extent_along(&right), b.extent_along(&right));
        (a.1.min(b.1) - a.0.max(b.0)) / (a.1 - a.0).min(b.1 - b.0).max(1e-9)
    });
    shares.fold(1.0, f64::min)
}

/// What the silhouettes lose in one slice if a section becomes `narrowed`, px.
fn uncovered_px(slice: &Slice, index: usize, narrowed: &Section, directions: &[Outline]) -> f64 {
    let lost = |direction: &Outline| {
        let right = direction.right();
        let before = slice.sections[index].extent_along(&right);
        let sections = slice.sections.iter().enumerate();
        let mut after: Vec<_> = sections
            .map(|(other, section)| if other == index { narrowed } else { section })
            .map(|section| section.extent_along(&right))
            .collect();
        after.sort_by(|a, b| a.0.total_cmp(&b.0));
        length(&difference(&[before], &after))
    };
    directions.iter().map(lost).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::super::section::sections_of_row;
    use super::*;

    #[test]
    fn a_part_is_not_cut_from_what_hangs_on_it() {
        let directions = [0.0, 90.0_f64]
            .map(|degrees| Outline { azimuth_rad: degrees.to_radians(), rows: Vec::new() });
        // Leg and cape as the hull has them: one block, 30 px deep; below, the leg alone.
        let at = |side: &[(f64, f64)]| Slice {
            row: 0,
            sections: sections_of_row(&directions, &[&[(-5.0, 5.0)], side], 100.0),
        };
        let slices = [at(&[(-10.0, 0.0)]), at(&[(-10.0, 20.0)])];
        let keeps = |range: (f64, f64)| {
            let narrowed = slices[1].sections[0].narrowed(&directions[1], 1, range).unwrap();
            keeps_neighbours(&slices, (1, 0), &narrowed, &directions)
        };
        assert!(keeps((-10.0, 0.0)), "the leg");
        assert!(!keeps((15.0, 20.0)), "the cape");
        assert!(!keeps((-2.0, 20.0)), "the cape, and the leg's edge");
    }
}
