//! How the cells of one level are kept, and sweeps over them.
//!
//! A row is stored as its even columns, then its odd ones: the cells of one
//! colour of a checkerboard are contiguous, and so are those at each corner of
//! the 2x2 blocks that the next level's cells are made of. A border of cells
//! that do not exist surrounds the grid. Where a cut parts a block, one part
//! has the block's place in the grid; the others are extra cells with lists of
//! links, kept after the grid's.

use std::ops::Range;

/// The order of a grid's cells in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Layout {
    /// Cells of each parity in a row, the border's among them.
    stride: usize,
    rows: usize,
}

impl Layout {
    /// A grid of whole blocks of blocks across.
    pub(super) fn new(width: usize, rows: usize) -> Self {
        Self { stride: width.div_ceil(4) * 2 + 2, rows }
    }

    /// Cells, the border's among them.
    pub(super) fn len(self) -> usize {
        (self.rows + 2) * 2 * self.stride
    }

    pub(super) fn rows(self) -> usize {
        self.rows
    }

    /// Half columns.
    pub(super) fn half_width(self) -> usize {
        self.stride - 2
    }

    pub(super) fn slot(self, x: usize, y: usize) -> usize {
        self.start(y, x % 2) + x / 2
    }

    /// The first slot of a row's even (0) or odd (1) columns.
    pub(super) fn start(self, y: usize, parity: usize) -> usize {
        ((y + 1) * 2 + parity) * self.stride + 1
    }

    /// Column and row of a slot inside the border.
    pub(super) fn position(self, slot: usize) -> (usize, usize) {
        let (line, k) = (slot / self.stride, slot % self.stride);
        ((k - 1) * 2 + line % 2, line / 2 - 1)
    }

    pub(super) fn right_of(self, slot: usize) -> usize {
        match (slot / self.stride) % 2 {
            0 => slot + self.stride,
            _ => slot + 1 - self.stride,
        }
    }

    fn left_of(self, slot: usize) -> usize {
        match (slot / self.stride) % 2 {
            0 => slot + self.stride - 1,
            _ => slot - self.stride,
        }
    }

    pub(super) fn below(self, slot: usize) -> usize {
        slot + 2 * self.stride
    }

    fn above(self, slot: usize) -> usize {
        slot - 2 * self.stride
    }

    fn line(self, y: usize, parity: usize, span: &Range<usize>) -> Line {
        let start = self.start(y, parity) + span.start;
        let (left, right) = match parity {
            0 => (start + self.stride - 1, start + self.stride),
            _ => (start - self.stride, start - self.stride + 1),
        };
        let (above, below) = (start - 2 * self.stride, start + 2 * self.stride);
        Line { start, length: span.len(), left, right, above, below }
    }
}

/// The even or the odd columns of a row, and the slots beside the first.
#[derive(Clone, Copy)]
struct Line {
    start: usize,
    length: usize,
    left: usize,
    right: usize,
    above: usize,
    below: usize,
}

impl Line {
    fn range(self) -> Range<usize> {
        self.start..self.start + self.length
    }

    fn neighbours(self) -> [usize; 4] {
        [self.left, self.right, self.above, self.below]
    }
}

/// The links of one level's cells.
#[derive(Clone, Debug, Default)]
pub(super) struct Links {
    pub layout: Layout,
    /// Per row the half columns that hold cells.
    pub spans: Vec<Range<usize>>,
    /// Per slot of the grid the weight of the link to the right and down.
    pub right: Vec<f32>,
    pub down: Vec<f32>,
    /// Per cell, extra ones too, the sum of its links' weights.
    pub sums: Vec<f32>,
    /// The links of the extra cells.
    pub extra: Rows,
    /// The grid's cells that have links to extra ones, and those links.
    pub touched: Vec<u32>,
    pub touched_links: Rows,
}

/// Links in compressed rows.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    starts: Vec<u32>,
    others: Vec<u32>,
    weights: Vec<f32>,
}

impl Rows {
    /// * `links`: row, other cell and weight, sorted by row.
    pub(super) fn new(rows: usize, links: &[(u32, u32, f32)]) -> Self {
        let mut starts = vec![0_u32; rows + 1];
        for &(row, ..) in links {
            starts[row as usize + 1] += 1;
        }
        for row in 0..rows {
            starts[row + 1] += starts[row];
        }
        let others = links.iter().map(|link| link.1).collect();
        Self { starts, others, weights: links.iter().map(|link| link.2).collect() }
    }

    pub(super) fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// The weighted sum of `values` over a row's links.
    fn linked(&self, row: usize, values: &[f32]) -> f32 {
        let range = self.starts[row] as usize..self.starts[row + 1] as usize;
        let links = self.others[range.clone()].iter().zip(&self.weights[range]);
        links.map(|(&other, &weight)| weight * values[other as usize]).sum()
    }
}

/// The colours of the checkerboard, whose cells are linked with the other
/// colour's and with extra cells only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Colour {
    Red = 0,
    Black = 1,
}

impl Links {
    pub(super) fn len(&self) -> usize {
        self.sums.len()
    }

    pub(super) fn extras(&self) -> Range<usize> {
        self.layout.len()..self.len()
    }

    /// Stretches of slots that hold all cells.
    pub(super) fn ranges(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let of_row = move |(y, span): (usize, &Range<usize>)| {
            [0, 1].map(|parity| {
                let start = self.layout.start(y, parity);
                start + span.start..start + span.end
            })
        };
        self.spans.iter().enumerate().flat_map(of_row).chain([self.extras()])
    }

    fn line(&self, y: usize, parity: usize) -> Line {
        self.layout.line(y, parity, &self.spans[y])
    }

    fn weights(&self, line: Line) -> [&[f32]; 4] {
        let n = line.length;
        [
            &self.right[line.left..][..n],
            &self.right[line.start..][..n],
            &self.down[line.above..][..n],
            &self.down[line.start..][..n],
        ]
    }

    /// Gauss-Seidel over the grid's cells of one colour.
    pub(super) fn relax(
        &self,
        colour: Colour,
        inverse: &[f32],
        target: &[f32],
        values: &mut [f32],
    ) {
        for y in 0..self.layout.rows() {
            let line = self.line(y, (y + colour as usize) % 2);
            let n = line.length;
            let (before, rest) = values.split_at_mut(line.start);
            let (own, after) = rest.split_at_mut(n);
            let beside = line.neighbours().map(|start| match start.checked_sub(line.start + n) {
                Some(start) => &after[start..][..n],
                None => &before[start..][..n],
            });
            let weights = self.weights(line);
            let (inverse, target) = (&inverse[line.start..][..n], &target[line.start..][..n]);
            for k in 0..n {
                own[k] = (target[k] + linked(weights, beside, k)) * inverse[k];
            }
        }
    }

    /// The same as [`relax`](Self::relax) of red cells where all others are 0.
    pub(super) fn relax_red_first(&self, inverse: &[f32], target: &[f32], values: &mut [f32]) {
        for y in 0..self.layout.rows() {
            let line = self.red_line(y);
            let own = values[line.clone()].iter_mut();
            for ((value, inverse), target) in own.zip(&inverse[line.clone()]).zip(&target[line]) {
                *value = target * inverse;
            }
        }
    }

    /// Gauss-Seidel over the extra cells.
    pub(super) fn relax_extras(
        &self,
        order: impl Iterator<Item = usize>,
        inverse: &[f32],
        target: &[f32],
        values: &mut [f32],
    ) {
        let first = self.layout.len();
        for row in order {
            let slot = first + row;
            values[slot] = (target[slot] + self.extra.linked(row, values)) * inverse[slot];
        }
    }

    /// The product with `diag(diagonal) - links`.
    pub(super) fn apply(&self, diagonal: &[f32], values: &[f32], product: &mut [f32]) {
        for y in 0..self.layout.rows() {
            for parity in [0, 1] {
                let line = self.line(y, parity);
                let n = line.length;
                let beside = line.neighbours().map(|start| &values[start..][..n]);
                let weights = self.weights(line);
                let own = &values[line.start..][..n];
                let diagonal = &diagonal[line.start..][..n];
                let product = &mut product[line.start..][..n];
                for k in 0..n {
                    product[k] = diagonal[k] * own[k] - linked(weights, beside, k);
                }
            }
        }
        for (row, &slot) in self.touched.iter().enumerate() {
            product[slot as usize] -= self.touched_links.linked(row, values);
        }
        for (row, slot) in self.extras().enumerate() {
            product[slot] = diagonal[slot] * values[slot] - self.extra.linked(row, values);
        }
    }

    /// What the extra cells add to the target of the grid's: remembers the
    /// target as it was.
    pub(super) fn add_extras(&self, values: &[f32], target: &mut [f32], saved: &mut Vec<f32>) {
        saved.clear();
        for (row, &slot) in self.touched.iter().enumerate() {
            let target = &mut target[slot as usize];
            saved.push(*target);
            *target += self.touched_links.linked(row, values);
        }
    }

    pub(super) fn restore(&self, target: &mut [f32], saved: &[f32]) {
        for (&slot, &value) in self.touched.iter().zip(saved) {
            target[slot as usize] = value;
        }
    }

    /// The slots of row `y`'s even and odd columns.
    pub(super) fn lines(&self, y: usize) -> [Range<usize>; 2] {
        [self.line(y, 0).range(), self.line(y, 1).range()]
    }

    /// The slots of row `y`'s red cells.
    pub(super) fn red_line(&self, y: usize) -> Range<usize> {
        self.line(y, y % 2).range()
    }

    /// The residual of the red cells of row `y`; returns their slots.
    pub(super) fn red_residual(
        &self,
        y: usize,
        Stencil { diagonal, target }: Stencil<'_>,
        values: &[f32],
        residual: &mut [f32],
    ) -> Range<usize> {
        let line = self.line(y, y % 2);
        let n = line.length;
        let beside = line.neighbours().map(|start| &values[start..][..n]);
        let weights = self.weights(line);
        let own = &values[line.start..][..n];
        let (diagonal, target) = (&diagonal[line.start..][..n], &target[line.start..][..n]);
        let residual = &mut residual[..n];
        for k in 0..n {
            residual[k] = target[k] + linked(weights, beside, k) - diagonal[k] * own[k];
        }
        line.range()
    }

    /// The residual of one cell of the grid.
    pub(super) fn residual_at(&self, cell: usize, stencil: Stencil<'_>, values: &[f32]) -> f32 {
        let (left, right) = (self.layout.left_of(cell), self.layout.right_of(cell));
        let (above, below) = (self.layout.above(cell), self.layout.below(cell));
        let across = self.right[left] * values[left] + self.right[cell] * values[right];
        let along = self.down[above] * values[above] + self.down[cell] * values[below];
        stencil.target[cell] + across + along - stencil.diagonal[cell] * values[cell]
    }

    /// The residual of the extra cell of number `row`.
    pub(super) fn extra_residual(&self, row: usize, stencil: Stencil<'_>, values: &[f32]) -> f32 {
        let cell = self.layout.len() + row;
        stencil.target[cell] + self.extra.linked(row, values)
            - stencil.diagonal[cell] * values[cell]
    }
}

/// The diagonal and the right side of one level's equations.
#[derive(Clone, Copy)]
pub(super) struct Stencil<'a> {
    pub diagonal: &'a [f32],
    pub target: &'a [f32],
}

#[inline(always)]
fn linked(weights: [&[f32]; 4], beside: [&[f32]; 4], k: usize) -> f32 {
    let across = weights[0][k] * beside[0][k] + weights[1][k] * beside[1][k];
    across + weights[2][k] * beside[2][k] + weights[3][k] * beside[3][k]
}
