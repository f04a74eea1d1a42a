//! Bilateral symmetry: a view at one azimuth gives its mirror image for free.

use super::outline::{Outline, difference, length};
use super::section::{covered, sections_of_row};
use super::solid_views::{SolidSheet, SolidView, directions_of};

/// A vertical plane that mirrors the subject onto itself.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct MirrorPlane {
    /// Whether the plane is left to right (X = offset) or front to back (Y = offset).
    pub left_right: bool,
    /// px from the axis.
    pub offset_px: f64,
    /// Intersection over union of the silhouette with its mirror image.
    pub silhouette_iou: f64,
    /// The share of inner ink that the mirror image has too; `None` without inner ink.
    pub ink_agreement: Option<f64>,
}

/// Silhouettes less like their mirror image are not symmetric.
const MIN_IOU: f64 = 0.96;
/// Drawings whose lines agree less with their mirror image are not symmetric.
const MIN_INK: f64 = 0.5;
/// Less inner ink says nothing, px.
const MIN_INK_PX: usize = 50;
/// Mirrored views that leave more of what is drawn without anything behind it
/// show that the subject is not symmetric.
const MAX_UNCOVERED: f64 = 0.01;
/// About so many rows are tested.
const TESTED_ROWS: usize = 100;
/// Farther from the axis than anything, px.
const HALF_PX: f64 = 1e5;
/// Ink this close to the outline is the outline's, px.
const INNER_PX: f64 = 5.0;
/// Lines are drawn alike within this distance, px.
const INK_REACH_PX: i64 = 3;

impl MirrorPlane {
    /// What the plane does to `azimuth_rad`.
    pub fn azimuth_rad(&self, azimuth_rad: f64) -> f64 {
        let mirrored =
            if self.left_right { -azimuth_rad } else { std::f64::consts::PI - azimuth_rad };
        mirrored.rem_euclid(std::f64::consts::TAU)
    }

    /// The sum of a point's column at `azimuth_rad` and its image's column in
    /// the mirrored view, px from the axis.
    ///
    /// For the plane X = p: X' = 2p - X, so at -a the column is
    /// X' cos a - Y sin a = 2p cos a - u.
    pub fn column_sum_px(&self, azimuth_rad: f64) -> f64 {
        let (sine, cosine) = azimuth_rad.sin_cos();
        2.0 * self.offset_px * if self.left_right { cosine } else { sine }
    }

    /// What a point's depth gains in the mirrored view, px.
    ///
    /// For the plane X = p: d' = X' sin a + Y cos a = 2p sin a + d.
    pub fn depth_gain_px(&self, azimuth_rad: f64) -> f64 {
        let (sine, cosine) = azimuth_rad.sin_cos();
        2.0 * self.offset_px * if self.left_right { sine } else { -cosine }
    }
}

/// The ink of one drawing, for comparing it with its mirror image.
pub(super) struct Drawing<'a> {
    pub outline: &'a Outline,
    /// Per pixel, whether it is ink.
    pub ink: &'a [bool],
    pub width: usize,
    pub axis_px: f64,
}

/// The plane that front, back or side views show best; `None` if they show none.
///
/// Only views at 0, 90, 180 and 270 degrees look along such a plane. With
/// `forced` the best one is taken however little it fits.
pub(super) fn detect(drawings: &[Drawing], forced: bool) -> Option<MirrorPlane> {
    let planes: Vec<MirrorPlane> = drawings.iter().filter_map(plane_of).collect();
    // Between equals the usual one: left like right.
    let score = |plane: &MirrorPlane| {
        let usual = if plane.left_right { 1e-3 } else { 0.0 };
        plane.silhouette_iou + plane.ink_agreement.unwrap_or(1.0) + usual
    };
    let fits = |plane: &&MirrorPlane| {
        forced
            || (plane.silhouette_iou > MIN_IOU
                && plane.ink_agreement.is_none_or(|ink| ink > MIN_INK))
    };
    planes.iter().filter(fits).max_by(|a, b| score(a).total_cmp(&score(b))).copied()
}

/// Whether mirrored views leave something behind what the drawings show.
pub(super) fn leaves_covered(sheet: &SolidSheet, images: &[SolidView]) -> bool {
    uncovered_share(&sheet.directions(), &directions_of(images)) <= MAX_UNCOVERED
}

/// The share of what the drawings show that nothing stands behind once the
/// outlines in `mirrored` bound the subject too.
///
/// A drawing may look like its own mirror image where the subject does not: a
/// ring turned by 45 degrees does from the front and from the side.
fn uncovered_share(drawn: &[Outline], mirrored: &[Outline]) -> f64 {
    use rayon::prelude::*;
    let rows = drawn.iter().filter_map(Outline::row_range);
    let Some((first, last)) = rows.reduce(|a, b| (a.0.max(b.0), a.1.min(b.1))) else { return 0.0 };
    let step = (last.saturating_sub(first) / TESTED_ROWS).max(1);
    let all: Vec<&Outline> = drawn.iter().chain(mirrored).collect();
    let tested: Vec<usize> = (first..last).step_by(step).collect();
    let lost_of_row = |&y: &usize| {
        let rows: Vec<_> = all.iter().map(|outline| outline.row(y)).collect();
        let before = sections_of_row(&all[..drawn.len()], &rows[..drawn.len()], HALF_PX);
        let after = sections_of_row(&all, &rows, HALF_PX);
        let of_view = |outline: &Outline| {
            let axis = outline.right();
            let shown = covered(&before, &axis);
            (length(&difference(&shown, &covered(&after, &axis))), length(&shown))
        };
        drawn.iter().map(of_view).fold((0.0, 0.0), |sum, of| (sum.0 + of.0, sum.1 + of.1))
    };
    let of_rows: Vec<(f64, f64)> = tested.par_iter().map(lost_of_row).collect();
    let (lost, shown) = of_rows.iter().fold((0.0, 0.0), |sum, of| (sum.0 + of.0, sum.1 + of.1));
    if shown > 0.0 { lost / shown } else { 0.0 }
}

fn plane_of(drawing: &Drawing) -> Option<MirrorPlane> {
    let quarter = drawing.outline.azimuth_rad.to_degrees() / 90.0;
    if (quarter - quarter.round()).abs() > 1e-6 {
        return None;
    }
    let (low, high) = drawing.outline.column_range()?;
    let candidates = (-12..=12).map(|step| low + high + f64::from(step) * 0.5);
    let scored = candidates.map(|sum| (mirror_iou(drawing.outline, sum), sum));
    let (silhouette_iou, sum) = scored.max_by(|a, b| a.0.total_cmp(&b.0))?;
    let quarter = quarter.round() as i64;
    // The column at 0 and 90 degrees is X and Y, at 180 and 270 their negative.
    let sign = if quarter.rem_euclid(4) < 2 { 1.0 } else { -1.0 };
    Some(MirrorPlane {
        left_right: quarter.rem_euclid(2) == 0,
        offset_px: sum / 2.0 * sign,
        silhouette_iou,
        ink_agreement: ink_agreement(drawing, sum),
    })
}

fn mirror_iou(outline: &Outline, sum_px: f64) -> f64 {
    let shared: f64 = outline.rows.iter().map(|row| shared_with_mirror_px(row, sum_px)).sum();
    let own: f64 = outline.rows.iter().map(|row| length(row)).sum();
    shared / (2.0 * own - shared).max(1e-9)
}

/// What a row and itself with every column `u` moved to `sum_px - u` share.
fn shared_with_mirror_px(row: &[(f64, f64)], sum_px: f64) -> f64 {
    let mut flipped = row.iter().rev().map(|(low, high)| (sum_px - high, sum_px - low)).peekable();
    let mut shared = 0.0;
    for &(low, high) in row {
        while let Some(&(other_low, other_high)) = flipped.peek() {
            shared += (high.min(other_high) - low.max(other_low)).max(0.0);
            if other_high > high {
                break;
            }
            flipped.next();
        }
    }
    shared
}

/// The share of inner ink with ink at its mirror image.
fn ink_agreement(drawing: &Drawing, sum_px: f64) -> Option<f64> {
    let (mut inner, mut agreeing) = (0_usize, 0_usize);
    for (y, row) in drawing.outline.rows.iter().enumerate() {
        for &(low, high) in row {
            let first = (low + INNER_PX + drawing.axis_px).ceil().max(0.0) as usize;
            let last = (high - INNER_PX + drawing.axis_px).floor().max(0.0) as usize;
            for x in first..last.min(drawing.width) {
                if drawing.ink.get(y * drawing.width + x).is_some_and(|&ink| ink) {
                    inner += 1;
                    let across = sum_px - (x as f64 + 0.5 - drawing.axis_px) + drawing.axis_px;
                    agreeing += usize::from(ink_near(drawing, across.floor() as i64, y as i64));
                }
            }
        }
    }
    (inner >= MIN_INK_PX).then(|| agreeing as f64 / inner as f64)
}

fn ink_near(drawing: &Drawing, x: i64, y: i64) -> bool {
    let at = |x: i64, y: i64| {
        let in_row = x >= 0 && x < drawing.width as i64 && y >= 0;
        in_row && drawing.ink.get(y as usize * drawing.width + x as usize).is_some_and(|&ink| ink)
    };
    (-INK_REACH_PX..=INK_REACH_PX).any(|dy| {
        let reach = INK_REACH_PX - dy.abs();
        (-reach..=reach).any(|dx| at(x + dx, y + dy))
    })
}
