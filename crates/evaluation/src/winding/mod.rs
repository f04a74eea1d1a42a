//! The generalised winding number of a triangle mesh, open or self-crossing.
//!
//! `w(p)` is the solid angle the mesh subtends at `p` over 4π: 1 inside a
//! closed mesh, 0 outside, in between near the holes of an open one (Jacobson
//! et al. 2013). Summing it over all triangles is slow, so the mesh is closed
//! by fans over its open edges: of the closed mesh the winding number is a
//! signed count of crossings along a ray, of the few fan triangles the solid
//! angles are summed, and `w` is the difference.

mod caps;
mod columns;
mod frame;
mod solid_angle;

use nalgebra::Point3;

use columns::Columns;
use frame::Frame;
use mesh::Mesh;
use solid_angle::SolidAngleTree;

/// Answers for the winding number at any point.
#[derive(Debug)]
pub struct WindingField {
    frame: Frame,
    /// The mesh and its caps, closed.
    closed: Columns,
    /// The caps alone; `None` if the mesh was closed.
    caps: Option<SolidAngleTree>,
}

impl WindingField {
    /// Prepares `mesh`; triangles that use one vertex twice are ignored.
    ///
    /// `None` without vertices, with coordinates that are not finite, with all
    /// vertices in one place, or with an index out of range.
    ///
    /// Vertices are rounded to 2⁻²⁹ of the longest side and joined where that
    /// makes them equal.
    pub fn new(mesh: &Mesh) -> Option<Self> {
        let count = mesh.positions.len();
        if mesh.triangles.iter().flatten().any(|&vertex| vertex as usize >= count) {
            return None;
        }
        let frame = Frame::around(mesh)?;
        let mut triangles: Vec<[frame::Vertex; 3]> = mesh
            .triangles
            .iter()
            .map(|triangle| triangle.map(|v| frame.vertex(&mesh.positions[v as usize])))
            .filter(|[a, b, c]| a != b && b != c && c != a)
            .collect();
        let caps = caps::caps(&triangles);
        triangles.extend(&caps);
        Some(Self {
            frame,
            closed: Columns::new(&triangles),
            caps: (!caps.is_empty()).then(|| SolidAngleTree::new(&caps)),
        })
    }

    /// Whether the mesh has no open edge, so that winding numbers are integers.
    pub fn is_closed(&self) -> bool {
        self.caps.is_none()
    }

    /// The winding number at `point`, in the mesh's frame.
    pub fn at(&self, point: &Point3<f64>) -> f64 {
        let local = self.frame.local(point);
        let crossings = self.closed.crossings(local.x, local.y);
        count_above(&crossings, &local) as f64 - self.of_caps(point)
    }

    /// Whether `point` is inside the solid, `|w| > ½`.
    pub fn is_inside(&self, point: &Point3<f64>) -> bool {
        self.at(point).abs() > 0.5
    }

    /// Winding numbers of the closed mesh, mesh and caps, at `(x, y, z)` for
    /// each of `zs`: one ray for all. Less [`Self::of_caps`] they are the mesh's.
    pub(super) fn closed_column(&self, x: f64, y: f64, zs: &[f64]) -> Vec<i64> {
        let local = |z: f64| self.frame.local(&Point3::new(x, y, z));
        let foot = local(0.0);
        let crossings = self.closed.crossings(foot.x, foot.y);
        zs.iter().map(|&z| count_above(&crossings, &local(z))).collect()
    }

    /// The winding number of the caps at `point`; 0 if the mesh was closed.
    pub(super) fn of_caps(&self, point: &Point3<f64>) -> f64 {
        self.caps.as_ref().map_or(0.0, |caps| caps.at(&self.frame.local(point)))
    }

    /// Whether a cap may be within `radius` of `point`.
    pub(super) fn has_caps_within(&self, point: &Point3<f64>, radius: f64) -> bool {
        let (point, radius) = (self.frame.local(point), self.frame.local_length(radius));
        self.caps.as_ref().is_some_and(|caps| caps.comes_within(&point, radius))
    }
}

fn count_above(crossings: &[columns::Crossing], point: &Point3<f64>) -> i64 {
    crossings.iter().filter(|crossing| crossing.z > point.z).map(|crossing| crossing.sign).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solid::shapes::{cuboid, merged, sphere};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// The definition: every triangle's solid angle, summed.
    fn by_definition(mesh: &Mesh, point: &Point3<f64>) -> f64 {
        (0..mesh.triangles.len())
            .map(|index| solid_angle::winding_of_triangle(&mesh.corners(index), point))
            .sum()
    }

    fn assert_agrees(mesh: &Mesh, tolerance: f64) {
        let field = WindingField::new(mesh).unwrap();
        let mut random = ChaCha8Rng::seed_from_u64(5);
        for _ in 0..500 {
            let point = Point3::from(std::array::from_fn(|_| random.random_range(-1.6..1.6)));
            let expected = by_definition(mesh, &point);
            assert!((field.at(&point) - expected).abs() < tolerance, "{point}: {expected}");
        }
    }

    #[test]
    fn inside_is_one_and_outside_zero() {
        let field = WindingField::new(&cuboid([-1.0; 3], [1.0; 3])).unwrap();
        assert!(field.is_closed());
        for point in [[0.0; 3], [0.99, -0.99, 0.5], [0.0, 0.0, -0.999]] {
            assert_eq!(field.at(&Point3::from(point)), 1.0);
        }
        for point in [[1.01, 0.0, 0.0], [0.0, 0.0, -1.01], [0.0, 0.0, 50.0], [1e9, 0.0, 0.0]] {
            assert_eq!(field.at(&Point3::from(point)), 0.0);
        }
    }

    #[test]
    fn rays_through_edges_and_vertices_cross_once() {
        // The axis of the sphere goes through both poles, x = 0 through edges.
        let field = WindingField::new(&sphere(1.0, 12)).unwrap();
        for z in [-0.9, -0.3, 0.0, 0.4, 0.9] {
            assert_eq!(field.at(&Point3::new(0.0, 0.0, z)), 1.0);
        }
        for y in [-0.5, -0.25, 0.0, 0.25, 0.5] {
            assert_eq!(field.at(&Point3::new(0.0, y, 0.1)), 1.0);
            assert_eq!(field.at(&Point3::new(0.0, y, 1.1)), 0.0);
            assert_eq!(field.at(&Point3::new(0.0, y, -1.1)), 0.0);
        }
    }

    #[test]
    fn an_inverted_mesh_counts_backwards_but_is_solid() {
        let mut mesh = cuboid([-1.0; 3], [1.0; 3]);
        mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        let field = WindingField::new(&mesh).unwrap();
        assert_eq!(field.at(&Point3::origin()), -1.0);
        assert!(field.is_inside(&Point3::origin()));
    }

    #[test]
    fn overlapping_parts_add_up() {
        let parts = [cuboid([-1.0; 3], [0.5; 3]), cuboid([-0.5; 3], [1.0; 3])];
        let field = WindingField::new(&merged(&parts)).unwrap();
        assert_eq!(field.at(&Point3::origin()), 2.0);
        assert_eq!(field.at(&Point3::new(0.9, 0.9, 0.9)), 1.0);
        assert_eq!(field.at(&Point3::new(0.9, -0.9, 0.9)), 0.0);
    }

    #[test]
    fn open_meshes_agree_with_the_sum_of_solid_angles() {
        let mut open_box = cuboid([-1.0; 3], [1.0; 3]);
        open_box.triangles.truncate(9);
        assert!(!WindingField::new(&open_box).unwrap().is_closed());
        assert_agrees(&open_box, 1e-6);
        let mut bowl = sphere(1.0, 24);
        let half = bowl.triangles.len() / 2;
        bowl.triangles.truncate(half);
        assert_agrees(&bowl, 5e-3);
        // Holes apart, overlapping another open part.
        let mut holey = merged(&[sphere(1.0, 24), open_box]);
        holey.triangles.drain(300..310);
        holey.triangles.drain(40..45);
        assert_agrees(&holey, 5e-3);
    }

    /// Every triangle is on its own, so every edge is open.
    #[test]
    fn a_soup_agrees_with_the_sum_of_solid_angles() {
        let whole = sphere(1.0, 16);
        let mut soup = Mesh::default();
        for (index, triangle) in whole.triangles.iter().enumerate() {
            let first = soup.positions.len() as u32;
            let nudge = nalgebra::Vector3::repeat(1e-3 * (index % 7) as f64);
            soup.positions.extend(triangle.map(|v| whole.positions[v as usize] + nudge));
            soup.triangles.push([first, first + 1, first + 2]);
        }
        assert_agrees(&soup, 5e-3);
    }

    #[test]
    fn equal_vertices_need_not_be_shared() {
        let whole = sphere(1.0, 16);
        let soup = Mesh {
            positions: whole
                .triangles
                .iter()
                .flatten()
                .map(|&v| whole.positions[v as usize])
                .collect(),
            triangles: (0..whole.triangles.len() as u32)
                .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
                .collect(),
        };
        assert!(WindingField::new(&soup).unwrap().is_closed());
    }

    #[test]
    fn a_column_is_its_points() {
        let mut mesh = sphere(1.0, 24);
        mesh.triangles.truncate(900);
        let field = WindingField::new(&mesh).unwrap();
        let zs = [-1.2, -0.5, 0.0, 0.7, 1.3];
        let column = field.closed_column(0.3, -0.2, &zs);
        for (z, closed) in zs.into_iter().zip(column) {
            let point = Point3::new(0.3, -0.2, z);
            assert_eq!(closed as f64 - field.of_caps(&point), field.at(&point));
        }
    }

    #[test]
    fn unusable_meshes_are_refused() {
        assert!(WindingField::new(&Mesh::default()).is_none());
        let at = |positions: Vec<Point3<f64>>| Mesh { positions, triangles: vec![[0, 1, 2]] };
        assert!(WindingField::new(&at(vec![Point3::origin(); 3])).is_none());
        assert!(
            WindingField::new(&at(vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0)])).is_none()
        );
        let infinite = Point3::new(f64::INFINITY, 0.0, 0.0);
        assert!(WindingField::new(&at(vec![Point3::origin(), infinite, infinite])).is_none());
        let huge = Point3::new(f64::MAX, 0.0, 0.0);
        assert!(WindingField::new(&at(vec![-huge, huge, Point3::origin()])).is_none());
    }
}
