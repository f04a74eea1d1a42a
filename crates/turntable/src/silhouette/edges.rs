//! How wide the stroke is that draws a silhouette's border.

use image::GrayImage;

use crate::ink::{INK_THRESHOLD, InkMap};
use crate::raster::runs;

/// Strokes wider than this are areas, not lines, px.
const MAX_LINE_PX: f64 = 6.0;
/// How far a stroke's width is followed, px.
const REACH_PX: i64 = 10;

/// Half the width of the stroke that draws the silhouette's border, px.
///
/// At each border pixel the ink along its row and along its column are
/// `w / cos` and `w / sin` of the stroke's slant; the median of `w` is halved.
/// 0 without a drawn border.
pub(super) fn half_line_px(ink: &InkMap, mask: &GrayImage) -> f64 {
    let mut widths = Vec::new();
    for (y, row) in rows(mask).enumerate() {
        for (start, end) in runs(row) {
            widths.extend(stroke_width_px(ink, start as i64, y as i64, 1));
            widths.extend(stroke_width_px(ink, end as i64 - 1, y as i64, -1));
        }
    }
    let middle = widths.len() / 2;
    if widths.is_empty() {
        return 0.0;
    }
    *widths.select_nth_unstable_by(middle, f64::total_cmp).1 / 2.0
}

/// The width of the stroke met going from column `x` in direction `step`.
fn stroke_width_px(ink: &InkMap, x: i64, y: i64, step: i64) -> Option<f64> {
    let peak =
        (0..3).map(|k| x + k * step).max_by(|&a, &b| ink.at(a, y).total_cmp(&ink.at(b, y)))?;
    if ink.at(peak, y) < 0.5 {
        return None;
    }
    let along = |dx: i64, dy: i64| -> f64 {
        (1..REACH_PX)
            .map(|k| ink.at(peak + k * dx, y + k * dy))
            .take_while(|&share| share > 0.05)
            .map(f64::from)
            .sum()
    };
    let centre = f64::from(ink.at(peak, y));
    let across = centre + along(1, 0) + along(-1, 0);
    let down = centre + along(0, 1) + along(0, -1);
    let width = 1.0 / across.hypot(down) * across * down;
    (width <= MAX_LINE_PX).then_some(width)
}

/// Runs that are wider than their stroke by at most so much are a stroke alone, px.
pub(crate) const ALONE_PX: f64 = 1.5;

/// The mask's runs with ends at the middle of the stroke, or at the mask's own
/// edge where `half_line_px` is 0 or the run is a stroke alone: a sheet seen
/// edge-on has no other thickness.
pub(super) fn row_intervals(
    ink: &InkMap,
    mask: &GrayImage,
    half_line_px: f64,
) -> Vec<Vec<(f64, f64)>> {
    let inset = |x: i64, y: usize, outward: i64| -> f64 {
        if half_line_px == 0.0 {
            return 0.0;
        }
        // The stroke's outer edge cuts through the border pixel: its bare part
        // lies outside, faint ink beyond it inside.
        let bare = f64::from((1.0 - ink.at(x, y as i64) / 0.9).clamp(0.0, 1.0));
        let bare = if ink.at(x, y as i64) > INK_THRESHOLD { bare } else { 0.0 };
        half_line_px + bare - f64::from(ink.at(x + outward, y as i64))
    };
    rows(mask)
        .enumerate()
        .map(|(y, row)| {
            runs(row)
                .map(|(start, end)| {
                    if (end - start) as f64 <= 2.0 * half_line_px + ALONE_PX {
                        return (start as f64, end as f64);
                    }
                    let left = start as f64 + inset(start as i64, y, -1);
                    (left, end as f64 - inset(end as i64 - 1, y, 1))
                })
                .filter(|(left, right)| right > left)
                .collect()
        })
        .collect()
}

pub(super) fn rows(mask: &GrayImage) -> impl Iterator<Item = &[u8]> {
    mask.as_raw().chunks_exact(mask.width().max(1) as usize)
}
