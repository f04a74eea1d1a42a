//! Sums from a level to the next coarser one, and values back.

use std::ops::Range;

use super::grid::{Links, Stencil};

/// Which cell of the coarser level each cell is part of.
#[derive(Clone, Debug, Default)]
pub(super) struct Transfer {
    /// Rows of the coarser level's blocks: 1 or 2.
    pub block_rows: usize,
    /// 1 for cells that are part of the grid's coarser cell at their place.
    pub in_place: Vec<f32>,
    /// The others, with the cell that they are part of: the grid's red ones,
    /// its black ones, and the extra ones.
    pub strays: [Vec<(u32, u32)>; 3],
}

/// Where the two parities of a coarse row are that a fine row's `span` falls on.
fn halves(coarse: &Links, y: usize, span: &Range<usize>) -> [Range<usize>; 2] {
    [0, 1].map(|parity| {
        let start = coarse.layout.start(y, parity) + span.start / 2;
        start..start + span.len() / 2
    })
}

impl Transfer {
    /// The rows that a coarse row is made of.
    fn rows(&self, fine: &Links, y: usize) -> Range<usize> {
        self.block_rows * y..(self.block_rows * (y + 1)).min(fine.layout.rows())
    }

    /// Sums `values` over the coarser cells.
    pub(super) fn restrict(&self, fine: &Links, coarse: &Links, values: &[f32]) -> Vec<f32> {
        let mut sums = vec![0.0; coarse.len()];
        let mut row = Vec::new();
        for y in 0..coarse.layout.rows() {
            let span = &fine.spans[self.block_rows * y];
            row.clear();
            row.resize(span.len(), 0.0);
            for line in self.rows(fine, y).flat_map(|y| fine.lines(y)) {
                let own = values[line.clone()].iter().zip(&self.in_place[line]);
                for (sum, (value, share)) in row.iter_mut().zip(own) {
                    *sum += value * share;
                }
            }
            split(&row, halves(coarse, y, span), &mut sums);
        }
        for &(cell, part_of) in self.strays.iter().flatten() {
            sums[part_of as usize] += values[cell as usize];
        }
        sums
    }

    /// Sums the residual over the coarser cells, where black cells have none.
    pub(super) fn restrict_residual(
        &self,
        (fine, coarse): (&Links, &Links),
        stencil: Stencil<'_>,
        values: &[f32],
        sums: &mut [f32],
    ) {
        sums[coarse.extras()].fill(0.0);
        let (mut row, mut residual) = (Vec::new(), Vec::new());
        for y in 0..coarse.layout.rows() {
            let span = &fine.spans[self.block_rows * y];
            row.clear();
            row.resize(span.len(), 0.0);
            residual.resize(span.len(), 0.0);
            for y in self.rows(fine, y) {
                let line = fine.red_residual(y, stencil, values, &mut residual);
                for ((sum, value), share) in row.iter_mut().zip(&residual).zip(&self.in_place[line])
                {
                    *sum += value * share;
                }
            }
            split(&row, halves(coarse, y, span), sums);
        }
        for &(cell, part_of) in &self.strays[0] {
            sums[part_of as usize] += fine.residual_at(cell as usize, stencil, values);
        }
    }

    /// Adds the coarser cells' values to those of red and extra cells.
    pub(super) fn prolong(&self, fine: &Links, coarse: &Links, from: &[f32], values: &mut [f32]) {
        let mut row = Vec::new();
        for y in 0..coarse.layout.rows() {
            let span = &fine.spans[self.block_rows * y];
            row.resize(span.len(), 0.0);
            merge(halves(coarse, y, span).map(|half| &from[half]), &mut row);
            for y in self.rows(fine, y) {
                let line = fine.red_line(y);
                let own = values[line.clone()].iter_mut().zip(&self.in_place[line]);
                for ((value, share), coarse) in own.zip(&row) {
                    *value += share * coarse;
                }
            }
        }
        for &(cell, part_of) in self.strays[0].iter().chain(&self.strays[2]) {
            values[cell as usize] += from[part_of as usize];
        }
    }
}

/// Even places of `row` to the first range, odd ones to the second.
fn split(row: &[f32], [even, odd]: [Range<usize>; 2], to: &mut [f32]) {
    for (pair, value) in row.chunks_exact(2).zip(&mut to[even]) {
        *value = pair[0];
    }
    for (pair, value) in row.chunks_exact(2).zip(&mut to[odd]) {
        *value = pair[1];
    }
}

/// The reverse of [`split`].
fn merge([even, odd]: [&[f32]; 2], row: &mut [f32]) {
    for ((pair, even), odd) in row.chunks_exact_mut(2).zip(even).zip(odd) {
        pair.copy_from_slice(&[*even, *odd]);
    }
}
