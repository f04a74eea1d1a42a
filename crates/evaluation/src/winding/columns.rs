//! Counts where vertical lines cross a mesh, exactly.

use super::frame::{HALF_RANGE, Vertex};

/// Bins hold about this many triangles a side of the binning grid squared.
const MOST_BINS_A_SIDE: usize = 512;

/// Triangles binned by their projection along z, for counting the crossings
/// of vertical lines.
///
/// Orientation tests are exact in integers and a line through an edge or
/// vertex is taken as if it were shifted by an infinitesimal `(ε, ε²)`: every
/// line crosses a closed mesh consistently.
#[derive(Debug)]
pub(super) struct Columns {
    triangles: Vec<[Vertex; 3]>,
    bins_a_side: usize,
    /// Where each bin begins in `members`, and the end of the last.
    starts: Vec<u32>,
    members: Vec<u32>,
}

/// Where a vertical line crosses a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crossing {
    pub(super) z: f64,
    /// 1 if the triangle faces up, -1 if down.
    pub(super) sign: i64,
}

impl Columns {
    pub(super) fn new(triangles: &[[Vertex; 3]]) -> Self {
        let triangles: Vec<[Vertex; 3]> = triangles
            .iter()
            .copied()
            .filter(|&[a, b, c]| doubled_area([a[0], a[1]], [b[0], b[1]], [c[0], c[1]]) != 0)
            .collect();
        let mut bins_a_side = ((triangles.len() as f64).sqrt() as usize).clamp(1, MOST_BINS_A_SIDE);
        // Many triangles that each span the whole picture would fill every
        // bin: coarser bins bound the memory.
        let allowed = 16 * triangles.len() + MOST_BINS_A_SIDE * MOST_BINS_A_SIDE;
        while bins_a_side > 1 && entries(&triangles, bins_a_side) > allowed {
            bins_a_side /= 2;
        }
        let mut columns = Self { triangles, bins_a_side, starts: Vec::new(), members: Vec::new() };
        columns.fill_bins();
        columns
    }

    /// Counting sort of triangles into bins, by rising index in each.
    fn fill_bins(&mut self) {
        let side = self.bins_a_side;
        self.starts = vec![0; side * side + 1];
        for triangle in &self.triangles {
            for bin in covered_bins(triangle, side) {
                self.starts[bin + 1] += 1;
            }
        }
        for bin in 0..side * side {
            self.starts[bin + 1] += self.starts[bin];
        }
        let mut next = self.starts.clone();
        self.members = vec![0; self.starts[side * side] as usize];
        for (index, triangle) in self.triangles.iter().enumerate() {
            for bin in covered_bins(triangle, side) {
                self.members[next[bin] as usize] = index as u32;
                next[bin] += 1;
            }
        }
    }

    /// All crossings of the vertical line at `(x, y)`, in no particular order
    /// but always the same.
    pub(super) fn crossings(&self, x: f64, y: f64) -> Vec<Crossing> {
        let limit = f64::from(HALF_RANGE);
        let (x, y) = (x.round(), y.round());
        if !(x.abs() <= limit && y.abs() <= limit) {
            return Vec::new();
        }
        let foot = [x as i32, y as i32];
        let bin = bin_of(foot[1], self.bins_a_side) * self.bins_a_side
            + bin_of(foot[0], self.bins_a_side);
        self.members[self.starts[bin] as usize..self.starts[bin + 1] as usize]
            .iter()
            .filter_map(|&index| crossing(&self.triangles[index as usize], foot))
            .collect()
    }
}

fn bin_of(coordinate: i32, bins_a_side: usize) -> usize {
    let from_low = (i64::from(coordinate) + i64::from(HALF_RANGE)) as usize;
    (from_low * bins_a_side / (2 * HALF_RANGE as usize)).min(bins_a_side - 1)
}

/// The first and last bin on one axis.
fn bin_range(triangle: &[Vertex; 3], axis: usize, bins_a_side: usize) -> (usize, usize) {
    let [a, b, c] = triangle.map(|vertex| vertex[axis]);
    (bin_of(a.min(b).min(c), bins_a_side), bin_of(a.max(b).max(c), bins_a_side))
}

fn covered_bins(triangle: &[Vertex; 3], side: usize) -> impl Iterator<Item = usize> + use<> {
    let (left, right) = bin_range(triangle, 0, side);
    let (bottom, top) = bin_range(triangle, 1, side);
    (bottom..=top).flat_map(move |row| (left..=right).map(move |column| row * side + column))
}

fn entries(triangles: &[[Vertex; 3]], side: usize) -> usize {
    triangles
        .iter()
        .map(|triangle| {
            let (left, right) = bin_range(triangle, 0, side);
            let (bottom, top) = bin_range(triangle, 1, side);
            (right - left + 1) * (top - bottom + 1)
        })
        .sum()
}

/// Twice the signed area of `abp`; exact.
fn doubled_area(a: [i32; 2], b: [i32; 2], p: [i32; 2]) -> i64 {
    let [ax, ay] = a.map(i64::from);
    let [bx, by] = b.map(i64::from);
    let [px, py] = p.map(i64::from);
    (bx - ax) * (py - ay) - (by - ay) * (px - ax)
}

/// Whether `p`, shifted by `(ε, ε²)`, is left of the line from `a` to `b`.
fn is_left(area: i64, a: [i32; 2], b: [i32; 2]) -> bool {
    match area {
        0 if a[1] != b[1] => b[1] < a[1],
        0 => b[0] > a[0],
        _ => area > 0,
    }
}

fn crossing(triangle: &[Vertex; 3], foot: [i32; 2]) -> Option<Crossing> {
    let [a, b, c] = triangle.map(|vertex| [vertex[0], vertex[1]]);
    let areas = [doubled_area(b, c, foot), doubled_area(c, a, foot), doubled_area(a, b, foot)];
    let left = [is_left(areas[0], b, c), is_left(areas[1], c, a), is_left(areas[2], a, b)];
    if left[0] != left[1] || left[1] != left[2] {
        return None;
    }
    let total: i64 = areas.iter().sum();
    let weighed: f64 = areas
        .iter()
        .zip(triangle)
        .map(|(&area, vertex)| area as f64 / total as f64 * f64::from(vertex[2]))
        .sum();
    Some(Crossing { z: weighed, sign: if left[0] { 1 } else { -1 } })
}
