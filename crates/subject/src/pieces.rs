//! Which connected parts of a silhouette belong to the subject.

use crate::options::Hints;
use crate::raster::Bits;
use crate::report::{Box2, Piece, PieceRole, Point, Removed, RemovedKind, Warning};
use crate::structure::figure_size;

/// Parts smaller than this are dirt, share of the figure's size.
const SPECK: f64 = 0.006;
/// A part with at least this share of the largest one's area is the subject's
/// wherever it is, unless it touches the page's border.
const LARGE: f64 = 0.25;
/// Dropping more than this share of the area is worth a word.
const NOTABLE: f64 = 0.02;
/// A subject of which the largest part has less is scattered.
const SCATTERED: f64 = 0.5;

pub(crate) struct Decided {
    pub(crate) kept: Bits,
    pub(crate) pieces: Vec<Piece>,
    pub(crate) specks: Vec<Removed>,
    pub(crate) warnings: Vec<Warning>,
}

/// Keeps the largest part and, one after another, those near what is kept.
pub(crate) fn decide(inside: &Bits, hints: &Hints, factor: usize, reach: f64) -> Decided {
    let parts = inside.components(true);
    let mut order: Vec<usize> = (0..parts.parts.len()).collect();
    order.sort_by_key(|&k| (std::cmp::Reverse(parts.parts[k].area), k));
    let none = Decided {
        kept: inside.clone(),
        pieces: Vec::new(),
        specks: Vec::new(),
        warnings: Vec::new(),
    };
    let Some(&main) = order.first() else { return none };
    let mut size = figure_size(&parts.parts[main].bounds);
    let width = inside.width;
    let at = |p: &Point| {
        let (x, y) = ((p.x / factor as f64) as i64, (p.y / factor as f64) as i64);
        let on_page = x >= 0 && y >= 0 && (x as usize) < width && (y as usize) < inside.height;
        let label = if on_page { parts.labels[y as usize * width + x as usize] } else { 0 };
        (label as usize).checked_sub(1)
    };
    let said = |points: &[Point]| points.iter().filter_map(at).collect::<Vec<usize>>();
    let (attached, ignored) = (said(&hints.attach), said(&hints.ignore));
    let mut warnings: Vec<Warning> = Vec::new();
    for point in hints.attach.iter().chain(&hints.ignore).filter(|p| at(p).is_none()) {
        warnings.push(Warning::HintMissed { point: *point });
    }
    let main = order.iter().copied().find(|k| !ignored.contains(k)).unwrap_or(main);
    let speck = ((SPECK * size).powi(2)).max(1.5);
    let mut kept = vec![false; parts.parts.len()];
    kept[main] = true;
    attached.iter().for_each(|&k| kept[k] = true);
    let on_border = |b: &Box2| {
        b.left == 0 || b.top == 0 || b.right as usize >= width || b.bottom as usize >= inside.height
    };
    let is_speck = |k: usize| {
        let part = &parts.parts[k];
        part.area as f64 <= speck
    };
    for &k in &order {
        let part = &parts.parts[k];
        let large = part.area as f64 >= LARGE * parts.parts[main].area as f64;
        kept[k] |= large && !on_border(&part.bounds) && !ignored.contains(&k);
    }
    // Chains of near pieces: from the largest on, until nothing changes.
    for _ in 0..12 {
        let distance = parts.select(width, |k| kept[k]).distance();
        let mut nearest = vec![f32::MAX; parts.parts.len()];
        for (i, &label) in parts.labels.iter().enumerate().filter(|(_, label)| **label != 0) {
            let own = &mut nearest[label as usize - 1];
            *own = own.min(distance.data[i]);
        }
        let mut changed = false;
        for &k in &order {
            let near = f64::from(nearest[k]) <= reach * size;
            // A neighbour's part reaches in from the border.
            let foreign = on_border(&parts.parts[k].bounds) && f64::from(nearest[k]) > 0.03 * size;
            if !kept[k] && near && !foreign && !is_speck(k) && !ignored.contains(&k) {
                (kept[k], changed) = (true, true);
            }
        }
        // A figure of many parts is as large as what is kept of it.
        let bounds = (0..kept.len()).filter(|&k| kept[k]).map(|k| parts.parts[k].bounds);
        size = bounds.reduce(|a, b| a.joined(&b)).map_or(size, |all| figure_size(&all));
        if !changed {
            break;
        }
    }
    let total: usize = order.iter().filter(|&&k| kept[k]).map(|&k| parts.parts[k].area).sum();
    let mut pieces = Vec::new();
    let mut specks = Vec::new();
    for &k in &order {
        let part = &parts.parts[k];
        if !kept[k] && is_speck(k) {
            if specks.len() < 64 {
                specks.push(Removed { kind: RemovedKind::Speck, place: part.bounds });
            }
            continue;
        }
        let role = match (k == main, kept[k]) {
            (true, _) => PieceRole::Main,
            (_, true) => PieceRole::Attached,
            _ => PieceRole::Dropped,
        };
        pieces.push(Piece { role, place: part.bounds, area_px: part.area as u64 });
        let share = part.area as f64 / total.max(1) as f64;
        if !kept[k] && share >= NOTABLE && !ignored.contains(&k) {
            warnings.push(Warning::PieceDropped { place: part.bounds, share });
        }
    }
    let main_share = parts.parts[main].area as f64 / total.max(1) as f64;
    let count = kept.iter().filter(|is| **is).count();
    if main_share < SCATTERED && count > 3 {
        warnings.push(Warning::Scattered { pieces: count, main_share });
    }
    Decided { kept: parts.select(width, |k| kept[k]), pieces, specks, warnings }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page() -> Bits {
        let mut bits = Bits::filled(200, 200, false);
        let mut block = |x0: i64, y0: i64, w: i64, h: i64| {
            (y0..y0 + h).for_each(|y| (x0..x0 + w).for_each(|x| bits.set(x, y, true)));
        };
        block(60, 40, 60, 100);
        block(124, 60, 8, 8);
        block(180, 180, 12, 12);
        block(10, 10, 1, 1);
        bits
    }

    #[test]
    fn near_pieces_stay_and_far_ones_go() {
        let decided = decide(&page(), &Hints::default(), 1, 0.1);
        let roles: Vec<PieceRole> = decided.pieces.iter().map(|piece| piece.role).collect();
        assert_eq!(roles, [PieceRole::Main, PieceRole::Dropped, PieceRole::Attached]);
        assert_eq!(decided.specks.len(), 1);
        assert_eq!(decided.kept.count(), 6000 + 64);
    }

    #[test]
    fn hints_decide() {
        let hints = Hints {
            attach: vec![Point { x: 185.0, y: 185.0 }, Point { x: 5.0, y: 100.0 }],
            ignore: vec![Point { x: 126.0, y: 64.0 }],
            ..Hints::default()
        };
        let decided = decide(&page(), &hints, 1, 0.1);
        assert_eq!(decided.kept.count(), 6000 + 144);
        assert!(matches!(decided.warnings[..], [Warning::HintMissed { .. }]));
    }
}
