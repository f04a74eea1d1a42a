//! Screened Laplace equations on a graph of pixels, by conjugate gradients
//! with a multigrid preconditioner.
//!
//! Links may be cut anywhere, so cells of the coarser levels are the connected
//! parts of 2x2 blocks: a cut one pixel thin still separates its two sides on
//! every level.
//!
//! Source: Braess, Towards algebraic multigrid for elliptic problems of second
//! order, Computing 55 (1995): piecewise constant aggregation whose coarse
//! operator is scaled down; Hestenes & Stiefel 1952; red-black relaxation and
//! nested iteration: Trottenberg, Oosterlee & Schüller, Multigrid (2001).

mod coarsen;
mod grid;
mod transfer;
mod vectors;

use coarsen::Graph;
use grid::{Colour, Links, Stencil};
use transfer::Transfer;

/// A link between two nodes and its weight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Link {
    pub a: u32,
    pub b: u32,
    pub weight: f32,
}

const MAX_LEVELS: usize = 14;
const COARSEST_SWEEPS: usize = 10;

/// The links of a graph on all levels: built once, solved for many screenings.
#[derive(Clone, Debug)]
pub(super) struct Hierarchy {
    /// The cell of each node.
    cells: Vec<u32>,
    levels: Vec<Level>,
}

#[derive(Clone, Debug)]
struct Level {
    links: Links,
    /// To the next coarser level.
    transfer: Transfer,
}

/// A screened Laplace operator `diag(screen) + L` with its coarser versions.
pub(super) struct Operator<'a> {
    hierarchy: &'a Hierarchy,
    diagonals: Vec<Diagonal>,
}

/// The diagonal of one level and its inverse, 0 where there is no cell.
struct Diagonal {
    values: Vec<f32>,
    inverse: Vec<f32>,
}

/// Vectors of one level that a cycle works in.
struct Scratch {
    target: Vec<f32>,
    values: Vec<f32>,
    saved: Vec<f32>,
}

impl Hierarchy {
    /// * `positions`: column and row of each node.
    /// * `links`: each pair once, of nodes at the same or adjacent positions;
    ///   weights above 0.
    pub(super) fn new(positions: &[(u32, u32)], links: impl IntoIterator<Item = Link>) -> Self {
        let (mut graph, cells) = Graph::new(positions, links.into_iter());
        let mut levels = Vec::new();
        let mut size = graph.cells();
        loop {
            let (coarse, transfer) = graph.coarser();
            let coarsened = coarse.cells();
            let links = std::mem::replace(&mut graph, coarse).into_links();
            let last = coarsened * 10 > size * 9 || levels.len() + 1 == MAX_LEVELS;
            levels.push(Level { links, transfer });
            if last {
                return Self { cells, levels };
            }
            size = coarsened;
        }
    }

    /// The operator with `screen` (≥ 0) added to the diagonal.
    ///
    /// # Panics
    /// If `screen` does not have one value per node.
    pub(super) fn operator(&self, screen: &[f32]) -> Operator<'_> {
        let mut screen = self.spread(screen);
        let mut diagonals = Vec::with_capacity(self.levels.len());
        for (depth, level) in self.levels.iter().enumerate() {
            let sums = &level.links.sums;
            let values: Vec<f32> = sums.iter().zip(&screen).map(|(sum, own)| sum + own).collect();
            let inverse =
                values.iter().map(|&value| if value > 0.0 { 1.0 / value } else { 0.0 }).collect();
            diagonals.push(Diagonal { values, inverse });
            if let Some(coarse) = self.levels.get(depth + 1) {
                screen = level.transfer.restrict(&level.links, &coarse.links, &screen);
            }
        }
        Operator { hierarchy: self, diagonals }
    }

    /// Values of nodes, in the order of cells.
    fn spread(&self, values: &[f32]) -> Vec<f32> {
        assert_eq!(values.len(), self.cells.len());
        let mut spread = vec![0.0; self.levels[0].links.len()];
        for (&cell, &value) in self.cells.iter().zip(values) {
            spread[cell as usize] = value;
        }
        spread
    }

    fn of_nodes(&self, values: &[f32]) -> Vec<f32> {
        self.cells.iter().map(|&cell| values[cell as usize]).collect()
    }
}

impl Operator<'_> {
    /// Solves `(diag(screen) + L) x = right` until the preconditioned residual,
    /// about the error that is left, has fallen to `tolerance` of `x`, both
    /// root mean square, or for `max_iterations`.
    ///
    /// * `start`: where to start from; without it, a solution is worked up from
    ///   the coarsest level first.
    ///
    /// # Panics
    /// If `right` or `start` does not have one value per node.
    pub(super) fn solve(
        &self,
        right: &[f32],
        start: Option<&[f32]>,
        tolerance: f64,
        max_iterations: usize,
    ) -> Vec<f32> {
        self.solve_counted(right, start, tolerance, max_iterations).0
    }

    /// [`solve`](Self::solve) on cells of 2x2 nodes, with the nodes relaxed
    /// once: good to a fraction of what differs from node to node.
    ///
    /// # Panics
    /// If `right` does not have one value per node.
    pub(super) fn solve_roughly(
        &self,
        right: &[f32],
        tolerance: f64,
        max_iterations: usize,
    ) -> Vec<f32> {
        let hierarchy = self.hierarchy;
        let [fine, coarse, ..] = &hierarchy.levels[..] else {
            return self.solve(right, None, tolerance, max_iterations);
        };
        let mut target = hierarchy.spread(right);
        let sums = fine.transfer.restrict(&fine.links, &coarse.links, &target);
        let (found, _) = self.conjugate_gradients(1, sums, None, tolerance, max_iterations);
        let mut values = vec![0.0; target.len()];
        self.step_down(0, &found, &mut target, &mut values, &mut Vec::new());
        hierarchy.of_nodes(&values)
    }

    /// The solution and the iterations that it took.
    fn solve_counted(
        &self,
        right: &[f32],
        start: Option<&[f32]>,
        tolerance: f64,
        max_iterations: usize,
    ) -> (Vec<f32>, usize) {
        let hierarchy = self.hierarchy;
        let (right, start) = (hierarchy.spread(right), start.map(|start| hierarchy.spread(start)));
        let (values, iterations) =
            self.conjugate_gradients(0, right, start, tolerance, max_iterations);
        (hierarchy.of_nodes(&values), iterations)
    }

    /// Solves the equations of level `depth`, in cells.
    fn conjugate_gradients(
        &self,
        depth: usize,
        mut residual: Vec<f32>,
        start: Option<Vec<f32>>,
        tolerance: f64,
        max_iterations: usize,
    ) -> (Vec<f32>, usize) {
        let links = &self.hierarchy.levels[depth].links;
        let diagonal = &self.diagonals[depth].values;
        let mut scratch = self.scratch(depth);
        let mut values = start.unwrap_or_else(|| self.nested(depth, &residual, &mut scratch));
        let mut product = vec![0.0; links.len()];
        links.apply(diagonal, &values, &mut product);
        links.add_scaled(-1.0, &product, &mut residual);
        let mut direction = vec![0.0; links.len()];
        let mut energy = f64::INFINITY;
        let mut iterations = 0;
        loop {
            let scaled = self.precondition(depth, &residual, &mut scratch);
            let next = links.dot(&residual, scaled);
            let error = links.dot(scaled, scaled);
            let small = error <= tolerance * tolerance * links.dot(&values, &values);
            if small || iterations >= max_iterations || next <= 0.0 || !next.is_finite() {
                return (values, iterations);
            }
            links.scale_and_add((next / energy) as f32, scaled, &mut direction);
            energy = next;
            links.apply(diagonal, &direction, &mut product);
            let step = energy / links.dot(&direction, &product).max(f64::MIN_POSITIVE);
            links.add_scaled(step as f32, &direction, &mut values);
            links.add_scaled(-step as f32, &product, &mut residual);
            iterations += 1;
        }
    }

    /// Vectors for level `depth` and coarser ones.
    fn scratch(&self, depth: usize) -> Vec<Scratch> {
        let of_level = |level: &Level| {
            let zeros = vec![0.0; level.links.len()];
            Scratch { target: zeros.clone(), values: zeros, saved: Vec::new() }
        };
        self.hierarchy.levels[depth..].iter().map(of_level).collect()
    }

    /// Solves on the coarsest level and goes up to level `finest` from there,
    /// a cycle a level.
    fn nested(&self, finest: usize, right: &[f32], scratch: &mut [Scratch]) -> Vec<f32> {
        let levels = &self.hierarchy.levels;
        let mut targets = vec![right.to_vec()];
        for (pair, k) in levels[finest..].windows(2).zip(0..) {
            let (fine, coarse) = (&pair[0].links, &pair[1].links);
            targets.push(pair[0].transfer.restrict(fine, coarse, &targets[k]));
        }
        for (k, right) in targets.into_iter().enumerate().rev() {
            let depth = finest + k;
            scratch[k].target = right;
            if depth + 1 < levels.len() {
                let (own, coarser) = scratch[k..].split_at_mut(1);
                let Scratch { target, values, saved } = &mut own[0];
                values.fill(0.0);
                self.step_down(depth, &coarser[0].values, target, values, saved);
            }
            self.cycle(depth, &mut scratch[k..], depth + 1 == levels.len());
        }
        scratch[0].values.clone()
    }

    /// Carries a solution of the next coarser level over to level `depth`,
    /// where `values` are 0, and relaxes it.
    fn step_down(
        &self,
        depth: usize,
        coarse: &[f32],
        target: &mut [f32],
        values: &mut [f32],
        saved: &mut Vec<f32>,
    ) {
        let Level { links, transfer } = &self.hierarchy.levels[depth];
        let inverse = &self.diagonals[depth].inverse;
        transfer.prolong(links, &self.hierarchy.levels[depth + 1].links, coarse, values);
        links.add_extras(values, target, saved);
        links.relax(Colour::Black, inverse, target, values);
        links.relax(Colour::Red, inverse, target, values);
        links.restore(target, saved);
    }

    /// One symmetric cycle from zero.
    fn precondition<'s>(
        &self,
        depth: usize,
        right: &[f32],
        scratch: &'s mut [Scratch],
    ) -> &'s [f32] {
        scratch[0].target.copy_from_slice(right);
        self.cycle(depth, scratch, true);
        &scratch[0].values
    }

    /// * `afresh`: from zero, rather than from the values of the cycle before.
    fn cycle(&self, depth: usize, scratch: &mut [Scratch], afresh: bool) {
        let Level { links, transfer } = &self.hierarchy.levels[depth];
        let Diagonal { values: diagonal, inverse } = &self.diagonals[depth];
        let (own, coarser) = scratch.split_at_mut(1);
        let Scratch { target, values, saved } = &mut own[0];
        let sweeps = if coarser.is_empty() { COARSEST_SWEEPS } else { 1 };
        if afresh && links.extra.len() > 0 {
            values.fill(0.0);
        }
        for sweep in 0..sweeps {
            links.relax_extras(0..links.extra.len(), inverse, target, values);
            links.add_extras(values, target, saved);
            if afresh && sweep == 0 {
                links.relax_red_first(inverse, target, values);
            } else {
                links.relax(Colour::Red, inverse, target, values);
            }
            links.relax(Colour::Black, inverse, target, values);
            if let Some(next) = coarser.first_mut() {
                let coarse = &self.hierarchy.levels[depth + 1].links;
                let stencil = Stencil { diagonal, target };
                transfer.restrict_residual((links, coarse), stencil, values, &mut next.target);
                links.restore(target, saved);
                let stencil = Stencil { diagonal, target };
                for &(cell, part_of) in &transfer.strays[2] {
                    let row = cell as usize - links.layout.len();
                    next.target[part_of as usize] += links.extra_residual(row, stencil, values);
                }
                self.cycle(depth + 1, coarser, true);
                transfer.prolong(links, coarse, &coarser[0].values, values);
                links.add_extras(values, target, saved);
                links.relax(Colour::Black, inverse, target, values);
            }
            links.relax(Colour::Red, inverse, target, values);
            links.restore(target, saved);
            links.relax_extras((0..links.extra.len()).rev(), inverse, target, values);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(side: u32, cut: impl Fn(u32, u32) -> bool) -> (Vec<(u32, u32)>, Vec<Link>) {
        let positions: Vec<_> = (0..side * side).map(|i| (i % side, i / side)).collect();
        let mut links = Vec::new();
        for &(x, y) in &positions {
            let a = y * side + x;
            if x + 1 < side && !cut(x, y) {
                links.push(Link { a, b: a + 1, weight: 1.0 });
            }
            if y + 1 < side {
                links.push(Link { a, b: a + side, weight: 1.0 });
            }
        }
        (positions, links)
    }

    #[test]
    fn a_membrane_between_two_fixed_sides_is_a_ramp() {
        let side = 65;
        let (positions, links) = grid(side, |_, _| false);
        let hierarchy = Hierarchy::new(&positions, links);
        let fixed = |x: u32| x == 0 || x == side - 1;
        let weight = |x: u32| if fixed(x) { 1e4 } else { 0.0 };
        let screen: Vec<f32> = positions.iter().map(|&(x, _)| weight(x)).collect();
        let right: Vec<f32> = positions.iter().map(|&(x, _)| weight(x) * x as f32).collect();
        let (solved, iterations) =
            hierarchy.operator(&screen).solve_counted(&right, None, 1e-5, 60);
        assert!(iterations < 20, "{iterations} iterations");
        for (&(x, _), &value) in positions.iter().zip(&solved) {
            assert!((value - x as f32).abs() < 0.05, "{value} at {x}");
        }
    }

    #[test]
    fn a_cut_keeps_its_sides_apart() {
        let side = 64;
        let (positions, links) = grid(side, |x, _| x == 20);
        let hierarchy = Hierarchy::new(&positions, links);
        let datum = |x: u32, y: u32| match (x, y) {
            (0, 0) => Some(-5.0),
            (63, 63) => Some(80.0),
            _ => None,
        };
        let datum = |&(x, y): &(u32, u32)| datum(x, y);
        let weight = |value: Option<f32>| value.map_or(0.0, |_| 10.0);
        let screen: Vec<f32> = positions.iter().map(|at| weight(datum(at))).collect();
        let right: Vec<f32> = positions.iter().map(|at| datum(at).unwrap_or(0.0) * 10.0).collect();
        let solved = hierarchy.operator(&screen).solve(&right, None, 1e-6, 100);
        for (&(x, _), &value) in positions.iter().zip(&solved) {
            let expected = if x <= 20 { -5.0 } else { 80.0 };
            assert!((value - expected).abs() < 0.05, "{value} at column {x}");
        }
    }

    #[test]
    fn a_better_start_needs_fewer_iterations() {
        let (positions, links) = grid(48, |_, _| false);
        let hierarchy = Hierarchy::new(&positions, links);
        let operator = hierarchy.operator(&vec![0.01; positions.len()]);
        let right: Vec<f32> = positions.iter().map(|&(x, y)| ((x * y) % 7) as f32).collect();
        let zero = vec![0.0; right.len()];
        let (values, cold) = operator.solve_counted(&right, Some(&zero), 1e-5, 100);
        let (_, nested) = operator.solve_counted(&right, None, 1e-5, 100);
        assert!(nested < cold, "{nested} against {cold}");
        assert_eq!(operator.solve_counted(&right, Some(&values), 1e-4, 100).1, 0);
    }

    #[test]
    fn any_graph_is_solved_with_many_nodes_at_a_place_and_links_across() {
        use rand::{Rng, SeedableRng};
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        // Two sheets, joined here and there, with holes and thin cuts in both.
        let (side, layers) = (37, 2);
        let mut positions = Vec::new();
        let mut node = std::collections::BTreeMap::new();
        for (y, x, layer) in
            (0..side).flat_map(|y| (0..side).flat_map(move |x| (0..layers).map(move |l| (y, x, l))))
        {
            if random.random_bool(0.9) {
                node.insert((x, y, layer), positions.len() as u32);
                positions.push((x + 5, y + 3));
            }
        }
        let mut links = Vec::new();
        for (&(x, y, layer), &a) in &node {
            let near = [(x + 1, y, layer), (x, y + 1, layer), (x + 1, y, 1 - layer), (x, y, 1)];
            for (place, chance) in near.into_iter().zip([0.9, 0.8, 0.02, 0.02]) {
                let b = node.get(&place).filter(|&&b| b != a && random.random_bool(chance));
                let weight = if random.random_bool(0.1) { 1e-4 } else { 1.0 };
                links.extend(b.map(|&b| Link { a, b, weight }));
            }
        }
        let screen: Vec<f32> =
            positions.iter().map(|_| if random.random_bool(0.02) { 5.0 } else { 1e-3 }).collect();
        let right: Vec<f32> = positions.iter().map(|_| random.random_range(-1.0..1.0)).collect();
        let operator = Hierarchy::new(&positions, links.clone());
        let operator = operator.operator(&screen);
        let (solved, iterations) = operator.solve_counted(&right, None, 1e-6, 200);
        assert!(iterations < 60, "{iterations} iterations");
        let mut residual: Vec<f32> =
            right.iter().zip(&screen).zip(&solved).map(|((b, s), x)| b - s * x).collect();
        for Link { a, b, weight } in links {
            let flow = weight * (solved[a as usize] - solved[b as usize]);
            residual[a as usize] -= flow;
            residual[b as usize] += flow;
        }
        let worst = residual.iter().fold(0.0_f32, |worst, value| worst.max(value.abs()));
        assert!(worst < 1e-3, "{worst}");
    }
}
