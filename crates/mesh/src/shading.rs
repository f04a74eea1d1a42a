//! Normals that break at creases.

use nalgebra::{Point3, Vector3};

use super::topology::{HalfEdge, HalfEdges};
use crate::Mesh;

/// A mesh for drawing: vertices are repeated where the normal breaks.
#[derive(Clone, Debug, Default)]
pub struct ShadedMesh {
    /// In the frame and unit of the original mesh.
    pub positions: Vec<Point3<f64>>,
    /// Unit length, one a position.
    pub normals: Vec<Vector3<f64>>,
    /// The vertex of the original mesh that each position repeats.
    pub sources: Vec<u32>,
    /// In the original's order.
    pub triangles: Vec<[u32; 3]>,
}

/// Faces that turn more than this are shaded apart, degrees.
pub const CREASE_ANGLE_DEG: f64 = 40.0;

/// Averages face normals over each vertex' smooth groups, weighted by the
/// corner's angle (Thürmer & Wüthrich 1998).
///
/// Triangles around a vertex are in one group while neighbours turn by less
/// than `crease_angle_deg`.
pub fn shaded(mesh: &Mesh, crease_angle_deg: f64) -> ShadedMesh {
    let faces: Vec<Vector3<f64>> =
        (0..mesh.triangles.len()).map(|i| face_normal(mesh, i)).collect();
    let mut corners: Vec<Vec<(usize, usize)>> = vec![Vec::new(); mesh.positions.len()];
    for (triangle, vertices) in mesh.triangles.iter().enumerate() {
        for (corner, &vertex) in vertices.iter().enumerate() {
            corners[vertex as usize].push((triangle, corner));
        }
    }
    let min_cosine = crease_angle_deg.to_radians().cos();
    let mut out =
        ShadedMesh { triangles: vec![[0; 3]; mesh.triangles.len()], ..ShadedMesh::default() };
    for (vertex, corners) in corners.iter().enumerate() {
        for group in smooth_groups(mesh, &faces, corners, min_cosine) {
            let index = out.positions.len() as u32;
            let sum: Vector3<f64> = group
                .iter()
                .map(|&(triangle, corner)| faces[triangle] * corner_angle(mesh, triangle, corner))
                .sum();
            out.positions.push(mesh.positions[vertex]);
            out.normals.push(sum.try_normalize(1e-12).unwrap_or_else(Vector3::z));
            out.sources.push(vertex as u32);
            for (triangle, corner) in group {
                out.triangles[triangle][corner] = index;
            }
        }
    }
    out
}

/// The unit normal of a triangle; zero for one without area.
pub fn face_normal(mesh: &Mesh, triangle: usize) -> Vector3<f64> {
    let [a, b, c] = mesh.corners(triangle);
    (b - a).cross(&(c - a)).try_normalize(1e-12).unwrap_or_default()
}

/// Edges whose faces turn by more than `crease_angle_deg`, low vertex first, sorted.
pub fn crease_edges(mesh: &Mesh, crease_angle_deg: f64) -> Vec<[u32; 2]> {
    let edges = HalfEdges::new(mesh.positions.len(), &mesh.triangles);
    let faces: Vec<Vector3<f64>> =
        (0..mesh.triangles.len()).map(|triangle| face_normal(mesh, triangle)).collect();
    let min_cosine = crease_angle_deg.to_radians().cos();
    let turns = |first: &HalfEdge, second: &HalfEdge| {
        faces[first.triangle as usize].dot(&faces[second.triangle as usize]) < min_cosine
    };
    let mut creases = Vec::new();
    for from in 0..mesh.positions.len() as u32 {
        let upward = edges.from(from).iter().filter(|edge| from < edge.to);
        let is_crease =
            |edge: &&HalfEdge| edges.find(edge.to, from).is_some_and(|back| turns(edge, back));
        creases.extend(upward.filter(is_crease).map(|edge| [from, edge.to]));
    }
    creases.sort_unstable();
    creases
}

fn corner_angle(mesh: &Mesh, triangle: usize, corner: usize) -> f64 {
    let points = mesh.corners(triangle);
    let [here, next, last] = [0, 1, 2].map(|step| points[(corner + step) % 3]);
    (next - here).angle(&(last - here))
}

/// Splits the corners at a vertex where neighbouring triangles turn too much.
fn smooth_groups(
    mesh: &Mesh,
    faces: &[Vector3<f64>],
    corners: &[(usize, usize)],
    min_cosine: f64,
) -> Vec<Vec<(usize, usize)>> {
    let vertex = |(triangle, corner): (usize, usize), step: usize| {
        mesh.triangles[triangle][(corner + step) % 3]
    };
    let mut group: Vec<usize> = (0..corners.len()).collect();
    for a in 0..corners.len() {
        for b in 0..corners.len() {
            let adjacent = vertex(corners[a], 2) == vertex(corners[b], 1);
            let smooth = faces[corners[a].0].dot(&faces[corners[b].0]) >= min_cosine;
            if adjacent && smooth {
                let (keep, drop) = (group[a].min(group[b]), group[a].max(group[b]));
                group.iter_mut().filter(|id| **id == drop).for_each(|id| *id = keep);
            }
        }
    }
    let ids = (0..corners.len()).filter(|&id| group[id] == id);
    ids.map(|id| {
        let members = corners.iter().zip(&group).filter(|(_, own)| **own == id);
        members.map(|(corner, _)| *corner).collect()
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner_of_a_box() -> Mesh {
        // Three faces that meet at right angles in vertex 0.
        Mesh {
            positions: [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
                .map(|(x, y, z)| Point3::new(f64::from(x), f64::from(y), f64::from(z)))
                .to_vec(),
            triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        }
    }

    #[test]
    fn right_angles_break_and_gentle_ones_do_not() {
        let mesh = corner_of_a_box();
        let broken = shaded(&mesh, 40.0);
        assert_eq!(broken.positions.len(), 12);
        assert!((broken.normals[broken.triangles[0][0] as usize] + Vector3::z()).norm() < 1e-12);
        let smooth = shaded(&mesh, 179.0);
        assert_eq!(smooth.positions.len(), 4);
        let expected = -Vector3::new(1.0, 1.0, 1.0).normalize();
        assert!((smooth.normals[0] - expected).norm() < 1e-12);
    }
}
