//! Strokes as skeletons: their width, their ends and where those point.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use crate::raster::Bits;

/// Branches shorter than this many stroke widths are the skeleton's own noise.
const MIN_BRANCH: f64 = 1.6;
/// So many stroke widths back an end's direction is measured.
const DIRECTION: f64 = 5.0;
const MAX_PEELS: usize = 40;
/// Strokes that meet at a tip are told so many stroke widths beyond their fork, and px.
const BRANCH: f64 = 3.0;
const LEAST_BRANCH_PX: f64 = 6.0;
/// Nor is a fork looked for farther from the tip, stroke widths.
const FARTHEST_FORK: f64 = 12.0;
/// A stroke is lost where no skeleton is within so many widths, and px.
const LOST: f64 = 2.0;
const LEAST_LOST_PX: f64 = 4.0;
/// The most that each of them leaves the way on from the tip, degrees: a stroke that ends on
/// another has it leave at 90 to both sides.
const WEDGE_DEG: f64 = 50.0;
/// From a tip of ink to the fork of its skeleton it is so many times as far as from the corner of
/// its outline to the corner within, and so many px: strokes that lie together go on farther.
const WEDGE_REACH: f64 = 1.8;
const WEDGE_SLACK_PX: f64 = 2.0;

/// The end of a stroke.
#[derive(Clone, Copy, Debug)]
pub(crate) struct End {
    pub(crate) x: f64,
    pub(crate) y: f64,
    /// Unit vector in which the stroke would go on.
    pub(crate) heading: (f64, f64),
}

impl End {
    pub(crate) fn to(&self, x: f64, y: f64) -> f64 {
        (x - self.x).hypot(y - self.y)
    }

    /// The angle between the heading and the direction to a place, degrees.
    pub(crate) fn turn_deg(&self, x: f64, y: f64) -> f64 {
        let (dx, dy) = (x - self.x, y - self.y);
        let cross = self.heading.0 * dy - self.heading.1 * dx;
        let dot = self.heading.0 * dx + self.heading.1 * dy;
        cross.atan2(dot).abs().to_degrees()
    }
}

/// The width of most strokes, px. At least 1.
pub(crate) fn typical_width(ink: &Bits) -> f64 {
    width_of(ink, 0.5)
}

/// The width that a share of all ridges of the ink stays below, px: twice their distance from
/// paper, less the pixel that both sides share. At least 1.
pub(crate) fn width_of(ink: &Bits, share: f64) -> f64 {
    let depth = ink.not().distance();
    let (w, h) = (ink.width as i64, ink.height as i64);
    let mut widths: Vec<f32> = Vec::new();
    for y in 0..h {
        for x in 0..w {
            let own = depth.at(x, y);
            if own <= 0.0 {
                continue;
            }
            let ridge = [(1, 0), (0, 1), (1, 1), (1, -1)]
                .iter()
                .any(|(dx, dy)| own >= depth.at(x - dx, y - dy) && own > depth.at(x + dx, y + dy));
            if ridge {
                widths.push(2.0 * own - 1.0);
            }
        }
    }
    if widths.is_empty() {
        return 1.0;
    }
    let place = (widths.len() as f64 * share) as usize;
    f64::from(*widths.select_nth_unstable_by(place, f32::total_cmp).1).max(1.0)
}

/// The ends of strokes about `width_px` wide.
///
/// Zhang and Suen's skeletons lose strokes at about 45 degrees whole. Guo and Hall's keep them,
/// but give small crooked strokes so many ends that gaps are closed wrongly: theirs count only
/// where the first have nothing.
pub(crate) fn ends(ink: &Bits, width_px: f64) -> Vec<End> {
    let own = Skeleton::thinned(ink, Thinning::ZhangSuen);
    let mut ends = own.ends(width_px);
    let kept = own.bits.dilated((LOST * width_px).max(LEAST_LOST_PX) as f32);
    let all = Skeleton::thinned(ink, Thinning::GuoHall);
    let lost = all.points.iter().filter(|&&i| !kept.data[i]);
    ends.extend(lost.filter_map(|&i| all.end_at(i, width_px)));
    ends
}

/// Which pixels a round of thinning may peel.
#[derive(Clone, Copy, PartialEq)]
enum Thinning {
    /// Zhang & Suen 1984, A fast parallel algorithm for thinning digital patterns.
    ZhangSuen,
    /// Guo & Hall 1989, Parallel thinning with two-subiteration algorithms.
    GuoHall,
}

/// The skeleton of thin parts of a raster of ink.
struct Skeleton {
    bits: Bits,
    points: Vec<usize>,
}

impl Skeleton {
    fn thinned(ink: &Bits, thinning: Thinning) -> Self {
        // A bare border makes every pixel's neighbours exist.
        let (w, h) = (ink.width + 2, ink.height + 2);
        let mut bits = Bits::filled(w, h, false);
        for y in 0..ink.height {
            bits.data[(y + 1) * w + 1..(y + 1) * w + 1 + ink.width].copy_from_slice(ink.row(y));
        }
        let mut left: Vec<usize> = (0..bits.data.len()).filter(|&i| bits.data[i]).collect();
        let mut skeleton = Self { bits, points: Vec::new() };
        // Only pixels beside bare ones can be peeled.
        let mut edge: Vec<usize> = left.clone();
        for _ in 0..MAX_PEELS {
            let mut peeled_any = false;
            for second in [false, true] {
                edge.retain(|&i| skeleton.bits.data[i]);
                let peel: Vec<usize> = edge
                    .iter()
                    .copied()
                    .filter(|&i| skeleton.is_peeled(i, second, thinning))
                    .collect();
                peeled_any |= !peel.is_empty();
                peel.iter().for_each(|&i| skeleton.bits.data[i] = false);
            }
            if !peeled_any {
                break;
            }
        }
        left.retain(|&i| skeleton.bits.data[i]);
        skeleton.points = left;
        skeleton
    }

    fn around(&self, i: usize) -> [usize; 8] {
        let w = self.bits.width;
        [i - w, i - w + 1, i + 1, i + w + 1, i + w, i + w - 1, i - 1, i - w - 1]
    }

    fn neighbours(&self, i: usize) -> (usize, usize, [bool; 8]) {
        let around = self.around(i).map(|other| self.bits.data[other]);
        let groups = (0..8).filter(|&k| !around[k] && around[(k + 1) % 8]).count();
        (around.iter().filter(|is| **is).count(), groups, around)
    }

    fn is_peeled(&self, i: usize, second: bool, thinning: Thinning) -> bool {
        if thinning == Thinning::GuoHall {
            return self.is_peeled_by_guo_hall(i, second);
        }
        let (count, groups, [up, _, right, _, down, _, left, _]) = self.neighbours(i);
        let held =
            if second { up && left && (right || down) } else { right && down && (up || left) };
        (2..=6).contains(&count) && groups == 1 && !held
    }

    fn is_peeled_by_guo_hall(&self, i: usize, second: bool) -> bool {
        let around = self.around(i).map(|other| self.bits.data[other]);
        let at = |k: usize| around[k % 8];
        // Pairs of a side and a corner beside it: groups, and neighbours counted two ways.
        let sides = [0, 2, 4, 6];
        let groups = sides.iter().filter(|&&k| !at(k) && (at(k + 1) || at(k + 2))).count();
        let before = sides.iter().filter(|&&k| at(k + 7) || at(k)).count();
        let after = sides.iter().filter(|&&k| at(k) || at(k + 1)).count();
        let [up, up_right, right, down_right, down, down_left, left, up_left] = around;
        let held = if second {
            (up || up_right || !down_right) && right
        } else {
            (down || down_left || !up_left) && left
        };
        groups == 1 && (2..=3).contains(&before.min(after)) && !held
    }

    /// The ends of strokes about `width_px` wide.
    fn ends(&self, width_px: f64) -> Vec<End> {
        self.points.iter().filter_map(|&i| self.end_at(i, width_px)).collect()
    }

    fn end_at(&self, index: usize, width_px: f64) -> Option<End> {
        let (count, groups, _) = self.neighbours(index);
        if groups != 1 || count > 2 {
            return None;
        }
        let length = (DIRECTION * width_px).max(7.0) as usize;
        let mut path = vec![index];
        while path.len() <= length {
            let at = path[path.len() - 1];
            let beside = |other: usize, past: &[usize]| {
                let around = self.around(other);
                past.iter().any(|p| around.contains(p))
            };
            let next = self.around(at).into_iter().find(|&other| {
                self.bits.data[other]
                    && !path.contains(&other)
                    && !beside(other, &path[path.len().saturating_sub(4)..path.len() - 1])
            });
            let Some(next) = next else { break };
            path.push(next);
            if self.neighbours(next).1 > 2 {
                break;
            }
        }
        if (path.len() as f64) < (MIN_BRANCH * width_px).max(4.0) {
            return None;
        }
        let skip = (path.len() / 4).min((width_px / 2.0) as usize);
        let (x, y) = self.place(index);
        let (tip_x, tip_y) = self.place(path[skip]);
        let (from_x, from_y) = self.place(path[path.len() - 1]);
        let length = (tip_x - from_x).hypot(tip_y - from_y);
        if length == 0.0 || self.is_tip(index, width_px) {
            return None;
        }
        Some(End { x, y, heading: ((tip_x - from_x) / length, (tip_y - from_y) / length) })
    }

    /// Whether an end is none, but the tip at which strokes meet at an acute angle.
    ///
    /// Their ink is one piece from the outer corner to the inner one, so the skeleton has a branch
    /// there of up to `width / sin(angle / 2)`, which goes on as the bisector of the strokes
    /// behind its fork.
    fn is_tip(&self, index: usize, width_px: f64) -> bool {
        let reach = (BRANCH * width_px).max(LEAST_BRANCH_PX);
        let Some(fork) = self.fork(index, reach as usize, FARTHEST_FORK * width_px + reach) else {
            return false;
        };
        let place = |i: usize| self.place(i);
        let (tip, at) = (place(index), place(fork.at));
        let (dx, dy) = (at.0 - tip.0, at.1 - tip.1);
        let turns = fork.branches.iter().map(|&branch| {
            let (x, y) = place(branch);
            let (bx, by) = (x - at.0, y - at.1);
            (dx * by - dy * bx).atan2(dx * bx + dy * by)
        });
        let (least, most) =
            turns.fold((f64::MAX, f64::MIN), |(least, most), t| (least.min(t), most.max(t)));
        let half = (most - least) / 2.0;
        // What is shorter than the stroke is wide points anywhere.
        let most = if dx.hypot(dy) < width_px { half } else { least.abs().max(most.abs()) };
        let within = most <= WEDGE_DEG.to_radians();
        let longest = WEDGE_REACH * width_px / half.sin().max(1e-3) + WEDGE_SLACK_PX;
        within && dx.hypot(dy) <= longest
    }

    /// The first fork on the way from an end with two branches or more of `reach` steps.
    fn fork(&self, index: usize, reach: usize, farthest_px: f64) -> Option<Fork> {
        // One front a step, of pixels with the pixel before each.
        let mut before: HashMap<usize, usize> = HashMap::from([(index, index)]);
        let mut front = vec![index];
        for step in 1..=farthest_px as usize {
            let mut next = Vec::new();
            for &at in &front {
                for other in self.around(at).into_iter().filter(|&i| self.bits.data[i]) {
                    if let Entry::Vacant(entry) = before.entry(other) {
                        entry.insert(at);
                        next.push(other);
                    }
                }
            }
            front = next;
            if front.is_empty() {
                return None;
            }
            if step < reach {
                continue;
            }
            let heads = self.apart(&front);
            let mut back = heads.clone();
            for _ in 0..reach {
                back.iter_mut().for_each(|at| *at = before[at]);
            }
            // Those that met within `reach` steps are noise of the front.
            let mut branches: Vec<(usize, usize)> = Vec::new();
            for (head, back) in heads.into_iter().zip(back) {
                if self.apart_from(back, branches.iter().map(|(_, other)| *other)) {
                    branches.push((head, back));
                }
            }
            if branches.len() > 1 {
                let mut at: Vec<usize> = branches.iter().map(|(_, back)| *back).collect();
                while at.iter().any(|other| *other != at[0]) {
                    at.iter_mut().for_each(|at| *at = before[at]);
                }
                let branches = branches.into_iter().map(|(head, _)| head).collect();
                return Some(Fork { at: at[0], branches });
            }
        }
        None
    }

    /// One pixel of each connected part of `pixels`.
    fn apart(&self, pixels: &[usize]) -> Vec<usize> {
        let mut left = pixels.to_vec();
        let mut parts = Vec::new();
        while let Some(first) = left.pop() {
            parts.push(first);
            let mut open = vec![first];
            while let Some(at) = open.pop() {
                let around = self.around(at);
                open.extend(left.extract_if(.., |other| around.contains(other)));
            }
        }
        parts
    }

    fn apart_from(&self, pixel: usize, mut others: impl Iterator<Item = usize>) -> bool {
        let around = self.around(pixel);
        !others.any(|other| other == pixel || around.contains(&other))
    }

    /// A pixel's middle in the raster of ink, px.
    fn place(&self, index: usize) -> (f64, f64) {
        let w = self.bits.width;
        ((index % w) as f64 - 0.5, (index / w) as f64 - 0.5)
    }
}

/// Where a skeleton's way parts.
struct Fork {
    at: usize,
    /// A pixel on each branch, equally far from the fork.
    branches: Vec<usize>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stroke_has_two_ends_and_its_width() {
        let mut ink = Bits::filled(80, 40, false);
        for x in 10..60 {
            (18..21).for_each(|y| ink.set(x, y, true));
        }
        let ends = super::ends(&ink, 3.0);
        assert_eq!(ends.len(), 2);
        assert!(ends.iter().any(|end| end.x < 13.0 && end.heading.0 < -0.9));
        assert!((typical_width(&ink) - 3.0).abs() < 0.6, "{}", typical_width(&ink));
    }

    /// Ink of strokes `width` px wide, `[x, y]` to `[x, y]`.
    fn drawn(width: f64, strokes: &[[[f64; 2]; 2]]) -> Bits {
        let mut ink = Bits::filled(200, 200, false);
        for (i, is) in ink.data.iter_mut().enumerate() {
            let (x, y) = ((i % 200) as f64 + 0.5, (i / 200) as f64 + 0.5);
            *is = strokes.iter().any(|[a, b]| {
                let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
                let along = ((x - a[0]) * dx + (y - a[1]) * dy) / (dx * dx + dy * dy);
                let along = along.clamp(0.0, 1.0);
                (a[0] + along * dx - x).hypot(a[1] + along * dy - y) <= width / 2.0
            });
        }
        ink
    }

    /// The ends of thin strokes, and of those about 45 degrees, are not always found.
    fn is_sure(width: f64, degrees: f64) -> bool {
        width >= 3.7 && (degrees.rem_euclid(90.0) - 45.0).abs() > 15.0
    }

    /// Widths, half angles and turns, degrees; all strokes start in the middle, 70 px long.
    fn cases() -> impl Iterator<Item = (f64, f64, f64)> {
        let widths = [2.2, 3.0, 3.7, 5.0, 8.0];
        let turns = [3.0_f64, 28.0, 141.0, 308.0];
        let of_width = move |width| {
            [12.0_f64, 23.0, 38.0]
                .into_iter()
                .flat_map(move |half| turns.map(|turn| (width, half, turn)))
        };
        widths.into_iter().flat_map(of_width)
    }

    fn ray(degrees: f64, from: f64, to: f64) -> [[f64; 2]; 2] {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        [from, to].map(|along| [100.2 + cosine * along, 99.7 + sine * along])
    }

    fn ends_at(ink: &Bits, [x, y]: [f64; 2], within: f64) -> usize {
        let ends = super::ends(ink, typical_width(ink));
        ends.iter().filter(|end| end.to(x, y) <= within).count()
    }

    #[test]
    fn a_tip_is_no_end() {
        for (width, half, turn) in cases() {
            let ink = drawn(width, &[ray(turn - half, 0.0, 70.0), ray(turn + half, 0.0, 70.0)]);
            let case = format!("width {width}, half angle {half}, turned by {turn}");
            assert_eq!(ends_at(&ink, [100.2, 99.7], 25.0), 0, "{case}");
            for side in [turn - half, turn + half].into_iter().filter(|side| is_sure(width, *side))
            {
                assert_eq!(ends_at(&ink, ray(side, 0.0, 70.0)[1], width + 2.0), 1, "{case}");
            }
        }
    }

    #[test]
    fn what_stands_on_a_stroke_or_goes_on_behind_a_tip_ends() {
        for (width, half, turn) in cases() {
            let long = 4.0 * width + 8.0;
            let stub = ray(turn, 0.0, long);
            let bar = [ray(turn + 90.0, 0.0, 70.0), ray(turn - 90.0, 0.0, 70.0)];
            let ink = drawn(width, &[stub, bar[0], bar[1]]);
            let case = format!("width {width}, half angle {half}, turned by {turn}");
            let sure = is_sure(width, turn);
            assert!(!sure || ends_at(&ink, stub[1], width + 2.0) == 1, "stub, {case}");
            // Strokes that overshoot where they cross.
            let crossing = [turn - half, turn + half].map(|turn| ray(turn, -long - 20.0, 70.0));
            let ink = drawn(width, &crossing);
            let sides_sure = is_sure(width, turn - half) && is_sure(width, turn + half);
            for end in crossing.iter().flatten().filter(|_| sides_sure) {
                assert_eq!(ends_at(&ink, *end, width + 2.0), 1, "crossing, {case}");
            }
            // Two strokes that become one.
            let one = ray(turn, -7.0 * width - 30.0, 0.0);
            let two = [turn - half, turn + half].map(|turn| ray(turn, 0.0, 70.0));
            let ink = drawn(width, &[one, two[0], two[1]]);
            assert!(!sure || ends_at(&ink, one[0], width + 2.0) == 1, "two in one, {case}");
        }
    }

    #[test]
    fn a_bare_raster_has_none() {
        assert!(super::ends(&Bits::filled(0, 0, false), 1.0).is_empty());
        assert_eq!(typical_width(&Bits::filled(4, 4, false)), 1.0);
    }
}
