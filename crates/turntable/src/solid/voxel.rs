//! The dissertation's alternative: an octree carved by the outlines.

use super::cuts::Cut;
use super::outline::Outline;
use crate::surface::field::Lattice;
use crate::surface::occupancy::Occupancy;
use nalgebra::Point3;

/// How many pixels of an outline lie in any rectangle (Crow 1984).
struct AreaTable {
    right: nalgebra::Vector2<f64>,
    /// Column of the table's left border, px from the axis.
    left_px: f64,
    columns: usize,
    rows: usize,
    sums: Vec<u32>,
}

impl AreaTable {
    fn new(outline: &Outline) -> Option<Self> {
        let (low, high) = outline.column_range()?;
        let left_px = low.floor();
        let columns = (high - left_px).ceil() as usize + 1;
        let rows = outline.rows.len();
        let mut sums = vec![0_u32; (columns + 1) * (rows + 1)];
        for y in 0..rows {
            let mut in_row = 0;
            for x in 0..columns {
                let centre = left_px + x as f64 + 0.5;
                let inside =
                    outline.row(y).iter().any(|&(low, high)| low <= centre && centre < high);
                in_row += u32::from(inside);
                sums[(y + 1) * (columns + 1) + x + 1] = sums[y * (columns + 1) + x + 1] + in_row;
            }
        }
        Some(Self { right: outline.right(), left_px, columns, rows, sums })
    }

    /// The share of a rectangle that is inside; columns in px from the axis.
    fn coverage(&self, (left, right): (f64, f64), (top, bottom): (f64, f64)) -> Coverage {
        let first = (left - self.left_px).floor();
        let last = (right - self.left_px).ceil().max(first + 1.0);
        let (from_row, to_row) = (top.floor(), bottom.ceil().max(top.floor() + 1.0));
        let clamp = |value: f64, limit: usize| value.clamp(0.0, limit as f64) as usize;
        let (x0, x1) = (clamp(first, self.columns), clamp(last, self.columns));
        let (y0, y1) = (clamp(from_row, self.rows), clamp(to_row, self.rows));
        let at = |x: usize, y: usize| self.sums[y * (self.columns + 1) + x];
        let inside = at(x1, y1) + at(x0, y0) - at(x0, y1) - at(x1, y0);
        if inside == 0 {
            Coverage::Outside
        } else if f64::from(inside) >= (last - first) * (to_row - from_row) {
            Coverage::Inside
        } else {
            Coverage::Mixed
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Coverage {
    Inside,
    Mixed,
    Outside,
}

/// Carves an octree over `lattice`: octants outside any outline go, octants
/// inside all stay, others are divided down to single nodes, which stay if
/// their centre is inside every outline.
///
/// Returns the nodes that stay. `outlines` are one per direction; of those inside all, only nodes
/// inside all `cuts` stay.
pub(super) fn carve(
    lattice: &Lattice,
    outlines: &[Outline],
    origin_row_px: f64,
    cuts: &[Cut],
) -> Occupancy {
    let tables: Vec<AreaTable> = outlines.iter().filter_map(AreaTable::new).collect();
    let mut kept = Occupancy::empty(lattice.nodes);
    if tables.len() < outlines.len() {
        return kept;
    }
    let side = lattice.nodes.iter().copied().max().unwrap_or(1).next_power_of_two();
    let mut pending = vec![([0_usize; 3], side)];
    while let Some((first, side)) = pending.pop() {
        if (0..3).any(|axis| first[axis] >= lattice.nodes[axis]) {
            continue;
        }
        let coverage = octant_coverage(lattice, &tables, origin_row_px, first, side);
        match coverage {
            Coverage::Outside => {}
            Coverage::Inside => fill(&mut kept, first, side, lattice, cuts),
            Coverage::Mixed if side == 1 => {}
            Coverage::Mixed => {
                let half = side / 2;
                for corner in 0..8_usize {
                    let child =
                        std::array::from_fn(|axis| first[axis] + half * (corner >> axis & 1));
                    pending.push((child, half));
                }
            }
        }
    }
    kept.compose_well();
    kept
}

fn octant_coverage(
    lattice: &Lattice,
    tables: &[AreaTable],
    origin_row_px: f64,
    first: [usize; 3],
    side: usize,
) -> Coverage {
    // A single node stands for its centre, an octant for its nodes' hull.
    let reach = (side - 1) as f64 / 2.0 * lattice.pitch_px;
    let [x, y, z] =
        [lattice.x(first[0]), lattice.y(first[1]), lattice.z(first[2])].map(|low| low + reach);
    let mut worst = Coverage::Inside;
    for table in tables {
        let column = x * table.right.x + y * table.right.y;
        let half = reach * (table.right.x.abs() + table.right.y.abs());
        let row = origin_row_px - z;
        let columns = (column - half, column + half);
        worst = worst.max(table.coverage(columns, (row - reach, row + reach)));
        if worst == Coverage::Outside {
            break;
        }
    }
    worst
}

fn fill(kept: &mut Occupancy, first: [usize; 3], side: usize, lattice: &Lattice, cuts: &[Cut]) {
    let nodes = kept.nodes();
    let inside = |i, j, k| {
        let point = Point3::new(lattice.x(i), lattice.y(j), lattice.z(k));
        cuts.iter().all(|cut| cut.distance()(&point) > 0.0)
    };
    let end: [usize; 3] = std::array::from_fn(|axis| (first[axis] + side).min(nodes[axis]));
    for k in first[2]..end[2] {
        for j in first[1]..end[1] {
            for i in first[0]..end[0] {
                if inside(i, j, k) {
                    kept.set([i + 1, j + 1, k + 1]);
                }
            }
        }
    }
}
