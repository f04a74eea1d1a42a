//! PLY, ASCII or binary.

use std::io::Cursor;

use nalgebra::Vector3;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Header, Property, PropertyAccess, PropertyAccessResult};

use super::finish::Soup;
use super::polygon::Triangulator;
use super::{Limits, LinearRgb, ModelError};
use crate::colour::linear_from_srgb_byte;

const FORMAT: &str = "PLY";

/// Reads a PLY: its vertices with their normals, and its faces.
pub(super) fn read(bytes: &[u8], limits: &Limits) -> Result<Soup, ModelError> {
    let malformed = |error| ModelError::malformed(FORMAT, error);
    let mut reader = Reader::new(Cursor::new(bytes));
    let header = Parser::<Skipped>::new().read_header(&mut reader).map_err(malformed)?;
    check_header(&header, bytes.len(), limits)?;
    let mut vertices = Vec::new();
    let mut faces = Vec::new();
    for element in header.elements.values() {
        match element.name.as_str() {
            "vertex" => vertices = elements(&mut reader, element, &header)?,
            "face" => faces = elements(&mut reader, element, &header)?,
            _ => drop(elements::<Skipped>(&mut reader, element, &header)?),
        }
    }
    let has_normals = header.elements.get("vertex").is_some_and(|vertex| {
        ["nx", "ny", "nz"].iter().all(|name| vertex.properties.contains_key(*name))
    });
    assembled(&vertices, &faces, has_normals, limits)
}

/// Counts are promises: each element takes at least a byte.
fn check_header(header: &Header, bytes: usize, limits: &Limits) -> Result<(), ModelError> {
    for element in header.elements.values() {
        let (name, count) = (&element.name, element.count);
        match name.as_str() {
            "vertex" => limits.check_vertices(count)?,
            "face" => limits.check_triangles(count)?,
            _ => {}
        }
        if count > bytes {
            let reason = format!("{count} elements {name:?} in {bytes} bytes");
            return Err(ModelError::malformed(FORMAT, reason));
        }
        if element.properties.is_empty() && count > 0 {
            let reason = format!("elements {name:?} without properties");
            return Err(ModelError::malformed(FORMAT, reason));
        }
    }
    Ok(())
}

fn elements<E: PropertyAccess>(
    reader: &mut Reader<Cursor<&[u8]>>,
    element: &ElementDef,
    header: &Header,
) -> Result<Vec<E>, ModelError> {
    Parser::<E>::new()
        .read_payload_for_element(reader, element, header)
        .map_err(|error| ModelError::malformed(FORMAT, error))
}

fn assembled(
    vertices: &[Vertex],
    faces: &[Face],
    has_normals: bool,
    limits: &Limits,
) -> Result<Soup, ModelError> {
    let mut soup = Soup {
        positions: vertices.iter().map(|v| v.position).collect(),
        parts: vec![0; vertices.len()],
        ..Soup::default()
    };
    let mut triangulator = Triangulator::default();
    for (index, face) in faces.iter().enumerate() {
        let corners = face.corners(index, vertices.len())?;
        let places: Vec<_> = corners.iter().map(|&c| vertices[c as usize].position).collect();
        let mut triangles = Vec::new();
        triangulator.triangulate(&places, &mut triangles);
        for triangle in triangles {
            let triangle = triangle.map(|i| corners[i as usize]);
            soup.triangles.push(triangle);
            soup.materials.push(face.material);
            let normals = triangle.map(|v| vertices[v as usize].normal);
            soup.corner_normals.push(has_normals.then_some(normals));
            let [a, b, c] = triangle.map(|v| vertices[v as usize].colour());
            soup.corner_colours.push(a.zip(b).zip(c).map(|((a, b), c)| [a, b, c]));
        }
        limits.check_triangles(soup.triangles.len())?;
    }
    Ok(soup)
}

/// An element that is read only to get past it.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}

#[derive(Default)]
struct Vertex {
    position: Vector3<f64>,
    normal: Vector3<f64>,
    /// Red, green and blue, sRGB.
    rgb: [Option<u8>; 3],
}

impl Vertex {
    /// `None` unless all three channels are given.
    fn colour(&self) -> Option<LinearRgb> {
        let [r, g, b] = self.rgb.map(|channel| channel.map(linear_from_srgb_byte));
        Some([r?, g?, b?])
    }
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if let (Some(channel), Property::UChar(level)) = (channel(name), &property) {
            self.rgb[channel] = Some(*level);
            return PropertyAccessResult::Set;
        }
        let place = match name {
            "x" => &mut self.position.x,
            "y" => &mut self.position.y,
            "z" => &mut self.position.z,
            "nx" => &mut self.normal.x,
            "ny" => &mut self.normal.y,
            "nz" => &mut self.normal.z,
            _ => return PropertyAccessResult::Ignored,
        };
        let value = match property {
            Property::Char(v) => f64::from(v),
            Property::UChar(v) => f64::from(v),
            Property::Short(v) => f64::from(v),
            Property::UShort(v) => f64::from(v),
            Property::Int(v) => f64::from(v),
            Property::UInt(v) => f64::from(v),
            Property::Float(v) => f64::from(v),
            Property::Double(v) => v,
            _ => return PropertyAccessResult::UnsupportedType,
        };
        *place = value;
        PropertyAccessResult::Set
    }
}

fn channel(name: &str) -> Option<usize> {
    ["red", "green", "blue"].iter().position(|&known| known == name)
}

#[derive(Default)]
struct Face {
    vertices: Vec<i64>,
    material: u32,
}

impl Face {
    fn corners(&self, index: usize, vertices: usize) -> Result<Vec<u32>, ModelError> {
        let in_range = |&vertex: &i64| {
            let usable = u32::try_from(vertex).ok().filter(|&v| (v as usize) < vertices);
            usable.ok_or(ModelError::IndexOutOfRange { triangle: index, vertex, vertices })
        };
        self.vertices.iter().map(in_range).collect()
    }
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        match (name, property) {
            ("vertex_indices" | "vertex_index", list) => match integers(list) {
                Some(vertices) => self.vertices = vertices,
                None => return PropertyAccessResult::UnsupportedType,
            },
            // Only told apart: -1, for none, is one like the others.
            ("material_index", Property::Int(material)) => self.material = material.cast_unsigned(),
            ("material_index", Property::UChar(material)) => self.material = material.into(),
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

fn integers(list: Property) -> Option<Vec<i64>> {
    fn all<T: Into<i64>>(list: Vec<T>) -> Vec<i64> {
        list.into_iter().map(Into::into).collect()
    }
    Some(match list {
        Property::ListChar(list) => all(list),
        Property::ListUChar(list) => all(list),
        Property::ListShort(list) => all(list),
        Property::ListUShort(list) => all(list),
        Property::ListInt(list) => all(list),
        Property::ListUInt(list) => all(list),
        _ => return None,
    })
}
