//! Fewer faces for the same shape.

use meshopt::{SimplifyOptions, VertexDataAdapter};
use nalgebra::Point3;

use mesh::Mesh;
use mesh::repair::without_touching;
use mesh::topology::check_manifold;

/// Triangles that are decimated by themselves first.
const CHUNK_FACES: usize = 16_384;
/// Triangles that repairs may add, as a share of the budget.
const REPAIR_SHARE: usize = 100;
/// How often fewer triangles are tried if repairs add too many.
const MAX_ATTEMPTS: usize = 5;

/// Collapses edges by the quadric error: all that stay within `tolerance_px`,
/// and more as long as there are more than `target_faces` triangles.
///
/// Creases survive because collapsing them costs most. A closed manifold stays
/// one: where collapses made it touch itself, it is pulled apart. Should that
/// fail even for fewer triangles, the mesh is returned as it is, above the
/// budget.
///
/// # Source
/// Garland & Heckbert 1997, Surface simplification using quadric error metrics.
pub fn decimated(mesh: &Mesh, target_faces: usize, tolerance_px: f64) -> Mesh {
    let Some((low, high)) = mesh.bounds() else {
        return Mesh::default();
    };
    let centre = nalgebra::center(&low, &high);
    let vertices = Vertices::new(&mesh.positions, &centre);
    let tolerance_px = tolerance_px.max(0.0) as f32;
    let indices = merged_by_chunk(&vertices, &mesh.triangles, tolerance_px);
    let mut budget = target_faces - target_faces / REPAIR_SHARE;
    let mut closed = None;
    for _ in 0..MAX_ATTEMPTS {
        let indices = vertices.within(&indices, budget, tolerance_px);
        match closed_mesh(compacted(&mesh.positions, indices.as_chunks().0)) {
            Some(mesh) if mesh.triangles.len() <= target_faces => return mesh,
            Some(mesh) => {
                let excess = 2 * (mesh.triangles.len() - target_faces);
                budget = budget.saturating_sub(excess).max(target_faces / 2);
                closed = Some(mesh);
            }
            None => budget -= budget / 10,
        }
    }
    closed.unwrap_or_else(|| mesh.clone())
}

/// Vertices as meshopt reads them: single precision about their centre.
struct Vertices {
    bytes: Vec<u8>,
}

impl Vertices {
    fn new(positions: &[Point3<f64>], centre: &Point3<f64>) -> Self {
        let coordinates =
            positions.iter().flat_map(|position| (position - centre).cast::<f32>().data.0[0]);
        Self { bytes: coordinates.flat_map(f32::to_ne_bytes).collect() }
    }

    /// At most about `budget` triangles, and fewer where that stays within
    /// `tolerance_px`.
    fn within(&self, indices: &[u32], budget: usize, tolerance_px: f32) -> Vec<u32> {
        let none = SimplifyOptions::None;
        let (within, error_px) = if indices.len() > budget * 3 {
            self.simplified(indices, budget, f32::MAX, none)
        } else {
            (indices.to_vec(), 0.0)
        };
        if error_px < tolerance_px {
            self.simplified(&within, 0, tolerance_px, none).0
        } else {
            within
        }
    }

    /// Fewer triangles, at least `faces`, none off by more than `tolerance_px`,
    /// and by how much they are off.
    fn simplified(
        &self,
        indices: &[u32],
        faces: usize,
        tolerance_px: f32,
        options: SimplifyOptions,
    ) -> (Vec<u32>, f32) {
        let options = SimplifyOptions::ErrorAbsolute | options;
        let mut error_px = 0.0;
        let error = Some(&mut error_px);
        let fewer = VertexDataAdapter::new(&self.bytes, 12, 0).map_or_else(
            |_| indices.to_vec(),
            |adapter| meshopt::simplify(indices, &adapter, faces * 3, tolerance_px, options, error),
        );
        (fewer, error_px)
    }
}

/// Collapses within slabs of the mesh at once; their common edges stay.
///
/// Slabs are of one size whatever the number of threads.
fn merged_by_chunk(vertices: &Vertices, triangles: &[[u32; 3]], tolerance_px: f32) -> Vec<u32> {
    use rayon::prelude::*;
    let inner = SimplifyOptions::LockBorder | SimplifyOptions::Sparse;
    let chunks: Vec<Vec<u32>> = triangles
        .par_chunks(CHUNK_FACES)
        .map(|chunk| vertices.simplified(chunk.as_flattened(), 0, tolerance_px, inner).0)
        .collect();
    chunks.concat()
}

/// The mesh, pulled apart where it touches itself; `None` if it is not closed
/// even so.
fn closed_mesh(mesh: Mesh) -> Option<Mesh> {
    if check_manifold(&mesh).is_ok() {
        return Some(mesh);
    }
    let repaired = without_touching(&mesh);
    let repaired = compacted(&repaired.positions, &repaired.triangles);
    check_manifold(&repaired).is_ok().then_some(repaired)
}

/// The mesh of `triangles` without unused vertices, in order of first use.
pub fn compacted<'a>(
    positions: &[Point3<f64>],
    triangles: impl IntoIterator<Item = &'a [u32; 3]>,
) -> Mesh {
    let mut new_index = vec![u32::MAX; positions.len()];
    let mut mesh = Mesh::default();
    for triangle in triangles {
        mesh.triangles.push(triangle.map(|vertex| {
            let index = &mut new_index[vertex as usize];
            if *index == u32::MAX {
                *index = mesh.positions.len() as u32;
                mesh.positions.push(positions[vertex as usize]);
            }
            *index
        }));
    }
    mesh
}
