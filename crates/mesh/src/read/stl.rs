//! STL, ASCII or binary.

use std::io::Cursor;

use nalgebra::Vector3;

use super::finish::Soup;
use super::{Limits, ModelError};

const FORMAT: &str = "STL";

/// Of a binary file: the header, then the number of triangles.
const HEADER_BYTES: usize = 80;
const COUNT_BYTES: usize = 4;
const TRIANGLE_BYTES: usize = 50;

/// Reads an STL, ASCII or binary.
pub(super) fn read(bytes: &[u8], limits: &Limits) -> Result<Soup, ModelError> {
    let mut soup = Soup::default();
    let malformed = |error: std::io::Error| ModelError::malformed(FORMAT, error);
    let mut reader;
    if let Some(count) = binary_triangles(bytes) {
        limits.check_triangles(count)?;
        limits.check_vertices(count.saturating_mul(3))?;
        // Some binary files begin with "solid" too, which the parser takes for ASCII.
        let mut plain = bytes.to_vec();
        plain[..HEADER_BYTES].fill(0);
        reader = Cursor::new(plain);
    } else {
        reader = Cursor::new(bytes.to_vec());
    }
    for triangle in stl_io::create_stl_reader(&mut reader).map_err(malformed)? {
        push_triangle(&mut soup, triangle.map_err(malformed)?);
        limits.check_triangles(soup.triangles.len())?;
        limits.check_vertices(soup.positions.len())?;
    }
    Ok(soup)
}

/// The number of triangles, if the length is that of a binary file.
fn binary_triangles(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(HEADER_BYTES..HEADER_BYTES + COUNT_BYTES)?;
    let count = u32::from_le_bytes(count.try_into().ok()?) as usize;
    let expected = count.checked_mul(TRIANGLE_BYTES)? + HEADER_BYTES + COUNT_BYTES;
    let plausible = bytes.len() == expected || !bytes.starts_with(b"solid");
    plausible.then_some(count)
}

/// Its normal is left alone: it says nothing that the corners do not.
fn push_triangle(soup: &mut Soup, triangle: stl_io::Triangle) {
    let first = soup.positions.len() as u32;
    for stl_io::Vertex { 0: [x, y, z], .. } in triangle.vertices {
        soup.positions.push(Vector3::new(x, y, z).map(f64::from));
        soup.parts.push(0);
    }
    soup.triangles.push([first, first + 1, first + 2]);
    soup.materials.push(0);
    soup.corner_normals.push(None);
    soup.corner_colours.push(None);
}
