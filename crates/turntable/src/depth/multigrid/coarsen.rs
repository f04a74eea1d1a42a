//! Coarser versions of a graph of cells.

use std::ops::Range;

use super::Link;
use super::grid::{Layout, Links, Rows};
use super::transfer::Transfer;

/// Piecewise constant interpolation makes coarse links about twice too stiff.
const COARSE_LINK_SCALE: f32 = 0.5;
/// Rows are kept apart where links along them are this many times stronger.
const ANISOTROPIC: f32 = 2.8;
/// Weaker links do not make cells one of the coarser level.
const STRONG: f32 = 0.004;
const NONE: u32 = u32::MAX;

/// Cells on a grid, extra ones where several share a place, and their links.
#[derive(Clone, Debug, Default)]
pub(super) struct Graph {
    layout: Layout,
    spans: Vec<Range<usize>>,
    /// Per cell the number of nodes in it, 0 where there is none.
    sizes: Vec<u32>,
    extra_positions: Vec<(u32, u32)>,
    right: Vec<f32>,
    down: Vec<f32>,
    /// Links of extra cells: the lower number first, sorted, each once.
    odd_links: Vec<(u32, u32, f32)>,
}

impl Graph {
    /// * `positions`: column and row of each node; several may share one.
    /// * `links`: each pair once, between nodes at the same or adjacent places.
    ///
    /// Returns the graph and each node's cell.
    pub(super) fn new(
        positions: &[(u32, u32)],
        links: impl Iterator<Item = Link>,
    ) -> (Self, Vec<u32>) {
        let bounds = |value: fn(&(u32, u32)) -> u32| {
            positions.iter().map(value).fold((u32::MAX, 0), |(a, b), v| (a.min(v), b.max(v)))
        };
        let (x, y) = (bounds(|position| position.0), bounds(|position| position.1));
        let extent = |(low, high): (u32, u32)| (high + 1).saturating_sub(low) as usize;
        let mut graph = Self::empty(Layout::new(extent(x), extent(y)));
        let mut cells = Vec::with_capacity(positions.len());
        for position in positions {
            let place = (position.0 - x.0, position.1 - y.0);
            let slot = graph.layout.slot(place.0 as usize, place.1 as usize);
            cells.push(if graph.sizes[slot] == 0 {
                slot as u32
            } else {
                graph.extra_positions.push(place);
                (graph.layout.len() + graph.extra_positions.len() - 1) as u32
            });
            graph.sizes[slot] = 1;
        }
        graph.sizes.resize(graph.layout.len() + graph.extra_positions.len(), 1);
        for link in links {
            graph.link(cells[link.a as usize], cells[link.b as usize], link.weight);
        }
        graph.sort_odd_links();
        graph.set_spans();
        (graph, cells)
    }

    fn empty(layout: Layout) -> Self {
        let zeros = vec![0.0; layout.len()];
        Self {
            layout,
            sizes: vec![0; layout.len()],
            right: zeros.clone(),
            down: zeros,
            ..Self::default()
        }
    }

    /// Adds to the weight of the link between two cells.
    #[inline]
    fn link(&mut self, a: u32, b: u32, weight: f32) {
        let (low, high) = (a.min(b) as usize, a.max(b) as usize);
        let in_grid = high < self.layout.len();
        if in_grid && high == self.layout.below(low) {
            self.down[low] += weight;
        } else if in_grid && high == self.layout.right_of(low) {
            self.right[low] += weight;
        } else if in_grid && low == self.layout.right_of(high) {
            self.right[high] += weight;
        } else {
            self.odd_links.push((low as u32, high as u32, weight));
        }
    }

    fn sort_odd_links(&mut self) {
        self.odd_links.sort_by_key(|&(a, b, _)| (a, b));
        self.odd_links.dedup_by(|next, kept| {
            let same = (next.0, next.1) == (kept.0, kept.1);
            kept.2 += if same { next.2 } else { 0.0 };
            same
        });
    }

    /// The same span for the two rows of a block, of whole blocks of blocks.
    fn set_spans(&mut self) {
        let none = Range { start: usize::MAX, end: 0 };
        let mut spans = vec![none; self.layout.rows()];
        let half_width = self.layout.half_width();
        for y in 0..self.layout.rows() {
            for parity in [0, 1] {
                let start = self.layout.start(y, parity);
                let row = &self.sizes[start..start + half_width];
                let first = row.iter().position(|&size| size > 0);
                let last = row.iter().rposition(|&size| size > 0);
                let (Some(first), Some(last)) = (first, last) else { continue };
                for near in [y & !1, y | 1] {
                    if let Some(span) = spans.get_mut(near) {
                        span.start = span.start.min(first & !1);
                        span.end = span.end.max((last + 2) & !1);
                    }
                }
            }
        }
        let or_empty = |span: Range<usize>| if span.start < span.end { span } else { 0..0 };
        self.spans = spans.into_iter().map(or_empty).collect();
    }

    pub(super) fn cells(&self) -> usize {
        self.sizes.iter().filter(|&&size| size > 0).count()
    }

    /// Calls `visit` with every cell of the grid and its column and row.
    fn for_each_in_grid(&self, mut visit: impl FnMut(usize, (usize, usize))) {
        for (y, span) in self.spans.iter().enumerate() {
            for parity in [0, 1] {
                let start = self.layout.start(y, parity);
                for k in span.clone() {
                    if self.sizes[start + k] > 0 {
                        visit(start + k, (2 * k + parity, y));
                    }
                }
            }
        }
    }

    fn place_of_extra(&self, cell: usize) -> (usize, usize) {
        let (x, y) = self.extra_positions[cell - self.layout.len()];
        (x as usize, y as usize)
    }

    fn place(&self, cell: usize) -> (usize, usize) {
        if cell < self.layout.len() {
            self.layout.position(cell)
        } else {
            self.place_of_extra(cell)
        }
    }

    /// How many rows the blocks of the coarser level have.
    fn block_rows(&self) -> usize {
        let total = |weights: &[f32]| weights.iter().sum::<f32>();
        if total(&self.right) > ANISOTROPIC * total(&self.down) { 1 } else { 2 }
    }

    /// Per cell the lowest number among those of its block that strong links
    /// connect it with.
    fn joined(&self, block_rows: usize) -> Vec<u32> {
        let mut parent: Vec<u32> = (0..self.sizes.len() as u32).collect();
        for (y, span) in self.spans.iter().enumerate() {
            let even = self.layout.start(y, 0);
            for slot in even + span.start..even + span.end {
                if self.right[slot] >= STRONG {
                    join(&mut parent, slot, self.layout.right_of(slot));
                }
            }
            if y % block_rows + 1 == block_rows {
                continue;
            }
            for start in [even, self.layout.start(y, 1)] {
                for slot in start + span.start..start + span.end {
                    if self.down[slot] >= STRONG {
                        join(&mut parent, slot, self.layout.below(slot));
                    }
                }
            }
        }
        let block = |cell: u32| {
            let (x, y) = self.place(cell as usize);
            (x / 2, y / block_rows)
        };
        for &(a, b, weight) in &self.odd_links {
            if weight >= STRONG && block(a) == block(b) {
                join(&mut parent, a as usize, b as usize);
            }
        }
        for cell in 0..parent.len() {
            // The parents of lower cells are roots already.
            parent[cell] = parent[parent[cell] as usize];
        }
        parent
    }

    /// The graph of the joined cells, and which is part of which.
    pub(super) fn coarser(&self) -> (Self, Transfer) {
        let block_rows = self.block_rows();
        let root = self.joined(block_rows);
        let mut sizes = vec![0_u32; root.len()];
        for (&root, &size) in root.iter().zip(&self.sizes) {
            sizes[root as usize] += size;
        }
        let layout = Layout::new(self.layout.half_width(), self.layout.rows().div_ceil(block_rows));
        let mut coarse = Self::empty(layout);
        let mut first = vec![NONE; layout.len()];
        let mut offer = |cell: usize, (x, y): (usize, usize)| {
            let slot = layout.slot(x / 2, y / block_rows);
            if root[cell] as usize == cell && sizes[cell] > coarse.sizes[slot] {
                coarse.sizes[slot] = sizes[cell];
                first[slot] = cell as u32;
            }
        };
        self.for_each_in_grid(&mut offer);
        for cell in layout_extras(self) {
            offer(cell, self.place_of_extra(cell));
        }
        let mut part_of = vec![NONE; root.len()];
        let mut number = |cell: usize, (x, y): (usize, usize)| {
            let slot = layout.slot(x / 2, y / block_rows);
            if root[cell] as usize != cell {
                return;
            }
            part_of[cell] = if first[slot] == cell as u32 {
                slot as u32
            } else {
                coarse.extra_positions.push((x as u32 / 2, (y / block_rows) as u32));
                coarse.sizes.push(sizes[cell]);
                coarse.sizes.len() as u32 - 1
            };
        };
        self.for_each_in_grid(&mut number);
        for cell in layout_extras(self) {
            number(cell, self.place_of_extra(cell));
        }
        for cell in 0..root.len() {
            part_of[cell] = part_of[root[cell] as usize];
        }
        self.link_coarser(&part_of, block_rows, &mut coarse);
        coarse.set_spans();
        let transfer = self.transfer(&part_of, block_rows, layout);
        (coarse, transfer)
    }

    fn link_coarser(&self, part_of: &[u32], block_rows: usize, coarse: &mut Self) {
        // Cells as far apart as the finer ones are linked as firmly.
        let down_scale = if block_rows == 1 { 1.0 } else { COARSE_LINK_SCALE };
        let mut add = |a: usize, b: usize, weight: f32| {
            if weight > 0.0 && part_of[a] != part_of[b] {
                coarse.link(part_of[a], part_of[b], weight);
            }
        };
        for (y, span) in self.spans.iter().enumerate() {
            for parity in [0, 1] {
                let start = self.layout.start(y, parity);
                for slot in start + span.start..start + span.end {
                    let (right, down) = (self.right[slot], self.down[slot]);
                    add(slot, self.layout.right_of(slot), right * COARSE_LINK_SCALE);
                    add(slot, self.layout.below(slot), down * down_scale);
                }
            }
        }
        for &(a, b, weight) in &self.odd_links {
            add(a as usize, b as usize, weight * COARSE_LINK_SCALE);
        }
        coarse.sort_odd_links();
    }

    fn transfer(&self, part_of: &[u32], block_rows: usize, coarse: Layout) -> Transfer {
        let mut transfer =
            Transfer { block_rows, in_place: vec![0.0; self.layout.len()], ..Transfer::default() };
        self.for_each_in_grid(|cell, (x, y)| {
            if part_of[cell] as usize == coarse.slot(x / 2, y / block_rows) {
                transfer.in_place[cell] = 1.0;
            } else {
                transfer.strays[(x + y) % 2].push((cell as u32, part_of[cell]));
            }
        });
        let extras = layout_extras(self).map(|cell| (cell as u32, part_of[cell]));
        transfer.strays[2] = extras.collect();
        transfer
    }

    /// The links as the solver wants them.
    pub(super) fn into_links(self) -> Links {
        let first = self.layout.len() as u32;
        let mut sums = vec![0.0; self.sizes.len()];
        for (y, span) in self.spans.iter().enumerate() {
            for parity in [0, 1] {
                let start = self.layout.start(y, parity);
                for slot in start + span.start..start + span.end {
                    sums[slot] += self.right[slot] + self.down[slot];
                    sums[self.layout.right_of(slot)] += self.right[slot];
                    sums[self.layout.below(slot)] += self.down[slot];
                }
            }
        }
        let (mut extra, mut touching) = (Vec::new(), Vec::new());
        for &(a, b, weight) in &self.odd_links {
            sums[a as usize] += weight;
            sums[b as usize] += weight;
            extra.push((b - first, a, weight));
            if a >= first {
                extra.push((a - first, b, weight));
            } else {
                touching.push((a, b, weight));
            }
        }
        extra.sort_by_key(|&(row, other, _)| (row, other));
        let mut touched: Vec<u32> = touching.iter().map(|link| link.0).collect();
        touched.dedup();
        let mut row = 0;
        for link in &mut touching {
            row += usize::from(touched[row] != link.0);
            link.0 = row as u32;
        }
        Links {
            layout: self.layout,
            spans: self.spans,
            right: self.right,
            down: self.down,
            sums,
            extra: Rows::new(self.extra_positions.len(), &extra),
            touched_links: Rows::new(touched.len(), &touching),
            touched,
        }
    }
}

fn layout_extras(graph: &Graph) -> Range<usize> {
    graph.layout.len()..graph.sizes.len()
}

fn join(parent: &mut [u32], a: usize, b: usize) {
    let (a, b) = (root(parent, a), root(parent, b));
    parent[a.max(b) as usize] = a.min(b);
}

fn root(parent: &mut [u32], cell: usize) -> u32 {
    let mut cell = cell as u32;
    while parent[cell as usize] != cell {
        parent[cell as usize] = parent[parent[cell as usize] as usize];
        cell = parent[cell as usize];
    }
    cell
}
