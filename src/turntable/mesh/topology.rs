//! Whether a mesh bounds a solid.

use std::collections::HashMap;

use crate::geometry::Mesh;

/// Why a mesh does not bound a solid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TopologyError {
    #[error("triangle {triangle} names vertex {vertex}, there are {count}")]
    IndexOutOfRange { triangle: usize, vertex: u32, count: usize },
    #[error("triangle {triangle} uses a vertex twice")]
    Degenerate { triangle: usize },
    #[error("{open} edges do not belong to exactly two triangles of opposite direction")]
    OpenEdges { open: usize },
    #[error("the triangles around vertex {vertex} form more than one fan")]
    SplitFan { vertex: u32 },
}

/// Checks that `mesh` is watertight and a 2-manifold: every edge has two
/// triangles that run it in opposite directions, every vertex one fan.
///
/// # Errors
/// [`TopologyError`], the first kind found in its order.
pub fn check_manifold(mesh: &Mesh) -> Result<(), TopologyError> {
    let count = mesh.positions.len();
    // Directed edge (from, to) -> the triangle's third vertex.
    let mut third: HashMap<(u32, u32), u32> = HashMap::with_capacity(mesh.triangles.len() * 3);
    let mut open = 0;
    for (triangle, corners) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = *corners;
        if let Some(&vertex) = corners.iter().find(|&&vertex| vertex as usize >= count) {
            return Err(TopologyError::IndexOutOfRange { triangle, vertex, count });
        }
        if a == b || b == c || c == a {
            return Err(TopologyError::Degenerate { triangle });
        }
        for (edge, opposite) in [((a, b), c), ((b, c), a), ((c, a), b)] {
            open += usize::from(third.insert(edge, opposite).is_some());
        }
    }
    open += third.keys().filter(|(from, to)| !third.contains_key(&(*to, *from))).count();
    if open > 0 {
        return Err(TopologyError::OpenEdges { open });
    }
    check_fans(mesh, &third)
}

fn check_fans(mesh: &Mesh, third: &HashMap<(u32, u32), u32>) -> Result<(), TopologyError> {
    let mut degree = vec![0_u32; mesh.positions.len()];
    let mut start = vec![u32::MAX; mesh.positions.len()];
    for [a, b, c] in &mesh.triangles {
        for (vertex, next) in [(*a, *b), (*b, *c), (*c, *a)] {
            degree[vertex as usize] += 1;
            start[vertex as usize] = next;
        }
    }
    for (vertex, (&degree, &first)) in degree.iter().zip(&start).enumerate() {
        let vertex = vertex as u32;
        let (mut around, mut at) = (0, first);
        while around < degree {
            around += 1;
            at = third[&(vertex, at)];
            if at == first {
                break;
            }
        }
        if around < degree {
            return Err(TopologyError::SplitFan { vertex });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    fn tetrahedron(offset: u32) -> Vec<[u32; 3]> {
        [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]].map(|t| t.map(|v| v + offset)).to_vec()
    }

    fn mesh(vertices: usize, triangles: Vec<[u32; 3]>) -> Mesh {
        Mesh {
            positions: (0..vertices).map(|i| Point3::new(i as f64, 0.0, 0.0)).collect(),
            triangles,
        }
    }

    #[test]
    fn a_tetrahedron_is_closed() {
        assert_eq!(check_manifold(&mesh(4, tetrahedron(0))), Ok(()));
    }

    #[test]
    fn finds_holes_and_flips() {
        let mut open = tetrahedron(0);
        open.pop();
        assert_eq!(check_manifold(&mesh(4, open)), Err(TopologyError::OpenEdges { open: 3 }));
        let mut flipped = tetrahedron(0);
        flipped[0].reverse();
        assert!(matches!(check_manifold(&mesh(4, flipped)), Err(TopologyError::OpenEdges { .. })));
    }

    #[test]
    fn finds_solids_that_touch_in_a_vertex() {
        let mut both = tetrahedron(0);
        both.extend(tetrahedron(3));
        assert_eq!(check_manifold(&mesh(7, both)), Err(TopologyError::SplitFan { vertex: 3 }));
    }
}
