//! Which lines a view has: contours, borders, creases, material boundaries.

use nalgebra::{Point2, Point3, Vector2, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::camera::Camera;
use super::prepared::{Edge, PreparedModel};
use super::rules::LineRules;

/// Why a line is drawn.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum LineKind {
    /// Between the model and the background.
    Silhouette,
    /// Where the surface turns away in front of another part of it.
    Contour,
    /// The rim of an open surface.
    Border,
    /// An edge sharper than the crease angle.
    Crease,
    /// Between two materials.
    Material,
}

/// A point where line segments of the mesh may meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Node {
    Vertex(u32),
    /// Where the smooth contour crosses the edge between two vertices.
    OnEdge(u32, u32),
    /// Where a line comes out from behind something: nothing else meets there.
    Emergence(u32),
}

/// What a segment lies on, and so cannot be hidden by.
#[derive(Clone, Copy, Debug)]
pub(super) enum Host {
    Edge(u32),
    Face(u32),
}

/// A straight piece of a line in the view frame, hidden parts included.
#[derive(Clone, Debug)]
pub(super) struct Segment {
    pub ends: [(Node, Point3<f64>); 2],
    pub kind: LineKind,
    pub host: Host,
    /// In the picture, away from the surface; zero for lines with surface on both sides.
    pub outward: Vector2<f64>,
}

/// The model as one view sees it.
pub(super) struct ViewedModel<'a> {
    pub model: &'a PreparedModel,
    /// The vertices in the view frame.
    pub points: Vec<Point3<f64>>,
    faces_viewer: Vec<bool>,
}

impl<'a> ViewedModel<'a> {
    pub(crate) fn new(model: &'a PreparedModel, camera: &Camera) -> Self {
        let positions = &model.mesh.positions;
        let points: Vec<_> = positions.iter().map(|&p| camera.view_from_model(p)).collect();
        let mut viewed = Self { model, points, faces_viewer: Vec::new() };
        viewed.faces_viewer = (0..model.mesh.triangles.len())
            .map(|face| doubled_area(viewed.corners(face)) < 0.0)
            .collect();
        viewed
    }

    pub(crate) fn corners(&self, face: usize) -> [Point3<f64>; 3] {
        self.model.mesh.triangles[face].map(|v| self.points[v as usize])
    }

    /// The lines of this view before hidden ones are removed.
    pub(crate) fn segments(&self, camera: &Camera, rules: &LineRules) -> Vec<Segment> {
        let smooth = rules.smooth_normals.as_deref();
        let mut segments: Vec<_> = (0..self.model.edges.len())
            .filter_map(|index| self.edge_segment(index, rules))
            .collect();
        if let Some(normals) = smooth {
            let faces = 0..self.model.mesh.triangles.len();
            segments.extend(faces.filter_map(|face| self.smooth_segment(face, camera, normals)));
        }
        segments
    }

    fn edge_segment(&self, index: usize, rules: &LineRules) -> Option<Segment> {
        let edge = &self.model.edges[index];
        let kind = self.edge_kind(index, rules)?;
        let ends = edge.vertices.map(|v| (Node::Vertex(v), self.points[v as usize]));
        let outward = match kind {
            LineKind::Contour | LineKind::Border => self.outward(edge),
            _ => Vector2::zeros(),
        };
        Some(Segment { ends, kind, host: Host::Edge(index as u32), outward })
    }

    fn edge_kind(&self, index: usize, rules: &LineRules) -> Option<LineKind> {
        let edge = &self.model.edges[index];
        let faces = self.model.faces_of(edge);
        match faces {
            [_] => Some(LineKind::Border),
            [a, b] => {
                let turned = a.forward == b.forward;
                let opposed = self.faces_viewer[a.face as usize]
                    != (self.faces_viewer[b.face as usize] != turned);
                if opposed && !rules.is_smooth[index] {
                    return Some(LineKind::Contour);
                }
                rules.static_kinds[index]
            }
            _ if self.all_on_one_side(edge) => Some(LineKind::Contour),
            _ => rules.static_kinds[index],
        }
    }

    /// Whether the triangles at an edge all project to the same side of it.
    fn all_on_one_side(&self, edge: &Edge) -> bool {
        let mut sides = self.sides(edge);
        let first = sides.next();
        first.is_some_and(|first| sides.all(|side| side * first > 0.0))
    }

    /// On which side of the edge, and how far, its triangles project.
    fn sides(&self, edge: &Edge) -> impl Iterator<Item = f64> {
        let [a, b] = edge.vertices;
        let normal = perpendicular(self.points[a as usize], self.points[b as usize]);
        self.model.faces_of(edge).iter().map(move |side| {
            let triangle = self.model.mesh.triangles[side.face as usize];
            let opposite = triangle.into_iter().find(|v| !edge.vertices.contains(v));
            opposite.map_or(0.0, |v| {
                normal.dot(&(self.points[v as usize] - self.points[a as usize]).xy())
            })
        })
    }

    fn outward(&self, edge: &Edge) -> Vector2<f64> {
        let farthest = self
            .sides(edge)
            .fold(0.0_f64, |far, side| if side.abs() > far.abs() { side } else { far });
        let [a, b] = edge.vertices;
        perpendicular(self.points[a as usize], self.points[b as usize]) * -farthest.signum()
    }

    /// The zero set of n·v in a triangle, n interpolated between the corners' normals.
    fn smooth_segment(
        &self,
        face: usize,
        camera: &Camera,
        normals: &[[Vector3<f64>; 3]],
    ) -> Option<Segment> {
        let towards_viewer = normals[face].map(|n| -camera.rotate(n).z);
        let triangle = self.model.mesh.triangles[face];
        let mut ends = [0, 1, 2].into_iter().filter_map(|from| {
            let to = (from + 1) % 3;
            let (g, h) = (towards_viewer[from], towards_viewer[to]);
            if (g >= 0.0) == (h >= 0.0) {
                return None;
            }
            let [a, b] = [triangle[from], triangle[to]];
            let [p, q] = [a, b].map(|v| self.points[v as usize]);
            let point = p + (q - p) * (g / (g - h));
            Some((Node::OnEdge(a.min(b), a.max(b)), point))
        });
        let ends = [ends.next()?, ends.next()?];
        let outward = camera.rotate(normals[face].iter().sum()).xy();
        Some(Segment {
            ends,
            kind: LineKind::Contour,
            host: Host::Face(face as u32),
            outward: outward.try_normalize(1e-12).unwrap_or_default(),
        })
    }
}

/// Twice the signed area in the picture; negative if the triangle's front is seen (y is down).
fn doubled_area([a, b, c]: [Point3<f64>; 3]) -> f64 {
    (b - a).xy().perp(&(c - a).xy())
}

/// The unit vector at right angles to a projected segment; zero if it is a point.
fn perpendicular(a: Point3<f64>, b: Point3<f64>) -> Vector2<f64> {
    let along = Point2::new(b.x, b.y) - Point2::new(a.x, a.y);
    Vector2::new(-along.y, along.x).try_normalize(1e-12).unwrap_or_default()
}
