//! Sections that only exist because too few views rule them out.
//!
//! Where silhouettes show several parts side by side, their intervals also
//! meet in places where nothing is. A part that stands before others has an
//! outline of its own; one that would stand there without any line, and that
//! no silhouette needs, is dropped.

use super::branches::{Branch, branches};
use super::crease::{InkEvidence, Slice};
use super::outline::{Outline, difference, length};

/// A part must be seen in so many slices to be judged.
const MIN_JUDGED: usize = 4;
/// The largest share of judged slices that may have ink on the part.
const MAX_INKED: f64 = 0.2;
/// The largest share of the part's extent that may be left uncovered.
const MAX_UNCOVERED: f64 = 0.02;
/// The share of a part's width that must be well inside the silhouette.
const MIN_INNER: f64 = 0.6;

/// Drops ghosts from `slices`; returns how many parts were dropped.
///
/// * `directions`: what bounds the sections.
/// * `drawings`: what may show ink.
pub(super) fn drop_ghosts(
    slices: &mut [Slice],
    directions: &[Outline],
    drawings: &[InkEvidence],
) -> usize {
    let mut branches = branches(slices, directions);
    let volume = |branch: &Branch| -> f64 {
        branch.iter().map(|&(k, s)| slices[k].sections[s].area_px2()).sum()
    };
    branches.sort_by(|a, b| volume(a).total_cmp(&volume(b)));
    let mut dropped: Vec<Vec<bool>> =
        slices.iter().map(|slice| vec![false; slice.sections.len()]).collect();
    let mut count = 0;
    for branch in &branches {
        if is_undrawn(slices, branch, drawings) && is_covered(slices, branch, &dropped, directions)
        {
            branch.iter().for_each(|&(k, s)| dropped[k][s] = true);
            count += 1;
        }
    }
    for (slice, dropped) in slices.iter_mut().zip(&dropped) {
        let mut index = 0;
        slice.sections.retain(|_| {
            index += 1;
            !dropped[index - 1]
        });
    }
    count
}

/// Whether the part stands before others in some view without any line on it.
fn is_undrawn(slices: &[Slice], branch: &Branch, drawings: &[InkEvidence]) -> bool {
    drawings.iter().any(|drawing| {
        let judged: Vec<bool> =
            branch.iter().filter_map(|&(k, s)| inked_in_front(&slices[k], s, drawing)).collect();
        let inked = judged.iter().filter(|&&inked| inked).count();
        judged.len() >= MIN_JUDGED
            && judged.len() * 2 >= branch.len()
            && inked as f64 <= MAX_INKED * judged.len() as f64
    })
}

/// Whether there is ink on a section; `None` if another stands before it, or
/// none behind it, or it is at the outline.
fn inked_in_front(slice: &Slice, index: usize, drawing: &InkEvidence) -> Option<bool> {
    let right = drawing.outline.right();
    let toward = drawing.outline.toward_camera();
    let section = &slice.sections[index];
    let (low, high) = section.extent_along(&right);
    let nearness = toward.dot(&section.centre().coords);
    let mut behind = false;
    for (_, section) in slice.sections.iter().enumerate().filter(|(other, _)| *other != index) {
        let (other_low, other_high) = section.extent_along(&right);
        let shared = high.min(other_high) - low.max(other_low);
        if shared > 0.1 * (high - low) {
            if toward.dot(&section.centre().coords) > nearness {
                return None;
            }
            behind = true;
        }
    }
    if !behind {
        return None;
    }
    let columns = (high - low).ceil().max(1.0) as usize;
    let at = |i: usize| {
        drawing.ink_at(low + (i as f64 + 0.5) * (high - low) / columns as f64, slice.row)
    };
    let seen: Vec<bool> = (0..columns).filter_map(at).collect();
    (seen.len() as f64 >= MIN_INNER * columns as f64).then(|| seen.contains(&true))
}

/// Whether the silhouettes stay covered without the part.
fn is_covered(
    slices: &[Slice],
    branch: &Branch,
    dropped: &[Vec<bool>],
    directions: &[Outline],
) -> bool {
    let (mut lost, mut total) = (0.0, 0.0);
    for &(k, s) in branch {
        for direction in directions {
            let right = direction.right();
            let own = slices[k].sections[s].extent_along(&right);
            let kept = slices[k].sections.iter().enumerate();
            let kept = kept.filter(|(other, _)| *other != s && !dropped[k][*other]);
            let mut others: Vec<_> =
                kept.map(|(_, section)| section.extent_along(&right)).collect();
            others.sort_by(|a, b| a.0.total_cmp(&b.0));
            lost += length(&difference(&[own], &others));
            total += own.1 - own.0;
        }
    }
    lost <= MAX_UNCOVERED * total
}
