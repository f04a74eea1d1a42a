//! Closed regions of the drawings that are holes through the subject.

use std::f64::consts::PI;

use image::GrayImage;

use super::outline::{Outline, difference, length};
use super::section::sections_of_row;
use super::sheet::SolidSheet;
use super::symmetry::MirrorPlane;
use crate::options::Holes;
use crate::sheet::Azimuth;

/// A point of a drawing that is known to be a hole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HoleHint {
    pub azimuth: Azimuth,
    /// Column and row in the sheet frame, px.
    pub x_px: f64,
    pub y_px: f64,
}

/// A hole that was carved.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Hole {
    pub azimuth_deg: f64,
    /// A column and row inside it, px.
    pub x_px: f64,
    pub y_px: f64,
    pub area_px: usize,
    /// The thinnest material around it over the root of its area.
    pub ring: f64,
    /// Whether a hint named it.
    pub hinted: bool,
}

/// Smaller regions are eyes and buttons, share of the image's pixels.
const MIN_AREA: f64 = 600.0 / (960.0 * 540.0);
/// Regions closer to the outside are bounded by the outline itself, px.
const MIN_RING_PX: f64 = 5.0;
/// The widest ring, over the root of the region's area.
const MAX_RING: f64 = 0.8;
/// The same where another view already has a hole in the same rows.
const MAX_RING_BESIDE_HOLE: f64 = 2.0;
/// The share of rows that must have such a hole.
const MIN_SHARED_ROWS: f64 = 0.8;
/// The share of the other silhouettes that a hole may leave without anything behind it.
const MAX_UNCOVERED: f64 = 0.08;
/// How alike a region and the opposite view's must be.
const MIN_OPPOSITE_IOU: f64 = 0.9;
/// Every so many rows are tested.
const ROW_STEP: usize = 2;

/// A connected region of paper inside an outline.
struct Region {
    view: usize,
    /// (row, first column, one past the last).
    runs: Vec<(usize, usize, usize)>,
    area: usize,
    ring: f64,
}

/// Finds the holes and cuts them out of the outlines of `sheet`.
///
/// * `masks`: the silhouettes of the drawn views, in their order.
/// * `half_line_px`: per view, how far a hole reaches under its line.
/// * `plane`: the subject's mirror plane. Views from its two sides are alike
///   whatever they show and confirm nothing.
pub fn carve(
    sheet: &mut SolidSheet,
    masks: &[&GrayImage],
    half_line_px: &[f64],
    plane: Option<&MirrorPlane>,
    hints: &[HoleHint],
    mode: Holes,
) -> Vec<Hole> {
    use rayon::prelude::*;
    let per_view: Vec<Vec<Region>> = (0..sheet.views.len())
        .into_par_iter()
        .map(|view| regions_of(sheet, view, masks[view]))
        .collect();
    let mut regions: Vec<Region> = per_view.into_iter().flatten().collect();
    regions.sort_by(|a, b| a.ring.total_cmp(&b.ring));
    let accepted = accept(sheet, &regions, plane, hints, mode);
    let mut holes = Vec::new();
    for (region, hinted) in accepted {
        cut(
            &mut sheet.views[region.view].outline,
            region,
            half_line_px[region.view],
            sheet.axis_px,
        );
        let (y, from, to) = region.runs[region.runs.len() / 2];
        holes.push(Hole {
            azimuth_deg: sheet.azimuths[region.view].degrees(),
            x_px: (from + to) as f64 / 2.0,
            y_px: y as f64 + 0.5,
            area_px: region.area,
            ring: region.ring,
            hinted,
        });
    }
    share_with_opposites(sheet, &holes);
    holes
}

/// Paper inside the outline, well away from it, by connected regions.
fn regions_of(sheet: &SolidSheet, view: usize, mask: &GrayImage) -> Vec<Region> {
    let (width, height) = (sheet.width, sheet.height);
    let min_area = (MIN_AREA * (width * height) as f64) as usize;
    let near_ink = sheet.near_ink(view);
    let is_paper =
        |x: usize, y: usize| mask.as_raw()[y * width + x] != 0 && !near_ink[y * width + x];
    let mut label = vec![u32::MAX; width * height];
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut pending = Vec::new();
    for start in 0..width * height {
        if label[start] != u32::MAX || !is_paper(start % width, start / width) {
            continue;
        }
        let id = groups.len() as u32;
        label[start] = id;
        pending.push(start);
        let mut members = Vec::new();
        while let Some(pixel) = pending.pop() {
            members.push(pixel);
            let (x, y) = (pixel % width, pixel / width);
            let sides = [
                (x > 0).then(|| pixel - 1),
                (x + 1 < width).then_some(pixel + 1),
                pixel.checked_sub(width),
                (y + 1 < height).then_some(pixel + width),
            ];
            for next in sides.into_iter().flatten() {
                if label[next] == u32::MAX && is_paper(next % width, next / width) {
                    label[next] = id;
                    pending.push(next);
                }
            }
        }
        groups.push(members);
    }
    groups.retain(|members| members.len() >= min_area);
    if groups.is_empty() {
        return Vec::new();
    }
    let depth = chamfer_distance_px(mask);
    groups.into_iter().filter_map(|members| region(view, members, &depth, width)).collect()
}

fn region(view: usize, mut members: Vec<usize>, depth: &[f32], width: usize) -> Option<Region> {
    let ring_px = members.iter().map(|&pixel| depth[pixel]).fold(f32::INFINITY, f32::min);
    if f64::from(ring_px) <= MIN_RING_PX {
        return None;
    }
    members.sort_unstable();
    let mut runs: Vec<(usize, usize, usize)> = Vec::new();
    for &pixel in &members {
        let (x, y) = (pixel % width, pixel / width);
        match runs.last_mut() {
            Some(run) if run.0 == y && run.2 == x => run.2 += 1,
            _ => runs.push((y, x, x + 1)),
        }
    }
    Some(Region {
        view,
        runs,
        area: members.len(),
        ring: f64::from(ring_px) / (members.len() as f64).sqrt(),
    })
}

/// Distance to the nearest pixel outside `mask`, px, by two passes (Borgefors 1986).
fn chamfer_distance_px(mask: &GrayImage) -> Vec<f32> {
    let (width, height) = (mask.width() as usize, mask.height() as usize);
    let far = (width + height) as f32;
    let mut depth: Vec<f32> =
        mask.as_raw().iter().map(|&level| if level == 0 { 0.0 } else { far }).collect();
    let diagonal = std::f32::consts::SQRT_2;
    let mut relax = |x: usize, y: usize, back: bool| {
        let step: i64 = if back { 1 } else { -1 };
        let near =
            [(step, 0, 1.0), (0, step, 1.0), (step, step, diagonal), (-step, step, diagonal)];
        for (dx, dy, cost) in near {
            let (nx, ny) = (x as i64 + dx, y as i64 + dy);
            let inside = nx >= 0 && ny >= 0 && nx < width as i64 && ny < height as i64;
            let beside = if inside { depth[ny as usize * width + nx as usize] } else { 0.0 };
            let here = &mut depth[y * width + x];
            *here = here.min(beside + cost);
        }
    };
    for y in 0..height {
        (0..width).for_each(|x| relax(x, y, false));
    }
    for y in (0..height).rev() {
        (0..width).rev().for_each(|x| relax(x, y, true));
    }
    depth
}

/// Takes the regions that nothing speaks against, thinnest rings first.
fn accept<'a>(
    sheet: &SolidSheet,
    regions: &'a [Region],
    plane: Option<&MirrorPlane>,
    hints: &[HoleHint],
    mode: Holes,
) -> Vec<(&'a Region, bool)> {
    let mut accepted: Vec<(&Region, bool)> = Vec::new();
    let mut rows_with_hole = vec![false; sheet.height];
    for region in regions {
        let hinted = hints.iter().any(|hint| is_hinted(sheet, region, hint));
        let shared = region.runs.iter().filter(|run| rows_with_hole[run.0]).count() as f64;
        let beside_hole = shared > MIN_SHARED_ROWS * region.runs.len() as f64;
        let max_ring = if beside_hole { MAX_RING_BESIDE_HOLE } else { MAX_RING };
        let found = mode != Holes::Off
            && region.ring <= max_ring
            && confirmed_across(sheet, regions, region, plane, mode)
            && uncovered_share(sheet, regions, region) < MAX_UNCOVERED;
        if hinted || found {
            accepted.push((region, hinted));
            region.runs.iter().for_each(|run| rows_with_hole[run.0] = true);
        }
    }
    accepted
}

fn is_hinted(sheet: &SolidSheet, region: &Region, hint: &HoleHint) -> bool {
    sheet.azimuths[region.view] == hint.azimuth
        && region.runs.iter().any(|&(y, from, to)| {
            y as f64 == hint.y_px.floor() && from as f64 <= hint.x_px && hint.x_px < to as f64
        })
}

/// Whether the opposite view shows the mirrored region; without one, whether
/// `mode` is eager.
fn confirmed_across(
    sheet: &SolidSheet,
    regions: &[Region],
    region: &Region,
    plane: Option<&MirrorPlane>,
    mode: Holes,
) -> bool {
    let own_rad = sheet.views[region.view].outline.azimuth_rad;
    let alike = plane.is_some_and(|plane| (plane.azimuth_rad(own_rad) - own_rad).cos() < -0.999);
    match opposite(sheet, region.view) {
        Some(across) if !alike || mode == Holes::Eager => regions
            .iter()
            .filter(|other| other.view == across)
            .any(|other| mirrored_iou(region, other, sheet.width) > MIN_OPPOSITE_IOU),
        _ => mode == Holes::Eager,
    }
}

fn opposite(sheet: &SolidSheet, view: usize) -> Option<usize> {
    let azimuth = |view: usize| sheet.views[view].outline.azimuth_rad;
    (0..sheet.views.len()).find(|&other| (azimuth(other) - azimuth(view) - PI).cos() > 1.0 - 1e-6)
}

fn mirrored_iou(a: &Region, b: &Region, width: usize) -> f64 {
    let mirrored = b.runs.iter().map(|&(y, from, to)| (y, width - to, width - from));
    let mut shared = 0;
    for (y, from, to) in mirrored {
        for run in a.runs.iter().filter(|run| run.0 == y) {
            shared += to.min(run.2).saturating_sub(from.max(run.1));
        }
    }
    shared as f64 / (a.area + b.area - shared) as f64
}

/// The share of what the other views show in the region's rows that nothing
/// would stand behind once the region is carved.
fn uncovered_share(sheet: &SolidSheet, regions: &[Region], region: &Region) -> f64 {
    let own = &sheet.views[region.view].outline;
    let mut bounds: Vec<Outline> = vec![own.clone()];
    let mut indices = vec![region.view];
    for (index, view) in sheet.views.iter().enumerate() {
        if !bounds.iter().any(|bound| bound.is_parallel_to(&view.outline)) {
            bounds.push(view.outline.clone());
            indices.push(index);
        }
    }
    let half_px = sheet.width as f64;
    let (mut lost, mut total) = (0.0, 0.0);
    let mut last_row = usize::MAX;
    for &(y, ..) in region.runs.iter().filter(|run| run.0 % ROW_STEP == 0) {
        if y == last_row {
            continue;
        }
        last_row = y;
        let rows: Vec<&[(f64, f64)]> = bounds.iter().map(|bound| bound.row(y)).collect();
        let carved = difference(rows[0], &columns_of(region, y, 0.0, sheet.axis_px));
        let mut carved_rows = rows.clone();
        carved_rows[0] = &carved;
        let before = sections_of_row(&bounds, &rows, half_px);
        let after = sections_of_row(&bounds, &carved_rows, half_px);
        for (bound, &index) in bounds.iter().zip(&indices).skip(1) {
            let cover = |sections: &[super::section::Section]| {
                let extents = sections.iter().map(|section| section.extent_along(&bound.right()));
                union(extents.collect())
            };
            // Another candidate's region may be open too.
            let candidates = regions.iter().filter(|other| other.view == index);
            let open: Vec<_> =
                candidates.flat_map(|other| columns_of(other, y, 3.0, sheet.axis_px)).collect();
            let covered = difference(&cover(&before), &union(open));
            total += length(&covered);
            lost += length(&difference(&covered, &cover(&after)));
        }
    }
    if total > 0.0 { lost / total } else { 1.0 }
}

/// The region's columns in row `y`, px from the axis, grown by `margin_px`.
fn columns_of(region: &Region, y: usize, margin_px: f64, axis_px: f64) -> Vec<(f64, f64)> {
    let first = region.runs.partition_point(|run| run.0 < y);
    let runs = region.runs[first..].iter().take_while(|run| run.0 == y);
    runs.map(|&(_, from, to)| (from as f64 - axis_px - margin_px, to as f64 - axis_px + margin_px))
        .collect()
}

fn union(mut intervals: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    intervals.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut joined: Vec<(f64, f64)> = Vec::new();
    for (low, high) in intervals {
        match joined.last_mut() {
            Some(last) if low <= last.1 => last.1 = last.1.max(high),
            _ => joined.push((low, high)),
        }
    }
    joined
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
        if let Some(across) = opposite(sheet, view) {
            let flipped = sheet.views[view].outline.mirrored(0.0, 0.0);
            let rows = sheet.views[across].outline.rows.iter().zip(&flipped.rows);
            let rows =
                rows.map(|(own, flipped)| super::outline::intersection(own, flipped)).collect();
            sheet.views[across].outline.rows = rows;
        }
    }
}
