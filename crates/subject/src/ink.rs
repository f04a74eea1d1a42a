//! The cleaned drawing as dark lines on white paper, and the subject cut out.

use image::{GrayImage, RgbaImage};
use rayon::prelude::*;

use crate::alpha::luma;
use crate::raster::Bits;
use crate::report::DrawingKind;
use crate::structure::Structure;
use crate::tone::Tone;

/// Contrast from which lines are left as they are, levels.
const FULL_CONTRAST: f32 = 200.0;
/// What differs by less than so many standard deviations becomes white.
const GRAINS: f32 = 2.5;
/// Differences of colour that make a full line and none, levels.
const EDGE_FULL: f32 = 72.0;
const EDGE_NONE: f32 = 14.0;
/// How much darker than both sides a full line is, levels.
const LINE_FULL: f32 = 90.0;

/// The lines of a drawing, 255 where nothing is drawn.
pub(crate) fn of_kind(
    image: &RgbaImage,
    tone: &Tone<'_>,
    structure: &Structure,
    mask: &GrayImage,
) -> GrayImage {
    let lines = matches!(structure.kind, DrawingKind::LineArt | DrawingKind::InkLayer)
        || (structure.kind == DrawingKind::Given && structure.colour_from.is_none());
    if lines { of_lines(tone, structure) } else { of_areas(image, structure, mask) }
}

/// Where the cleaned drawing may have ink: the subject and a little around it.
fn shown(structure: &Structure) -> Bits {
    let reach = (2.0 / structure.factor as f64).max(1.0) as f32 + 0.5;
    let mut shown = structure.inside.dilated(reach);
    // Guides through the figure are removed from it as well.
    shown.data.iter_mut().zip(&structure.cleared.data).for_each(|(shown, gone)| *shown &= !gone);
    shown
}

fn of_lines(tone: &Tone<'_>, structure: &Structure) -> GrayImage {
    let (w, h) = tone.size();
    let shown = shown(structure);
    let factor = structure.factor;
    let gain = if tone.contrast >= FULL_CONTRAST { tone.contrast } else { 255.0 };
    let floor = GRAINS * tone.noise() / tone.contrast;
    let mut levels = vec![255_u8; w * h];
    levels.par_chunks_mut(w.max(1)).enumerate().for_each(|(y, row)| {
        let cells = &shown.data[y / factor * shown.width..(y / factor + 1) * shown.width];
        if !cells.contains(&true) {
            return;
        }
        let (pixels, paper) = tone.row(y);
        for (x, level) in row.iter_mut().enumerate() {
            let cell = x / factor;
            if cells[cell] {
                let share = tone.share(&pixels[x * 4..], &paper, x);
                if share > floor {
                    *level = (255.0 - gain * share).round().clamp(0.0, 255.0) as u8;
                }
            }
        }
        for (x, level) in row.iter_mut().enumerate() {
            let bridged = structure.bridged.data[y / factor * shown.width + x / factor];
            if bridged && cells[x / factor] {
                *level = (*level).min((255.0 - gain).max(0.0) as u8);
            }
        }
    });
    GrayImage::from_raw(w as u32, h as u32, levels).unwrap_or_default()
}

/// Dark lines, edges between colours, and the mask's boundary.
fn of_areas(image: &RgbaImage, structure: &Structure, mask: &GrayImage) -> GrayImage {
    let (w, h) = (image.width() as usize, image.height() as usize);
    let stroke = (structure.stroke * structure.factor as f64).max(1.0);
    let apart = ((1.2 * stroke).round() as usize).clamp(1, 24);
    let step = ((0.35 * stroke).round() as usize).clamp(1, 4);
    let outline = structure.outline.unwrap_or_default() * structure.factor as f64;
    let edge_px = (outline.round() as usize).clamp(1, 6);
    let pixel = |x: usize, y: usize| &image.as_raw()[(y * w + x) * 4..(y * w + x) * 4 + 3];
    let inside = |x: usize, y: usize| mask.as_raw()[y * w + x] != 0;
    let mut levels = vec![255_u8; w * h];
    levels.par_chunks_mut(w.max(1)).enumerate().for_each(|(y, row)| {
        if !mask.as_raw()[y * w..(y + 1) * w].iter().any(|level| *level != 0) {
            return;
        }
        for (x, level) in row.iter_mut().enumerate() {
            if !inside(x, y) {
                continue;
            }
            let at = |dx: i64, dy: i64| {
                let u = (x as i64 + dx).clamp(0, w as i64 - 1) as usize;
                let v = (y as i64 + dy).clamp(0, h as i64 - 1) as usize;
                (u, v)
            };
            let d = edge_px as i64;
            let boundary = [(d, 0), (-d, 0), (0, d), (0, -d)].iter().any(|&(dx, dy)| {
                let (u, v) = at(dx, dy);
                let out = x as i64 + dx != u as i64 || y as i64 + dy != v as i64;
                out || !inside(u, v)
            });
            if boundary {
                *level = 0;
                continue;
            }
            let own = luma(pixel(x, y));
            let far = apart as i64;
            let mut line = 0.0_f32;
            let mut edge = 0.0_f32;
            for (dx, dy) in [(1, 0), (0, 1), (1, 1), (1, -1)] {
                let (a, b) = (at(dx * far, dy * far), at(-dx * far, -dy * far));
                let both = luma(pixel(a.0, a.1)).min(luma(pixel(b.0, b.1)));
                line = line.max(both - own);
                if dx * dy == 0 {
                    let s = step as i64;
                    let (a, b) = (at(dx * s, dy * s), at(-dx * s, -dy * s));
                    if inside(a.0, a.1) && inside(b.0, b.1) {
                        let (p, q) = (pixel(a.0, a.1), pixel(b.0, b.1));
                        let off = (0..3).map(|c| p[c].abs_diff(q[c])).max().unwrap_or(0);
                        // Beside a dark line the edge is the line's own.
                        let across = at(dx * far * 2, dy * far * 2);
                        let back = at(-dx * far * 2, -dy * far * 2);
                        let (p, q) = (pixel(across.0, across.1), pixel(back.0, back.1));
                        let sides = (0..3).map(|c| p[c].abs_diff(q[c])).max().unwrap_or(0);
                        edge = edge.max(f32::from(off.min(sides)));
                    }
                }
            }
            let line = ((line - EDGE_NONE) / (LINE_FULL - EDGE_NONE)).clamp(0.0, 1.0);
            let edge = ((edge - EDGE_NONE) / (EDGE_FULL - EDGE_NONE)).clamp(0.0, 1.0);
            *level = (255.0 * (1.0 - line.max(edge))).round() as u8;
        }
    });
    GrayImage::from_raw(w as u32, h as u32, levels).unwrap_or_default()
}

/// The drawing's colours where the mask is, transparent elsewhere.
pub(crate) fn cut_out(drawing: &RgbaImage, opaque: &RgbaImage, mask: &GrayImage) -> RgbaImage {
    let mut bytes = vec![0_u8; drawing.as_raw().len()];
    let rows = bytes.par_chunks_mut(1 << 14).zip(opaque.as_raw().par_chunks(1 << 14));
    rows.zip(mask.as_raw().par_chunks(1 << 12)).for_each(|((bytes, from), mask)| {
        let pixels = bytes.chunks_exact_mut(4).zip(from.chunks_exact(4));
        for ((to, from), mask) in pixels.zip(mask).filter(|(_, mask)| **mask != 0) {
            to.copy_from_slice(&[from[0], from[1], from[2], *mask]);
        }
    });
    RgbaImage::from_raw(drawing.width(), drawing.height(), bytes).unwrap_or_default()
}
