//! The solid as a stack of signed distance planes.

use nalgebra::{Point2, Point3, Vector2};

/// A regular lattice in the turntable frame, slices bottom to top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// The position of node (0, 0, 0), px.
    pub origin: Point3<f64>,
    /// The distance between neighbouring nodes, px.
    pub pitch_px: f64,
    /// Nodes along X, Y and Z.
    pub nodes: [usize; 3],
}

impl Lattice {
    /// X of the nodes with first index `i`, px.
    pub fn x(&self, i: usize) -> f64 {
        self.origin.x + i as f64 * self.pitch_px
    }

    /// Y of the nodes with second index `j`, px.
    pub fn y(&self, j: usize) -> f64 {
        self.origin.y + j as f64 * self.pitch_px
    }

    /// Height of slice `k`, px.
    pub fn z(&self, k: usize) -> f64 {
        self.origin.z + k as f64 * self.pitch_px
    }

    /// The farthest distance that planes tell, px.
    pub fn truncation_px(&self) -> f64 {
        4.0 * self.pitch_px
    }

    /// The nodes along one axis between two coordinates, clamped to the lattice.
    fn range(&self, axis: usize, low: f64, high: f64) -> std::ops::Range<usize> {
        let index = |value: f64| (value - self.origin[axis]) / self.pitch_px;
        // Rounded by casts, which are quicker than calls.
        let low = index(low).max(0.0);
        let first = (low as usize).saturating_add(usize::from(low > (low as usize) as f64));
        let last = (index(high) + 1.0).max(0.0) as usize;
        first.min(self.nodes[axis])..last.min(self.nodes[axis])
    }
}

/// Signed distances to the solid's outline in one slice, px, positive inside,
/// truncated; a window of the lattice beyond which everything is outside.
#[derive(Clone, Debug, Default)]
pub struct Plane {
    /// Column and row of the lattice where the window begins.
    pub first: [usize; 2],
    /// Columns and rows of the window; 0 where nothing is inside.
    pub size: [usize; 2],
    /// Row by row, X fastest.
    pub values: Vec<f32>,
    /// Where creases cross the slice.
    pub creases: Vec<Point2<f64>>,
}

impl Plane {
    /// The union of `polygons` on `lattice`. Polygons are simple and
    /// counter-clockwise.
    pub fn of_polygons(lattice: &Lattice, polygons: &[Vec<Point2<f64>>]) -> Self {
        if let [polygon] = polygons {
            return Self::of_polygon(lattice, polygon);
        }
        let outside = -lattice.truncation_px() as f32;
        let mut plane = Self::window(lattice, polygons.iter().flatten(), outside);
        for polygon in polygons {
            plane.unite(&Self::of_polygon(lattice, polygon));
        }
        plane
    }

    /// What is near `corners`, all of it `value`.
    fn window<'a>(
        lattice: &Lattice,
        corners: impl IntoIterator<Item = &'a Point2<f64>>,
        value: f32,
    ) -> Self {
        let margin = lattice.truncation_px();
        let mut corners = corners.into_iter();
        let Some(first) = corners.next() else {
            return Self::default();
        };
        let (low, high) =
            corners.fold((*first, *first), |(low, high), p| (low.inf(p), high.sup(p)));
        let columns = lattice.range(0, low.x - margin, high.x + margin);
        let rows = lattice.range(1, low.y - margin, high.y + margin);
        Self {
            first: [columns.start, rows.start],
            size: [columns.len(), rows.len()],
            values: vec![value; columns.len() * rows.len()],
            creases: Vec::new(),
        }
    }

    fn of_polygon(lattice: &Lattice, polygon: &[Point2<f64>]) -> Self {
        let farthest = lattice.truncation_px() * lattice.truncation_px();
        let mut plane = Self::window(lattice, polygon, farthest as f32);
        for (i, from) in polygon.iter().enumerate() {
            plane.lower_to_segment(lattice, from, &polygon[(i + 1) % polygon.len()]);
        }
        plane.values.iter_mut().for_each(|squared| *squared = squared.sqrt());
        plane.negate_outside(lattice, polygon);
        plane
    }

    /// Adds what is inside `other`, whose window lies in this one's.
    fn unite(&mut self, other: &Self) {
        let offset = [0, 1].map(|axis| other.first[axis].saturating_sub(self.first[axis]));
        for (j, row) in other.values.chunks_exact(other.size[0].max(1)).enumerate() {
            let start = (offset[1] + j) * self.size[0] + offset[0];
            for (value, other) in self.values[start..].iter_mut().zip(row) {
                *value = value.max(*other);
            }
        }
    }

    /// Lowers squared distances to those of the segment.
    fn lower_to_segment(&mut self, lattice: &Lattice, from: &Point2<f64>, to: &Point2<f64>) {
        let reach = lattice.truncation_px();
        let along = to - from;
        let (low_y, high_y) = (from.y.min(to.y) - reach, from.y.max(to.y) + reach);
        for j in lattice.range(1, low_y, high_y) {
            let y = lattice.y(j);
            // The part of the segment whose distance to the row is in reach.
            let at = |value: f64| {
                if along.y.abs() < 1e-9 {
                    None
                } else {
                    Some(((value - from.y) / along.y).clamp(0.0, 1.0))
                }
            };
            let (s, t) = (at(y - reach).unwrap_or(0.0), at(y + reach).unwrap_or(1.0));
            let (a, b) = (from.x + along.x * s, from.x + along.x * t);
            let columns = lattice.range(0, a.min(b) - reach, a.max(b) + reach);
            let first = Point2::new(lattice.x(columns.start), y) - from;
            let start = (j - self.first[1]) * self.size[0] + columns.start - self.first[0];
            let row = &mut self.values[start..start + columns.len()];
            lower_row(row, first.cast(), lattice.pitch_px as f32, along.cast());
        }
    }

    /// Turns distances outside `polygon` negative, by scanlines.
    fn negate_outside(&mut self, lattice: &Lattice, polygon: &[Point2<f64>]) {
        let mut crossings: Vec<f64> = Vec::new();
        for j in 0..self.size[1] {
            let y = lattice.y(self.first[1] + j);
            crossings.clear();
            for (i, from) in polygon.iter().enumerate() {
                let to = &polygon[(i + 1) % polygon.len()];
                if (from.y <= y) != (to.y <= y) {
                    crossings.push(from.x + (to.x - from.x) * (y - from.y) / (to.y - from.y));
                }
            }
            crossings.sort_by(f64::total_cmp);
            let row = &mut self.values[j * self.size[0]..(j + 1) * self.size[0]];
            // Outside from each second crossing to the next; what lies on one is past it.
            let column = |&x: &f64| {
                let nodes = lattice.range(0, x, f64::INFINITY);
                (nodes.start.max(self.first[0]) - self.first[0]).min(row.len())
            };
            let ends: Vec<usize> = crossings.iter().map(column).collect();
            let ends = [&[0], &ends[..], &[row.len()]].concat();
            for outside in ends.chunks_exact(2) {
                row[outside[0]..outside[1]].iter_mut().for_each(|value| *value = -*value);
            }
        }
    }

    /// The node of the lattice that a value belongs to.
    pub fn node(&self, index: usize) -> (usize, usize) {
        (self.first[0] + index % self.size[0], self.first[1] + index / self.size[0])
    }

    /// The value at node (i, j) of the lattice; `outside` beyond the window.
    pub fn at(&self, i: usize, j: usize, outside: f32) -> f32 {
        match (i.checked_sub(self.first[0]), j.checked_sub(self.first[1])) {
            (Some(i), Some(j)) if i < self.size[0] && j < self.size[1] => {
                self.values[j * self.size[0] + i]
            }
            _ => outside,
        }
    }

    /// The values at the nodes from `first` on in row `j` of the lattice; `outside` beyond the
    /// window.
    pub fn copy_row(&self, first: usize, j: usize, outside: f32, out: &mut [f32]) {
        out.fill(outside);
        let row = j.checked_sub(self.first[1]).filter(|row| *row < self.size[1]);
        let (start, end) = (first.max(self.first[0]), first + out.len());
        let end = end.min(self.first[0] + self.size[0]);
        if let Some(row) = row.filter(|_| start < end) {
            let from = row * self.size[0] + start - self.first[0];
            let values = &self.values[from..from + end - start];
            out[start - first..end - first].copy_from_slice(values);
        }
    }
}

/// Lowers squared distances to those of the segment `along` from the origin, in
/// a row of points `pitch_px` apart that starts at `first`.
fn lower_row(squared: &mut [f32], first: Vector2<f32>, pitch_px: f32, along: Vector2<f32>) {
    let per_length = along / along.norm_squared().max(1e-12);
    for (i, squared) in squared.iter_mut().enumerate() {
        let x = first.x + i as f32 * pitch_px;
        let nearest = (x * per_length.x + first.y * per_length.y).clamp(0.0, 1.0);
        let (dx, dy) = (x - nearest * along.x, first.y - nearest * along.y);
        *squared = squared.min(dx * dx + dy * dy);
    }
}

/// A plane per slice, bottom to top.
#[derive(Clone, Debug)]
pub struct Field {
    /// Where the nodes are.
    pub lattice: Lattice,
    /// One a slice.
    pub planes: Vec<Plane>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice() -> Lattice {
        Lattice { origin: Point3::new(-10.0, -10.0, 0.0), pitch_px: 0.5, nodes: [41, 41, 2] }
    }

    fn square(low: f64, high: f64) -> Vec<Point2<f64>> {
        [(low, low), (high, low), (high, high), (low, high)]
            .map(|(x, y)| Point2::new(x, y))
            .to_vec()
    }

    #[test]
    fn distances_are_exact_and_truncated() {
        let plane = Plane::of_polygons(&lattice(), &[square(-5.2, 5.2)]);
        let at = |x: f64, y: f64| {
            plane.at(((x + 10.0) * 2.0) as usize, ((y + 10.0) * 2.0) as usize, -2.0)
        };
        assert!((at(5.0, 0.0) - 0.2).abs() < 1e-5);
        assert!((at(6.0, 0.0) + 0.8).abs() < 1e-5);
        assert!((at(6.0, 6.0) + 0.8 * 2.0_f32.sqrt()).abs() < 1e-5);
        assert_eq!(at(0.0, 0.0), 2.0);
        assert_eq!(at(9.5, 0.0), -2.0);
    }

    #[test]
    fn polygons_unite() {
        let plane = Plane::of_polygons(&lattice(), &[square(-6.0, -3.0), square(3.0, 6.0)]);
        let inside = plane.values.iter().filter(|&&value| value > 0.0).count();
        assert_eq!(inside, 2 * 5 * 5);
    }
}
