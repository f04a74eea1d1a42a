//! Closed regions of paper in the drawings.

use image::GrayImage;

use super::super::super::raster::{stroke_scale, two_passes};
use super::super::sheet::SolidSheet;

/// Smaller regions are eyes and buttons, share of the image's pixels.
const MIN_AREA: f64 = 600.0 / (960.0 * 540.0);
/// Regions closer to the outside are bounded by the outline itself, px of small
/// drawings.
const MIN_RING_PX: f64 = 5.0;

/// A connected region of paper inside an outline.
pub struct Region {
    pub view: usize,
    /// (row, first column, one past the last).
    pub runs: Vec<(usize, usize, usize)>,
    pub area: usize,
    /// The thinnest material around it over the root of its area.
    pub ring: f64,
}

/// The region's columns in row `y`, px from the axis, grown by `margin_px`.
pub fn columns_of(region: &Region, y: usize, margin_px: f64, axis_px: f64) -> Vec<(f64, f64)> {
    let first = region.runs.partition_point(|run| run.0 < y);
    let runs = region.runs[first..].iter().take_while(|run| run.0 == y);
    runs.map(|&(_, from, to)| (from as f64 - axis_px - margin_px, to as f64 - axis_px + margin_px))
        .collect()
}

/// Paper inside the outline, well away from it, by connected regions.
pub fn regions_of(sheet: &SolidSheet, view: usize, mask: &GrayImage) -> Vec<Region> {
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
    let min_ring_px = MIN_RING_PX * stroke_scale(height);
    let region = |members| region(view, members, &depth, width, min_ring_px);
    groups.into_iter().filter_map(region).collect()
}

fn region(
    view: usize,
    mut members: Vec<usize>,
    depth: &[f32],
    width: usize,
    min_ring_px: f64,
) -> Option<Region> {
    let ring_px = members.iter().map(|&pixel| depth[pixel]).fold(f32::INFINITY, f32::min);
    if f64::from(ring_px) <= min_ring_px {
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
    let mut left = 0.0;
    for x in 0..row.len() {
        if row[x] != 0.0 {
            let beside = |index: Option<usize>| {
                index.and_then(|index| above.get(index)).copied().unwrap_or(0.0)
            };
            let slanted = beside(x.checked_sub(1)).min(beside(Some(x + 1))) + diagonal;
            row[x] = row[x].min(left + 1.0).min(above[x] + 1.0).min(slanted);
        }
        left = row[x];
    }
}
