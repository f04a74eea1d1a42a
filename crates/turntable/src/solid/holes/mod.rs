//! Closed regions of the drawings that are holes through the subject.

mod evidence;
mod regions;

use image::GrayImage;

use super::outline::{Outline, difference, intersection, union};
use super::solid_views::SolidSheet;
use super::symmetry::MirrorPlane;
use crate::options::Holes;
use evidence::Evidence;
use frames::Viewpoint;
use regions::{Region, columns_of, regions_of};

/// A point of a drawing that is known to be a hole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HoleHint {
    /// The view that it points into.
    pub viewpoint: Viewpoint,
    /// Column and row in the sheet frame, px.
    pub x_px: f64,
    /// The row, downward.
    pub y_px: f64,
}

/// A hole that was carved.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Hole {
    /// The view that shows it, degrees in [0, 360).
    pub azimuth_deg: f64,
    /// A column and row inside it, px.
    pub x_px: f64,
    /// The row, downward.
    pub y_px: f64,
    /// Pixels that it covers in that view.
    pub area_px: usize,
    /// The thinnest material around it over the root of its area.
    pub ring: f64,
    /// Whether a hint named it.
    pub hinted: bool,
}

/// The widest ring, over the root of the region's area.
const MAX_RING: f64 = 0.8;
/// The same where another view already has a hole in the same rows.
const MAX_RING_BESIDE_HOLE: f64 = 2.0;
/// The share of rows that must have such a hole.
const MIN_SHARED_ROWS: f64 = 0.8;
/// The share of the other silhouettes that a hole may leave without anything behind it.
const MAX_UNCOVERED: f64 = 0.08;
/// The share of rows in which a hole may leave a line of another view without
/// anything that it is drawn on.
const MAX_INKED: f64 = 0.05;
/// A passage longer than this many times its width is more likely a panel that
/// is drawn on both sides.
const MAX_LENGTH: f64 = 1.0;
/// Of more views than this, more than one must confirm a hole: regions that
/// happen to look like one are many among them.
const MANY_VIEWS: usize = 8;

/// Holes that were carved, and regions that others spoke for and against.
#[derive(Clone, Debug, Default)]
pub(super) struct Found {
    pub carved: Vec<Hole>,
    pub candidates: Vec<Hole>,
}

/// Finds the holes and cuts them out of the outlines of `sheet`.
///
/// * `masks`: the silhouettes of the drawn views, in their order.
/// * `half_line_px`: per view, how far a hole reaches under its line.
/// * `plane`: the subject's mirror plane. Views from its two sides are alike
///   whatever they show and confirm nothing.
pub(super) fn carve(
    sheet: &mut SolidSheet,
    masks: &[&GrayImage],
    half_line_px: &[f64],
    plane: Option<&MirrorPlane>,
    hints: &[HoleHint],
    mode: Holes,
) -> Found {
    use rayon::prelude::*;
    let per_view: Vec<Vec<Region>> = (0..sheet.views.len())
        .into_par_iter()
        .map(|view| regions_of(sheet, view, masks[view], half_line_px[view]))
        .collect();
    let mut regions: Vec<Region> = per_view.into_iter().flatten().collect();
    regions.sort_by(|a, b| a.ring.total_cmp(&b.ring));
    let (accepted, candidates) = accept(sheet, &regions, plane, hints, mode);
    let mut found = Found::default();
    for region in candidates {
        found.candidates.push(hole_of(sheet, region, false));
    }
    for (region, hinted) in accepted {
        cut(
            &mut sheet.views[region.view].outline,
            region,
            half_line_px[region.view],
            sheet.axis_px,
        );
        found.carved.push(hole_of(sheet, region, hinted));
    }
    share_with_opposites(sheet, &found.carved);
    found
}

fn hole_of(sheet: &SolidSheet, region: &Region, hinted: bool) -> Hole {
    let (y, from, to) = region.runs[region.runs.len() / 2];
    Hole {
        azimuth_deg: sheet.azimuths[region.view].degrees(),
        x_px: (from + to) as f64 / 2.0,
        y_px: y as f64 + 0.5,
        area_px: region.area,
        ring: region.ring,
        hinted,
    }
}

/// Regions to cut, each with whether a hint named it, and those to list.
type Accepted<'a> = (Vec<(&'a Region, bool)>, Vec<&'a Region>);

/// Takes the regions that nothing speaks against, thinnest rings first.
fn accept<'a>(
    sheet: &SolidSheet,
    regions: &'a [Region],
    plane: Option<&MirrorPlane>,
    hints: &[HoleHint],
    mode: Holes,
) -> Accepted<'a> {
    let evidence = Evidence { sheet, regions, plane };
    let required = if sheet.azimuths.len() > MANY_VIEWS { 2 } else { 1 };
    let (mut accepted, mut candidates) = (Vec::new(), Vec::new());
    let mut rows_with_hole = vec![false; sheet.height];
    for region in regions {
        let hinted = hints.iter().any(|hint| is_hinted(sheet, region, hint));
        let shared = region.runs.iter().filter(|run| rows_with_hole[run.0]).count() as f64;
        let beside_hole = shared > MIN_SHARED_ROWS * region.runs.len() as f64;
        let max_ring = if beside_hole { MAX_RING_BESIDE_HOLE } else { MAX_RING };
        // Where the outline leaves out what one sees through, the rest is painted.
        let searched = match mode {
            Holes::Off => false,
            Holes::Auto => !sheet.has_holes[region.view],
            Holes::Eager => true,
        };
        let possible = searched
            && region.ring <= max_ring
            && evidence.confirms(region, required, mode == Holes::Eager);
        let is_open = || {
            (mode == Holes::Eager || evidence.length_over_width(region) <= MAX_LENGTH)
                && nothing_falls(&evidence, region)
        };
        if hinted || (possible && is_open()) {
            accepted.push((region, hinted));
            region.runs.iter().for_each(|run| rows_with_hole[run.0] = true);
        } else if possible {
            candidates.push(region);
        }
    }
    (accepted, candidates)
}

/// Whether the other views keep something behind outlines and lines.
fn nothing_falls(evidence: &Evidence<'_>, region: &Region) -> bool {
    let uncovered = evidence.uncovered(region);
    uncovered.share < MAX_UNCOVERED && uncovered.inked_share <= MAX_INKED
}

fn is_hinted(sheet: &SolidSheet, region: &Region, hint: &HoleHint) -> bool {
    Viewpoint::from(sheet.azimuths[region.view]) == hint.viewpoint
        && region.runs.iter().any(|&(y, from, to)| {
            y as f64 == hint.y_px.floor() && from as f64 <= hint.x_px && hint.x_px < to as f64
        })
}

/// Cuts the region, up to the middle of the line around it, out of `outline`.
fn cut(outline: &mut Outline, region: &Region, half_line_px: f64, axis_px: f64) {
    // Regions keep two columns and one row away from ink.
    let margin_px = 2.0 + half_line_px;
    let grow_rows = (1.0 + half_line_px).round() as usize;
    let first = region.runs[0].0.saturating_sub(grow_rows);
    let last = region.runs[region.runs.len() - 1].0 + grow_rows;
    for y in first..=last.min(outline.rows.len().saturating_sub(1)) {
        let near = y.saturating_sub(grow_rows)..=y + grow_rows;
        let columns = near.flat_map(|near| {
            let margin_px = if near == y { margin_px } else { 0.0 };
            columns_of(region, near, margin_px, axis_px)
        });
        outline.rows[y] = difference(&outline.rows[y], &union(columns.collect()));
    }
}

/// Gives the view opposite to a hole the same outline, mirrored.
fn share_with_opposites(sheet: &mut SolidSheet, holes: &[Hole]) {
    for hole in holes {
        let Some(view) =
            sheet.azimuths.iter().position(|azimuth| azimuth.degrees() == hole.azimuth_deg)
        else {
            continue;
        };
        if let Some(across) = evidence::opposite(sheet, view) {
            let flipped = sheet.views[view].outline.mirrored(0.0, 0.0);
            let rows = sheet.views[across].outline.rows.iter().zip(&flipped.rows);
            let rows = rows.map(|(own, flipped)| intersection(own, flipped)).collect();
            sheet.views[across].outline.rows = rows;
        }
    }
}
