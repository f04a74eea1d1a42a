//! Whether a mesh bounds a solid.

use crate::{Mesh, connected};

/// Why a mesh does not bound a solid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TopologyError {
    /// A triangle names a vertex that there is not.
    #[error("triangle {triangle} names vertex {vertex}, there are {count}")]
    IndexOutOfRange {
        /// Index of the triangle.
        triangle: usize,
        /// The vertex it names.
        vertex: u32,
        /// How many vertices there are.
        count: usize,
    },
    /// A triangle has two corners at one vertex.
    #[error("triangle {triangle} uses a vertex twice")]
    Degenerate {
        /// Index of the triangle.
        triangle: usize,
    },
    /// The surface has a border, or edges of more than two triangles.
    #[error("{open} edges do not belong to exactly two triangles of opposite direction")]
    OpenEdges {
        /// How many directed edges are doubled or lack their opposite.
        open: usize,
    },
    /// Surfaces touch in one vertex.
    #[error("the triangles around vertex {vertex} form more than one fan")]
    SplitFan {
        /// Index of the vertex.
        vertex: u32,
    },
}

/// The directed edges of a mesh by the vertex that they leave.
pub struct HalfEdges {
    /// Per vertex the first of its edges; last, the number of edges.
    starts: Vec<u32>,
    edges: Vec<HalfEdge>,
}

/// One side of a triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HalfEdge {
    /// The vertex that the edge leads to.
    pub to: u32,
    /// The triangle's third vertex.
    pub third: u32,
    /// Index of the triangle that it belongs to.
    pub triangle: u32,
}

impl HalfEdges {
    /// Of `triangles` of vertices below `vertices`.
    ///
    /// # Panics
    /// If a triangle names another vertex.
    pub fn new(vertices: usize, triangles: &[[u32; 3]]) -> Self {
        let mut starts = vec![0_u32; vertices + 1];
        triangles.as_flattened().iter().for_each(|&from| starts[from as usize] += 1);
        let mut sum = 0;
        for start in &mut starts {
            sum += *start;
            *start = sum;
        }
        let mut edges = vec![HalfEdge::default(); triangles.len() * 3];
        // From the back, so that each vertex' edges are in the triangles' order.
        for (triangle, &[a, b, c]) in triangles.iter().enumerate().rev() {
            for (from, to, third) in [(c, a, b), (b, c, a), (a, b, c)] {
                starts[from as usize] -= 1;
                let triangle = triangle as u32;
                edges[starts[from as usize] as usize] = HalfEdge { to, third, triangle };
            }
        }
        Self { starts, edges }
    }

    /// The edges that leave `vertex`, in the triangles' order.
    pub fn from(&self, vertex: u32) -> &[HalfEdge] {
        let [start, end] = [0, 1].map(|next| self.starts[vertex as usize + next] as usize);
        &self.edges[start..end]
    }

    /// The edge from one vertex to another; `None` if no triangle has it.
    pub fn find(&self, from: u32, to: u32) -> Option<&HalfEdge> {
        self.from(from).iter().find(|edge| edge.to == to)
    }
}

/// Handles of a closed surface, summed over its pieces: 0 for spheres, 1 for a torus.
///
/// From Euler's characteristic, V - E + F = 2 pieces - 2 genus; tells nothing of a mesh that
/// [`check_manifold`] refuses.
pub fn genus(mesh: &Mesh) -> i64 {
    let links = mesh.triangles.iter().flat_map(|&[a, b, c]| [(a, b), (a, c)]);
    let (labels, count) = connected::components(mesh.positions.len(), links);
    let mut used = vec![false; mesh.positions.len()];
    mesh.triangles.iter().flatten().for_each(|&vertex| used[vertex as usize] = true);
    let mut is_piece = vec![false; count];
    let of_used = labels.iter().zip(&used).filter(|(_, used)| **used);
    of_used.for_each(|(&label, _)| is_piece[label as usize] = true);
    let vertices = used.iter().filter(|used| **used).count() as i64;
    let pieces = is_piece.iter().filter(|is_piece| **is_piece).count() as i64;
    // Three edges a triangle, each shared by two.
    let faces = mesh.triangles.len() as i64;
    pieces - (vertices - faces * 3 / 2 + faces) / 2
}

/// Checks that `mesh` is watertight and a 2-manifold: every edge has two
/// triangles that run it in opposite directions, every vertex one fan.
///
/// # Errors
/// [`TopologyError`], the first kind found in its order.
pub fn check_manifold(mesh: &Mesh) -> Result<(), TopologyError> {
    let count = mesh.positions.len();
    for (triangle, corners) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = *corners;
        if let Some(&vertex) = corners.iter().find(|&&vertex| vertex as usize >= count) {
            return Err(TopologyError::IndexOutOfRange { triangle, vertex, count });
        }
        if a == b || b == c || c == a {
            return Err(TopologyError::Degenerate { triangle });
        }
    }
    let edges = HalfEdges::new(count, &mesh.triangles);
    let vertices = 0..count as u32;
    let open = vertices.clone().map(|vertex| open_edges(&edges, vertex)).sum();
    if open > 0 {
        return Err(TopologyError::OpenEdges { open });
    }
    match vertices.into_iter().find(|&vertex| !is_one_fan(&edges, vertex)) {
        Some(vertex) => Err(TopologyError::SplitFan { vertex }),
        None => Ok(()),
    }
}

/// How many edges leave `vertex` that another runs too, or that none comes back.
fn open_edges(edges: &HalfEdges, vertex: u32) -> usize {
    let own = edges.from(vertex);
    let is_open = |(index, edge): (usize, &HalfEdge)| {
        own[..index].iter().any(|other| other.to == edge.to)
            || edges.find(edge.to, vertex).is_none()
    };
    own.iter().enumerate().filter(|edge| is_open(*edge)).count()
}

/// Whether the triangles around `vertex` follow each other in one round.
fn is_one_fan(edges: &HalfEdges, vertex: u32) -> bool {
    let own = edges.from(vertex);
    let Some(first) = own.first() else {
        return true;
    };
    let (mut around, mut at) = (1, first.third);
    while at != first.to && around < own.len() {
        let Some(next) = edges.find(vertex, at) else {
            return false;
        };
        around += 1;
        at = next.third;
    }
    around == own.len()
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

    #[test]
    fn handles_are_counted_over_all_pieces() {
        use crate::builtin::{cuboid, torus};
        assert_eq!(genus(&cuboid([1.0; 3]).mesh), 0);
        let ring = torus(2.0, 0.5, 12, 8);
        assert_eq!(genus(&ring.mesh), 1);
        let mut both = ring.clone().mesh;
        // A vertex that nothing uses is no piece.
        both.positions.push(Point3::origin());
        let first = both.positions.len() as u32;
        both.positions.extend(&ring.mesh.positions);
        both.triangles.extend(ring.mesh.triangles.iter().map(|t| t.map(|v| v + first)));
        assert_eq!(genus(&both), 2);
    }
}
