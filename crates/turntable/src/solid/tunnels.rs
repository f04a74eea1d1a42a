//! Narrow tunnels filled: where surfaces come as near as a few cells, noise of the field pierces
//! them.

use rayon::prelude::*;

use crate::surface::field::{Field, Plane};

/// Gaps that so many rounds of growing close, one after the other: up to two and four nodes wide.
const REACHES: [usize; 2] = [1, 2];
/// What a filled node becomes, share of the pitch.
const FILLED: f64 = 0.5;

type Node = [i32; 3];

/// Fills gaps of `field` that are narrower than a few nodes where that closes more tunnels than it
/// opens and encloses nothing; how many. Nothing outside of `hulls` is filled: where drawings see through, it stays
/// open.
///
/// The planes of `field` take the windows of `hulls`.
pub(super) fn fill(field: &mut Field, hulls: &[Plane]) -> usize {
    let value = (FILLED * field.lattice.pitch_px) as f32;
    let within = Grid::of(field.lattice.nodes, hulls);
    let mut filled = 0;
    for reach in REACHES {
        let mut inside = Grid::of(field.lattice.nodes, &field.planes);
        let mut closed = inside.clone();
        (0..reach).for_each(|_| closed = closed.dilated());
        (0..reach).for_each(|_| closed = closed.eroded());
        for ((gap, inside), hull) in closed.bits.iter_mut().zip(&inside.bits).zip(&within.bits) {
            *gap &= hull & !inside;
        }
        let mut closing = parts(closed);
        closing.retain(|part| add_if_closing(&mut inside, part));
        if closing.is_empty() {
            continue;
        }
        // A hollow behind a narrow mouth is no tunnel.
        let open = inside.open();
        closing.retain(|part| !part.iter().any(|&node| inside.encloses(&open, node)));
        filled += closing.len();
        for [i, j, k] in closing.into_iter().flatten() {
            let plane = &mut field.planes[k as usize];
            let [x, y] = [i as usize - plane.first[0], j as usize - plane.first[1]];
            let index = y * plane.size[0] + x;
            plane.values[index] = value.min(hulls[k as usize].values[index]);
        }
    }
    filled
}

/// The grid's nodes by parts that touch, in faces, edges or corners.
fn parts(mut grid: Grid) -> Vec<Vec<Node>> {
    let mut parts = Vec::new();
    for word in 0..grid.bits.len() {
        while grid.bits[word] != 0 {
            let (row, first) = (word / grid.words, word % grid.words * 64);
            let i = first + grid.bits[word].trailing_zeros() as usize;
            let start = [i, row % grid.nodes[1], row / grid.nodes[1]].map(|index| index as i32);
            grid.set(start, false);
            let mut part = vec![start];
            let mut next = 0;
            while next < part.len() {
                for offset in offsets() {
                    let other = [0, 1, 2].map(|axis| part[next][axis] + offset[axis]);
                    if grid.contains(other) {
                        grid.set(other, false);
                        part.push(other);
                    }
                }
                next += 1;
            }
            parts.push(part);
        }
    }
    parts
}

fn offsets() -> impl Iterator<Item = Node> {
    (0..27).map(|n| [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1])
}

/// Adds nodes if that makes Euler's characteristic of the cubes about the nodes inside grow: by
/// one for each tunnel closed and each hollow enclosed, less one for each tunnel opened and each
/// two pieces joined. Whether it did.
fn add_if_closing(inside: &mut Grid, added: &[Node]) -> bool {
    let mut change = 0;
    for &node in added {
        for offset in offsets() {
            // A corner, edge or side of the cube, or the cube itself: new if no other cube has it.
            let is_new = !(0..8).any(|bits| {
                let near = [0, 1, 2].map(|axis| node[axis] + offset[axis] * (bits >> axis & 1));
                inside.contains(near)
            });
            if is_new {
                let dimension = offset.iter().filter(|step| **step == 0).count();
                change += if dimension % 2 == 0 { 1 } else { -1 };
            }
        }
        inside.set(node, true);
    }
    if change <= 0 {
        added.iter().for_each(|&node| inside.set(node, false));
    }
    change > 0
}

/// Whether each node of a lattice is inside, a bit each.
#[derive(Clone)]
struct Grid {
    nodes: [usize; 3],
    /// Of a row along X.
    words: usize,
    bits: Vec<u64>,
}

impl Grid {
    fn of(nodes: [usize; 3], planes: &[Plane]) -> Self {
        let words = nodes[0].div_ceil(64);
        let mut bits = vec![0; words * nodes[1] * nodes[2]];
        let slices = bits.par_chunks_mut((words * nodes[1]).max(1));
        slices.zip(planes).for_each(|(slice, plane)| {
            for (index, _) in plane.values.iter().enumerate().filter(|(_, value)| **value > 0.0) {
                let (i, j) = plane.node(index);
                slice[j * words + i / 64] |= 1 << (i % 64);
            }
        });
        Self { nodes, words, bits }
    }

    fn get(&self, [i, j, k]: [usize; 3]) -> bool {
        self.bits[(k * self.nodes[1] + j) * self.words + i / 64] >> (i % 64) & 1 != 0
    }

    fn set(&mut self, node: Node, value: bool) {
        let [i, j, k] = node.map(|index| index as usize);
        let word = &mut self.bits[(k * self.nodes[1] + j) * self.words + i / 64];
        *word = *word & !(1 << (i % 64)) | u64::from(value) << (i % 64);
    }

    fn has(&self, node: Node) -> bool {
        (0..3).all(|axis| node[axis] >= 0 && (node[axis] as usize) < self.nodes[axis])
    }

    /// Outside beyond the lattice.
    fn contains(&self, node: Node) -> bool {
        self.has(node) && self.get(node.map(|index| index as usize))
    }

    /// With all nodes in the cubes of three nodes about those inside.
    fn dilated(&self) -> Self {
        let mut grid = self.clone();
        for row in grid.bits.chunks_exact_mut(self.words.max(1)) {
            let mut before = 0;
            for word in 0..row.len() {
                let own = row[word];
                let after = row.get(word + 1).map_or(0, |next| next << 63);
                row[word] = own | own << 1 | own >> 1 | before >> 63 | after;
                before = own;
            }
        }
        grid.clear_beyond();
        for stride in [self.words, self.words * self.nodes[1]] {
            let source = grid.bits.clone();
            let stride = stride.min(source.len());
            // A slice's last row takes the next one's first for a neighbour: at the border a gap
            // may stay.
            grid.bits[stride..].iter_mut().zip(&source).for_each(|(own, before)| *own |= before);
            grid.bits.iter_mut().zip(&source[stride..]).for_each(|(own, after)| *own |= after);
        }
        grid
    }

    /// Without all nodes in the cubes of three nodes about those outside; none are beyond the
    /// lattice.
    fn eroded(&self) -> Self {
        self.inverted().dilated().inverted()
    }

    fn inverted(&self) -> Self {
        let mut grid = self.clone();
        grid.bits.iter_mut().for_each(|word| *word = !*word);
        grid.clear_beyond();
        grid
    }

    /// Clears the bits that no node has.
    fn clear_beyond(&mut self) {
        let used = self.nodes[0] % 64;
        if used > 0 {
            let last = self.words - 1;
            for row in self.bits.chunks_exact_mut(self.words) {
                row[last] &= (1 << used) - 1;
            }
        }
    }

    /// The nodes outside that are connected, in faces, with the lattice's border.
    fn open(&self) -> Self {
        let outside = self.inverted();
        let mut open = outside.clone();
        let ends = |row: usize| {
            let [j, k] = [row % self.nodes[1], row / self.nodes[1]];
            j == 0 || k == 0 || j + 1 == self.nodes[1] || k + 1 == self.nodes[2]
        };
        let last = self.nodes[0].saturating_sub(1);
        for (row, bits) in open.bits.chunks_exact_mut(self.words.max(1)).enumerate() {
            for (word, bits) in bits.iter_mut().enumerate().filter(|_| !ends(row)) {
                let mut border = u64::from(word == 0);
                border |= u64::from(word == last / 64) << (last % 64);
                *bits &= border;
            }
        }
        // Each sweep goes on from every row to the next ones, and there and back along them.
        let rows = open.bits.len() / self.words.max(1);
        loop {
            let mut changed = false;
            for row in 0..rows {
                changed |= open.spread(&outside, row, false);
            }
            for row in (0..rows).rev() {
                changed |= open.spread(&outside, row, true);
            }
            if !changed {
                break;
            }
        }
        open
    }

    /// Takes over into a row, within `outside`, what is set in the rows before it, or after it;
    /// then along the row. Whether that set anything.
    fn spread(&mut self, outside: &Self, row: usize, after: bool) -> bool {
        let [j, k] = [row % self.nodes[1], row / self.nodes[1]];
        let beside = if after {
            let next = (j + 1 < self.nodes[1]).then_some(row + 1);
            [next, (k + 1 < self.nodes[2]).then_some(row + self.nodes[1])]
        } else {
            [(j > 0).then(|| row - 1), (k > 0).then(|| row - self.nodes[1])]
        };
        let first = row * self.words;
        let mut changed = false;
        for word in 0..self.words {
            let own = self.bits[first + word];
            let mut bits = own;
            for other in beside.into_iter().flatten() {
                bits |= self.bits[other * self.words + word];
            }
            if word > 0 {
                bits |= self.bits[first + word - 1] >> 63;
            }
            let bits = along(bits & outside.bits[first + word], outside.bits[first + word]);
            self.bits[first + word] = bits;
            changed |= bits != own;
        }
        for word in (1..self.words).rev() {
            let within = outside.bits[first + word - 1];
            let own = self.bits[first + word - 1];
            let bits = along((own | self.bits[first + word] << 63) & within, within);
            self.bits[first + word - 1] = bits;
            changed |= bits != own;
        }
        changed
    }

    /// Whether a node touches, in a face, one outside that is not `open`.
    fn encloses(&self, open: &Self, node: Node) -> bool {
        let faces =
            offsets().filter(|offset| offset.iter().map(|step| step.abs()).sum::<i32>() == 1);
        faces.map(|offset| [0, 1, 2].map(|axis| node[axis] + offset[axis])).any(|other| {
            self.has(other) && {
                let other = other.map(|index| index as usize);
                !self.get(other) && !open.get(other)
            }
        })
    }
}

/// What of `within` is connected with `bits` in a word, towards both ends.
fn along(bits: u64, within: u64) -> u64 {
    let (mut up, mut down) = (bits, bits);
    let (mut way_up, mut way_down) = (within, within);
    for step in [1, 2, 4, 8, 16, 32] {
        up |= way_up & up << step;
        way_up &= way_up << step;
        down |= way_down & down >> step;
        way_down &= way_down >> step;
    }
    up | down
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::field::Lattice;
    use nalgebra::Point3;

    /// A block of 20 nodes with a square tunnel of some width through it along Y.
    fn pierced(width: usize) -> (Field, Vec<Plane>) {
        let lattice = Lattice { origin: Point3::origin(), pitch_px: 1.0, nodes: [24, 24, 24] };
        let whole = |k: usize| {
            let inside = |index: usize| (2..22).contains(&index);
            let values = (0..24 * 24)
                .map(|n| if inside(n % 24) && inside(n / 24) && inside(k) { 3.0 } else { -3.0 });
            Plane { first: [0, 0], size: [24, 24], values: values.collect(), creases: vec![] }
        };
        let hulls: Vec<Plane> = (0..24).map(whole).collect();
        let mut planes = hulls.clone();
        let gap = 10..10 + width;
        for plane in &mut planes[gap.clone()] {
            let columns = plane.values.iter_mut().enumerate();
            columns.filter(|(n, _)| gap.contains(&(n % 24))).for_each(|(_, value)| *value = -3.0);
        }
        (Field { lattice, planes }, hulls)
    }

    fn inside(field: &Field) -> usize {
        let values = field.planes.iter().flat_map(|plane| &plane.values);
        values.filter(|value| **value > 0.0).count()
    }

    #[test]
    fn narrow_tunnels_are_filled_and_wide_ones_stay() {
        for (width, filled) in [(1, 1), (2, 1), (4, 1), (6, 0)] {
            let (mut field, hulls) = pierced(width);
            assert_eq!(fill(&mut field, &hulls), filled, "{width}");
            let hole = if filled == 0 { width * width * 20 } else { 0 };
            assert_eq!(inside(&field), 8000 - hole);
        }
    }

    #[test]
    fn hollows_keep_their_mouths() {
        let (mut field, hulls) = pierced(0);
        let set = |field: &mut Field, [x, y, z]: [std::ops::Range<usize>; 3]| {
            for plane in &mut field.planes[z] {
                for (n, value) in plane.values.iter_mut().enumerate() {
                    if x.contains(&(n % 24)) && y.contains(&(n / 24)) {
                        *value = -3.0;
                    }
                }
            }
        };
        set(&mut field, [7..17, 7..17, 7..17]);
        set(&mut field, [11..13, 11..13, 17..22]);
        let before = inside(&field);
        assert_eq!(fill(&mut field, &hulls), 0);
        assert_eq!(inside(&field), before);
    }

    #[test]
    fn what_drawings_see_through_and_slits_stay_open() {
        let (mut field, _) = pierced(2);
        let hulls = field.planes.clone();
        assert_eq!(fill(&mut field, &hulls), 0);
        // A slit from above: it goes around nothing.
        let (mut field, hulls) = pierced(2);
        for plane in &mut field.planes[10..] {
            let columns = plane.values.iter_mut().enumerate();
            columns.filter(|(n, _)| (10..12).contains(&(n % 24))).for_each(|(_, v)| *v = -3.0);
        }
        let before = inside(&field);
        assert_eq!(fill(&mut field, &hulls), 0);
        assert_eq!(inside(&field), before);
    }
}
