//! Silhouettes as column intervals, one list per slice of the solid.

use nalgebra::{Point2, Vector2};

use crate::raster::runs;
use crate::silhouette::{ALONE_PX, Silhouette};

/// A silhouette as one bound per slice of the solid: in the turntable frame,
/// columns measured from the axis.
#[derive(Clone, Debug)]
pub(super) struct Outline {
    pub azimuth_rad: f64,
    /// Per image row, disjoint intervals of the column, px from the axis,
    /// left to right.
    pub rows: Vec<Vec<(f64, f64)>>,
}

impl Outline {
    /// The sub-pixel intervals of `silhouette`, cut where the row half a
    /// stroke above or below is outside: the stroke is as thick downward as it
    /// is sideways. Strokes alone are not cut.
    pub(super) fn from_silhouette(silhouette: &Silhouette, axis_px: f64) -> Self {
        let (width, height) = silhouette.mask().dimensions();
        let (width, height) = (width as usize, height as usize);
        let mask = silhouette.mask().as_raw();
        let reach = silhouette.half_line_px().round() as usize;
        let shifted = |bounds: &(f64, f64)| (bounds.0 - axis_px, bounds.1 - axis_px);
        let whole = |mask: &[u8], y: usize| -> Vec<(f64, f64)> {
            let runs = mask.get(y * width..(y + 1) * width).into_iter().flat_map(runs);
            runs.map(|(from, to)| shifted(&(from as f64, to as f64))).collect()
        };
        let most_px = 2.0 * silhouette.half_line_px() + ALONE_PX;
        let alone = if reach == 0 { Vec::new() } else { alone(mask, width, most_px) };
        let rows = (0..height)
            .map(|y| {
                let own: Vec<_> = silhouette.intervals_px(y).iter().map(shifted).collect();
                if reach == 0 || own.is_empty() {
                    return own;
                }
                let above = y.checked_sub(reach).map(|y| whole(mask, y)).unwrap_or_default();
                let cut = intersection(&intersection(&own, &above), &whole(mask, y + reach));
                let strokes = whole(&alone, y);
                if strokes.is_empty() {
                    cut
                } else {
                    union([cut, intersection(&own, &strokes)].concat())
                }
            })
            .collect();
        Self { azimuth_rad: silhouette.azimuth().radians(), rows }
    }

    /// With what is narrower than `least_px` as wide as that, but for half of the gaps beside it:
    /// what falls between a lattice's nodes is lost.
    pub(super) fn widened(&self, least_px: f64) -> Self {
        let of_row = |row: &Vec<(f64, f64)>| -> Vec<(f64, f64)> {
            let wide = |(index, &(left, right)): (usize, &(f64, f64))| {
                let grow = ((least_px - (right - left)) / 2.0).max(0.0);
                let before = index.checked_sub(1).map(|before| left - row[before].1);
                let after = row.get(index + 1).map(|after| after.0 - right);
                let within = |gap: Option<f64>| gap.map_or(grow, |gap| grow.min(gap / 2.0));
                (left - within(before), right + within(after))
            };
            row.iter().enumerate().map(wide).collect()
        };
        Self { azimuth_rad: self.azimuth_rad, rows: self.rows.iter().map(of_row).collect() }
    }

    /// The same subject seen in a mirror: the outline at `azimuth_rad`, every
    /// column `u` moved to `sum_px - u`.
    pub(super) fn mirrored(&self, azimuth_rad: f64, sum_px: f64) -> Self {
        let flip = |row: &Vec<(f64, f64)>| {
            row.iter().rev().map(|&(left, right)| (sum_px - right, sum_px - left)).collect()
        };
        Self { azimuth_rad, rows: self.rows.iter().map(flip).collect() }
    }

    /// The horizontal direction in which the column grows.
    pub(super) fn right(&self) -> Vector2<f64> {
        Vector2::new(self.azimuth_rad.cos(), self.azimuth_rad.sin())
    }

    /// The horizontal direction from the axis to the camera.
    pub(super) fn toward_camera(&self) -> Vector2<f64> {
        Vector2::new(self.azimuth_rad.sin(), -self.azimuth_rad.cos())
    }

    /// The column of a point of the horizontal plane, px from the axis.
    pub(super) fn column(&self, point: &Point2<f64>) -> f64 {
        self.right().dot(&point.coords)
    }

    pub(super) fn row(&self, y: usize) -> &[(f64, f64)] {
        self.rows.get(y).map_or(&[], Vec::as_slice)
    }

    /// The first and one past the last row that holds anything.
    pub(super) fn row_range(&self) -> Option<(usize, usize)> {
        let first = self.rows.iter().position(|row| !row.is_empty())?;
        let last = self.rows.iter().rposition(|row| !row.is_empty())?;
        Some((first, last + 1))
    }

    /// The smallest and largest column, px from the axis.
    pub(super) fn column_range(&self) -> Option<(f64, f64)> {
        let ends = self.rows.iter().filter_map(|row| Some((row.first()?.0, row.last()?.1)));
        ends.reduce(|all, row| (all.0.min(row.0), all.1.max(row.1)))
    }

    /// Whether the two look along one line, from the same or opposite sides.
    pub(super) fn is_parallel_to(&self, other: &Self) -> bool {
        let sine = (self.azimuth_rad - other.azimuth_rad).sin();
        sine.abs() < 1e-3
    }
}

/// What of a mask is at most `most_px` high, column by column: 255.
fn alone(mask: &[u8], width: usize, most_px: f64) -> Vec<u8> {
    let mut alone = vec![0; mask.len()];
    let mut above = vec![0_usize; width];
    let rows = mask.len() / width.max(1);
    for y in 0..=rows {
        for (x, above) in above.iter_mut().enumerate() {
            if mask.get(y * width + x).is_some_and(|level| *level != 0) {
                *above += 1;
                continue;
            }
            if *above as f64 <= most_px {
                (y - *above..y).for_each(|y| alone[y * width + x] = 255);
            }
            *above = 0;
        }
    }
    alone
}

/// What two ascending lists of disjoint intervals share.
pub(super) fn intersection(a: &[(f64, f64)], b: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let (mut i, mut j) = (0, 0);
    let mut shared = Vec::new();
    while i < a.len() && j < b.len() {
        let (low, high) = (a[i].0.max(b[j].0), a[i].1.min(b[j].1));
        if low < high {
            shared.push((low, high));
        }
        if a[i].1 < b[j].1 {
            i += 1;
        } else {
            j += 1;
        }
    }
    shared
}

/// What `a` holds and `b` does not, both ascending and disjoint.
pub(super) fn difference(a: &[(f64, f64)], b: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut left = Vec::new();
    for &(low, high) in a {
        let mut from = low;
        for &(cut_low, cut_high) in b.iter().filter(|cut| cut.1 > low && cut.0 < high) {
            if cut_low > from {
                left.push((from, cut_low));
            }
            from = from.max(cut_high);
        }
        if from < high {
            left.push((from, high));
        }
    }
    left
}

/// Overlapping intervals joined, ascending.
pub(super) fn union(mut intervals: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    intervals.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut joined: Vec<(f64, f64)> = Vec::new();
    for (low, high) in intervals {
        match joined.last_mut() {
            Some(last) if low <= last.1 => last.1 = last.1.max(high),
            _ => joined.push((low, high)),
        }
    }
    joined
}

/// The summed length of intervals.
pub(super) fn length(intervals: &[(f64, f64)]) -> f64 {
    intervals.iter().map(|(low, high)| high - low).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn narrow_intervals_widen_up_to_the_middle_of_gaps() {
        let rows = vec![vec![(0.0, 1.0), (2.0, 3.0), (10.0, 20.0)], vec![]];
        let outline = Outline { azimuth_rad: 0.0, rows };
        let wide = outline.widened(4.0);
        assert_eq!(wide.rows[0], [(-1.5, 1.5), (1.5, 4.5), (10.0, 20.0)]);
        assert!(wide.rows[1].is_empty());
    }

    #[test]
    fn low_parts_of_columns_are_strokes_alone() {
        let rows = ["#...", "##..", "##..", "#..#"];
        let mask: Vec<u8> =
            rows.concat().bytes().map(|c| if c == b'#' { 255 } else { 0 }).collect();
        let found = alone(&mask, 4, 2.0);
        let expected = ["....", ".#..", ".#..", "...#"].concat();
        assert!(
            found.iter().zip(expected.bytes()).all(|(level, c)| (*level == 255) == (c == b'#'))
        );
        assert!(alone(&[], 0, 2.0).is_empty());
    }

    #[test]
    fn intersects_and_subtracts() {
        let a = [(0.0, 4.0), (6.0, 9.0)];
        let b = [(-1.0, 1.0), (3.0, 7.0)];
        assert_eq!(intersection(&a, &b), [(0.0, 1.0), (3.0, 4.0), (6.0, 7.0)]);
        assert_eq!(difference(&a, &b), [(1.0, 3.0), (7.0, 9.0)]);
        assert_eq!(length(&difference(&a, &b)), 4.0);
    }

    #[test]
    fn mirrors_about_a_plane() {
        let outline =
            Outline { azimuth_rad: 0.5, rows: vec![vec![(-3.0, -1.0), (2.0, 5.0)], vec![]] };
        let mirrored = outline.mirrored(-0.5, 1.0);
        assert_eq!(mirrored.rows[0], [(-4.0, -1.0), (2.0, 4.0)]);
        assert_eq!(mirrored.column_range(), Some((-4.0, 4.0)));
    }
}
