//! Figures put together of painted pieces with seams of paper between them:
//! charts of muscles, cut paper, stained glass.

use crate::raster::{Bits, Component, Components, filled};
use crate::structure::figure_size;

/// A mosaic has so many pieces.
const PIECES: usize = 12;
/// None of them has more of the area,
const LARGEST: f64 = 0.35;
/// or of the figure's height: poses in rows are no pieces.
const TALLEST: f64 = 0.5;
/// The middle one is so much smaller than the largest: rows of sprites are of one size.
const MIDDLE: f64 = 0.25;
/// With its seams shut it has so little more area.
const SEAMS: f64 = 0.45;
/// And is most of what it encloses, or it is an outline whose strokes lie side by side.
const COVERS: f64 = 0.6;
/// Seams are shut from the width on that joins so much of the pieces,
const JOINED: f64 = 0.8;
/// and this much wider ones as well: seams vary.
const VARY: f64 = 1.6;
/// And are at most so wide, share of the figure's size.
const WIDEST: f64 = 0.02;

/// The mosaics among `painted` areas, each as one piece with its seams shut; nothing else.
///
/// * `reach`: pieces further apart are not of one figure, px.
pub fn figures(painted: &Bits, reach: f64) -> Bits {
    let mut all = Bits::filled(painted.width, painted.height, false);
    let parts = painted.components(true);
    if parts.parts.len() < PIECES {
        return all;
    }
    let near = painted.dilated((reach / 2.0) as f32).components(true);
    let mut of = vec![0; parts.parts.len()];
    for (label, owner) in parts.labels.iter().zip(&near.labels).filter(|(label, _)| **label != 0) {
        of[*label as usize - 1] = *owner as usize;
    }
    let mut pieces: Vec<Vec<usize>> = vec![Vec::new(); near.parts.len() + 1];
    of.iter().enumerate().for_each(|(k, owner)| pieces[*owner].push(k));
    for own in pieces.iter().filter(|own| own.len() >= PIECES) {
        if is_mosaic(own, &parts.parts)
            && let Some(whole) = shut(own, &parts, painted)
        {
            all = all.or(&whole);
        }
    }
    all
}

fn is_mosaic(own: &[usize], parts: &[Component]) -> bool {
    let mut areas: Vec<usize> = own.iter().map(|&k| parts[k].area).collect();
    areas.sort_unstable();
    let (largest, total) = (areas[areas.len() - 1] as f64, areas.iter().sum::<usize>() as f64);
    let bounds = own.iter().map(|&k| parts[k].bounds).reduce(|a, b| a.joined(&b));
    let height = f64::from(bounds.unwrap_or_default().height());
    largest <= LARGEST * total
        && areas[areas.len() / 2] as f64 <= MIDDLE * largest
        && own.iter().all(|&k| f64::from(parts[k].bounds.height()) <= TALLEST * height)
}

/// `own` pieces with the seams between them, as narrow as joins nearly all; `None` if that takes
/// too much paper.
fn shut(own: &[usize], parts: &Components, painted: &Bits) -> Option<Bits> {
    let bounds = own.iter().map(|&k| parts.parts[k].bounds).reduce(|a, b| a.joined(&b))?;
    let widest = WIDEST * figure_size(&bounds) / 2.0;
    let is_own: std::collections::BTreeSet<usize> = own.iter().copied().collect();
    let pieces = parts.select(painted.width, |k| is_own.contains(&k));
    let area = pieces.count() as f64;
    let radii = std::iter::successors(Some(1.0), |radius| Some(radius * 1.3));
    for radius in radii.take_while(|radius| *radius <= widest.max(1.0)) {
        let wide = pieces.dilated(radius as f32);
        let joined = wide.components(true);
        let mut areas = vec![0_usize; joined.parts.len() + 1];
        let labels = joined.labels.iter().zip(&pieces.data).filter(|(_, is)| **is);
        labels.for_each(|(label, _)| areas[*label as usize] += 1);
        let largest = areas.iter().max().copied().unwrap_or(0) as f64;
        if largest >= JOINED * area {
            let radius = (VARY * radius) as f32;
            let whole = filled_narrow(&pieces.closed(radius).or(&pieces), radius);
            let covered = whole.count() as f64;
            let is_one = covered <= (1.0 + SEAMS) * area
                && covered >= COVERS * filled(&whole).count() as f64;
            return is_one.then_some(whole);
        }
    }
    None
}

/// Fills holes that vanish when their edge moves in by twice `radius`: where several seams meet.
fn filled_narrow(bits: &Bits, radius: f32) -> Bits {
    let holes = filled(bits).and_not(bits);
    let wide = holes.eroded(2.0 * radius);
    let parts = holes.components(false);
    let mut is_wide = vec![false; parts.parts.len()];
    for (label, _) in
        parts.labels.iter().zip(&wide.data).filter(|(label, wide)| **label != 0 && **wide)
    {
        is_wide[*label as usize - 1] = true;
    }
    bits.clone().or(&parts.select(bits.width, |k| !is_wide[k]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tiles of `sizes` in rows, `gap` px apart.
    fn tiles(rows: &[&[usize]], high: usize, gap: usize) -> Bits {
        let mut bits = Bits::filled(500, 500, false);
        for (row, sizes) in rows.iter().enumerate() {
            let mut left = 40;
            for size in *sizes {
                for y in 0..high {
                    (0..*size).for_each(|x| {
                        bits.set((left + x) as i64, (40 + row * (high + gap) + y) as i64, true);
                    });
                }
                left += size + gap;
            }
        }
        bits
    }

    const UNEVEN: [&[usize]; 4] = [&[8, 90, 10], &[50, 8, 9, 45], &[10, 94, 8], &[8, 9, 50, 40]];

    #[test]
    fn uneven_pieces_with_narrow_seams_are_one() {
        let pieces = tiles(&UNEVEN, 90, 4);
        assert_eq!(pieces.components(true).parts.len(), 14);
        let whole = figures(&pieces, 8.0);
        assert_eq!(whole.components(true).parts.len(), 1);
        assert_eq!(pieces.and_not(&whole).count(), 0);
    }

    #[test]
    fn seams_are_shut_within_a_figure_not_to_the_border() {
        let mut near = Bits::filled(60, 40, false);
        (10..30).for_each(|y| (3..55).filter(|x| x % 10 != 0).for_each(|x| near.set(x, y, true)));
        let whole = near.closed(6.0);
        assert!(near.bounds() == whole.bounds() && whole.at(20, 20));
    }

    #[test]
    fn pieces_of_an_outline_are_no_figure() {
        let mut ring = Bits::filled(400, 400, false);
        let mut along = 40;
        for size in [8, 110, 8, 9, 90, 8, 10, 8] {
            for (k, across) in (along..along + size).flat_map(|k| (0..12).map(move |a| (k, a))) {
                let (near, far) = (40 + across, 310 + across);
                for (x, y) in [(k, near), (k, far), (near, k), (far, k)] {
                    ring.set(x, y, true);
                }
            }
            along += size + 3;
        }
        assert!(ring.components(true).parts.len() > PIECES);
        assert_eq!(figures(&ring, 20.0).count(), 0);
    }

    #[test]
    fn sprites_in_rows_and_pieces_far_apart_are_not() {
        let even: [&[usize]; 4] = [&[30; 4]; 4];
        assert_eq!(figures(&tiles(&even, 90, 4), 8.0).count(), 0);
        assert_eq!(figures(&tiles(&UNEVEN, 90, 14), 8.0).count(), 0);
        assert_eq!(figures(&tiles(&UNEVEN[..2], 180, 4), 8.0).count(), 0);
    }
}
