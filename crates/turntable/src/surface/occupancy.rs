//! Which nodes of a lattice are inside, one bit each.

use rayon::prelude::*;

use crate::surface::field::Field;

/// A bit per node, with a border of one outside node on every side.
///
/// Indices are those of the lattice plus one.
#[derive(Clone, Debug)]
pub struct Occupancy {
    nodes: [usize; 3],
    words_per_row: usize,
    bits: Vec<u64>,
}

impl Occupancy {
    /// The nodes where `field` is positive, with as many more as make the set
    /// well composed.
    pub fn of_field(field: &Field) -> Self {
        let mut occupancy = Self::empty(field.lattice.nodes);
        for (k, plane) in field.planes.iter().enumerate() {
            for (j, row) in plane.values.chunks_exact(plane.size[0].max(1)).enumerate() {
                let start = occupancy.row_start(plane.first[1] + j + 1, k + 1);
                let mut next = plane.first[0] + 1;
                for values in row.chunks(64) {
                    let bits = values
                        .iter()
                        .rev()
                        .fold(0, |bits, &value| bits << 1 | u64::from(value > 0.0));
                    occupancy.add_bits(start, next, bits);
                    next += values.len();
                }
            }
        }
        occupancy.compose_well();
        occupancy
    }

    /// All outside, with `nodes` along X, Y and Z.
    pub fn empty(nodes: [usize; 3]) -> Self {
        let words_per_row = (nodes[0] + 2).div_ceil(64);
        Self {
            nodes,
            words_per_row,
            bits: vec![0; words_per_row * (nodes[1] + 2) * (nodes[2] + 2)],
        }
    }

    /// Nodes along each axis without the border.
    pub fn nodes(&self) -> [usize; 3] {
        self.nodes
    }

    fn row_start(&self, j: usize, k: usize) -> usize {
        (k * (self.nodes[1] + 2) + j) * self.words_per_row
    }

    /// Whether a node is inside.
    pub fn get(&self, [i, j, k]: [usize; 3]) -> bool {
        self.bits[self.row_start(j, k) + i / 64] >> (i % 64) & 1 != 0
    }

    /// Sets nodes from `i` on in the row that starts at word `start`.
    fn add_bits(&mut self, start: usize, i: usize, bits: u64) {
        let (word, shift) = (start + i / 64, i % 64);
        self.bits[word] |= bits << shift;
        if shift > 0 && bits >> (64 - shift) != 0 {
            self.bits[word + 1] |= bits >> (64 - shift);
        }
    }

    /// Of the nodes at `low` and one and two `steps` on, along each axis, which
    /// are inside: a bit each, X fastest. Those beyond the border are outside.
    pub fn sampled(&self, low: [usize; 3], step: usize) -> u32 {
        let rows = (0..9).map(|n| [low[1] + n % 3 * step, low[2] + n / 3 * step]);
        rows.enumerate().fold(0, |all, (n, [j, k])| {
            if j > self.nodes[1] + 1 || k > self.nodes[2] + 1 {
                return all;
            }
            let row = &self.bits[self.row_start(j, k)..][..self.words_per_row];
            let inside = |i: usize| row.get(i / 64).map_or(0, |word| (word >> (i % 64)) as u32 & 1);
            let three = (0..3).fold(0, |three, x| three | inside(low[0] + x * step) << x);
            all | three << (3 * n)
        })
    }

    /// Puts a node inside.
    pub fn set(&mut self, [i, j, k]: [usize; 3]) {
        let word = self.row_start(j, k) + i / 64;
        self.bits[word] |= 1 << (i % 64);
    }

    /// The cells of row (j, k) whose eight corners are not all alike, by their
    /// low corner's index along X.
    pub fn mixed_columns(&self, j: usize, k: usize) -> impl Iterator<Item = usize> + '_ {
        let rows = [(j, k), (j + 1, k), (j, k + 1), (j + 1, k + 1)];
        let starts = rows.map(|(j, k)| self.row_start(j, k));
        let word = move |w: usize| -> (u64, u64) {
            let words = starts.map(|start| self.bits[start + w]);
            (words.iter().fold(0, |any, w| any | w), words.iter().fold(u64::MAX, |all, w| all & w))
        };
        let last = self.words_per_row - 1;
        let cells = self.nodes[0] + 1;
        (0..self.words_per_row)
            .flat_map(move |w| {
                let (any, all) = word(w);
                let (next_any, next_all) = if w < last { word(w + 1) } else { (0, 0) };
                let any = any | any >> 1 | next_any << 63;
                let all = all & (all >> 1 | next_all << 63);
                set_bits(any & !all).map(move |bit| w * 64 + bit)
            })
            .filter(move |&i| i < cells)
    }

    /// The corners of a cell that are inside: bit 1 along X, 2 along Y, 4 along Z.
    pub fn pattern(&self, [i, j, k]: [usize; 3]) -> u8 {
        let (word, shift) = (i / 64, i % 64);
        let pair = |j: usize, k: usize| {
            let row = &self.bits[self.row_start(j, k)..][..self.words_per_row];
            let next = if shift == 63 { row[word + 1] << 1 } else { 0 };
            ((row[word] >> shift | next) & 3) as u8
        };
        pair(j, k) | pair(j + 1, k) << 2 | pair(j, k + 1) << 4 | pair(j + 1, k + 1) << 6
    }

    /// Adds nodes until inside and outside meet in faces only.
    pub fn compose_well(&mut self) {
        let table: Vec<Option<u8>> = (0..=u8::MAX).map(corner_to_fill).collect();
        let is_critical = |cell: &[usize; 3]| table[usize::from(self.pattern(*cell))].is_some();
        let of_layer = |k: usize| {
            let rows =
                (0..=self.nodes[1]).flat_map(|j| self.mixed_columns(j, k).map(move |i| [i, j, k]));
            rows.filter(is_critical).collect::<Vec<_>>()
        };
        let layers: Vec<_> = (0..=self.nodes[2]).into_par_iter().map(of_layer).collect();
        let mut pending = layers.concat();
        while let Some(cell) = pending.pop() {
            let Some(corner) = table[usize::from(self.pattern(cell))] else {
                continue;
            };
            let node: [usize; 3] =
                std::array::from_fn(|axis| cell[axis] + usize::from(corner >> axis & 1));
            // The border stays outside: a critical cell there cannot arise
            // from nodes that are all outside.
            self.set(node);
            for corner in 0..8_usize {
                let around: [usize; 3] =
                    std::array::from_fn(|axis| node[axis].wrapping_sub(corner >> axis & 1));
                if (0..3).all(|axis| around[axis] <= self.nodes[axis]) {
                    pending.push(around);
                }
            }
        }
    }
}

fn set_bits(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (word != 0).then(|| word.trailing_zeros() as usize)?;
        word &= word - 1;
        Some(bit)
    })
}

/// An outside corner to fill if the cell's inside corners meet only along an
/// edge or in a point, or its outside corners do.
pub fn corner_to_fill(pattern: u8) -> Option<u8> {
    let inside = |corner: u8| pattern >> corner & 1 != 0;
    for axis in 0..3_u8 {
        let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        for base in [0, 1 << axis] {
            let face = [base, base + u, base + u + v, base + v];
            let [a, b, c, d] = face.map(inside);
            if a == c && b == d && a != b {
                return face.into_iter().find(|&corner| !inside(corner));
            }
        }
    }
    (0..4_u8).find_map(|corner| {
        let pair = 1_u8 << corner | 1 << (7 - corner);
        if pattern == pair {
            Some(corner ^ 1)
        } else if pattern == !pair {
            Some(corner)
        } else {
            None
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mixed_cells_surround_a_node() {
        let mut occupancy = Occupancy::empty([130, 3, 3]);
        occupancy.set([64, 2, 2]);
        assert_eq!(occupancy.mixed_columns(1, 1).collect::<Vec<_>>(), [63, 64]);
        assert_eq!(occupancy.mixed_columns(0, 1).count(), 0);
    }

    #[test]
    fn filling_leaves_nothing_to_fill() {
        for pattern in 0..=u8::MAX {
            let mut filled = pattern;
            while let Some(corner) = corner_to_fill(filled) {
                assert_eq!(filled >> corner & 1, 0, "{pattern:08b} fills an inside corner");
                filled |= 1 << corner;
            }
        }
        assert!(corner_to_fill(0b0000_1001).is_some());
        assert!(corner_to_fill(0b1000_0001).is_some());
        assert!(corner_to_fill(0b0111_1110).is_some());
        assert!(corner_to_fill(0b0000_0111).is_none());
    }
}
