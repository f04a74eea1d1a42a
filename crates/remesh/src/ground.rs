//! The surface that vertices stay on.

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use mesh::Mesh;
use nalgebra::{Point3, Vector3};

use super::vertices::Level;

/// The surface to stay on.
pub(crate) struct Ground<'a> {
    mesh: &'a Mesh,
    triangles: Vec<Vec<u32>>,
    vertices: Option<ImmutableKdTree<f64, 3>>,
    /// Points of creases, and their tree.
    creases: Vec<(Point3<f64>, Vector3<f64>)>,
    crease_tree: Option<ImmutableKdTree<f64, 3>>,
}

impl<'a> Ground<'a> {
    pub(crate) fn new(mesh: &'a Mesh, level: &Level) -> Self {
        let mut triangles = vec![Vec::new(); mesh.positions.len()];
        for (index, triangle) in mesh.triangles.iter().enumerate() {
            triangle.iter().for_each(|&v| triangles[v as usize].push(index as u32));
        }
        let tree = |points: &[[f64; 3]]| {
            let any = !points.is_empty();
            any.then(|| ImmutableKdTree::new_from_slice(points).ok()).flatten()
        };
        let points: Vec<[f64; 3]> = mesh.positions.iter().map(|&p| p.into()).collect();
        let creases: Vec<(Point3<f64>, Vector3<f64>)> = mesh
            .positions
            .iter()
            .zip(&level.creases)
            .filter_map(|(&point, crease)| Some((point, (*crease)?)))
            .collect();
        let crease_points: Vec<[f64; 3]> = creases.iter().map(|&(p, _)| p.into()).collect();
        Self {
            mesh,
            triangles,
            vertices: tree(&points),
            crease_tree: tree(&crease_points),
            creases,
        }
    }

    /// The point of the faces about the vertex nearest to `point` that is nearest to it.
    pub(crate) fn nearest(&self, point: &Point3<f64>) -> Point3<f64> {
        let Some(vertex) = self.vertices.as_ref().map(|tree| index_nearest(tree, point)) else {
            return *point;
        };
        let mut best = (f64::INFINITY, self.mesh.positions[vertex]);
        for &triangle in &self.triangles[vertex] {
            let near = nearest_of_triangle(&self.mesh.corners(triangle as usize), point);
            let distance = (near - point).norm_squared();
            if distance < best.0 {
                best = (distance, near);
            }
        }
        best.1
    }

    pub(crate) fn nearest_crease(&self, point: &Point3<f64>) -> Option<Point3<f64>> {
        let tree = self.crease_tree.as_ref()?;
        let (on, direction) = self.creases[index_nearest(tree, point)];
        Some(on + direction * direction.dot(&(point - on)))
    }
}

fn index_nearest(tree: &ImmutableKdTree<f64, 3>, point: &Point3<f64>) -> usize {
    let query: [f64; 3] = (*point).into();
    tree.query(&query).nearest_one::<SquaredEuclidean<f64>>().execute().item as usize
}

/// The point of a triangle that is nearest to `point`.
fn nearest_of_triangle(corners: &[Point3<f64>; 3], point: &Point3<f64>) -> Point3<f64> {
    let [a, b, c] = corners;
    let normal = (b - a).cross(&(c - a));
    let area = normal.norm_squared();
    let inside = |p: &Point3<f64>, q: &Point3<f64>| (q - p).cross(&(point - p)).dot(&normal) >= 0.0;
    if area > 0.0 && inside(a, b) && inside(b, c) && inside(c, a) {
        return point - normal * (normal.dot(&(point - a)) / area);
    }
    let mut best = (f64::INFINITY, *a);
    for (p, q) in [(a, b), (b, c), (c, a)] {
        let side = q - p;
        let share =
            (side.dot(&(point - p)) / side.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        let near = p + side * share;
        let distance = (near - point).norm_squared();
        if distance < best.0 {
            best = (distance, near);
        }
    }
    best.1
}
