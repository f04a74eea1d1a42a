//! Fewer vertices where the surface is flat, before edges are collapsed one by
//! one: blocks of cells get one vertex each, as leaves of an octree do.

use rayon::prelude::*;

use super::decimate;
use super::occupancy::{Occupancy, corner_to_fill};
use super::quad_mesh::QuadMesh;
use super::quadrics::Faces;
use mesh::Mesh;

/// Blocks are at most this many cells long.
const LARGEST_BLOCK: usize = 4;
/// Parts of a block that the surface runs through, about.
const PARTS_PER_BLOCK: usize = 3;
/// Quads that are cut in one go.
const QUADS_PER_TASK: usize = 8192;

/// The mesh's triangles, with the vertices of a block of cells made one where
/// it stays within `tolerance_px`, root mean square, of all faces around, and
/// the surface through the block is a disk.
///
/// * `inside`: what `mesh` is the surface of.
///
/// # Source
/// Ju, Losasso, Schaefer, Warren 2002, Dual contouring of Hermite data: octree
/// simplification and its topology safety test.
pub fn clustered(mesh: &QuadMesh, inside: &Occupancy, tolerance_px: f64) -> Mesh {
    let merger = Merger { mesh, inside, tolerance_px };
    let (mut block_of, mut blocks) = merger.blocks_of_cells();
    let mut places: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    let mut length = 2;
    loop {
        for (place, &block) in places.iter_mut().zip(&block_of) {
            let block = &blocks[block as usize];
            *place = if block.is_one { block.place } else { *place };
        }
        length *= 2;
        if length > LARGEST_BLOCK {
            return triangles(mesh, &places);
        }
        let (larger, next) = merger.blocks_of_blocks(&blocks, length);
        block_of.iter_mut().for_each(|block| *block = larger[*block as usize]);
        blocks = next;
    }
}

/// Cuts every quad along its shorter diagonal, each vertex replaced by its
/// entry in `places`; what has no area left is dropped.
fn triangles(mesh: &QuadMesh, places: &[u32]) -> Mesh {
    let position = |vertex: u32| mesh.positions[vertex as usize];
    let halves = |quad: &[u32; 4]| {
        let [a, b, c, d] = quad.map(|vertex| places[vertex as usize]);
        let first = (position(a) - position(c)).norm_squared();
        let second = (position(b) - position(d)).norm_squared();
        if first <= second { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
    };
    let has_area = |[a, b, c]: &[u32; 3]| a != b && b != c && c != a;
    let runs: Vec<Vec<[u32; 3]>> = mesh
        .quads
        .par_chunks(QUADS_PER_TASK)
        .map(|quads| quads.iter().flat_map(halves).filter(has_area).collect())
        .collect();
    decimate::compacted(&mesh.positions, runs.iter().flatten())
}

/// A cube of cells.
struct Block {
    /// Its index on each axis among blocks of its size.
    at: [u16; 3],
    /// Whether its vertices are made one.
    is_one: bool,
    /// The vertex where they are put.
    place: u32,
    faces: Faces,
}

/// The corners of a block among its 27 nodes, X fastest.
const CORNERS: [u32; 8] = [0, 2, 6, 8, 18, 20, 24, 26];
/// Per node, the corners, a bit each, that it lies between.
const NEAR: [u32; 27] = corners_near();

const fn corners_near() -> [u32; 27] {
    let mut near = [0; 27];
    let mut n = 0;
    while n < 27 {
        let steps = [n % 3, n / 3 % 3, n / 9];
        let mut corner = 0;
        while corner < 8 {
            let ends = [corner % 2 * 2, corner / 2 % 2 * 2, corner / 4 * 2];
            let mut axis = 0;
            while axis < 3 && (steps[axis] == 1 || steps[axis] == ends[axis]) {
                axis += 1;
            }
            near[n] |= ((axis == 3) as u32) << corner;
            corner += 1;
        }
        n += 1;
    }
    near
}

/// The vertices of a block that may stand for all.
#[derive(Clone, Copy, Default)]
struct Candidates {
    vertices: [u32; 8],
    count: usize,
}

impl Candidates {
    fn push(&mut self, vertex: u32) {
        self.vertices[self.count] = vertex;
        self.count += 1;
    }
}

struct Merger<'a> {
    mesh: &'a QuadMesh,
    inside: &'a Occupancy,
    tolerance_px: f64,
}

impl Merger<'_> {
    /// Blocks two cells long; per vertex the block, by index, and the blocks.
    fn blocks_of_cells(&self) -> (Vec<u32>, Vec<Block>) {
        let layers = self.mesh.layer_vertices.len() - 1;
        let slabs: Vec<_> =
            (0..layers.div_ceil(2)).into_par_iter().map(|slab| self.slab(slab * 2)).collect();
        let (mut block_of, mut blocks) = (Vec::with_capacity(self.mesh.cells.len()), Vec::new());
        for (of_slab, mut own) in slabs {
            let first = blocks.len() as u32;
            block_of.extend(of_slab.into_iter().map(|block| first + block));
            blocks.append(&mut own);
        }
        (block_of, blocks)
    }

    /// The same of the layers of cells `k` and `k + 1`.
    fn slab(&self, k: usize) -> (Vec<u32>, Vec<Block>) {
        let starts = &self.mesh.layer_vertices;
        let first = starts[k];
        let cells = &self.mesh.cells[first..starts[(k + 2).min(starts.len() - 1)]];
        let mut grouped = Grouped::new(self.inside, cells.len());
        for (&cell, vertex) in cells.iter().zip(first as u32..) {
            grouped.push(cell, vertex, true);
        }
        let Grouped { parents, mut blocks, candidates, .. } = grouped;
        for block in &mut blocks {
            block.is_one = self.is_disk(block.at, 2);
        }
        // The quads of the layer above touch this one from above.
        let starts = &self.mesh.layer_quads;
        for quad in &self.mesh.quads[starts[k]..starts[(k + 3).min(starts.len() - 1)]] {
            let owners = quad.map(|vertex| {
                let own = (vertex as usize).checked_sub(first);
                own.and_then(|own| parents.get(own)).copied()
            });
            let is_first = |n: usize| !owners[..n].contains(&owners[n]);
            let distinct = (0..4).filter(|&n| is_first(n)).filter_map(|n| owners[n]);
            let mut faces = None;
            for owner in distinct {
                let block = &mut blocks[owner as usize];
                if block.is_one {
                    let corners = || quad.map(|vertex| self.mesh.positions[vertex as usize]);
                    block.faces.add(faces.get_or_insert_with(|| Faces::of_quad(corners())));
                }
            }
        }
        for (block, candidates) in blocks.iter_mut().zip(&candidates) {
            self.settle(block, candidates);
        }
        (parents, blocks)
    }

    /// Blocks `length` cells long; per block half as long the larger one, by
    /// index, and the larger ones.
    fn blocks_of_blocks(&self, halves: &[Block], length: usize) -> (Vec<u32>, Vec<Block>) {
        let mut grouped = Grouped::new(self.inside, halves.len());
        for half in halves {
            grouped.push(half.at, half.place, half.is_one);
        }
        let Grouped { parents, mut blocks, candidates, .. } = grouped;
        for (half, &parent) in halves.iter().zip(&parents) {
            blocks[parent as usize].faces.add(&half.faces);
        }
        for (block, candidates) in blocks.iter_mut().zip(&candidates) {
            block.is_one = block.is_one && self.is_disk(block.at, length);
            self.settle(block, candidates);
        }
        (parents, blocks)
    }

    /// Whether the surface through a block whose eight parts hold a disk each
    /// is a disk itself: every node between its corners is like one of those
    /// that it lies between.
    fn is_disk(&self, at: [u16; 3], length: usize) -> bool {
        let inside = self.inside.sampled(at.map(|index| usize::from(index) * length), length / 2);
        let corners =
            |inside: u32| CORNERS.iter().rev().fold(0, |all, n| all << 1 | inside >> n & 1);
        let pattern = corners(inside);
        let is_like_one = |(n, near): (usize, &u32)| {
            let alike = if inside >> n & 1 != 0 { pattern } else { !pattern };
            alike & near != 0
        };
        corner_to_fill(pattern as u8).is_none() && NEAR.iter().enumerate().all(is_like_one)
    }

    /// Puts the block where it fits the faces around best, if it fits them.
    fn settle(&self, block: &mut Block, candidates: &Candidates) {
        if !block.is_one {
            return;
        }
        let misfit =
            |&vertex: &u32| block.faces.mean_squared(&self.mesh.positions[vertex as usize].coords);
        let vertices = &candidates.vertices[..candidates.count];
        let misfits = vertices.iter().map(|vertex| (misfit(vertex), *vertex));
        let best = misfits.min_by(|a, b| a.0.total_cmp(&b.0));
        let fits = best.filter(|best| best.0 <= self.tolerance_px * self.tolerance_px);
        match fits.filter(|_| !block.faces.is_bent()) {
            Some((_, vertex)) => block.place = vertex,
            None => block.is_one = false,
        }
    }
}

/// Parts, in order of their layers, by the block twice as long.
struct Grouped {
    /// Blocks along Y and X.
    width: usize,
    height: usize,
    /// The block of each column of the layer at hand.
    index: Vec<u32>,
    layer: Option<u16>,
    parents: Vec<u32>,
    blocks: Vec<Block>,
    candidates: Vec<Candidates>,
}

impl Grouped {
    fn new(inside: &Occupancy, count: usize) -> Self {
        let [nx, ny, _] = inside.nodes();
        let (width, height) = (nx / 2 + 1, ny / 2 + 1);
        Self {
            width,
            height,
            index: Vec::new(),
            layer: None,
            parents: Vec::with_capacity(count),
            blocks: Vec::with_capacity(count / PARTS_PER_BLOCK),
            candidates: Vec::with_capacity(count / PARTS_PER_BLOCK),
        }
    }

    /// Adds the part at `at`; its block is one only if all its parts are.
    fn push(&mut self, at: [u16; 3], place: u32, is_one: bool) {
        let at = at.map(|index| index / 2);
        if self.layer != Some(at[2]) {
            self.layer = Some(at[2]);
            self.index = vec![u32::MAX; self.width * self.height];
        }
        let block = &mut self.index[usize::from(at[1]) * self.width + usize::from(at[0])];
        if *block == u32::MAX {
            *block = self.blocks.len() as u32;
            self.blocks.push(Block { at, is_one: true, place, faces: Faces::default() });
            self.candidates.push(Candidates::default());
        }
        self.parents.push(*block);
        self.blocks[*block as usize].is_one &= is_one;
        self.candidates[*block as usize].push(place);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::surface::field::{Field, Lattice, Plane};
    use crate::surface::quad_mesh::quads_of_field;
    use mesh::topology::check_manifold;

    const NODES: usize = 24;

    fn meshed(value: impl Fn(Point3<f64>) -> f64) -> (QuadMesh, Occupancy) {
        let lattice = Lattice { origin: Point3::origin(), pitch_px: 1.0, nodes: [NODES; 3] };
        let plane = |k| {
            let nodes = (0..NODES * NODES).map(|n| (n % NODES, n / NODES));
            let values =
                nodes.map(|(i, j)| value(Point3::new(i as f64, j as f64, k as f64)) as f32);
            Plane { first: [0; 2], size: [NODES; 2], values: values.collect(), creases: Vec::new() }
        };
        let field = Field { lattice, planes: (0..NODES).map(plane).collect() };
        let inside = Occupancy::of_field(&field);
        (quads_of_field(&field, &inside), inside)
    }

    #[test]
    fn flat_faces_become_coarse_and_stay_where_they_are() {
        let (quads, inside) =
            meshed(|p| (0..3).map(|axis| 8.3 - (p[axis] - 11.5).abs()).fold(f64::MAX, f64::min));
        let fine = triangles(&quads, &(0..quads.cells.len() as u32).collect::<Vec<_>>());
        let coarse = clustered(&quads, &inside, 0.2);
        assert_eq!(check_manifold(&coarse), Ok(()));
        assert!(coarse.triangles.len() * 3 < fine.triangles.len());
        assert!((coarse.signed_volume() / fine.signed_volume() - 1.0).abs() < 0.01);
    }

    #[test]
    fn whatever_the_solid_is_it_stays_closed_and_keeps_its_handles() {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let euler = |mesh: &Mesh| mesh.positions.len() as i64 - mesh.triangles.len() as i64 / 2;
        let mut merged = 0;
        for _ in 0..40 {
            let waves: [[f64; 4]; 5] =
                std::array::from_fn(|_| [(); 4].map(|()| random.random_range(-1.0..1.0)));
            let (quads, inside) = meshed(|p| {
                let wave = |w: &[f64; 4]| (p.x * w[0] + p.y * w[1] + p.z * w[2] + 6.0 * w[3]).sin();
                waves.iter().map(wave).sum::<f64>()
            });
            let fine = triangles(&quads, &(0..quads.cells.len() as u32).collect::<Vec<_>>());
            assert_eq!(check_manifold(&fine), Ok(()));
            let coarse = clustered(&quads, &inside, 0.5);
            assert_eq!(check_manifold(&coarse), Ok(()));
            assert_eq!(euler(&coarse), euler(&fine));
            merged += fine.positions.len() - coarse.positions.len();
        }
        assert!(merged > 10_000, "only {merged} vertices were merged");
    }
}
