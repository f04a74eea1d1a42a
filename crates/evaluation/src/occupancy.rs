//! Which cells of a grid a mesh has inside.

use nalgebra::Point3;
use rayon::prelude::*;

use super::cap_blocks::subtract_caps;
use super::winding::WindingField;

/// A cube of cells, sampled at their centres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    pub(super) low: Point3<f64>,
    pub(super) cell: f64,
    /// Cells a side.
    pub(super) cells: usize,
}

impl Grid {
    pub(super) fn around(middle: Point3<f64>, side: f64, cells: usize) -> Self {
        let half = nalgebra::Vector3::repeat(side / 2.0);
        Self { low: middle - half, cell: side / cells as f64, cells }
    }

    /// The centre of cell `index` along `axis`.
    pub(super) fn centre(&self, axis: usize, index: usize) -> f64 {
        self.low[axis] + (index as f64 + 0.5) * self.cell
    }

    /// Where cell `[x, y, z]` is in a grid's values; z runs fastest.
    pub(super) fn at(&self, [x, y, z]: [usize; 3]) -> usize {
        (x * self.cells + y) * self.cells + z
    }

    pub(super) fn high(&self) -> Point3<f64> {
        self.low + nalgebra::Vector3::repeat(self.cell * self.cells as f64)
    }
}

/// Winding numbers at the centres of all cells.
pub(super) fn sample_winding(field: &WindingField, grid: &Grid) -> Vec<f32> {
    let zs: Vec<f64> = (0..grid.cells).map(|z| grid.centre(2, z)).collect();
    let mut windings: Vec<f32> = (0..grid.cells * grid.cells)
        .into_par_iter()
        .flat_map_iter(|column| {
            let (x, y) = (column / grid.cells, column % grid.cells);
            let closed = field.closed_column(grid.centre(0, x), grid.centre(1, y), &zs);
            closed.into_iter().map(|value| value as f32)
        })
        .collect();
    if !field.is_closed() {
        subtract_caps(field, grid, &mut windings);
    }
    windings
}

pub(super) fn is_inside(winding: f32) -> bool {
    winding.abs() > 0.5
}

/// Intersection over union of two solids on one grid; 0 if both are empty.
pub(super) fn intersection_over_union(one: &[bool], other: &[bool]) -> f64 {
    let both = one.iter().zip(other).filter(|&(one, other)| *one && *other).count();
    let any = one.iter().zip(other).filter(|&(one, other)| *one || *other).count();
    super::statistics::share(both, any)
}
