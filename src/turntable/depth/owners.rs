//! Which side of each line the surface that it bounds is on.
//!
//! The outline knows. An inner line's curvature tells where it is significant.
//! For the rest a line is released: if without it, the other lines predict its
//! depth on one side and something farther on the other, it belongs to the
//! first side. What stays undecided is a crease with surface on both sides.

use super::contours::{Contours, Crossing};
use super::filters::median;
use super::graph::{Cuts, HORIZONTAL_RUN_PX, Owner, PixelGraph, components};
use super::lines::LineDepths;
use super::multigrid::{Hierarchy, Link};

/// Label of cuts along lines whose owner is known.
const DECIDED: u16 = 1;
const MAX_ROUNDS: usize = 4;
/// Pieces of undecided chains are at most about this long, crossings.
const PIECE_CROSSINGS: usize = 90;
const MAX_PIECES: usize = 4000;
/// Side of the blocks that a release is solved on, px.
const BLOCK_PX: u32 = 4;

/// The owner of every crossing's line, `None` for creases.
pub fn owners(
    graph: &PixelGraph,
    contours: &Contours,
    lines: &LineDepths,
    unit_px: f64,
) -> Vec<Option<Owner>> {
    let mut owners = outline_owners(contours);
    let mut undecided = Vec::new();
    for chain in contours.chains.iter().filter(|chain| chain.len() >= 3) {
        let inner: Vec<u32> =
            chain.iter().copied().filter(|&index| owners[index as usize].is_none()).collect();
        if inner.is_empty() {
            continue;
        }
        match outline_majority(chain, &owners).or_else(|| curvature_owner(&inner, lines, unit_px)) {
            Some(owner) => inner.iter().for_each(|&index| owners[index as usize] = Some(owner)),
            None => undecided.push(inner),
        }
    }
    let pieces = pieces(contours, undecided);
    release(graph, contours, lines, unit_px, pieces, &mut owners);
    owners
}

/// The owners of the outline's crossings, `None` inside.
pub fn outline_owners(contours: &Contours) -> Vec<Option<Owner>> {
    contours.crossings.iter().map(outline_owner).collect()
}

fn outline_owner(crossing: &Crossing) -> Option<Owner> {
    match (crossing.outside_left, crossing.outside_right) {
        (true, false) => Some(Owner::Right),
        (false, true) => Some(Owner::Left),
        _ => None,
    }
}

/// A chain that is partly outline goes on inside with the same owner.
fn outline_majority(chain: &[u32], owners: &[Option<Owner>]) -> Option<Owner> {
    let count = |owner| chain.iter().filter(|&&i| owners[i as usize] == Some(owner)).count();
    let (left, right) = (count(Owner::Left), count(Owner::Right));
    let clear = left.max(right) >= 6 && left.max(right) > 4 * left.min(right);
    clear.then_some(if right > left { Owner::Right } else { Owner::Left })
}

/// The sign of the curvature: a left contour's is negative, its owner right.
fn curvature_owner(inner: &[u32], lines: &LineDepths, unit_px: f64) -> Option<Owner> {
    let of_sign = |rho: f64| if rho < 0.0 { Owner::Right } else { Owner::Left };
    let rho = |index: u32| lines.rho_px[index as usize];
    let sigma = |index: u32| lines.rho_sigma_px[index as usize];
    let tracked = |index: &u32| lines.rho_is_tracked[*index as usize];
    let mut wide: Vec<u32> = inner.iter().copied().filter(tracked).collect();
    if wide.len() >= 8 {
        let middle = median(&mut wide.iter().map(|&index| rho(index)).collect::<Vec<_>>());
        let spread = median(&mut wide.iter().map(|&index| sigma(index)).collect::<Vec<_>>());
        if middle.abs() > 3.0 * spread.max(4.0) {
            return Some(of_sign(middle));
        }
    }
    wide = inner.iter().copied().filter(|i| !tracked(i) && !rho(*i).is_nan()).collect();
    if wide.len() < 6 {
        return None;
    }
    let weight = |index: u32| sigma(index).powi(-2);
    let total: f64 = wide.iter().map(|&index| weight(index)).sum();
    let mean = wide.iter().map(|&index| weight(index) * rho(index)).sum::<f64>() / total;
    let spread = median(&mut wide.iter().map(|&index| sigma(index)).collect::<Vec<_>>());
    let significant = mean.abs() > 2.5 * spread.max(12.0) && mean.abs() > 25.0 * unit_px;
    significant.then(|| of_sign(mean))
}

/// A stretch of an undecided chain, tested on its own.
struct Piece {
    crossings: Vec<u32>,
    straight: bool,
}

fn pieces(contours: &Contours, undecided: Vec<Vec<u32>>) -> Vec<Piece> {
    let mut pieces = Vec::new();
    for inner in undecided {
        let straight = is_straight(contours, &inner);
        let count = ((inner.len() as f64 / PIECE_CROSSINGS as f64).round() as usize).max(1);
        let length = if straight { inner.len() } else { inner.len().div_ceil(count) };
        for part in inner.chunks(length).filter(|part| part.len() >= 4) {
            pieces.push(Piece { crossings: part.to_vec(), straight });
        }
    }
    pieces.truncate(MAX_PIECES);
    pieces
}

/// Whether a chain's slope hardly changes.
pub fn is_straight(contours: &Contours, chain: &[u32]) -> bool {
    const MAX_CHANGE: f64 = 0.12;
    if chain.len() <= 8 {
        return false;
    }
    let slopes = || chain[2..chain.len() - 2].iter().map(|&i| contours.crossings[i as usize].slope);
    slopes().fold(f64::MIN, f64::max) - slopes().fold(f64::MAX, f64::min) < MAX_CHANGE
}

/// How much farther than the line the surface beside it is predicted, px.
#[derive(Clone, Copy)]
struct Prediction {
    left_px: f64,
    right_px: f64,
}

impl Prediction {
    /// By how much one side fits the line better than the other.
    fn clarity(&self) -> f64 {
        self.left_px.max(self.right_px) - self.left_px.min(self.right_px).abs()
    }

    /// One side lies well behind the line, the other near it.
    fn is_decisive(&self, straight: bool, unit_px: f64) -> bool {
        let (far, near) = (self.left_px.max(self.right_px), self.left_px.min(self.right_px));
        let tolerance = if straight { 0.08 } else { 0.25 };
        far > 20.0 * unit_px && near > -0.6 * far && near < tolerance * far + 4.0 * unit_px
    }

    fn owner(&self) -> Owner {
        if self.left_px > self.right_px { Owner::Right } else { Owner::Left }
    }
}

fn release(
    graph: &PixelGraph,
    contours: &Contours,
    lines: &LineDepths,
    unit_px: f64,
    mut pieces: Vec<Piece>,
    owners: &mut [Option<Owner>],
) {
    let mut known: Vec<Option<Prediction>> = pieces.iter().map(|_| None).collect();
    let mut stale = vec![true; pieces.len()];
    for _ in 0..MAX_ROUNDS {
        let blocks = Blocks::new(graph, contours, lines, &pieces, owners);
        for (number, piece) in pieces.iter().enumerate().filter(|(number, _)| stale[*number]) {
            known[number] = blocks.predict(number, piece, contours, lines, graph);
        }
        let decisive = |number: usize| {
            known[number].filter(|found| found.is_decisive(pieces[number].straight, unit_px))
        };
        let clearest =
            (0..pieces.len()).filter_map(decisive).map(|p| p.clarity()).fold(0.0, f64::max);
        let decided: Vec<(usize, Owner)> = (0..pieces.len())
            .filter_map(|number| Some((number, decisive(number)?)))
            .filter(|(_, found)| found.clarity() >= 0.4 * clearest)
            .map(|(number, found)| (number, found.owner()))
            .collect();
        if decided.is_empty() {
            return;
        }
        let windows: Vec<Window> =
            decided.iter().map(|&(number, _)| Window::around(&pieces[number], contours)).collect();
        for &(number, owner) in &decided {
            for &index in &pieces[number].crossings {
                owners[index as usize] = Some(owner);
            }
        }
        let mut keep = vec![true; pieces.len()];
        decided.iter().for_each(|&(number, _)| keep[number] = false);
        let touched = |piece: &Piece| {
            let own = Window::around(piece, contours);
            windows.iter().any(|window| window.overlaps(&own))
        };
        stale = pieces.iter().map(touched).collect();
        retain(&mut stale, &keep);
        retain(&mut known, &keep);
        retain(&mut pieces, &keep);
    }
}

fn retain<T>(values: &mut Vec<T>, keep: &[bool]) {
    let mut flags = keep.iter();
    values.retain(|_| flags.next().copied().unwrap_or(false));
}

/// The part of the image that a release is solved in, blocks.
#[derive(Clone, Copy)]
struct Window {
    low: (u32, u32),
    high: (u32, u32),
}

impl Window {
    fn around(piece: &Piece, contours: &Contours) -> Self {
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

    fn overlaps(&self, other: &Self) -> bool {
        self.low.0 < other.high.0
            && other.low.0 < self.high.0
            && self.low.1 < other.high.1
            && other.low.1 < self.high.1
    }
}

/// The silhouette in blocks, split where any line may cut.
struct Blocks {
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
    fn new(
        graph: &PixelGraph,
        contours: &Contours,
        lines: &LineDepths,
        pieces: &[Piece],
        owners: &[Option<Owner>],
    ) -> Self {
        let mut cuts = Cuts::none(graph);
        cut_inner(&mut cuts, graph, contours, owners, DECIDED);
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

    /// Solves the neighbourhood of a piece with its line taken out.
    fn predict(
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
        let mut solution = vec![0.0; inside.len()];
        Hierarchy::new(&positions, links).operator(screen).solve(&right, &mut solution, 3e-3, 30);
        let mut depth = vec![f32::NAN; self.positions.len()];
        for (index, &cell) in inside.iter().enumerate() {
            if has_data[labels[index] as usize] {
                depth[cell as usize] = solution[index];
            }
        }
        depth
    }
}

/// How far a crossing's depth counts: little on slanted lines, not at all on
/// lines along the row, whose crossings are not points of the line.
pub fn line_weight(crossing: &Crossing) -> f64 {
    const MAX_SLOPE: f64 = 8.0;
    let slope = crossing.slope.abs();
    let along_row = crossing.run_px() >= 4 * HORIZONTAL_RUN_PX;
    if slope >= MAX_SLOPE || along_row { 0.0 } else { 1.0 / (1.0 + slope * slope) }
}

/// Cuts along all inner lines whose owner is known.
pub fn cut_inner(
    cuts: &mut Cuts,
    graph: &PixelGraph,
    contours: &Contours,
    owners: &[Option<Owner>],
    label: u16,
) {
    let inner_owner = |index: u32| {
        let inner = !contours.crossings[index as usize].on_outline();
        owners[index as usize].filter(|_| inner)
    };
    for chain in &contours.chains {
        for part in chain.chunk_by(|&a, &b| inner_owner(a) == inner_owner(b)) {
            if let Some(owner) = inner_owner(part[0]) {
                cuts.along(graph, contours, part, owner, label);
            }
        }
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
