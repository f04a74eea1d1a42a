//! How well the views' outlines agree: what one draws and the others cut away
//! was drawn elsewhere there.

use super::crease::Slice;
use super::outline::{Outline, intersection};

/// Drawings that agree as well as the first share are of one subject, save for
/// pixels: nearly all that are drawn from models are above it. Below the second,
/// hand-drawn sheets, rows of different views show different heights.
const AGREE: f64 = 0.995;
const DISAGREE: f64 = 0.985;

/// How far drawings that agree to such a share are from agreeing: 0 to 1.
pub(super) fn apart(agreement: f64) -> f64 {
    ((AGREE - agreement) / (AGREE - DISAGREE)).clamp(0.0, 1.0)
}

/// The share of what the views draw that is left where all are respected, 0 to 1.
///
/// Two views from different sides agree in every row that both have; more do only
/// if one subject can look like all of them.
pub(super) fn of_slices(slices: &[Slice], directions: &[Outline]) -> f64 {
    let (mut left, mut drawn) = (0.0, 0.0);
    let length =
        |intervals: &[(f64, f64)]| intervals.iter().map(|(low, high)| high - low).sum::<f64>();
    for (slice, view) in
        slices.iter().flat_map(|slice| directions.iter().map(move |view| (slice, view)))
    {
        let row = view.row(slice.row);
        drawn += length(row);
        left += length(&intersection(&shadows(slice, view), row));
    }
    if drawn > 0.0 { left / drawn } else { 1.0 }
}

/// The columns that a slice's sections take in a view, ascending and disjoint, px
/// from the axis.
fn shadows(slice: &Slice, view: &Outline) -> Vec<(f64, f64)> {
    let of_section = |corners: &Vec<nalgebra::Point2<f64>>| {
        let columns = corners.iter().map(|corner| view.column(corner));
        columns
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)))
    };
    let mut shadows: Vec<_> =
        slice.sections.iter().map(|section| of_section(&section.corners)).collect();
    shadows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut joined: Vec<(f64, f64)> = Vec::new();
    for shadow in shadows {
        match joined.last_mut() {
            Some(last) if shadow.0 <= last.1 => last.1 = last.1.max(shadow.1),
            _ => joined.push(shadow),
        }
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::super::section::sections_of_row;
    use super::*;

    /// Three views of a disc of 20 px, one of them `shift_px` beside the axis.
    fn agreement(shift_px: f64) -> f64 {
        let at = |degrees: f64, shift_px: f64| Outline {
            azimuth_rad: degrees.to_radians(),
            rows: vec![vec![(shift_px - 20.0, shift_px + 20.0)]],
        };
        let directions = [at(0.0, 0.0), at(45.0, shift_px), at(90.0, 0.0)];
        let rows: Vec<_> = directions.iter().map(|view| view.row(0)).collect();
        let sections = sections_of_row(&directions, &rows, 60.0);
        of_slices(&[Slice { row: 0, sections }], &directions)
    }

    #[test]
    fn views_of_one_disc_agree_and_views_of_two_do_not() {
        assert!(agreement(0.0) > 0.999);
        assert!(agreement(30.0) < DISAGREE);
        assert!(apart(agreement(0.0)) < 1e-9);
        assert!((apart(agreement(30.0)) - 1.0).abs() < 1e-9);
    }
}
