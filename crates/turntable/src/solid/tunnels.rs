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

    /// Outside beyond the lattice.
    fn contains(&self, node: Node) -> bool {
        let within = (0..3).all(|axis| node[axis] >= 0 && (node[axis] as usize) < self.nodes[axis]);
        within && self.get(node.map(|index| index as usize))
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
    fn open(&self) -> Vec<bool> {
        let [columns, rows, slices] = self.nodes;
        let strides = [1, columns, columns * rows];
        let place = |index: usize| [index % columns, index / columns % rows, index / strides[2]];
        let on_border = |index: usize| {
            let at = place(index);
            (0..3).any(|axis| at[axis] == 0 || at[axis] + 1 == self.nodes[axis])
        };
        let mut open = vec![false; columns * rows * slices];
        let mut next: Vec<usize> =
            (0..open.len()).filter(|&index| on_border(index) && !self.get(place(index))).collect();
        next.iter().for_each(|&index| open[index] = true);
        while let Some(index) = next.pop() {
            let at = place(index);
            for axis in 0..3 {
                let before = (at[axis] > 0).then(|| index - strides[axis]);
                let after = (at[axis] + 1 < self.nodes[axis]).then(|| index + strides[axis]);
                for other in before.into_iter().chain(after) {
                    if !self.get(place(other)) && !std::mem::replace(&mut open[other], true) {
                        next.push(other);
                    }
                }
            }
        }
        open
    }

    /// Whether a node touches, in a face, one outside that is not `open`.
    fn encloses(&self, open: &[bool], node: Node) -> bool {
        let faces =
            offsets().filter(|offset| offset.iter().map(|step| step.abs()).sum::<i32>() == 1);
        faces.map(|offset| [0, 1, 2].map(|axis| node[axis] + offset[axis])).any(|other| {
            let within =
                (0..3).all(|axis| other[axis] >= 0 && (other[axis] as usize) < self.nodes[axis]);
            within && {
                let [i, j, k] = other.map(|index| index as usize);
                !self.get([i, j, k]) && !open[(k * self.nodes[1] + j) * self.nodes[0] + i]
            }
        })
    }
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
