//! From a format's raw triangles to a checked model in the model frame.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

use frames::UpAxis;

use super::{LinearRgb, Model, ModelError};

/// What a format's reader hands over: unchecked triangles in the file's frame.
#[derive(Debug, Default)]
pub(super) struct Soup {
    pub positions: Vec<Vector3<f64>>,
    /// The object that each vertex belongs to.
    pub parts: Vec<u32>,
    pub triangles: Vec<[u32; 3]>,
    /// One for each triangle.
    pub materials: Vec<u32>,
    /// One for each triangle, `None` where the file gives no normals.
    pub corner_normals: Vec<Option<[Vector3<f64>; 3]>>,
    /// One for each triangle, `None` where the file gives no colours.
    pub corner_colours: Vec<Option<[LinearRgb; 3]>>,
}

/// Checks the triangles, joins vertices that files split at seams of normals or texture, leaves out
/// triangles without area, and turns all into the model frame.
pub(super) fn finish(soup: Soup, up_axis: UpAxis) -> Result<Model, ModelError> {
    check_indices(&soup)?;
    check_finite(&soup)?;
    let joined = joined_vertices(&soup);
    let positions: Vec<_> =
        joined.positions.iter().map(|&p| Point3::from(up_axis.model_from_file(p))).collect();
    let has_normals = soup.corner_normals.iter().any(Option::is_some);
    let has_colours = soup.corner_colours.iter().any(Option::is_some);
    let mut model = Model {
        corner_normals: has_normals.then(Vec::new),
        corner_colours: has_colours.then(Vec::new),
        ..Model::default()
    };
    for (index, triangle) in soup.triangles.iter().enumerate() {
        let triangle = triangle.map(|vertex| joined.index_of[vertex as usize]);
        let corners = triangle.map(|vertex| positions[vertex as usize]);
        let Some(face_normal) = unit_normal(corners) else {
            continue;
        };
        model.mesh.triangles.push(triangle);
        model.materials.push(soup.materials[index]);
        if let Some(normals) = &mut model.corner_normals {
            normals.push(corner_normals(soup.corner_normals[index], up_axis, face_normal));
        }
        if let Some(colours) = &mut model.corner_colours {
            colours.push(corner_colours(soup.corner_colours[index]));
        }
    }
    model.mesh.positions = positions;
    if model.mesh.triangles.is_empty() {
        return Err(ModelError::NoTriangles { degenerate: soup.triangles.len() });
    }
    Ok(model)
}

fn check_indices(soup: &Soup) -> Result<(), ModelError> {
    let vertices = soup.positions.len();
    for (triangle, corners) in soup.triangles.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertices) {
            return Err(ModelError::IndexOutOfRange {
                triangle,
                vertex: i64::from(vertex),
                vertices,
            });
        }
    }
    Ok(())
}

/// Vertices that no triangle uses may be anything.
fn check_finite(soup: &Soup) -> Result<(), ModelError> {
    let bad = |&vertex: &u32| {
        let p = soup.positions[vertex as usize];
        !p.iter().all(|c| c.is_finite() && c.abs() < MAX_COORDINATE)
    };
    match soup.triangles.iter().flatten().find(|v| bad(v)) {
        Some(&vertex) => Err(ModelError::NonFiniteVertex { vertex: vertex as usize }),
        None => Ok(()),
    }
}

/// Beyond it products of three coordinates would leave the range of f64.
const MAX_COORDINATE: f64 = 1e60;

/// `None` for triangles without area, also those whose area underflows.
fn unit_normal([a, b, c]: [Point3<f64>; 3]) -> Option<Vector3<f64>> {
    let scale = (b - a).amax().max((c - a).amax());
    if scale <= 0.0 {
        return None;
    }
    ((b - a) / scale).cross(&((c - a) / scale)).try_normalize(1e-12)
}

/// The file's normals in the model frame; the face's own where they are missing or zero.
fn corner_normals(
    given: Option<[Vector3<f64>; 3]>,
    up_axis: UpAxis,
    face_normal: Vector3<f64>,
) -> [Vector3<f64>; 3] {
    let usable = |n: Vector3<f64>| {
        n.iter()
            .all(|c| c.is_finite())
            .then(|| up_axis.model_from_file(n).try_normalize(1e-12))
            .flatten()
            .unwrap_or(face_normal)
    };
    given.map_or([face_normal; 3], |normals| normals.map(usable))
}

/// The file's colours within [0, 1]; white where they are missing or no numbers.
fn corner_colours(given: Option<[LinearRgb; 3]>) -> [LinearRgb; 3] {
    let usable = |c: f32| if c.is_nan() { 1.0 } else { c.clamp(0.0, 1.0) };
    given.map_or([[1.0; 3]; 3], |colours| colours.map(|colour| colour.map(usable)))
}

struct Joined {
    positions: Vec<Vector3<f64>>,
    /// New index of each old vertex.
    index_of: Vec<u32>,
}

/// Vertices of one part at the very same place become one; parts that touch stay apart.
fn joined_vertices(soup: &Soup) -> Joined {
    let mut index_at: HashMap<(u32, [u64; 3]), u32> = HashMap::new();
    let mut positions: Vec<Vector3<f64>> = Vec::new();
    let vertices = soup.positions.iter().zip(&soup.parts);
    let index_of = vertices.map(|(p, part)| {
        // Adding 0 makes -0 and 0 the same bits.
        let key = (*part, [p.x, p.y, p.z].map(|c| (c + 0.0).to_bits()));
        *index_at.entry(key).or_insert_with(|| {
            positions.push(*p);
            positions.len() as u32 - 1
        })
    });
    let index_of = index_of.collect();
    Joined { positions, index_of }
}
