//! Fewer faces for the same shape.

use meshopt::{SimplifyOptions, VertexDataAdapter};
use nalgebra::Point3;

use super::repair::without_touching;
use super::surface::QuadMesh;
use super::topology::check_manifold;
use crate::geometry::Mesh;

/// Cuts every quad along its shorter diagonal.
pub fn triangles_of_quads(mesh: &QuadMesh) -> Mesh {
    let position = |vertex: u32| mesh.positions[vertex as usize];
    let triangles = mesh.quads.iter().flat_map(|&[a, b, c, d]| {
        let first = (position(a) - position(c)).norm_squared();
        let second = (position(b) - position(d)).norm_squared();
        if first <= second { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
    });
    Mesh { triangles: triangles.collect(), positions: mesh.positions.clone() }
}

/// Triangles that repairs may add, as a share of the budget.
const REPAIR_SHARE: usize = 100;

/// Collapses edges by the quadric error: all that stay within `tolerance_px`,
/// and more as long as there are more than `target_faces` triangles.
///
/// Creases survive because collapsing them costs most. A closed manifold stays
/// one: where collapses made it touch itself, it is pulled apart. Should that
/// fail, the mesh is returned as it is, above the budget.
///
/// # Source
/// Garland & Heckbert 1997, Surface simplification using quadric error metrics.
pub fn decimated(mesh: &Mesh, target_faces: usize, tolerance_px: f64) -> Mesh {
    let Some((low, high)) = mesh.bounds() else {
        return Mesh::default();
    };
    let centre = nalgebra::center(&low, &high);
    let vertices: Vec<f32> = mesh
        .positions
        .iter()
        .flat_map(|position| (position - centre).cast::<f32>().data.0[0])
        .collect();
    let mut indices: Vec<u32> = mesh.triangles.as_flattened().to_vec();
    let bytes: Vec<u8> = vertices.iter().flat_map(|value| value.to_ne_bytes()).collect();
    let Ok(adapter) = VertexDataAdapter::new(&bytes, 12, 0) else {
        return mesh.clone();
    };
    let options = SimplifyOptions::ErrorAbsolute;
    indices = meshopt::simplify(&indices, &adapter, 0, tolerance_px.max(0.0) as f32, options, None);
    let target_faces = target_faces - target_faces / REPAIR_SHARE;
    if indices.len() > target_faces * 3 {
        indices = meshopt::simplify(&indices, &adapter, target_faces * 3, f32::MAX, options, None);
    }
    let compact = compacted(&mesh.positions, indices.as_chunks().0);
    if check_manifold(&compact).is_ok() {
        return compact;
    }
    let repaired = compacted_mesh(&without_touching(&compact));
    if check_manifold(&repaired).is_ok() { repaired } else { mesh.clone() }
}

fn compacted_mesh(mesh: &Mesh) -> Mesh {
    compacted(&mesh.positions, &mesh.triangles)
}

/// The mesh of `triangles` without unused vertices, in order of first use.
fn compacted(positions: &[Point3<f64>], triangles: &[[u32; 3]]) -> Mesh {
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
