//! Closed regions of paper in the drawings.

use image::GrayImage;

use crate::raster::{runs, stroke_scale, two_passes};
use crate::solid::solid_views::SolidSheet;
use mesh::connected::components;

/// Smaller regions are eyes and buttons, share of the image's pixels.
const MIN_AREA: f64 = 600.0 / (960.0 * 540.0);
/// Regions closer to the outside are bounded by the outline itself, px of small
/// drawings.
const MIN_RING_PX: f64 = 5.0;
/// The same beside the outline's stroke: regions keep two columns away from ink, and strokes
/// have soft edges.
const BESIDE_STROKE_PX: f64 = 3.0;

/// (row, first column, one past the last).
pub(super) type Run = (usize, usize, usize);

/// A connected region of paper inside an outline.
pub(super) struct Region {
    pub view: usize,
    /// Row by row.
    pub runs: Vec<Run>,
    pub area: usize,
    /// The thinnest material around it over the root of its area.
    pub ring: f64,
}

/// The region's columns in row `y`, px from the axis, grown by `margin_px`.
pub(super) fn columns_of(
    region: &Region,
    y: usize,
    margin_px: f64,
    axis_px: f64,
) -> Vec<(f64, f64)> {
    let first = region.runs.partition_point(|run| run.0 < y);
    let runs = region.runs[first..].iter().take_while(|run| run.0 == y);
    runs.map(|&(_, from, to)| (from as f64 - axis_px - margin_px, to as f64 - axis_px + margin_px))
        .collect()
}

/// Paper inside the outline, well away from it, by connected regions.
///
/// * `half_line_px`: half the width of the outline's stroke.
pub(super) fn regions_of(
    sheet: &SolidSheet,
    view: usize,
    mask: &GrayImage,
    half_line_px: f64,
) -> Vec<Region> {
    let min_area = (MIN_AREA * (sheet.width * sheet.height) as f64) as usize;
    let mut groups = connected(&paper_runs(mask, sheet.near_ink(view)));
    groups.retain(|runs| area(runs) >= min_area);
    if groups.is_empty() {
        return Vec::new();
    }
    let depth = chamfer_distance_px(mask);
    let min_ring_px =
        (MIN_RING_PX * stroke_scale(sheet.height)).max(2.0 * half_line_px + BESIDE_STROKE_PX);
    let ring_px = |runs: &[Run]| {
        let rows = runs.iter().map(|&(y, from, to)| &depth[y * sheet.width..][from..to]);
        rows.flatten().copied().fold(f32::INFINITY, f32::min)
    };
    groups
        .into_iter()
        .map(|runs| (f64::from(ring_px(&runs)), runs))
        .filter(|(ring_px, _)| *ring_px > min_ring_px)
        .map(|(ring_px, runs)| {
            let area = area(&runs);
            Region { view, runs, area, ring: ring_px / (area as f64).sqrt() }
        })
        .collect()
}

fn area(runs: &[Run]) -> usize {
    runs.iter().map(|(_, from, to)| to - from).sum()
}

/// What is inside the mask and not near ink, row by row.
fn paper_runs(mask: &GrayImage, near_ink: &[bool]) -> Vec<Run> {
    let width = (mask.width() as usize).max(1);
    let rows = mask.as_raw().chunks_exact(width).zip(near_ink.chunks_exact(width));
    let of_row = |(y, (mask, near_ink)): (usize, (&[u8], &[bool]))| {
        let mut paper = Vec::new();
        for (mut next, end) in runs(mask) {
            while next < end {
                let from = next + near_ink[next..end].iter().take_while(|near| **near).count();
                next = from + near_ink[from..end].iter().take_while(|near| !**near).count();
                if from < next {
                    paper.push((y, from, next));
                }
            }
        }
        paper
    };
    rows.enumerate().flat_map(of_row).collect()
}

/// Runs that share columns with one in the next row, in one group; groups in
/// order of their first run.
fn connected(runs: &[Run]) -> Vec<Vec<Run>> {
    let mut links: Vec<(u32, u32)> = Vec::new();
    let mut above = 0;
    for (index, &(y, from, to)) in runs.iter().enumerate() {
        while runs[above].0 + 1 < y || (runs[above].0 + 1 == y && runs[above].2 <= from) {
            above += 1;
        }
        let beside = (above..index).take_while(|&other| runs[other].0 < y && runs[other].1 < to);
        links.extend(beside.map(|other| (other as u32, index as u32)));
    }
    let (labels, count) = components(runs.len(), links.into_iter());
    let mut groups: Vec<Vec<Run>> = vec![Vec::new(); count];
    for (run, label) in runs.iter().zip(labels) {
        groups[label as usize].push(*run);
    }
    groups
}

/// Distance to the nearest pixel outside `mask`, px.
fn chamfer_distance_px(mask: &GrayImage) -> Vec<f32> {
    let (width, height) = (mask.width() as usize, mask.height() as usize);
    let far = (width + height) as f32;
    let mut depth: Vec<f32> =
        mask.as_raw().iter().map(|&level| if level == 0 { 0.0 } else { far }).collect();
    let outside = vec![0.0; width];
    two_passes(&mut depth, width, |row, above| relax(row, above.unwrap_or(&outside)));
    depth
}

/// Lowers distances to those over the pixels above and to the left; beyond the
/// row's ends everything is outside.
fn relax(row: &mut [f32], above: &[f32]) {
    let diagonal = std::f32::consts::SQRT_2;
    let Some(first) = row.iter().position(|&depth| depth != 0.0) else {
        return;
    };
    let last = row.iter().rposition(|&depth| depth != 0.0).unwrap_or(first);
    lower(&mut row[first..=last], &above[first..], 1.0);
    let beside = first.max(1);
    lower(&mut row[beside..=last], &above[beside - 1..], diagonal);
    lower(&mut row[first..=last], &above[first + 1..], diagonal);
    if first == 0 {
        row[0] = row[0].min(diagonal);
    }
    if last + 1 == row.len() {
        row[last] = row[last].min(diagonal);
    }
    let mut left = 0.0;
    for depth in &mut row[first..=last] {
        left = depth.min(left + 1.0);
        *depth = left;
    }
}

fn lower(row: &mut [f32], above: &[f32], step: f32) {
    for (depth, above) in row.iter_mut().zip(above) {
        *depth = depth.min(above + step);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_that_meet_further_down_are_one_region() {
        let runs =
            [(3, 0, 4), (3, 6, 9), (4, 1, 3), (4, 8, 12), (5, 2, 10), (5, 12, 14), (7, 0, 9)];
        let groups = connected(&runs);
        let sizes: Vec<usize> = groups.iter().map(Vec::len).collect();
        assert_eq!(sizes, [5, 1, 1]);
        assert_eq!(groups[1], [(5, 12, 14)]);
        assert_eq!(area(&groups[0]), 4 + 3 + 2 + 4 + 8);
    }

    #[test]
    fn paper_is_inside_and_away_from_ink() {
        let mask = GrayImage::from_fn(8, 2, |x, y| image::Luma([u8::from(y == 1 && x > 1) * 255]));
        let near_ink: Vec<bool> = (0..16).map(|index| index % 8 == 4 || index % 8 == 7).collect();
        assert_eq!(paper_runs(&mask, &near_ink), [(1, 2, 4), (1, 5, 7)]);
    }
}
