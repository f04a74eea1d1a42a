//! Gaps in lines: where a stroke ends and, straight on, another goes on.
//!
//! A gap lies between the ends of strokes, a slit between their sides. Closing
//! the first never closes the second, however narrow it is.

use crate::ink::{INK_THRESHOLD, InkMap};

/// A drawing with more ends is not one of lines.
const MAX_ENDS: usize = 4096;
/// Areas that are thicker are not strokes, px.
const MAX_STROKE_PX: usize = 12;
/// The length of a stroke's end that tells its direction, px.
const END_PX: usize = 8;
/// Shorter branches of a skeleton are its own noise, px.
const MIN_BRANCH_PX: usize = 5;
/// Up to this gap an end may be met from any side in front of it, px.
const NEAR_PX: f64 = 4.0;
/// How far to the side the widest gap may lead, degrees.
const FAR_FAN_DEG: f64 = 30.0;
const NEAR_FAN_DEG: f64 = 60.0;
const RAY_STEP_DEG: f64 = 5.0;
/// Gaps between two ends that point at each other may be this many times wider.
const FACING_GAP: f64 = 2.0;
/// How far two ends may turn towards each other in all, degrees.
const FACING_TURN_DEG: f64 = 75.0;
/// What a degree to the side costs, as a share of the gap.
const TURN_COST: f64 = 0.01;

/// The pixels, by index, of a straight line that closes a gap.
pub(super) type Bridge = Vec<usize>;

/// The gaps of up to `max_gap_px` between a stroke's end and the ink in front
/// of it, and wider ones between two ends that point at each other.
pub(super) fn bridges(ink: &InkMap, max_gap_px: u32) -> Vec<Bridge> {
    if max_gap_px == 0 {
        return Vec::new();
    }
    let lines = Lines::thinned(ink);
    let skeleton = lines.thin.iter();
    let ends: Vec<End> = skeleton.filter_map(|&index| lines.end_at(index)).take(MAX_ENDS).collect();
    let max_gap_px = f64::from(max_gap_px);
    let ahead = ends.iter().filter_map(|end| lines.bridge_from(end, max_gap_px));
    let facing = facing_pairs(&ends, FACING_GAP * max_gap_px);
    let between = facing.into_iter().map(|(from, to)| lines.bridge_between(from, to));
    ahead.chain(between).collect()
}

/// Each end with the nearest that it points at and that points back at it.
fn facing_pairs(ends: &[End], max_gap_px: f64) -> Vec<(&End, &End)> {
    let facing = |from: &End, to: &End| {
        let (dx, dy) = (to.x - from.x, to.y - from.y);
        let gap_px = dx.hypot(dy);
        if gap_px == 0.0 || gap_px > max_gap_px {
            return None;
        }
        let turn = |end: &End, dx: f64, dy: f64| {
            let (sine, cosine) = end.heading_rad.sin_cos();
            (cosine * dy - sine * dx).atan2(cosine * dx + sine * dy).abs().to_degrees()
        };
        let turned_deg = turn(from, dx, dy) + turn(to, -dx, -dy);
        (turned_deg <= FACING_TURN_DEG).then_some(gap_px)
    };
    let partner = |index: usize| {
        let others = ends.iter().enumerate().filter(|(other, _)| *other != index);
        let gaps = others.filter_map(|(other, end)| Some((facing(&ends[index], end)?, other)));
        gaps.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, other)| other)
    };
    let partners: Vec<Option<usize>> = (0..ends.len()).map(partner).collect();
    let pairs = partners.iter().enumerate().filter_map(|(index, partner)| {
        let partner = (*partner)?;
        let mutual = partners[partner] == Some(index) && index < partner;
        mutual.then(|| (&ends[index], &ends[partner]))
    });
    pairs.collect()
}

/// The ink as strokes and their skeletons, with a border of one bare pixel.
struct Lines {
    width: usize,
    inked: Vec<bool>,
    skeleton: Vec<bool>,
    /// The skeleton's pixels, ascending.
    thin: Vec<usize>,
}

/// The end of a stroke and the direction in which it would go on.
struct End {
    x: f64,
    y: f64,
    heading_rad: f64,
}

impl Lines {
    /// # Source
    /// Zhang & Suen 1984, A fast parallel algorithm for thinning digital patterns.
    fn thinned(ink: &InkMap) -> Self {
        let width = ink.width() + 2;
        let mut inked = vec![false; width * (ink.height() + 2)];
        let mut left: Vec<usize> = Vec::new();
        for y in 0..ink.height() {
            let start = (y + 1) * width + 1;
            for (index, _) in (start..).zip(ink.row(y)).filter(|(_, share)| **share > INK_THRESHOLD)
            {
                inked[index] = true;
                left.push(index);
            }
        }
        let mut lines = Self { width, skeleton: inked.clone(), inked, thin: Vec::new() };
        for _ in 0..MAX_STROKE_PX {
            let before = left.len();
            for second in [false, true] {
                let peeled: Vec<bool> = left.iter().map(|&i| lines.is_edge(i, second)).collect();
                let mut peeled = peeled.into_iter();
                let skeleton = &mut lines.skeleton;
                left.retain(|&i| {
                    let peel = peeled.next() == Some(true);
                    skeleton[i] &= !peel;
                    !peel
                });
            }
            if left.len() == before {
                break;
            }
        }
        lines.thin = left;
        lines
    }

    /// The eight pixels around `index`, clockwise from the one above.
    fn around(&self, index: usize) -> [usize; 8] {
        let w = self.width;
        [
            index - w,
            index - w + 1,
            index + 1,
            index + w + 1,
            index + w,
            index + w - 1,
            index - 1,
            index - w - 1,
        ]
    }

    /// How many pixels of the skeleton are around `index`, and in how many groups.
    fn neighbours(&self, index: usize) -> (usize, usize) {
        let around = self.around(index).map(|other| self.skeleton[other]);
        let groups = (0..8).filter(|&k| !around[k] && around[(k + 1) % 8]).count();
        (around.into_iter().filter(|&is| is).count(), groups)
    }

    fn is_edge(&self, index: usize, second: bool) -> bool {
        let (count, groups) = self.neighbours(index);
        let [up, _, right, _, down, _, left, _] = self.around(index).map(|i| self.skeleton[i]);
        let closed =
            if second { up && left && (right || down) } else { right && down && (up || left) };
        (2..=6).contains(&count) && groups == 1 && !closed
    }

    /// The end of a stroke at pixel `index` of the skeleton, if it is one.
    fn end_at(&self, index: usize) -> Option<End> {
        let (count, groups) = self.neighbours(index);
        if groups != 1 || count > 2 {
            return None;
        }
        let mut path = vec![index];
        while path.len() <= END_PX {
            let at = path[path.len() - 1];
            let next = self.around(at).into_iter().find(|&other| {
                self.skeleton[other] && !path.contains(&other) && !self.touches(&path, other)
            });
            let Some(next) = next else { break };
            path.push(next);
            if self.neighbours(next).1 > 2 {
                break;
            }
        }
        if path.len() < MIN_BRANCH_PX {
            return None;
        }
        let place = |index: usize| ((index % self.width) as f64, (index / self.width) as f64);
        let ((x, y), (from_x, from_y)) = (place(index), place(path[path.len() - 1]));
        Some(End { x, y, heading_rad: (y - from_y).atan2(x - from_x) })
    }

    /// Whether a pixel touches the path elsewhere than at its end.
    fn touches(&self, path: &[usize], index: usize) -> bool {
        let around = self.around(index);
        path[..path.len() - 1].iter().any(|before| around.contains(before))
    }

    /// The pixels between `end` and the ink that it most likely led to.
    fn bridge_from(&self, end: &End, max_gap_px: f64) -> Option<Bridge> {
        let steps = (NEAR_FAN_DEG / RAY_STEP_DEG) as i32;
        let mut best: Option<(f64, Bridge)> = None;
        for step in -steps..=steps {
            let turn_deg = f64::from(step) * RAY_STEP_DEG;
            let Some((gap_px, pixels)) = self.gap_along(end, turn_deg, max_gap_px) else {
                continue;
            };
            let cost = gap_px * (1.0 + TURN_COST * turn_deg.abs());
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, pixels));
            }
        }
        best.map(|(_, pixels)| pixels)
    }

    /// The bare pixels of the straight line between two ends.
    fn bridge_between(&self, from: &End, to: &End) -> Bridge {
        let steps = ((to.x - from.x).abs().max((to.y - from.y).abs())).ceil().max(1.0);
        let at = |step: f64| {
            let x = from.x + (to.x - from.x) * step / steps;
            let y = from.y + (to.y - from.y) * step / steps;
            (x.round() as usize, y.round() as usize)
        };
        (0..=steps as usize)
            .map(|step| at(step as f64))
            .filter(|(x, y)| !self.inked[y * self.width + x])
            .map(|(x, y)| (y - 1) * (self.width - 2) + x - 1)
            .collect()
    }

    /// The gap from `end` to the next ink along a ray, and its pixels in the
    /// image; `None` if there is none, or no ink within reach.
    fn gap_along(&self, end: &End, turn_deg: f64, max_gap_px: f64) -> Option<(f64, Bridge)> {
        const STEP_PX: f64 = 0.5;
        let near = turn_deg.abs() > FAR_FAN_DEG;
        let reach_px = if near { NEAR_PX.min(max_gap_px) } else { max_gap_px };
        let (sine, cosine) = (end.heading_rad + turn_deg.to_radians()).sin_cos();
        let mut pixels: Vec<usize> = Vec::new();
        let height = self.inked.len() / self.width;
        for step in 1.. {
            let along = f64::from(step) * STEP_PX;
            let (x, y) = ((end.x + cosine * along).round(), (end.y + sine * along).round());
            let inside = x >= 1.0 && y >= 1.0 && x < self.width as f64 - 1.0;
            if !inside || y >= height as f64 - 1.0 {
                return None;
            }
            let (x, y) = (x as usize, y as usize);
            let inked = self.inked[y * self.width + x];
            match (inked, pixels.is_empty()) {
                (true, true) if along > MAX_STROKE_PX as f64 => return None,
                // One bare pixel is a notch in the stroke's own edge.
                (true, false) if pixels.len() == 1 => pixels.clear(),
                (true, false) => return Some((pixels.len() as f64, pixels)),
                (true, true) => {}
                (false, _) => {
                    let pixel = (y - 1) * (self.width - 2) + x - 1;
                    if pixels.last() != Some(&pixel) {
                        pixels.push(pixel);
                    }
                    if pixels.len() as f64 > reach_px {
                        return None;
                    }
                }
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayImage, Luma};

    /// Strokes of two pixels between points.
    fn drawn(strokes: &[[(f64, f64); 2]]) -> InkMap {
        InkMap::from_image(&GrayImage::from_fn(80, 60, |x, y| {
            let (x, y) = (f64::from(x), f64::from(y));
            let distance = |[(ax, ay), (bx, by)]: &[(f64, f64); 2]| {
                let (dx, dy) = (bx - ax, by - ay);
                let t = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy);
                let t = t.clamp(0.0, 1.0);
                (x - ax - t * dx).hypot(y - ay - t * dy)
            };
            let near = strokes.iter().map(distance).fold(f64::INFINITY, f64::min);
            Luma([(255.0 * (near - 0.5).clamp(0.0, 1.0)) as u8])
        }))
    }

    fn bridged(ink: &InkMap) -> Vec<usize> {
        bridges(ink, 10).concat()
    }

    #[test]
    fn a_gap_between_two_ends_is_bridged() {
        let ink = drawn(&[[(10.0, 20.0), (35.0, 24.0)], [(43.0, 25.5), (70.0, 30.0)]]);
        let found = bridged(&ink);
        let columns: Vec<usize> = found.iter().map(|index| index % 80).collect();
        assert!((37..=41).all(|x| columns.contains(&x)), "{columns:?}");
        assert!(found.iter().all(|index| (23..=27).contains(&(index / 80))), "{found:?}");
        assert!(bridges(&ink, 3).is_empty());
    }

    #[test]
    fn a_line_that_stops_short_of_another_is_led_to_it() {
        let ink = drawn(&[[(10.0, 20.0), (40.0, 20.0)], [(46.0, 5.0), (46.0, 50.0)]]);
        let found = bridged(&ink);
        assert!((42..=44).all(|x| found.contains(&(20 * 80 + x))), "{found:?}");
    }

    #[test]
    fn ends_that_face_each_other_are_joined_over_a_wider_gap() {
        let ink = drawn(&[[(10.0, 20.0), (30.0, 20.0)], [(46.0, 24.0), (70.0, 24.0)]]);
        let found = bridged(&ink);
        assert!((32..=44).all(|x| found.iter().any(|index| index % 80 == x)), "{found:?}");
        let apart = drawn(&[[(10.0, 20.0), (30.0, 20.0)], [(46.0, 40.0), (70.0, 40.0)]]);
        assert!(bridges(&apart, 10).is_empty());
    }

    #[test]
    fn a_slit_between_two_sides_stays_open() {
        let ink = drawn(&[[(36.0, 5.0), (36.0, 55.0)], [(42.0, 5.0), (42.0, 55.0)]]);
        assert!(bridges(&ink, 10).is_empty());
    }

    #[test]
    fn an_empty_page_has_none() {
        assert!(bridges(&drawn(&[]), 10).is_empty());
    }
}
