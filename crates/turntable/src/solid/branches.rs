//! Which sections of neighbouring slices are one part.

use super::crease::Slice;
use super::outline::Outline;
use super::section::Section;

/// Sections of neighbouring slices are one part if their extents overlap this much.
const MIN_OVERLAP: f64 = 0.35;

/// A part by its sections: (slice, index), upward.
pub(super) type Branch = Vec<(usize, usize)>;

/// Chains of sections that continue each other from slice to slice.
pub(super) fn branches(slices: &[Slice], directions: &[Outline]) -> Vec<Branch> {
    let mut branches: Vec<Branch> = Vec::new();
    let mut below: Vec<usize> = Vec::new();
    for (k, slice) in slices.iter().enumerate() {
        let previous = k.checked_sub(1).map_or(&[][..], |k| &slices[k].sections);
        let best = |section: &Section, others: &[Section]| {
            let overlaps = others.iter().map(|other| overlap(section, other, directions));
            overlaps.enumerate().max_by(|a, b| a.1.total_cmp(&b.1))
        };
        let current: Vec<usize> = slice
            .sections
            .iter()
            .enumerate()
            .map(|(s, section)| {
                let continued = best(section, previous).filter(|&(below, share)| {
                    share > MIN_OVERLAP
                        && best(&previous[below], &slice.sections).is_some_and(|(own, _)| own == s)
                });
                match continued {
                    Some((index, _)) => below[index],
                    None => {
                        branches.push(Vec::new());
                        branches.len() - 1
                    }
                }
            })
            .collect();
        for (s, &branch) in current.iter().enumerate() {
            branches[branch].push((k, s));
        }
        below = current;
    }
    branches
}

/// The smallest overlap of two sections' extents over all directions, share of both; below 0
/// where they are apart in one.
fn overlap(a: &Section, b: &Section, directions: &[Outline]) -> f64 {
    directions
        .iter()
        .map(|direction| {
            let right = direction.right();
            let (a, b) = (a.extent_along(&right), b.extent_along(&right));
            let shared = a.1.min(b.1) - a.0.max(b.0);
            shared / (a.1.max(b.1) - a.0.min(b.0)).max(1e-9)
        })
        .fold(1.0, f64::min)
}
