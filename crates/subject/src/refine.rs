//! From the subject at working size to its mask at full size.

use image::GrayImage;
use rayon::prelude::*;

use crate::options::Hints;
use crate::raster::{Bits, grown};
use crate::structure::Structure;
use crate::subject::image_of;
use crate::tone::Tone;

const INSIDE: u8 = 255;
const OUTSIDE: u8 = 0;
const OPEN: u8 = 1;
const SWEEPS: usize = 12;

/// The mask of a drawing: pixels clearly inside or outside at working size
/// stay so; between, paper floods in from outside up to the strokes.
pub(crate) fn boundary(tone: &Tone<'_>, structure: &Structure, hints: &Hints) -> GrayImage {
    let factor = structure.factor;
    let mut mask = if factor == 1 { image_of(&structure.inside) } else { banded(tone, structure) };
    if factor > 1 {
        flood_band(&mut mask);
    }
    erase(&mut mask, hints);
    mask
}

fn banded(tone: &Tone<'_>, structure: &Structure) -> GrayImage {
    let (w, h) = tone.size();
    let factor = structure.factor;
    let inside = &structure.inside;
    let sure_inside = grown(&inside.not()).not();
    let sure_outside = grown(inside).not();
    let cleared = grown(&structure.cleared);
    let rw = inside.width;
    let mut levels = vec![OUTSIDE; w * h];
    levels.par_chunks_mut(w.max(1)).enumerate().for_each(|(y, row)| {
        let at = y / factor * rw;
        let cells = at..at + rw;
        if sure_outside.data[cells.clone()].iter().all(|is| *is) {
            return;
        }
        let (pixels, paper) = tone.row(y);
        for (x, level) in row.iter_mut().enumerate() {
            let cell = at + x / factor;
            if sure_inside.data[cell] {
                *level = INSIDE;
            } else if !sure_outside.data[cell] {
                let pixel = &pixels[x * 4..];
                let drawn = structure.bridged.data[cell]
                    || (!cleared.data[cell] || inside.data[cell])
                        && (tone.share(pixel, &paper, x) > tone.threshold
                            || structure
                                .colour_from
                                .is_some_and(|from| tone.difference(pixel, &paper, x) > from));
                *level = if drawn { INSIDE } else { OPEN };
            }
        }
    });
    GrayImage::from_raw(w as u32, h as u32, levels).unwrap_or_default()
}

/// Lets the outside flood open pixels; those that it does not reach are inside.
fn flood_band(mask: &mut GrayImage) {
    let (w, h) = (mask.width() as usize, mask.height() as usize);
    let data: &mut [u8] = mask;
    for _ in 0..SWEEPS {
        let mut changed = false;
        for down in [true, false] {
            for k in 0..h {
                let y = if down { k } else { h - 1 - k };
                let (before, rest) = data.split_at_mut(y * w);
                let (row, after) = rest.split_at_mut(w);
                if !row.contains(&OPEN) {
                    continue;
                }
                let beside: &[u8] = match (down, y) {
                    (true, 0) => &[],
                    (true, _) => &before[(y - 1) * w..],
                    (false, _) if y + 1 == h => &[],
                    (false, _) => &after[..w],
                };
                for x in 0..w {
                    let open = row[x] == OPEN;
                    let near = (x > 0 && row[x - 1] == OUTSIDE) || beside.get(x) == Some(&OUTSIDE);
                    if open && (near || (x == 0 && row[x] == OUTSIDE)) {
                        row[x] = OUTSIDE;
                        changed = true;
                    }
                }
                for x in (0..w.saturating_sub(1)).rev() {
                    if row[x] == OPEN && row[x + 1] == OUTSIDE {
                        row[x] = OUTSIDE;
                        changed = true;
                    }
                }
            }
        }
        if !changed {
            break;
        }
    }
    data.par_iter_mut().filter(|level| **level == OPEN).for_each(|level| *level = INSIDE);
}

/// Of a known mask the pieces that were kept.
pub(crate) fn selected(mask: &GrayImage, structure: &Structure, hints: &Hints) -> GrayImage {
    let factor = structure.factor;
    let kept: Bits = grown(&structure.inside);
    let all_kept = structure.cleared.count() == 0
        && structure.pieces.iter().all(|piece| piece.role != crate::report::PieceRole::Dropped)
        && structure.removed.is_empty();
    let (w, rw) = (mask.width() as usize, kept.width);
    let level = |(index, level): (usize, &u8)| {
        let (x, y) = (index % w, index / w);
        let cell = y / factor * rw + x / factor;
        let cleared = structure.cleared.data[cell] && !structure.inside.data[cell];
        let wanted = all_kept || (kept.data[cell] && !cleared);
        let shut = structure.bridged.data[cell] && structure.inside.data[cell];
        if (*level >= 128 && wanted) || shut { INSIDE } else { OUTSIDE }
    };
    let levels = mask.as_raw().par_iter().enumerate().map(level).collect();
    let mut mask = GrayImage::from_raw(mask.width(), mask.height(), levels).unwrap_or_default();
    erase(&mut mask, hints);
    mask
}

fn erase(mask: &mut GrayImage, hints: &Hints) {
    if hints.erase.is_empty() {
        return;
    }
    let (w, h) = (mask.width() as usize, mask.height() as usize);
    let mut area = Bits::filled(w, h, false);
    hints.erase.iter().for_each(|polygon| area.fill_polygon(polygon, true));
    mask.iter_mut()
        .zip(&area.data)
        .filter(|(_, erased)| **erased)
        .for_each(|(level, _)| *level = 0);
}
