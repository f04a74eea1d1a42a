//! Wavefront OBJ.

use std::collections::HashMap;
use std::io::{BufRead, Cursor, Read as _};

use nalgebra::Vector3;
use tobj::{LoadOptions, Mesh};

use super::finish::Soup;
use super::polygon::Triangulator;
use super::{Limits, LinearRgb, ModelError};
use crate::colour::linear_from_srgb;

const FORMAT: &str = "OBJ";

/// Reads a Wavefront OBJ. Material libraries are other files; names of materials are enough to
/// tell where one ends.
pub(super) fn read(bytes: &[u8], limits: &Limits) -> Result<Soup, ModelError> {
    check_counts(bytes, limits)?;
    let material_ids = material_names(bytes);
    // The parser splits meshes only at materials that a library defines; this one is first.
    let mut reader = Cursor::new(b"mtllib materials\n").chain(Cursor::new(bytes));
    let loaded = tobj::load_obj_buf(&mut reader, &LoadOptions::default(), |_| {
        let materials = material_ids
            .keys()
            .map(|name| tobj::Material { name: name.clone(), ..tobj::Material::default() });
        Ok((materials.collect(), material_ids.clone().into_iter().collect()))
    });
    let (models, _) = loaded.map_err(|error| ModelError::malformed(FORMAT, error))?;
    let mut soup = Soup::default();
    let mut parts: HashMap<String, u32> = HashMap::new();
    let mut triangulator = Triangulator::default();
    for model in &models {
        let next = parts.len() as u32;
        let part = *parts.entry(model.name.clone()).or_insert(next);
        push_mesh(&mut soup, &model.mesh, part, &mut triangulator)?;
        limits.check_triangles(soup.triangles.len())?;
    }
    Ok(soup)
}

/// Lines of vertices and corners of faces, before anything is taken from them.
fn check_counts(bytes: &[u8], limits: &Limits) -> Result<(), ModelError> {
    let mut vertices = 0;
    let mut corners = 0;
    for line in bytes.split(|&b| b == b'\n') {
        let mut words = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
        match words.next() {
            Some(b"v" | b"vn" | b"vt") => vertices += 1,
            Some(b"f") => corners += words.count(),
            _ => {}
        }
    }
    limits.check_vertices(vertices)?;
    limits.check_triangles(corners / 3)
}

fn material_names(bytes: &[u8]) -> HashMap<String, usize> {
    let mut names = HashMap::new();
    for line in bytes.lines().map_while(Result::ok) {
        if let Some(("usemtl", name)) = line.trim().split_once(' ') {
            let next = names.len();
            names.entry(name.trim().to_owned()).or_insert(next);
        }
    }
    names
}

fn push_mesh(
    soup: &mut Soup,
    mesh: &Mesh,
    part: u32,
    triangulator: &mut Triangulator,
) -> Result<(), ModelError> {
    let positions = vectors(&mesh.positions);
    let normals = vectors(&mesh.normals);
    let colours = colours(&mesh.vertex_color);
    let first = soup.positions.len() as u32;
    let material = mesh.material_id.map_or(0, |id| id as u32 + 1);
    let mut start = 0;
    for arity in face_arities(mesh) {
        let range = start..start + arity;
        start += arity;
        let (Some(indices), normal_indices) =
            (mesh.indices.get(range.clone()), mesh.normal_indices.get(range))
        else {
            return Err(ModelError::malformed(FORMAT, "a face has too few corners"));
        };
        let corners: Option<Vec<_>> =
            indices.iter().map(|&i| positions.get(i as usize).copied()).collect();
        let Some(corners) = corners else {
            return Err(ModelError::malformed(FORMAT, "a face has an unknown vertex"));
        };
        let mut triangles = Vec::new();
        triangulator.triangulate(&corners, &mut triangles);
        for triangle in triangles {
            soup.triangles.push(triangle.map(|i| first + indices[i as usize]));
            soup.materials.push(material);
            soup.corner_normals.push(normal_indices.and_then(|of_corner| {
                let normal = |i: u32| normals.get(of_corner[i as usize] as usize).copied();
                Some([normal(triangle[0])?, normal(triangle[1])?, normal(triangle[2])?])
            }));
            let colour = |i: u32| colours.get(indices[i as usize] as usize).copied();
            let [a, b, c] = triangle.map(colour);
            soup.corner_colours.push(a.zip(b).zip(c).map(|((a, b), c)| [a, b, c]));
        }
    }
    soup.parts.extend(std::iter::repeat_n(part, positions.len()));
    soup.positions.extend(positions);
    Ok(())
}

/// The number of corners of each face; the parser leaves it out if all are triangles.
fn face_arities(mesh: &Mesh) -> Vec<usize> {
    if mesh.face_arities.is_empty() {
        vec![3; mesh.indices.len() / 3]
    } else {
        mesh.face_arities.iter().map(|&arity| arity as usize).collect()
    }
}

/// `v x y z r g b`, an extension that common programs write, with colours as displays show them.
fn colours(numbers: &[f64]) -> Vec<LinearRgb> {
    let triples = numbers.as_chunks::<3>().0.iter();
    triples.map(|colour| colour.map(|c| linear_from_srgb(c as f32))).collect()
}

fn vectors(numbers: &[f64]) -> Vec<Vector3<f64>> {
    let triples = numbers.as_chunks::<3>().0.iter();
    triples.map(|&[x, y, z]| Vector3::new(x, y, z)).collect()
}
