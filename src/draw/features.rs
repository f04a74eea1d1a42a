use nalgebra::{Point2, Point3, Vector2, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::camera::Camera;
use super::options::ContourStyle;
use super::prepared::{Edge, PreparedModel};

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
    pub fn new(model: &'a PreparedModel, camera: &Camera) -> Self {
        let positions = &model.mesh.positions;
        let points: Vec<_> = positions.iter().map(|&p| camera.view_from_model(p)).collect();
        let mut viewed = Self { model, points, faces_viewer: Vec::new() };
        viewed.faces_viewer = (0..model.mesh.triangles.len())
            .map(|face| doubled_area(viewed.corners(face)) < 0.0)
            .collect();
        viewed
    }

    pub fn corners(&self, face: usize) -> [Point3<f64>; 3] {
        self.model.mesh.triangles[face].map(|v| self.points[v as usize])
    }

    /// The lines of this view before hidden ones are removed.
    pub fn segments(&self, camera: &Camera, rules: &LineRules) -> Vec<Segment> {
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

/// What decides about lines and is the same for all views.
pub(super) struct LineRules {
    /// Creases and material boundaries, one for each edge.
    static_kinds: Vec<Option<LineKind>>,
    /// Edges across which the normals are continuous, where the contour is not the edge's.
    is_smooth: Vec<bool>,
    smooth_normals: Option<Vec<[Vector3<f64>; 3]>>,
}

impl LineRules {
    /// * `crease_angle_deg`: the largest angle between two faces, through the solid's inside, that
    ///   still makes a crease; 180 is flat.
    pub fn new(model: &PreparedModel, crease_angle_deg: f64, style: ContourStyle) -> Self {
        // Two faces at interior angle t have normals at 180 - t.
        let cos_crease = -crease_angle_deg.to_radians().cos();
        let static_kinds = model.edges.iter().map(|e| static_kind(model, e, cos_crease));
        let smooth_normals = match style {
            ContourStyle::Polygonal => None,
            ContourStyle::Auto => model.corner_normals.clone(),
            ContourStyle::Smooth => Some(
                model.corner_normals.clone().unwrap_or_else(|| averaged_normals(model, cos_crease)),
            ),
        };
        let is_smooth = match &smooth_normals {
            None => vec![false; model.edges.len()],
            Some(normals) => {
                let edges = model.edges.iter();
                edges.map(|e| is_smooth(model, e, normals)).collect()
            }
        };
        Self { static_kinds: static_kinds.collect(), is_smooth, smooth_normals }
    }
}

fn static_kind(model: &PreparedModel, edge: &Edge, cos_crease: f64) -> Option<LineKind> {
    let faces = model.faces_of(edge);
    let cosine = |a: usize, b: usize| {
        let dot = model.face_normals[faces[a].face as usize]
            .dot(&model.face_normals[faces[b].face as usize]);
        if faces[a].forward == faces[b].forward { -dot } else { dot }
    };
    let pairs = || (0..faces.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
    // Where more than two faces meet, a pair that goes on smoothly is no crease.
    if pairs().next().is_some() && pairs().all(|(a, b)| cosine(a, b) <= cos_crease) {
        return Some(LineKind::Crease);
    }
    let material = |index: usize| model.materials[faces[index].face as usize];
    (1..faces.len()).any(|index| material(index) != material(0)).then_some(LineKind::Material)
}

/// Whether both triangles of an edge have the same normals at its ends.
fn is_smooth(model: &PreparedModel, edge: &Edge, normals: &[[Vector3<f64>; 3]]) -> bool {
    const SAME: f64 = 1e-4;
    let [a, b] = model.faces_of(edge) else {
        return false;
    };
    let normal_at = |face: u32, vertex: u32| {
        let triangle = model.mesh.triangles[face as usize];
        let corner = triangle.into_iter().position(|v| v == vertex).unwrap_or(0);
        normals[face as usize][corner]
    };
    edge.vertices.into_iter().all(|v| (normal_at(a.face, v) - normal_at(b.face, v)).norm() < SAME)
}

/// Normals for models that give none: at each corner the mean over the triangles at the vertex
/// that make no crease with this one, weighted by their angle there.
fn averaged_normals(model: &PreparedModel, cos_crease: f64) -> Vec<[Vector3<f64>; 3]> {
    let triangles = &model.mesh.triangles;
    let mut around: Vec<Vec<(u32, f64)>> = vec![Vec::new(); model.mesh.positions.len()];
    for (face, triangle) in triangles.iter().enumerate() {
        let corners = model.mesh.corners(face);
        for corner in 0..3 {
            let [p, q, r] = [0, 1, 2].map(|step| corners[(corner + step) % 3]);
            let angle = (q - p).angle(&(r - p));
            around[triangle[corner] as usize].push((face as u32, angle));
        }
    }
    let averaged = |face: usize, vertex: u32| {
        let own = model.face_normals[face];
        let near = around[vertex as usize].iter().filter_map(|&(other, angle)| {
            let normal = model.face_normals[other as usize];
            (normal.dot(&own) > cos_crease).then_some(normal * angle)
        });
        near.sum::<Vector3<f64>>().try_normalize(1e-12).unwrap_or(own)
    };
    let faces = triangles.iter().enumerate();
    faces.map(|(face, triangle)| triangle.map(|v| averaged(face, v))).collect()
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
