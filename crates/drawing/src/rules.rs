//! Which edges are creases or boundaries, whatever the view.

use nalgebra::Vector3;

use super::features::LineKind;
use super::options::ContourStyle;
use super::prepared::{Edge, PreparedModel};

/// What decides about lines and is the same for all views.
pub(super) struct LineRules {
    /// Creases and material boundaries, one for each edge.
    pub static_kinds: Vec<Option<LineKind>>,
    /// Edges across which the normals are continuous, where the contour is not the edge's.
    pub is_smooth: Vec<bool>,
    pub smooth_normals: Option<Vec<[Vector3<f64>; 3]>>,
}

impl LineRules {
    /// * `crease_angle_deg`: the largest angle between two faces, through the solid's inside, that
    ///   still makes a crease; 180 is flat.
    pub(crate) fn new(model: &PreparedModel, crease_angle_deg: f64, style: ContourStyle) -> Self {
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
