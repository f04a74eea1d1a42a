//! The pixels of a silhouette and the links between them that lines cut.

use super::contours::{Contours, Crossing};
use super::multigrid::Link;

/// Runs at least this wide follow the row: what is above and below them is
/// hardly linked, px.
pub(super) const HORIZONTAL_RUN_PX: u32 = 10;
/// Pixels farther than this from a line are beyond its stroke.
const STROKE_REACH_PX: usize = 3;
/// No pixel.
pub(super) const NONE: u32 = u32::MAX;

/// The side of a line that the surface it bounds is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Owner {
    Left,
    Right,
}

impl Owner {
    /// The column step towards the owner.
    pub(super) fn step(self) -> isize {
        match self {
            Self::Left => -1,
            Self::Right => 1,
        }
    }
}

/// Pixels inside the silhouette, numbered row by row.
pub(super) struct PixelGraph {
    pub width: usize,
    pub height: usize,
    /// Per pixel of the image its node, or [`NONE`].
    pub node_of: Vec<u32>,
    /// Per node its column and row.
    pub positions: Vec<(u32, u32)>,
    /// Per pixel: in a wide run of ink.
    pub horizontal_ink: Vec<bool>,
    /// Per pixel: what is below it is another surface, beyond a line along the row.
    pub steps: Vec<bool>,
}

/// Cut links: per pixel a label of the cut to its right and below, 0 for none.
#[derive(Clone)]
pub(super) struct Cuts {
    pub right: Vec<u16>,
    pub down: Vec<u16>,
}

impl PixelGraph {
    pub(super) fn new(mask: &image::GrayImage, contours: &Contours) -> Self {
        let (width, height) = (mask.width() as usize, mask.height() as usize);
        let mut node_of = vec![NONE; width * height];
        let mut positions = Vec::new();
        for (index, _) in mask.as_raw().iter().enumerate().filter(|(_, level)| **level != 0) {
            node_of[index] = positions.len() as u32;
            positions.push(((index % width) as u32, (index / width) as u32));
        }
        let mut horizontal_ink = vec![false; width * height];
        let inside = |x: usize, y: Option<usize>| {
            y.is_some_and(|y| node_of.get(y * width + x).is_some_and(|&node| node != NONE))
        };
        for run in &contours.crossings {
            if run.run_px() < HORIZONTAL_RUN_PX {
                continue;
            }
            let y = run.y as usize;
            for x in run.start as usize..run.end as usize {
                // The outline has surface on one side only: nothing to part there.
                let inner = inside(x, y.checked_sub(STROKE_REACH_PX));
                horizontal_ink[y * width + x] = inner && inside(x, Some(y + STROKE_REACH_PX));
            }
        }
        let steps = vec![false; width * height];
        Self { width, height, node_of, positions, horizontal_ink, steps }
    }

    pub(super) fn nodes(&self) -> usize {
        self.positions.len()
    }

    pub(super) fn pixel(&self, node: usize) -> usize {
        let (x, y) = self.positions[node];
        y as usize * self.width + x as usize
    }

    /// The node at a crossing's middle, or the nearest beside it in its row.
    pub(super) fn node_at(&self, crossing: &Crossing) -> Option<usize> {
        let column = crossing.column(self.width);
        [0, 1, -1, 2, -2].into_iter().find_map(|step| self.node_beside(crossing.y, column, step))
    }

    /// The node `step` columns from `column`; none beyond the last row.
    pub(super) fn node_beside(&self, y: u32, column: usize, step: isize) -> Option<usize> {
        let column = column.checked_add_signed(step).filter(|&column| column < self.width)?;
        let node = *self.node_of.get(y as usize * self.width + column)?;
        (node != NONE).then_some(node as usize)
    }

    /// All links with their weight and cut label, row by row.
    ///
    /// * `vertical`: the weight of links along a column.
    /// * `across_ink`: what is left of it across a line along the row.
    pub(super) fn links<'a>(
        &'a self,
        cuts: &'a Cuts,
        vertical: f32,
        across_ink: f32,
    ) -> impl Iterator<Item = (Link, u16)> + 'a {
        (0..self.nodes()).flat_map(move |node| {
            let pixel = self.pixel(node);
            let inner = self.positions[node].0 as usize + 1 < self.width;
            let right = if inner { self.node_of[pixel + 1] } else { NONE };
            let below = self.node_of.get(pixel + self.width).copied().unwrap_or(NONE);
            let inked = below != NONE
                && (self.horizontal_ink[pixel] || self.horizontal_ink[pixel + self.width]);
            let weight = if inked { vertical * across_ink } else { vertical };
            let weight = if self.steps[pixel] { 0.0 } else { weight };
            let link = |b: u32, weight: f32| Link { a: node as u32, b, weight };
            let run_ends =
                right != NONE && self.horizontal_ink[pixel] != self.horizontal_ink[pixel + 1];
            let across = if run_ends { across_ink } else { 1.0 };
            let right = (right != NONE).then(|| (link(right, across), cuts.right[pixel]));
            let below = (below != NONE).then(|| (link(below, weight), cuts.down[pixel]));
            right.into_iter().chain(below)
        })
    }
}

impl Cuts {
    pub(super) fn none(graph: &PixelGraph) -> Self {
        let none = vec![0; graph.width * graph.height];
        Self { right: none.clone(), down: none }
    }

    /// Cuts along a chain's part on the side away from each crossing's owner,
    /// where nothing is cut yet. The line's own pixels stay with the owner.
    pub(super) fn along(
        &mut self,
        graph: &PixelGraph,
        contours: &Contours,
        part: &[u32],
        owner: Owner,
        label: u16,
    ) {
        let boundary = |crossing: &Crossing| match owner {
            Owner::Right => crossing.column(graph.width),
            Owner::Left => crossing.column(graph.width) + 1,
        };
        for (k, &index) in part.iter().enumerate() {
            let crossing = &contours.crossings[index as usize];
            let (row, column) = (crossing.y as usize * graph.width, boundary(crossing));
            if (1..graph.width).contains(&column) {
                mark(&mut self.right[row + column - 1], label);
            }
            let below = part.get(k + 1).map(|&next| &contours.crossings[next as usize]);
            if let Some(below) = below.filter(|below| below.y == crossing.y + 1) {
                let other = boundary(below);
                let shifted = column.min(other)..column.max(other).min(graph.width);
                self.down[row..][shifted].iter_mut().for_each(|cut| mark(cut, label));
            }
        }
    }
}

fn mark(cut: &mut u16, label: u16) {
    if *cut == 0 {
        *cut = label;
    }
}
