//! Float maps as PFM, the portable float map.

use super::FloatImage;

/// Longest header that is read, bytes; a real one has about 20.
const MAX_HEADER_BYTES: usize = 256;

/// Why bytes are not a readable PFM picture.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PfmError {
    /// The header is malformed.
    #[error("does not begin with Pf, width, height and scale")]
    Header,
    /// The picture has colour.
    #[error("has three channels (PF), not one (Pf)")]
    Colour,
    /// The picture is too large to be decoded.
    #[error("is {width}x{height}, over the limit of {max_pixels} pixels and {max_side_px} a side")]
    TooManyPixels {
        /// As the header states it, px.
        width: u64,
        /// As the header states it, px.
        height: u64,
        /// The most pixels that are decoded.
        max_pixels: u64,
        /// The longest side that is decoded, px.
        max_side_px: u32,
    },
    /// Pixels are missing at the end.
    #[error("holds {found} bytes of pixels, its size needs {required}")]
    Truncated {
        /// Bytes of pixels that there are.
        found: usize,
        /// Bytes that width and height ask for.
        required: u64,
    },
}

/// Writes a map as a portable float map, little endian, bottom row first; NaN
/// is missing.
pub fn encode_pfm(map: &FloatImage) -> Vec<u8> {
    let (width, height) = map.dimensions();
    let mut bytes = format!("Pf\n{width} {height}\n-1.0\n").into_bytes();
    bytes.reserve(map.len() * 4);
    for row in map.as_raw().rchunks_exact(width.max(1) as usize) {
        for value in row {
            // One NaN, so that equal maps are equal bytes.
            let value = if value.is_nan() { f32::NAN } else { *value };
            bytes.extend_from_slice(&value.to_le_bytes());
        }
    }
    bytes
}

/// Reads a one-channel PFM picture: rows from the bottom up, 32-bit floats,
/// little endian where the scale is negative. Bytes after the pixels are
/// ignored, the scale's size too, as other readers do.
///
/// Memory is taken only after size and length were checked.
pub fn decode_pfm(bytes: &[u8], max_pixels: u64, max_side_px: u32) -> Result<FloatImage, PfmError> {
    let (fields, start) = header(bytes)?;
    match fields[0] {
        "Pf" => {}
        "PF" => return Err(PfmError::Colour),
        _ => return Err(PfmError::Header),
    }
    let side = |text: &str| text.parse::<u64>().ok().filter(|&side| side > 0);
    let width = side(fields[1]).ok_or(PfmError::Header)?;
    let height = side(fields[2]).ok_or(PfmError::Header)?;
    let scale: f64 = fields[3].parse().map_err(|_| PfmError::Header)?;
    if scale == 0.0 || !scale.is_finite() {
        return Err(PfmError::Header);
    }
    let longest = width.max(height);
    if longest > u64::from(max_side_px) || width.saturating_mul(height) > max_pixels {
        return Err(PfmError::TooManyPixels { width, height, max_pixels, max_side_px });
    }
    let required = width.saturating_mul(height).saturating_mul(4);
    let found = bytes.len() - start;
    let pixels = usize::try_from(required)
        .ok()
        .and_then(|required| bytes[start..].get(..required))
        .ok_or(PfmError::Truncated { found, required })?;
    Ok(pixels_from(pixels, width as usize, height as u32, scale < 0.0))
}

/// Four words, each followed by one white space byte, and where pixels begin.
fn header(bytes: &[u8]) -> Result<([&str; 4], usize), PfmError> {
    let head = &bytes[..bytes.len().min(MAX_HEADER_BYTES)];
    let mut fields = [""; 4];
    let mut at = 0;
    for field in &mut fields {
        while head.get(at).is_some_and(u8::is_ascii_whitespace) {
            at += 1;
        }
        let word = &head[at..];
        let end = word.iter().position(u8::is_ascii_whitespace).ok_or(PfmError::Header)?;
        *field = std::str::from_utf8(&word[..end]).map_err(|_| PfmError::Header)?;
        at += end;
    }
    Ok((fields, at + 1))
}

fn pixels_from(bytes: &[u8], width: usize, height: u32, little_endian: bool) -> FloatImage {
    let value = |bytes: [u8; 4]| match little_endian {
        true => f32::from_le_bytes(bytes),
        false => f32::from_be_bytes(bytes),
    };
    FloatImage::from_fn(width as u32, height, |x, y| {
        let row = (height - 1 - y) as usize;
        let at = 4 * (row * width + x as usize);
        image::Luma([value([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, values: &[f32], big_endian: bool) -> Vec<u8> {
        let pixels = values.iter().flat_map(|value| match big_endian {
            true => value.to_be_bytes(),
            false => value.to_le_bytes(),
        });
        header.bytes().chain(pixels).collect()
    }

    #[test]
    fn rows_come_bottom_up_in_either_byte_order() {
        let values = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        for (scale, big_endian) in [("-1.0", false), ("1", true)] {
            let bytes = file(&format!("Pf\n3 2\n{scale}\n"), &values, big_endian);
            let image = decode_pfm(&bytes, 100, 100).unwrap();
            assert_eq!(image.dimensions(), (3, 2));
            assert_eq!(image.as_raw(), &[4.0, 5.0, 6.0, 1.0, 2.0, 3.0]);
        }
    }

    #[test]
    fn damaged_and_huge_files_are_refused_before_memory_is_taken() {
        let refuse = |bytes: &[u8]| decode_pfm(bytes, 100, 50).unwrap_err();
        assert_eq!(refuse(b""), PfmError::Header);
        assert_eq!(refuse(b"Pf 3"), PfmError::Header);
        assert_eq!(refuse(b"Pf\n3 x\n-1\n"), PfmError::Header);
        assert_eq!(refuse(b"Pf\n3 0\n-1\n"), PfmError::Header);
        assert_eq!(refuse(b"Pf\n3 2\nnan\n"), PfmError::Header);
        assert_eq!(refuse(b"\xff\xfe\n3 2\n-1\n"), PfmError::Header);
        assert_eq!(refuse(&[b' '; 4096]), PfmError::Header);
        assert_eq!(refuse(b"PF\n3 2\n-1\n"), PfmError::Colour);
        let huge = "Pf\n18446744073709551615 18446744073709551615\n-1\n";
        assert!(matches!(refuse(huge.as_bytes()), PfmError::TooManyPixels { .. }));
        assert!(matches!(refuse(b"Pf\n51 1\n-1\n"), PfmError::TooManyPixels { .. }));
        let cut = file("Pf\n3 2\n-1\n", &[0.0; 5], false);
        assert_eq!(refuse(&cut), PfmError::Truncated { found: 20, required: 24 });
    }

    #[test]
    fn a_float_map_begins_with_its_bottom_row() {
        let map = FloatImage::from_raw(1, 2, vec![1.0, f32::NAN]).unwrap();
        let bytes = encode_pfm(&map);
        let header = b"Pf\n1 2\n-1.0\n";
        assert!(bytes.starts_with(header));
        assert!(f32::from_le_bytes(bytes[header.len()..][..4].try_into().unwrap()).is_nan());
        assert_eq!(bytes[header.len() + 4..], 1.0_f32.to_le_bytes());
    }

    #[test]
    fn float_maps_hold_their_values_bottom_row_first() {
        let map = FloatImage::from_raw(3, 2, vec![1.0, f32::NAN, 3.5, -2.0, 0.25, 8.0]).unwrap();
        let bytes = encode_pfm(&map);
        let header = b"Pf\n3 2\n-1.0\n";
        assert_eq!(&bytes[..header.len()], header);
        let values: Vec<f32> = bytes[header.len()..]
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect();
        assert_eq!(values[..4], [-2.0, 0.25, 8.0, 1.0]);
        assert!(values[4].is_nan());
        assert_eq!(values[5], 3.5);
    }
}
