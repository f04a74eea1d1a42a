//! Screened Laplace equations on a graph of pixels, by conjugate gradients
//! with an aggregation multigrid preconditioner.
//!
//! Links may be cut anywhere, so cells of the coarser levels are the connected
//! parts of 2x2 blocks: a cut one pixel thin still separates its two sides on
//! every level.
//!
//! Source: Braess, Towards algebraic multigrid for elliptic problems of second
//! order, Computing 55 (1995): piecewise constant aggregation whose coarse
//! operator is scaled down; Hestenes & Stiefel 1952.

/// A link between two nodes and its weight.
#[derive(Clone, Copy, Debug)]
pub struct Link {
    pub a: u32,
    pub b: u32,
    pub weight: f32,
}

/// Piecewise constant interpolation makes coarse links about twice too stiff.
const COARSE_LINK_SCALE: f32 = 0.55;
/// Weaker links do not make nodes one cell of the coarser level.
const STRONG: f32 = 0.004;
const MAX_LEVELS: usize = 14;
const COARSEST_SWEEPS: usize = 10;
/// Finest levels whose coarser level is visited twice a cycle.
const W_LEVELS: usize = 5;

/// Compressed rows of a graph's links.
#[derive(Clone, Debug, Default)]
struct Level {
    starts: Vec<u32>,
    columns: Vec<u32>,
    weights: Vec<f32>,
    link_sums: Vec<f32>,
    /// The cell of the next coarser level that each node belongs to.
    cell: Vec<u32>,
}

/// The links of a graph on all levels: built once, solved for many screenings.
#[derive(Clone, Debug)]
pub struct Hierarchy {
    levels: Vec<Level>,
}

/// A screened Laplace operator `diag(screen) + L` with its coarser versions.
pub struct Operator<'a> {
    hierarchy: &'a Hierarchy,
    /// Per level: the screening, and the inverse of the diagonal.
    screens: Vec<Vec<f32>>,
    inverse_diagonals: Vec<Vec<f32>>,
}

/// Vectors of one level that a cycle works in.
struct Scratch {
    right: Vec<f32>,
    solution: Vec<f32>,
}

impl Hierarchy {
    /// * `positions`: column and row of each node.
    /// * `links`: each pair once; weights above 0.
    pub fn new(positions: &[(u32, u32)], links: Vec<Link>) -> Self {
        let mut levels = Vec::new();
        let mut positions = positions.to_vec();
        let mut links = links;
        loop {
            let mut level = Level::new(positions.len(), &links);
            let (cells, coarse_positions) = aggregate(&positions, &links);
            let coarsened = coarse_positions.len();
            if coarsened * 10 > positions.len() * 9 || levels.len() + 1 == MAX_LEVELS {
                levels.push(level);
                return Self { levels };
            }
            links = coarse_links(&links, &cells);
            level.cell = cells;
            levels.push(level);
            positions = coarse_positions;
        }
    }

    pub fn len(&self) -> usize {
        self.levels[0].link_sums.len()
    }

    /// The operator with `screen` (≥ 0) added to the diagonal.
    ///
    /// # Panics
    /// If `screen` does not have one value per node.
    pub fn operator(&self, screen: Vec<f32>) -> Operator<'_> {
        assert_eq!(screen.len(), self.len());
        let mut screens = vec![screen];
        for pair in self.levels.windows(2) {
            let mut coarse = vec![0.0; pair[1].link_sums.len()];
            for (&cell, &value) in pair[0].cell.iter().zip(&screens[screens.len() - 1]) {
                coarse[cell as usize] += value;
            }
            screens.push(coarse);
        }
        let inverse_diagonals = screens
            .iter()
            .zip(&self.levels)
            .map(|(screen, level)| {
                let sums = level.link_sums.iter();
                screen.iter().zip(sums).map(|(s, l)| 1.0 / (s + l).max(1e-20)).collect()
            })
            .collect();
        Operator { hierarchy: self, screens, inverse_diagonals }
    }
}

impl Level {
    fn new(nodes: usize, links: &[Link]) -> Self {
        let mut starts = vec![0_u32; nodes + 1];
        for link in links {
            starts[link.a as usize + 1] += 1;
            starts[link.b as usize + 1] += 1;
        }
        for node in 0..nodes {
            starts[node + 1] += starts[node];
        }
        let mut next: Vec<u32> = starts[..nodes].to_vec();
        let mut columns = vec![0; links.len() * 2];
        let mut weights = vec![0.0; links.len() * 2];
        let mut link_sums = vec![0.0; nodes];
        for link in links {
            for (from, to) in [(link.a, link.b), (link.b, link.a)] {
                let slot = &mut next[from as usize];
                columns[*slot as usize] = to;
                weights[*slot as usize] = link.weight;
                link_sums[from as usize] += link.weight;
                *slot += 1;
            }
        }
        Self { starts, columns, weights, link_sums, cell: Vec::new() }
    }

    /// The weighted sum of `values` over the links of `node`.
    #[inline]
    fn linked(&self, node: usize, values: &[f32]) -> f32 {
        let range = self.starts[node] as usize..self.starts[node + 1] as usize;
        self.columns[range.clone()]
            .iter()
            .zip(&self.weights[range])
            .map(|(&column, &weight)| weight * values[column as usize])
            .sum()
    }
}

/// Groups nodes of the same 2x2 block that strong links connect.
fn aggregate(positions: &[(u32, u32)], links: &[Link]) -> (Vec<u32>, Vec<(u32, u32)>) {
    let mut parent: Vec<u32> = (0..positions.len() as u32).collect();
    let block = |node: u32| {
        let (x, y) = positions[node as usize];
        (x / 2, y / 2)
    };
    for link in links.iter().filter(|link| link.weight >= STRONG) {
        if block(link.a) == block(link.b) {
            let (a, b) = (root(&mut parent, link.a), root(&mut parent, link.b));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut cells = vec![u32::MAX; positions.len()];
    let mut coarse = Vec::with_capacity(positions.len() / 3);
    for node in 0..positions.len() as u32 {
        let top = root(&mut parent, node);
        if top == node {
            cells[node as usize] = coarse.len() as u32;
            coarse.push(block(node));
        }
        // Roots have the lowest number of their group, so theirs is known.
        cells[node as usize] = cells[top as usize];
    }
    (cells, coarse)
}

fn root(parent: &mut [u32], node: u32) -> u32 {
    let mut node = node;
    while parent[node as usize] != node {
        parent[node as usize] = parent[parent[node as usize] as usize];
        node = parent[node as usize];
    }
    node
}

fn coarse_links(links: &[Link], cells: &[u32]) -> Vec<Link> {
    let mut coarse: Vec<Link> = links
        .iter()
        .filter_map(|link| {
            let (a, b) = (cells[link.a as usize], cells[link.b as usize]);
            (a != b).then_some(Link {
                a: a.min(b),
                b: a.max(b),
                weight: link.weight * COARSE_LINK_SCALE,
            })
        })
        .collect();
    coarse.sort_by_key(|link| (u64::from(link.a) << 32) | u64::from(link.b));
    coarse.dedup_by(|next, kept| {
        let same = next.a == kept.a && next.b == kept.b;
        kept.weight += if same { next.weight } else { 0.0 };
        same
    });
    coarse
}

impl Operator<'_> {
    /// Solves `(diag(screen) + L) x = right`, starting from `solution`, until
    /// the residual in the preconditioner's norm has fallen to `tolerance` of
    /// the right side's, or for `max_iterations`. Returns the iterations used.
    ///
    /// # Panics
    /// If `right` or `solution` does not have one value per node.
    pub fn solve(
        &self,
        right: &[f32],
        solution: &mut [f32],
        tolerance: f64,
        max_iterations: usize,
    ) -> usize {
        assert!(right.len() == self.hierarchy.len() && solution.len() == right.len());
        let mut scratch = self.scratch();
        let target = {
            let scaled = self.precondition(right, &mut scratch);
            tolerance * tolerance * dot(right, &scaled)
        };
        let mut product = vec![0.0; right.len()];
        self.apply(solution, &mut product);
        let mut residual: Vec<f32> = right.iter().zip(&product).map(|(b, p)| b - p).collect();
        let mut scaled = self.precondition(&residual, &mut scratch);
        let mut direction = scaled.clone();
        let mut energy = dot(&residual, &scaled);
        for iteration in 0..max_iterations {
            if energy <= target || energy <= 0.0 || !energy.is_finite() {
                return iteration;
            }
            self.apply(&direction, &mut product);
            let step = (energy / dot(&direction, &product).max(f64::MIN_POSITIVE)) as f32;
            for node in 0..residual.len() {
                solution[node] += step * direction[node];
                residual[node] -= step * product[node];
            }
            scaled = self.precondition(&residual, &mut scratch);
            let next = dot(&residual, &scaled);
            let turn = (next / energy) as f32;
            for (along, &new) in direction.iter_mut().zip(&scaled) {
                *along = new + turn * *along;
            }
            energy = next;
        }
        max_iterations
    }

    fn apply(&self, values: &[f32], product: &mut [f32]) {
        let level = &self.hierarchy.levels[0];
        for node in 0..values.len() {
            product[node] = (self.screens[0][node] + level.link_sums[node]) * values[node]
                - level.linked(node, values);
        }
    }

    fn scratch(&self) -> Vec<Scratch> {
        let sizes = self.hierarchy.levels.iter().map(|level| level.link_sums.len());
        sizes.map(|size| Scratch { right: vec![0.0; size], solution: vec![0.0; size] }).collect()
    }

    /// One symmetric cycle from zero.
    fn precondition(&self, right: &[f32], scratch: &mut [Scratch]) -> Vec<f32> {
        scratch[0].right.copy_from_slice(right);
        scratch[0].solution.fill(0.0);
        self.cycle(0, scratch);
        scratch[0].solution.clone()
    }

    fn cycle(&self, depth: usize, scratch: &mut [Scratch]) {
        let level = &self.hierarchy.levels[depth];
        let inverse = &self.inverse_diagonals[depth];
        let (own, coarser) = scratch.split_at_mut(1);
        let Scratch { right, solution } = &mut own[0];
        let Some(next) = coarser.first_mut() else {
            for _ in 0..COARSEST_SWEEPS {
                sweep(level, inverse, right, solution, 0..right.len());
                sweep(level, inverse, right, solution, (0..right.len()).rev());
            }
            return;
        };
        sweep(level, inverse, right, solution, 0..right.len());
        next.right.fill(0.0);
        for node in 0..right.len() {
            let residual =
                right[node] + level.linked(node, solution) - solution[node] / inverse[node];
            next.right[level.cell[node] as usize] += residual;
        }
        next.solution.fill(0.0);
        for _ in 0..if depth < W_LEVELS { 2 } else { 1 } {
            self.cycle(depth + 1, coarser);
        }
        for (value, &cell) in solution.iter_mut().zip(&level.cell) {
            *value += coarser[0].solution[cell as usize];
        }
        sweep(level, inverse, right, solution, (0..right.len()).rev());
    }
}

/// Gauss-Seidel over `order`.
fn sweep(
    level: &Level,
    inverse_diagonal: &[f32],
    right: &[f32],
    solution: &mut [f32],
    order: impl Iterator<Item = usize>,
) {
    for node in order {
        solution[node] = (right[node] + level.linked(node, solution)) * inverse_diagonal[node];
    }
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum()
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
        let mut solution = vec![0.0; right.len()];
        let used = hierarchy.operator(screen).solve(&right, &mut solution, 1e-6, 60);
        assert!(used < 40, "{used} iterations");
        for (&(x, _), &value) in positions.iter().zip(&solution) {
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
        let screen = positions.iter().map(|&(x, y)| datum(x, y).map_or(0.0, |_| 10.0)).collect();
        let right: Vec<f32> =
            positions.iter().map(|&(x, y)| datum(x, y).unwrap_or(0.0) * 10.0).collect();
        let mut solution = vec![0.0; right.len()];
        hierarchy.operator(screen).solve(&right, &mut solution, 1e-7, 100);
        for (&(x, _), &value) in positions.iter().zip(&solution) {
            let expected = if x <= 20 { -5.0 } else { 80.0 };
            assert!((value - expected).abs() < 0.05, "{value} at column {x}");
        }
    }

    #[test]
    fn a_better_start_needs_fewer_iterations() {
        let (positions, links) = grid(48, |_, _| false);
        let hierarchy = Hierarchy::new(&positions, links);
        let operator = hierarchy.operator(vec![0.01; positions.len()]);
        let right: Vec<f32> = positions.iter().map(|&(x, y)| ((x * y) % 7) as f32).collect();
        let mut solution = vec![0.0; right.len()];
        let cold = operator.solve(&right, &mut solution, 1e-5, 100);
        assert!(operator.solve(&right, &mut solution, 1e-4, 100) == 0);
        assert!(cold > 2);
    }
}
