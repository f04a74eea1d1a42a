//! Marching cubes over a set of nodes.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

use super::occupancy::Occupancy;
use crate::surface::field::Lattice;
use mesh::Mesh;

/// The boundary of the nodes `inside`, halfway between inside and outside.
///
/// # Source
/// Lorensen & Cline 1987, with the triangles of each case found by following
/// the boundary over the cell's faces; sets are well composed, so that no face
/// is ambiguous.
pub fn marching_cubes(lattice: &Lattice, inside: &Occupancy) -> Mesh {
    let [_, ny, nz] = inside.nodes();
    let cases: Vec<Vec<Vec<u8>>> = (0..=u8::MAX).map(loops_of_case).collect();
    let mut vertices: HashMap<([usize; 3], u8), u32> = HashMap::new();
    let mut mesh = Mesh::default();
    for k in 0..=nz {
        // Edges of lower slices are done with.
        vertices.retain(|(node, _), _| node[2] >= k);
        for j in 0..=ny {
            for i in inside.mixed_columns(j, k) {
                for loop_edges in &cases[usize::from(inside.pattern([i, j, k]))] {
                    let corners: Vec<u32> = loop_edges
                        .iter()
                        .map(|&edge| vertex(lattice, [i, j, k], edge, &mut vertices, &mut mesh))
                        .collect();
                    for pair in corners[1..].windows(2) {
                        mesh.triangles.push([corners[0], pair[0], pair[1]]);
                    }
                }
            }
        }
    }
    mesh
}

/// An edge's low corner and axis.
fn edge_parts(edge: u8) -> (u8, u8) {
    (edge & 7, edge >> 3)
}

fn vertex(
    lattice: &Lattice,
    cell: [usize; 3],
    edge: u8,
    vertices: &mut HashMap<([usize; 3], u8), u32>,
    mesh: &mut Mesh,
) -> u32 {
    let (corner, axis) = edge_parts(edge);
    let node: [usize; 3] = std::array::from_fn(|axis| cell[axis] + usize::from(corner >> axis & 1));
    *vertices.entry((node, axis)).or_insert_with(|| {
        // Node indices are one more than the lattice's.
        let mut offset = Vector3::from(node.map(|index| index as f64 - 1.0));
        offset[usize::from(axis)] += 0.5;
        mesh.positions.push(Point3::from(lattice.origin.coords + offset * lattice.pitch_px));
        mesh.positions.len() as u32 - 1
    })
}

/// The closed loops of cut edges of a case, counter-clockwise seen from outside.
fn loops_of_case(pattern: u8) -> Vec<Vec<u8>> {
    let mut next: HashMap<u8, u8> = HashMap::new();
    for axis in 0..3_u8 {
        for high in [false, true] {
            let face = face_corners(axis, high);
            let inside = face.map(|corner| pattern >> corner & 1 != 0);
            // Walking the face counter-clockwise from outside the cell, the
            // boundary enters where inside begins and leaves where it ends.
            let edge = |i: usize| edge_between(face[i], face[(i + 1) % 4]);
            let ends = (0..4).filter(|&i| inside[i] && !inside[(i + 1) % 4]);
            for end in ends {
                let begin = (1..4).map(|step| (end + 4 - step) % 4).find(|&i| !inside[i]);
                if let Some(begin) = begin {
                    next.insert(edge(begin), edge(end));
                }
            }
        }
    }
    let mut loops = Vec::new();
    while let Some(&start) = next.keys().min() {
        let mut edges = Vec::new();
        let mut at = start;
        while let Some(following) = next.remove(&at) {
            edges.push(at);
            at = following;
        }
        loops.push(edges);
    }
    loops
}

/// A face's corners, counter-clockwise seen from outside the cell.
fn face_corners(axis: u8, high: bool) -> [u8; 4] {
    let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
    let base = if high { 1 << axis } else { 0 };
    if high {
        [base, base + u, base + u + v, base + v]
    } else {
        [base, base + v, base + u + v, base + u]
    }
}

fn edge_between(a: u8, b: u8) -> u8 {
    a.min(b) | ((a ^ b).trailing_zeros() as u8) << 3
}

#[cfg(test)]
mod tests {
    use super::*;
    use mesh::topology::check_manifold;

    fn lattice(n: usize) -> Lattice {
        Lattice { origin: Point3::origin(), pitch_px: 1.0, nodes: [n; 3] }
    }

    #[test]
    fn one_node_becomes_an_octahedron() {
        let mut inside = Occupancy::empty([3; 3]);
        inside.set([2, 2, 2]);
        let mesh = marching_cubes(&lattice(3), &inside);
        assert_eq!((mesh.positions.len(), mesh.triangles.len()), (6, 8));
        assert_eq!(check_manifold(&mesh), Ok(()));
        assert!((mesh.signed_volume() - 1.0 / 6.0).abs() < 1e-12);
    }

    #[test]
    fn any_well_composed_set_is_closed() {
        use rand::{Rng, SeedableRng};
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        for _ in 0..20 {
            let mut inside = Occupancy::empty([6; 3]);
            for _ in 0..60 {
                inside.set(std::array::from_fn(|_| random.random_range(1..=6)));
            }
            inside.compose_well();
            let mesh = marching_cubes(&lattice(6), &inside);
            assert_eq!(check_manifold(&mesh), Ok(()));
            assert!(mesh.signed_volume() > 0.0);
        }
    }
}
