//! What the caps of an open mesh add to winding numbers, on all cells of a grid.
//!
//! Away from the caps that part is harmonic and so changes slowly: it is
//! computed at the corners of blocks of cells and interpolated, unless a cap is
//! near, the block is not flat enough, or some cell may be on the other side of
//! the threshold. There every cell is computed.

use std::ops::Range;

use nalgebra::Point3;
use rayon::prelude::*;

use super::occupancy::Grid;
use super::winding::WindingField;

/// Cells a side of the first blocks.
const BLOCK: usize = 8;

/// Cells a side of the smallest blocks that are interpolated.
const SMALLEST: usize = 4;

/// How far a face's middle may be off the mean of its corners.
const FLAT: f64 = 0.01;

/// How far from a whole number a value may be to be taken as on its side; the
/// threshold is half way between.
const SURE: f64 = 0.44;

/// Subtracts the caps' part from `windings`, the values of `grid`.
pub(super) fn subtract_caps(field: &WindingField, grid: &Grid, windings: &mut [f32]) {
    let slab = BLOCK * grid.cells * grid.cells;
    windings.par_chunks_mut(slab.max(1)).enumerate().for_each(|(index, values)| {
        let xs = index * BLOCK..((index + 1) * BLOCK).min(grid.cells);
        let mut slab = Slab { field, grid, first: grid.at([xs.start, 0, 0]), values };
        for y in (0..grid.cells).step_by(BLOCK) {
            for z in (0..grid.cells).step_by(BLOCK) {
                let end = |start: usize| start..(start + BLOCK).min(grid.cells);
                slab.fill(&Block([xs.clone(), end(y), end(z)]));
            }
        }
    });
}

/// Layers of the grid.
struct Slab<'a> {
    field: &'a WindingField,
    grid: &'a Grid,
    /// Where the slab begins in the grid's values.
    first: usize,
    values: &'a mut [f32],
}

/// Ranges of cells on the three axes.
struct Block([Range<usize>; 3]);

impl Slab<'_> {
    fn fill(&mut self, block: &Block) {
        if block.0.iter().any(Range::is_empty) {
            return;
        }
        if let Some(corners) = self.flat_corners(block) {
            for cell in block.cells() {
                self.subtract(cell, block.interpolate(&corners, cell));
            }
        } else if block.0.iter().any(|range| range.len() > SMALLEST) {
            for part in block.halves() {
                self.fill(&part);
            }
        } else {
            for cell in block.cells() {
                let [x, y, z] = [0, 1, 2].map(|axis| self.grid.centre(axis, cell[axis]));
                self.subtract(cell, self.field.of_caps(&Point3::new(x, y, z)));
            }
        }
    }

    fn subtract(&mut self, cell: [usize; 3], value: f64) {
        let at = self.grid.at(cell) - self.first;
        self.values[at] = (f64::from(self.values[at]) - value) as f32;
    }

    /// The values at the block's corners if they tell of all its cells.
    fn flat_corners(&self, block: &Block) -> Option<[f64; 8]> {
        let at = |share: [f64; 3]| {
            let position = [0, 1, 2].map(|axis| {
                let range = &block.0[axis];
                let cells = range.start as f64 + share[axis] * range.len() as f64;
                self.grid.low[axis] + cells * self.grid.cell
            });
            Point3::from(position)
        };
        let (low, high) = (at([0.0; 3]), at([1.0; 3]));
        // The block's ball and half as much again.
        let reach = 0.75 * (high - low).norm();
        if self.field.has_caps_within(&nalgebra::center(&low, &high), reach) {
            return None;
        }
        let corners: [f64; 8] = std::array::from_fn(|corner| {
            let share = [0, 1, 2].map(|axis| ((corner >> axis) & 1) as f64);
            self.field.of_caps(&at(share))
        });
        let whole = corners[0].round();
        let mut sure = corners.iter().all(|value| (value - whole).abs() < SURE);
        for face in 0..6 {
            let (axis, side) = (face / 2, face % 2);
            let mut share = [0.5; 3];
            share[axis] = side as f64;
            let middle = self.field.of_caps(&at(share));
            let of_face = (0..8).filter(|corner| (corner >> axis) & 1 == side);
            let mean = of_face.map(|corner| corners[corner]).sum::<f64>() / 4.0;
            sure &= (middle - mean).abs() < FLAT && (middle - whole).abs() < SURE;
        }
        sure.then_some(corners)
    }
}

impl Block {
    fn cells(&self) -> impl Iterator<Item = [usize; 3]> + use<> {
        let [xs, ys, zs] = self.0.clone();
        xs.flat_map(move |x| {
            let zs = zs.clone();
            ys.clone().flat_map(move |y| zs.clone().map(move |z| [x, y, z]))
        })
    }

    /// Eight blocks of half the size; some are empty if it has one cell on an
    /// axis.
    fn halves(&self) -> [Self; 8] {
        std::array::from_fn(|half| {
            Self([0, 1, 2].map(|axis| {
                let Range { start, end } = self.0[axis];
                let middle = start + (end - start).div_ceil(2);
                if (half >> axis) & 1 == 0 { start..middle } else { middle..end }
            }))
        })
    }

    /// The value at a cell's centre, linear in each axis between the corners.
    fn interpolate(&self, corners: &[f64; 8], cell: [usize; 3]) -> f64 {
        let share = [0, 1, 2].map(|axis| {
            let range = &self.0[axis];
            ((cell[axis] - range.start) as f64 + 0.5) / range.len() as f64
        });
        let weight = |corner: usize| {
            let of_axis = |axis: usize| match (corner >> axis) & 1 {
                0 => 1.0 - share[axis],
                _ => share[axis],
            };
            of_axis(0) * of_axis(1) * of_axis(2)
        };
        (0..8).map(|corner| corners[corner] * weight(corner)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::occupancy::{is_inside, sample_winding};
    use crate::solid::shapes::{cuboid, merged, sphere};
    use mesh::Mesh;

    fn assert_near_exact(mesh: &Mesh) {
        let field = WindingField::new(mesh).unwrap();
        // A number of cells that no block divides.
        let grid = Grid::around(Point3::new(0.01, 0.02, 0.03), 2.6, 45);
        let found = sample_winding(&field, &grid);
        let (mut interpolated, mut other_side) = (0, 0);
        for cell in Block([0..45, 0..45, 0..45]).cells() {
            let [x, y, z] = [0, 1, 2].map(|axis| grid.centre(axis, cell[axis]));
            let (found, exact) = (found[grid.at(cell)], field.at(&Point3::new(x, y, z)) as f32);
            assert!((found - exact).abs() < 0.03, "{cell:?}: {found} for {exact}");
            interpolated += usize::from(found != exact);
            other_side += usize::from(is_inside(found) != is_inside(exact));
        }
        assert!(interpolated > 0, "every cell was computed");
        assert_eq!(other_side, 0);
    }

    #[test]
    fn interpolated_values_are_near_and_on_the_same_side() {
        let mut holey = sphere(1.0, 24);
        holey.triangles.drain(300..330);
        assert_near_exact(&holey);
        let mut bowl = sphere(1.0, 12);
        bowl.triangles.truncate(bowl.triangles.len() / 2);
        assert_near_exact(&bowl);
        let mut open_box = cuboid([-1.0; 3], [1.0; 3]);
        open_box.triangles.truncate(9);
        assert_near_exact(&merged(&[open_box, holey]));
    }

    #[test]
    fn blocks_of_any_size_come_apart_whole() {
        let block = Block([3..6, 0..1, 2..7]);
        let mut parts: Vec<_> = block.halves().iter().flat_map(Block::cells).collect();
        parts.sort_unstable();
        assert_eq!(parts, block.cells().collect::<Vec<_>>());
    }
}
