//! The silhouette in coarse blocks, on which lines are released.

use super::border_side::{Piece, Prediction};
use super::contours::{Contours, Crossing};
use super::filters::median;
use super::graph::{Cuts, Owner, PixelGraph};
use super::lines::LineDepths;
use super::multigrid::{Hierarchy, Link};
use super::owners::{cut_inner, line_weight};
use mesh::connected::components;

/// Label of cuts along lines whose owner is known.
const DECIDED: u16 = 1;
/// Side of the blocks that a release is solved on, px.
const BLOCK_PX: u32 = 4;

/// The part of the image that a release is solved in, blocks.
#[derive(Clone, Copy)]
pub(super) struct Window {
    low: (u32, u32),
    high: (u32, u32),
}

impl Window {
    pub(super) fn around(piece: &Piece, contours: &Contours) -> Self {
        const MARGIN_PX: (u32, u32) = (80, 32);
        let crossings = || piece.crossings.iter().map(|&i| &contours.crossings[i as usize]);
        let low = |value: u32, margin: u32| value.saturating_sub(margin) / BLOCK_PX;
        let high = |value: u32, margin: u32| (value + margin) / BLOCK_PX + 1;
        let bounds = |value: fn(&Crossing) -> u32| {
            crossings().map(value).fold((u32::MAX, 0), |(a, b), v| (a.min(v), b.max(v)))
        };
        let (x, y) = (bounds(|crossing| crossing.start), bounds(|crossing| crossing.y));
        Self {
            low: (low(x.0, MARGIN_PX.0), low(y.0, MARGIN_PX.1)),
            high: (high(x.1, MARGIN_PX.0), high(y.1, MARGIN_PX.1)),
        }
    }

    fn contains(&self, (x, y): (u32, u32)) -> bool {
        (self.low.0..self.high.0).contains(&x) && (self.low.1..self.high.1).contains(&y)
    }

    pub(super) fn overlaps(&self, other: &Self) -> bool {
        self.low.0 < other.high.0
            && other.low.0 < self.high.0
            && self.low.1 < other.high.1
            && other.low.1 < self.high.1
    }
}

/// The silhouette in blocks, split where any line may cut.
pub(super) struct Blocks {
    cell_of_node: Vec<u32>,
    positions: Vec<(u32, u32)>,
    /// Links that are not cut, or only by the piece of this number.
    links: Vec<(Link, Option<u32>)>,
    /// Per cell, line depths: weight and weighted sum, and those of pieces apart.
    data: Vec<(f32, f32)>,
    piece_data: Vec<Vec<(u32, f32, f32)>>,
}

const OPEN: u32 = u32::MAX;

impl Blocks {
    pub(super) fn new(
        graph: &PixelGraph,
        contours: &Contours,
        lines: &LineDepths,
        pieces: &[Piece],
        owners: &[Option<Owner>],
    ) -> Self {
        let mut cuts = Cuts::none(graph);
        cut_inner(&mut cuts, graph, contours, owners, DECIDED);
        // There are at most `border_side::MAX_PIECES`: a label has room for them.
        for (number, piece) in pieces.iter().enumerate() {
            for owner in [Owner::Left, Owner::Right] {
                cuts.along(graph, contours, &piece.crossings, owner, DECIDED + 1 + number as u16);
            }
        }
        let fine: Vec<(Link, u16)> = graph.links(&cuts, 1.0, 0.0).collect();
        let (cell_of_node, positions) = cells(graph, &fine);
        let links = cell_links(&fine, &cell_of_node);
        let mut blocks = Self {
            data: vec![(0.0, 0.0); positions.len()],
            piece_data: vec![Vec::new(); pieces.len()],
            cell_of_node,
            positions,
            links,
        };
        blocks.add_data(graph, contours, lines, pieces);
        blocks
    }

    fn add_data(
        &mut self,
        graph: &PixelGraph,
        contours: &Contours,
        lines: &LineDepths,
        pieces: &[Piece],
    ) {
        let mut piece_of = vec![None; contours.crossings.len()];
        for (number, piece) in pieces.iter().enumerate() {
            piece.crossings.iter().for_each(|&index| piece_of[index as usize] = Some(number));
        }
        for (index, crossing) in contours.crossings.iter().enumerate() {
            let (depth, weight) = (lines.depth_px[index], line_weight(crossing));
            let Some(node) = graph.node_at(crossing).filter(|_| !depth.is_nan() && weight > 0.0)
            else {
                continue;
            };
            let cell = self.cell_of_node[node];
            let (weight, sum) = (10.0 * weight as f32, (10.0 * weight * depth) as f32);
            match piece_of[index] {
                Some(number) => self.piece_data[number].push((cell, weight, sum)),
                None => {
                    self.data[cell as usize].0 += weight;
                    self.data[cell as usize].1 += sum;
                }
            }
        }
    }

    /// The depth that the lines give each node, NaN where none tells: nothing
    /// is joined across lines along the rows.
    pub(super) fn settled(&self) -> Vec<f32> {
        let depth = self.solve(usize::MAX, Window { low: (0, 0), high: (u32::MAX, u32::MAX) });
        self.cell_of_node.iter().map(|&cell| depth[cell as usize]).collect()
    }

    /// Solves the neighbourhood of a piece with its line taken out.
    pub(super) fn predict(
        &self,
        number: usize,
        piece: &Piece,
        contours: &Contours,
        lines: &LineDepths,
        graph: &PixelGraph,
    ) -> Option<Prediction> {
        let usable: Vec<u32> = piece
            .crossings
            .iter()
            .copied()
            .filter(|&index| {
                !lines.depth_px[index as usize].is_nan()
                    && contours.crossings[index as usize].slope.abs() < 5.0
            })
            .collect();
        if usable.len() < 4 {
            return None;
        }
        let depth = self.solve(number, Window::around(piece, contours));
        let beside = |left: bool| {
            let excess = |&index: &u32| {
                let crossing = &contours.crossings[index as usize];
                let middle = crossing.column(graph.width);
                let column = if left {
                    middle.min(crossing.start as usize).checked_sub(2)?
                } else {
                    middle.max(crossing.end as usize) + 1
                };
                let node = graph.node_beside(crossing.y, column, 0)?;
                let predicted = *depth.get(self.cell_of_node[node] as usize)?;
                (!predicted.is_nan()).then(|| f64::from(predicted) - lines.depth_px[index as usize])
            };
            let mut found: Vec<f64> = usable.iter().filter_map(excess).collect();
            (found.len() >= 3).then(|| median(&mut found))
        };
        Some(Prediction { left_px: beside(true)?, right_px: beside(false)? })
    }

    /// Depth per cell, NaN outside the window and where no line tells.
    fn solve(&self, number: usize, window: Window) -> Vec<f32> {
        let mut local = vec![u32::MAX; self.positions.len()];
        let inside: Vec<u32> = (0..self.positions.len() as u32)
            .filter(|&cell| window.contains(self.positions[cell as usize]))
            .collect();
        for (index, &cell) in inside.iter().enumerate() {
            local[cell as usize] = index as u32;
        }
        let links: Vec<Link> = self
            .links
            .iter()
            .filter(|(_, piece)| *piece != Some(number as u32))
            .map(|(link, _)| Link {
                a: local[link.a as usize],
                b: local[link.b as usize],
                weight: link.weight,
            })
            .filter(|link| link.a != u32::MAX && link.b != u32::MAX)
            .collect();
        let mut screen: Vec<f32> = inside.iter().map(|&c| self.data[c as usize].0).collect();
        let mut right: Vec<f32> = inside.iter().map(|&c| self.data[c as usize].1).collect();
        let others = self.piece_data.iter().enumerate().filter(|(other, _)| *other != number);
        for &(cell, weight, sum) in others.flat_map(|(_, data)| data) {
            let index = local[cell as usize] as usize;
            if index < inside.len() {
                screen[index] += weight;
                right[index] += sum;
            }
        }
        let pairs = links.iter().map(|link| (link.a, link.b));
        let (labels, count) = components(inside.len(), pairs);
        let mut has_data = vec![false; count];
        for (&label, &weight) in labels.iter().zip(&screen) {
            has_data[label as usize] |= weight > 0.0;
        }
        screen.iter_mut().for_each(|weight| *weight += 1e-6);
        let positions: Vec<(u32, u32)> =
            inside.iter().map(|&cell| self.positions[cell as usize]).collect();
        let hierarchy = Hierarchy::new(&positions, links);
        let solution = hierarchy.operator(&screen).solve(&right, None, 1e-3, 30);
        let mut depth = vec![f32::NAN; self.positions.len()];
        for (index, &cell) in inside.iter().enumerate() {
            if has_data[labels[index] as usize] {
                depth[cell as usize] = solution[index];
            }
        }
        depth
    }
}

/// Connected parts of the graph's blocks.
fn cells(graph: &PixelGraph, links: &[(Link, u16)]) -> (Vec<u32>, Vec<(u32, u32)>) {
    let block = |node: u32| {
        let (x, y) = graph.positions[node as usize];
        (x / BLOCK_PX, y / BLOCK_PX)
    };
    let together = links
        .iter()
        .filter(|(link, cut)| *cut == 0 && link.weight > 0.0 && block(link.a) == block(link.b))
        .map(|(link, _)| (link.a, link.b));
    let (cell_of_node, count) = components(graph.nodes(), together);
    let mut positions = vec![(0, 0); count];
    for (node, &cell) in cell_of_node.iter().enumerate() {
        positions[cell as usize] = block(node as u32);
    }
    (cell_of_node, positions)
}

fn cell_links(fine: &[(Link, u16)], cell_of_node: &[u32]) -> Vec<(Link, Option<u32>)> {
    let mut links: Vec<(u32, u32, u32, f32)> = fine
        .iter()
        .filter(|(link, cut)| link.weight > 0.0 && *cut != DECIDED)
        .map(|(link, cut)| {
            let (a, b) = (cell_of_node[link.a as usize], cell_of_node[link.b as usize]);
            let piece = if *cut == 0 { OPEN } else { u32::from(cut - DECIDED - 1) };
            (a.min(b), a.max(b), piece, link.weight / BLOCK_PX as f32)
        })
        .filter(|(a, b, ..)| a != b)
        .collect();
    links.sort_by_key(|&(a, b, piece, _)| (a, b, piece));
    links.dedup_by(|next, kept| {
        let same = (next.0, next.1, next.2) == (kept.0, kept.1, kept.2);
        kept.3 += if same { next.3 } else { 0.0 };
        same
    });
    links
        .into_iter()
        .map(|(a, b, piece, weight)| (Link { a, b, weight }, (piece != OPEN).then_some(piece)))
        .collect()
}
