//! Strokes as skeletons: their width, their ends and where those point.

use crate::raster::Bits;

/// Branches shorter than this many stroke widths are the skeleton's own noise.
const MIN_BRANCH: f64 = 1.6;
/// So many stroke widths back an end's direction is measured.
const DIRECTION: f64 = 5.0;
const MAX_PEELS: usize = 40;

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

/// The width of most strokes, px: twice the ink per length of skeleton where
/// that is not much thicker than usual. At least 1.
pub(crate) fn typical_width(ink: &Bits) -> f64 {
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
    let middle = widths.len() / 2;
    f64::from(*widths.select_nth_unstable_by(middle, f32::total_cmp).1).max(1.0)
}

/// The skeleton of thin parts of a raster of ink.
pub(crate) struct Skeleton {
    bits: Bits,
    points: Vec<usize>,
}

impl Skeleton {
    /// # Source
    /// Zhang & Suen 1984, A fast parallel algorithm for thinning digital patterns.
    pub(crate) fn of(ink: &Bits) -> Self {
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
                let peel: Vec<usize> =
                    edge.iter().copied().filter(|&i| skeleton.is_peeled(i, second)).collect();
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

    fn is_peeled(&self, i: usize, second: bool) -> bool {
        let (count, groups, [up, _, right, _, down, _, left, _]) = self.neighbours(i);
        let held =
            if second { up && left && (right || down) } else { right && down && (up || left) };
        (2..=6).contains(&count) && groups == 1 && !held
    }

    /// The ends of strokes about `width_px` wide.
    pub(crate) fn ends(&self, width_px: f64) -> Vec<End> {
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
        let w = self.bits.width;
        let place = |i: usize| ((i % w) as f64 - 0.5, (i / w) as f64 - 0.5);
        let skip = (path.len() / 4).min((width_px / 2.0) as usize);
        let (x, y) = place(index);
        let (tip_x, tip_y) = place(path[skip]);
        let (from_x, from_y) = place(path[path.len() - 1]);
        let length = (tip_x - from_x).hypot(tip_y - from_y);
        if length == 0.0 {
            return None;
        }
        Some(End { x, y, heading: ((tip_x - from_x) / length, (tip_y - from_y) / length) })
    }
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
        let ends = Skeleton::of(&ink).ends(3.0);
        assert_eq!(ends.len(), 2);
        assert!(ends.iter().any(|end| end.x < 13.0 && end.heading.0 < -0.9));
        assert!((typical_width(&ink) - 3.0).abs() < 0.6, "{}", typical_width(&ink));
    }

    #[test]
    fn a_bare_raster_has_none() {
        assert!(Skeleton::of(&Bits::filled(0, 0, false)).ends(1.0).is_empty());
        assert_eq!(typical_width(&Bits::filled(4, 4, false)), 1.0);
    }
}
