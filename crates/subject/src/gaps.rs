//! Gaps in outlines: where a stroke ends and, straight on or round a bend,
//! another goes on.
//!
//! Ends are joined in pairs by curves along their tangents. A curve counts
//! only where it shuts in an area that is wide for it, so that slits, which lie
//! between strokes' sides, stay open, and creases that end inside change nothing.

use std::collections::HashSet;

use crate::raster::{Bits, filled, grown};
use crate::strokes::{self, End};

/// A drawing with more ends is not one of lines.
const MAX_ENDS: usize = 6000;
/// How far two ends may turn towards each other in all, degrees.
const FACING_TURN_DEG: f64 = 80.0;
/// And at a corner.
const CORNER_TURN_DEG: f64 = 205.0;
/// What a degree of turn costs, share of the gap.
const TURN_COST: f64 = 0.014;
/// Second partners of an end, and what they may cost in terms of the first.
const MORE: usize = 3;
const MORE_COST: f64 = 8.0;
/// How far to the side an end may meet a stroke's side, degrees.
const FAN_DEG: f64 = 50.0;
/// An area counts if it is so many times as deep as the gap is wide: joined by
/// ends that face each other, and by others.
const DEPTH_FACING: f64 = 0.22;
const DEPTH_OTHER: f64 = 0.55;
/// The same of a large area, of more than a share of the gap squared: limbs that
/// have lost their tips are narrow.
const DEPTH_LARGE: f64 = 0.15;
const LARGE: f64 = 0.25;

/// What hangs together with an end within so many stroke widths, and px, is its own stroke.
const OWN: f64 = 2.0;
const LEAST_OWN_PX: f64 = 6.0;

/// A curve that joins two ends, or an end and a stroke's side.
#[derive(Clone, Debug)]
pub(crate) struct Bridge {
    pub(crate) pixels: Vec<usize>,
    pub(crate) width_px: f64,
    pub(crate) middle: (f64, f64),
    facing: bool,
    /// 0 for ends that face each other and are each other's best, 1 for other
    /// best partners, 2 for what else may be.
    rank: u8,
}

/// An outline with its gaps closed.
pub(crate) struct Closed {
    /// What the outline encloses, with its strokes.
    pub(crate) inside: Bits,
    /// The ink with the curves that count.
    pub(crate) barrier: Bits,
    /// The curves that count.
    pub(crate) bridges: Vec<Bridge>,
}

/// Closes gaps of up to `max_gap_px` in `barrier` where that shuts in at least
/// `least_area_px`.
///
/// * `lines`: the part of `barrier` that is strokes.
pub(crate) fn close(
    barrier: &Bits,
    lines: &Bits,
    stroke_px: f64,
    max_gap_px: f64,
    least_area_px: usize,
) -> Closed {
    let open = filled(barrier);
    let unchanged = |inside: Bits| Closed { inside, barrier: barrier.clone(), bridges: Vec::new() };
    if max_gap_px < 1.0 {
        return unchanged(open);
    }
    let ends = strokes::ends(lines, stroke_px);
    let margin = stroke_px + 1.0;
    let (w, h) = (barrier.width as f64, barrier.height as f64);
    let ends: Vec<End> = ends
        .into_iter()
        .filter(|end| {
            let inner =
                end.x > margin && end.y > margin && end.x < w - margin && end.y < h - margin;
            inner && is_outside(&open, end, stroke_px)
        })
        .collect();
    if ends.is_empty() || ends.len() > MAX_ENDS {
        return unchanged(open);
    }
    let candidates = candidates(&ends, barrier, stroke_px, max_gap_px);
    let mut closed = Closed { inside: open, barrier: barrier.clone(), bridges: Vec::new() };
    // Facing ends first: corners and stroke sides must add to what they enclose.
    for rank in 0..3 {
        let stage: Vec<&Bridge> = candidates.iter().filter(|b| b.rank <= rank).collect();
        closed.add(&stage, least_area_px);
    }
    closed
}

/// Whether paper from outside comes near an end.
fn is_outside(inside: &Bits, end: &End, stroke_px: f64) -> bool {
    let reach = (stroke_px + 2.0) as i64;
    let (x, y) = (end.x as i64, end.y as i64);
    let near = |d: i64| x + d < 0 || x + d >= inside.width as i64;
    (-reach..=reach).any(|dy| {
        (-reach..=reach).any(|dx| {
            near(dx) || y + dy < 0 || y + dy >= inside.height as i64 || !inside.at(x + dx, y + dy)
        })
    })
}

impl Closed {
    /// Takes those of `stage` that shut in wide areas.
    fn add(&mut self, stage: &[&Bridge], least_area_px: usize) {
        let mut with = self.barrier.clone();
        stage.iter().for_each(|b| b.pixels.iter().for_each(|&i| with.data[i] = true));
        let inside = filled(&with);
        let gained = inside.clone().and_not(&self.inside).and_not(&with);
        if gained.count() == 0 {
            return;
        }
        let depth = with.distance();
        let regions = gained.components(false);
        let (w, h) = (with.width as i64, with.height as i64);
        let outside = inside.not();
        // For each region the widest curve between it and the outside.
        let mut borders: Vec<Vec<usize>> = vec![Vec::new(); regions.parts.len()];
        for (k, bridge) in stage.iter().enumerate() {
            let mut touched: Vec<u32> = Vec::new();
            let mut open = false;
            for &i in &bridge.pixels {
                let (x, y) = (i as i64 % w, i as i64 / w);
                for (dx, dy) in AROUND {
                    let (x, y) = (x + dx, y + dy);
                    if x < 0 || y < 0 || x >= w || y >= h {
                        continue;
                    }
                    let at = (y * w + x) as usize;
                    let label = regions.labels[at];
                    if label != 0 && !touched.contains(&label) {
                        touched.push(label);
                    }
                    open |= outside.data[at];
                }
            }
            if open {
                touched.iter().for_each(|&label| borders[label as usize - 1].push(k));
            }
        }
        let mut depths = vec![0.0_f32; regions.parts.len()];
        for (i, &label) in regions.labels.iter().enumerate().filter(|(_, label)| **label != 0) {
            let own = &mut depths[label as usize - 1];
            *own = own.max(depth.data[i]);
        }
        let is_wide = |k: usize| {
            let area = regions.parts[k].area as f64;
            let needed = borders[k].iter().map(|&b| {
                let bridge = stage[b];
                let large = area >= LARGE * bridge.width_px.powi(2);
                let depth = match (bridge.facing, large) {
                    (true, _) => DEPTH_FACING,
                    (false, true) => DEPTH_LARGE,
                    (false, false) => DEPTH_OTHER,
                };
                bridge.width_px * depth
            });
            let needed = needed.fold(1.0, f64::max);
            f64::from(depths[k]) >= needed && regions.parts[k].area >= least_area_px
        };
        let kept: Vec<bool> = (0..regions.parts.len()).map(is_wide).collect();
        let mut used = vec![false; stage.len()];
        for (k, border) in borders.iter().enumerate().filter(|(k, _)| kept[*k]) {
            let _ = k;
            border.iter().for_each(|&b| used[b] = true);
        }
        let mut barrier = self.barrier.clone();
        for (bridge, _) in stage.iter().zip(&used).filter(|(_, used)| **used) {
            bridge.pixels.iter().for_each(|&i| barrier.data[i] = true);
        }
        // Curves that only shut in slivers were left out: look again.
        let region = regions.select(with.width, |k| kept[k]);
        let again = filled(&barrier);
        let mut inside = self.inside.clone().or(&grown(&region)).or(&barrier);
        let leaks = region.and_not(&again).count();
        if leaks == 0 {
            inside = self.inside.clone().or(&again);
        }
        self.inside = inside;
        self.barrier = barrier;
        let taken = stage.iter().zip(&used).filter(|(_, used)| **used).map(|(b, _)| (*b).clone());
        for bridge in taken {
            let known = self.bridges.iter().any(|other| other.pixels == bridge.pixels);
            if !known {
                self.bridges.push(bridge);
            }
        }
    }
}

const AROUND: [(i64, i64); 24] = {
    let mut around = [(0, 0); 24];
    let (mut k, mut n) = (0, 0);
    while k < 25 {
        if k != 12 {
            around[n] = (k % 5 - 2, k / 5 - 2);
            n += 1;
        }
        k += 1;
    }
    around
};

/// Curves between ends, cheapest partners first, and from what is left to the
/// nearest stroke in front.
fn candidates(ends: &[End], barrier: &Bits, stroke_px: f64, max_gap_px: f64) -> Vec<Bridge> {
    let mut pairs: Vec<(f64, bool, usize, usize)> = Vec::new();
    let mut order: Vec<usize> = (0..ends.len()).collect();
    order.sort_by(|&a, &b| ends[a].x.total_cmp(&ends[b].x));
    for (k, &a) in order.iter().enumerate() {
        for &b in order[k + 1..].iter().take_while(|&&b| ends[b].x - ends[a].x <= max_gap_px) {
            let gap = ends[a].to(ends[b].x, ends[b].y);
            if gap > max_gap_px || gap < 1.0 {
                continue;
            }
            let turns =
                (ends[a].turn_deg(ends[b].x, ends[b].y), ends[b].turn_deg(ends[a].x, ends[a].y));
            let turn = turns.0 + turns.1;
            let near = gap <= 3.0 * stroke_px;
            let facing = turn <= FACING_TURN_DEG || near;
            if turn <= CORNER_TURN_DEG && turns.0.max(turns.1) <= 110.0 || near {
                pairs.push((gap * (1.0 + TURN_COST * turn), facing, a.min(b), a.max(b)));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.2, a.3).cmp(&(b.2, b.3))));
    let mut best = vec![f64::INFINITY; ends.len()];
    let mut more = vec![0_usize; ends.len()];
    let mut bridges = Vec::new();
    for (cost, facing, a, b) in pairs {
        if best[a].is_infinite() && best[b].is_infinite() {
            (best[a], best[b]) = (cost, cost);
            let rank = if facing { 0 } else { 1 };
            bridges.push(Bridge { rank, ..joining(&ends[a], &ends[b], barrier, facing) });
        } else if cost <= MORE_COST * best[a].min(best[b]) && more[a].max(more[b]) < MORE {
            more[a] += 1;
            more[b] += 1;
            bridges.push(Bridge { rank: 2, ..joining(&ends[a], &ends[b], barrier, facing) });
        }
    }
    for (end, best) in ends.iter().zip(&best) {
        let rank = if best.is_infinite() { 1 } else { 2 };
        let side = to_side(end, barrier, stroke_px, max_gap_px);
        bridges.extend(side.map(|bridge| Bridge { rank, ..bridge }));
    }
    bridges
}

/// A cubic curve along both ends' tangents, or a corner where those meet.
fn joining(a: &End, b: &End, barrier: &Bits, facing: bool) -> Bridge {
    let gap = a.to(b.x, b.y);
    if !facing && let Some(corner) = corner(a, b) {
        let count = (gap * 4.0).ceil() as usize + 2;
        let at = |k: usize| {
            let t = 2.0 * k as f64 / count as f64;
            let ((p, q), t) =
                if t <= 1.0 { (((a.x, a.y), corner), t) } else { ((corner, (b.x, b.y)), t - 1.0) };
            (p.0 + (q.0 - p.0) * t, p.1 + (q.1 - p.1) * t)
        };
        let pixels = pixels((0..=count).map(at), barrier);
        return Bridge { pixels, width_px: gap, middle: corner, facing, rank: 0 };
    }
    let reach = if facing { gap * 0.9 } else { gap * 0.45 };
    let count = (gap * 2.0).ceil() as usize + 2;
    let at = |t: f64| {
        let (t2, t3) = (t * t, t * t * t);
        let (h0, h1) = (2.0 * t3 - 3.0 * t2 + 1.0, t3 - 2.0 * t2 + t);
        let (h2, h3) = (-2.0 * t3 + 3.0 * t2, t3 - t2);
        let x = h0 * a.x + h1 * reach * a.heading.0 + h2 * b.x - h3 * reach * b.heading.0;
        let y = h0 * a.y + h1 * reach * a.heading.1 + h2 * b.y - h3 * reach * b.heading.1;
        (x, y)
    };
    let points = (0..=count).map(|k| at(k as f64 / count as f64));
    Bridge { pixels: pixels(points, barrier), width_px: gap, middle: at(0.5), facing, rank: 0 }
}

/// Where two ends' tangents meet ahead of both, not much farther than the gap.
fn corner(a: &End, b: &End) -> Option<(f64, f64)> {
    let cross = a.heading.0 * b.heading.1 - a.heading.1 * b.heading.0;
    if cross.abs() < 0.2 {
        return None;
    }
    let (dx, dy) = (b.x - a.x, b.y - a.y);
    let along_a = (dx * b.heading.1 - dy * b.heading.0) / cross;
    let along_b = (dx * a.heading.1 - dy * a.heading.0) / cross;
    let reach = 1.3 * a.to(b.x, b.y);
    let ahead = |along: f64| (0.0..=reach).contains(&along);
    (ahead(along_a) && ahead(along_b))
        .then_some((a.x + a.heading.0 * along_a, a.y + a.heading.1 * along_a))
}

fn pixels(points: impl Iterator<Item = (f64, f64)>, barrier: &Bits) -> Vec<usize> {
    let (w, h) = (barrier.width as f64, barrier.height as f64);
    let mut pixels: Vec<usize> = points
        .filter(|(x, y)| *x >= 0.0 && *y >= 0.0 && *x < w && *y < h)
        .map(|(x, y)| y as usize * barrier.width + x as usize)
        .collect();
    pixels.dedup();
    pixels
}

/// The ink about an end that hangs together with it: a skeleton ends before its stroke does.
fn own_ink(end: &End, barrier: &Bits, stroke_px: f64) -> HashSet<(i64, i64)> {
    let reach = (OWN * stroke_px).max(LEAST_OWN_PX);
    let (x, y) = (end.x as i64, end.y as i64);
    let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
    let mut own = HashSet::new();
    let mut open: Vec<(i64, i64)> = vec![(x, y)];
    while let Some((x, y)) = open.pop() {
        for (dx, dy) in around.clone() {
            let (x, y) = (x + dx, y + dy);
            let near = end.to(x as f64 + 0.5, y as f64 + 0.5) <= reach;
            if near && barrier.at(x, y) && own.insert((x, y)) {
                open.push((x, y));
            }
        }
    }
    own
}

/// The straight way from an end to the first stroke in a fan before it.
fn to_side(end: &End, barrier: &Bits, stroke_px: f64, max_gap_px: f64) -> Option<Bridge> {
    let heading = end.heading.1.atan2(end.heading.0);
    let own = own_ink(end, barrier, stroke_px);
    let mut best: Option<(f64, f64, f64)> = None;
    for step in -10..=10 {
        let turn_deg = f64::from(step) * FAN_DEG / 10.0;
        let (sine, cosine) = (heading + turn_deg.to_radians()).sin_cos();
        let mut along = 0.5;
        while along <= max_gap_px {
            let (x, y) = (end.x + cosine * along, end.y + sine * along);
            if x < 0.0 || y < 0.0 {
                break;
            }
            let place = (x as i64, y as i64);
            if barrier.at(place.0, place.1) && !own.contains(&place) {
                let cost = along * (1.0 + TURN_COST * turn_deg.abs());
                if best.is_none_or(|(least, _, _)| cost < least) {
                    best = Some((cost, x, y));
                }
                break;
            }
            along += 0.5;
        }
    }
    let (_, x, y) = best?;
    let gap = end.to(x, y);
    let count = (gap * 2.0).ceil() as usize + 1;
    let at = |t: f64| (end.x + (x - end.x) * t, end.y + (y - end.y) * t);
    let points = (0..=count).map(|k| at(k as f64 / count as f64));
    Some(Bridge {
        pixels: pixels(points, barrier),
        width_px: gap,
        middle: at(0.5),
        facing: false,
        rank: 0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A circle of radius 60 with gaps of `gap` px at the given angles.
    fn circle(gap: f64, angles: &[f64]) -> Bits {
        let mut ink = Bits::filled(160, 160, false);
        for y in 0..160 {
            for x in 0..160 {
                let (dx, dy) = (f64::from(x) + 0.5 - 80.0, f64::from(y) + 0.5 - 80.0);
                let near = angles.iter().any(|angle: &f64| {
                    let (s, c) = angle.sin_cos();
                    (dx - 60.0 * c).hypot(dy - 60.0 * s) < gap / 2.0
                });
                if (dx.hypot(dy) - 60.0).abs() < 1.3 && !near {
                    ink.set(i64::from(x), i64::from(y), true);
                }
            }
        }
        ink
    }

    #[test]
    fn wide_gaps_are_closed_along_the_curve() {
        let whole = filled(&circle(0.0, &[])).count() as f64;
        for gap in [8.0, 16.0, 24.0] {
            let ink = circle(gap, &[0.3, 2.0, 4.4]);
            let closed = close(&ink, &ink, 2.6, 30.0, 9);
            let found = closed.inside.count() as f64;
            assert!((found / whole - 1.0).abs() < 0.015, "{gap}: {found} of {whole}");
            assert_eq!(closed.bridges.len(), 3);
        }
    }

    #[test]
    fn nothing_is_closed_where_nothing_is_open() {
        let ink = circle(0.0, &[]);
        let closed = close(&ink, &ink, 2.6, 30.0, 9);
        assert!(closed.bridges.is_empty());
        assert_eq!(closed.inside.data, filled(&ink).data);
    }

    #[test]
    fn a_slit_between_two_bars_stays_open() {
        let mut ink = Bits::filled(120, 120, false);
        for (left, right) in [(30, 55), (63, 88)] {
            for y in 20..100 {
                [left, left + 1, right - 1, right].iter().for_each(|&x| ink.set(x, y, true));
            }
            for x in left..=right {
                [20, 21, 98, 99].iter().for_each(|&y| ink.set(x, y, true));
            }
        }
        let closed = close(&ink, &ink, 2.0, 30.0, 9);
        assert_eq!(closed.inside.data, filled(&ink).data);
    }
}
