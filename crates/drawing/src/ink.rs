//! Strokes as anti-aliased ink.

use image::GrayImage;
use tiny_skia::{FillRule, LineCap, LineJoin, Mask, Path, PathBuilder, Transform};

use super::Stroke;

/// Draws strokes with round ends and joins.
///
/// * `supersampling`: the strokes are drawn, anti-aliased, on a grid this many times as fine.
/// * `line_width_px`: for strokes without widths of their own.
///
/// Returns how much of each pixel the ink covers, 0..255.
pub(super) fn ink_coverage(
    strokes: &[Stroke],
    width: u32,
    height: u32,
    supersampling: u32,
    line_width_px: f64,
) -> GrayImage {
    let factor = supersampling.max(1);
    let Some(mut mask) = Mask::new(width * factor, height * factor) else {
        return GrayImage::new(width, height);
    };
    let scale = Transform::from_scale(factor as f32, factor as f32);
    for stroke in strokes {
        for path in outlines(stroke, line_width_px, factor as f32) {
            mask.fill_path(&path, FillRule::Winding, true, scale);
        }
    }
    reduced(&mask, width, height, factor)
}

/// The filled shapes of a stroke; one, unless its width varies.
fn outlines(stroke: &Stroke, line_width_px: f64, resolution: f32) -> Vec<Path> {
    if stroke.widths_px.is_empty() {
        let points = stroke.points.iter().map(|p| (p.x as f32, p.y as f32));
        return outline(points, line_width_px as f32, resolution).into_iter().collect();
    }
    let pairs = stroke.points.windows(2).zip(stroke.widths_px.windows(2));
    pairs
        .filter_map(|(points, widths)| {
            let points = points.iter().map(|p| (p.x as f32, p.y as f32));
            outline(points, ((widths[0] + widths[1]) / 2.0) as f32, resolution)
        })
        .collect()
}

fn outline(
    points: impl Iterator<Item = (f32, f32)>,
    line_width_px: f32,
    resolution: f32,
) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for (index, (x, y)) in points.enumerate() {
        if index == 0 {
            builder.move_to(x, y);
        } else {
            builder.line_to(x, y);
        }
    }
    let pen = tiny_skia::Stroke {
        width: line_width_px,
        line_cap: LineCap::Round,
        line_join: LineJoin::Round,
        ..tiny_skia::Stroke::default()
    };
    builder.finish()?.stroke(&pen, resolution)
}

/// The mean over each pixel's samples.
fn reduced(mask: &Mask, width: u32, height: u32, factor: u32) -> GrayImage {
    let count = factor * factor;
    let (stride, factor) = ((width * factor) as usize, factor as usize);
    let mut levels = Vec::with_capacity((width * height) as usize);
    let mut sums = vec![0_u32; width as usize];
    for rows in mask.data().chunks_exact(stride * factor) {
        sums.fill(0);
        for row in rows.chunks_exact(stride) {
            for (sum, samples) in sums.iter_mut().zip(row.chunks_exact(factor)) {
                *sum += samples.iter().map(|&sample| u32::from(sample)).sum::<u32>();
            }
        }
        levels.extend(sums.iter().map(|sum| ((sum + count / 2) / count) as u8));
    }
    GrayImage::from_raw(width, height, levels).unwrap_or_default()
}
