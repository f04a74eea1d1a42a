//! Drawings that touch, cut at the neck of the join.

use subject::Box2;
use subject::raster::Bits;

use crate::blobs::{Blob, Blobs};
use crate::select::agreement;
use crate::shape::Profile;

/// Only drawings at least this tall are cut, share of the figures' height.
const TALL: f64 = 0.6;
/// A drawing is too wide for one view if it is so many times as wide as others.
const WIDE: f64 = 1.4;
/// A cut is at most this long, share of the height.
const NECK: f64 = 0.12;
/// Each side of a cut has at least this share of the height and of the area.
const LEAST_HEIGHT: f64 = 0.62;
const LEAST_AREA: f64 = 0.25;
/// Cuts are looked for between these shares of the width.
const MIDDLE: (f64, f64) = (0.15, 0.85);
/// Alike enough to be two views, if nothing else is there to compare with.
const ALIKE: f64 = 0.55;
const ROUNDS: usize = 8;

/// Cuts drawings that are several views joined; `size` is the figures' height.
pub(crate) fn cut(blobs: &mut Blobs, size: f64) {
    for _ in 0..ROUNDS {
        let mut any = false;
        for index in 0..blobs.list.len() {
            any |= cut_one(blobs, index, size);
        }
        if !any {
            break;
        }
    }
}

fn cut_one(blobs: &mut Blobs, index: usize, size: f64) -> bool {
    let own = blobs.list[index];
    if f64::from(own.bounds.height()) < TALL * size || own.bounds.width() < 12 {
        return false;
    }
    let width = f64::from(own.bounds.width());
    let mut others: Vec<f64> = (0..blobs.list.len())
        .filter(|&k| k != index && f64::from(blobs.list[k].bounds.height()) >= TALL * size)
        .map(|k| f64::from(blobs.list[k].bounds.width()))
        .collect();
    others.sort_by(f64::total_cmp);
    let alone = others.is_empty();
    let least = match others.get(others.len() / 2) {
        Some(usual) => WIDE * usual,
        _ => f64::from(own.bounds.height()),
    };
    if width < least {
        return false;
    }
    let bits = blobs.pixels(index, 0);
    let Some((seam, length)) = seam(&bits) else { return false };
    if length as f64 > NECK * f64::from(own.bounds.height()) {
        return false;
    }
    let sides = [true, false].map(|left| side(&bits, &seam, left));
    let total = bits.count() as f64;
    let mut blobs_of = Vec::new();
    for bits in &sides {
        let Some(bounds) = bits.bounds() else { return false };
        let large = f64::from(bounds.height()) >= LEAST_HEIGHT * f64::from(own.bounds.height());
        if !large || (bits.count() as f64) < LEAST_AREA * total {
            return false;
        }
        blobs_of.push(Blob { bounds: moved(&bounds, &own.bounds), area: bits.count() });
    }
    let profiles: Vec<Profile> = sides.iter().filter_map(Profile::of).collect();
    if alone && (profiles.len() < 2 || agreement(&profiles[0], &profiles[1]) < ALIKE) {
        return false;
    }
    let new = blobs.list.len() as u16 + 1;
    for y in 0..bits.height {
        let from = (y + own.bounds.top as usize) * blobs.owners.width + own.bounds.left as usize;
        for x in 0..bits.width {
            if sides[1].data[y * bits.width + x] {
                blobs.owners.data[from + x] = new;
            }
        }
    }
    blobs.list[index] = blobs_of[0];
    blobs.list.push(blobs_of[1]);
    true
}

fn moved(b: &Box2, to: &Box2) -> Box2 {
    Box2 {
        left: b.left + to.left,
        right: b.right + to.left,
        top: b.top + to.top,
        bottom: b.bottom + to.top,
    }
}

fn side(bits: &Bits, seam: &[usize], left: bool) -> Bits {
    let mut part = bits.clone();
    for (y, row) in part.data.chunks_exact_mut(bits.width).enumerate() {
        let (before, after) = row.split_at_mut(seam[y]);
        if left { after.fill(false) } else { before.fill(false) }
    }
    part
}

/// The path from top to bottom through the middle that crosses the fewest set
/// pixels, as the first column right of it in each row, and how many it crosses.
fn seam(bits: &Bits) -> Option<(Vec<usize>, u32)> {
    let (w, h) = (bits.width, bits.height);
    let (from, to) = ((MIDDLE.0 * w as f64) as usize, (MIDDLE.1 * w as f64) as usize);
    if to < from + 4 || h == 0 {
        return None;
    }
    let count = to - from;
    // A step aside costs a little, so that paths are straight where they can be.
    const SET: u32 = 16;
    let cost = |y: usize, k: usize| SET * u32::from(bits.data[y * w + from + k]);
    let mut sums: Vec<u32> = (0..count).map(|k| cost(0, k)).collect();
    let mut steps: Vec<Vec<i8>> = Vec::with_capacity(h);
    for y in 1..h {
        let mut next = vec![0; count];
        let mut step = vec![0_i8; count];
        for k in 0..count {
            let mut best = (sums[k], 0_i8);
            if k > 0 && sums[k - 1] + 1 < best.0 {
                best = (sums[k - 1] + 1, -1);
            }
            if k + 1 < count && sums[k + 1] + 1 < best.0 {
                best = (sums[k + 1] + 1, 1);
            }
            next[k] = best.0 + cost(y, k);
            step[k] = best.1;
        }
        sums = next;
        steps.push(step);
    }
    // Of equally good ends the middle one: the join is cut halfway along.
    let least = *sums.iter().min()?;
    let ends: Vec<usize> = (0..count).filter(|&k| sums[k] == least).collect();
    let mut k = ends[ends.len() / 2];
    let mut seam = vec![0; h];
    for y in (0..h).rev() {
        seam[y] = from + k;
        if y > 0 {
            k = (k as i64 + i64::from(steps[y - 1][k])) as usize;
        }
    }
    let crossed = (0..h).filter(|&y| bits.data[y * w + seam[y]]).count() as u32;
    Some((seam, crossed))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_figures_hand_in_hand_are_cut_and_a_table_among_tables_is_not() {
        let mut bits = Bits::filled(400, 220, false);
        let mut block = |x0: i64, y0: i64, w: i64, h: i64| {
            (y0..y0 + h).for_each(|y| (x0..x0 + w).for_each(|x| bits.set(x, y, true)));
        };
        for left in [10, 120, 300] {
            block(left, 10, 40, 200);
        }
        block(50, 100, 70, 8);
        block(230, 10, 40, 200);
        let mut blobs = Blobs::of(&bits, 200.0);
        assert_eq!(blobs.list.len(), 3);
        cut(&mut blobs, 200.0);
        assert_eq!(blobs.list.len(), 4);
        assert!(blobs.list.iter().all(|blob| blob.bounds.width() <= 90));
        let mut tables = Bits::filled(500, 100, false);
        for left in [10, 180, 350] {
            for x in left..left + 120_i64 {
                (10..18).for_each(|y| tables.set(x, y, true));
            }
            for x in (left..left + 8).chain(left + 112..left + 120) {
                (10..90).for_each(|y| tables.set(x, y, true));
            }
        }
        let mut blobs = Blobs::of(&tables, 80.0);
        cut(&mut blobs, 80.0);
        assert_eq!(blobs.list.len(), 3);
    }
}
