//! Kinds of files that look like drawings and are refused by name: what they
//! are and what to send instead.

use std::io::Cursor;

use image::codecs::gif::GifDecoder;
use image::codecs::png::PngDecoder;
use image::codecs::webp::WebPDecoder;
use image::{AnimationDecoder, ImageDecoder, ImageFormat, Limits};

/// What to do about a format that is not read.
pub(crate) const REMEDY: &str = "export it as PNG, JPEG, WebP or TIFF";
/// What to do about several pictures in one file.
pub(crate) const ONE_BY_ONE: &str = "send each picture as a view of its own";

/// The name of a known format that is not read, by the file's first bytes.
pub(crate) fn not_read(bytes: &[u8]) -> Option<&'static str> {
    let starts = |magic: &[u8]| bytes.starts_with(magic);
    // ISO base media files name their brand at byte 8.
    let brand = bytes.get(4..12).filter(|head| head.starts_with(b"ftyp"));
    match brand.map(|head| &head[4..8]) {
        Some(b"avif" | b"avis") => return Some("an AVIF image"),
        Some(b"heic" | b"heix" | b"hevc" | b"mif1" | b"msf1") => return Some("a HEIC image"),
        _ => {}
    }
    let text = bytes.get(..512).unwrap_or(bytes);
    let is_svg = text.windows(4).any(|window| window == b"<svg");
    if starts(b"%PDF") {
        Some("a PDF document")
    } else if starts(b"8BPS") {
        Some("a Photoshop document")
    } else if is_svg {
        Some("an SVG drawing")
    } else if starts(b"II+\0") || starts(b"MM\0+") {
        Some("a BigTIFF image")
    } else if starts(b"\0\0\0\x0cJXL ") || starts(b"\xff\x0a") {
        Some("a JPEG XL image")
    } else {
        None
    }
}

/// What a file with more than one picture is; none is taken in silence.
pub(crate) fn several(bytes: &[u8], format: ImageFormat, limits: Limits) -> Option<&'static str> {
    let reader = || Cursor::new(bytes);
    match format {
        ImageFormat::Gif => {
            let mut decoder = GifDecoder::new(reader()).ok()?;
            decoder.set_limits(limits).ok()?;
            (decoder.into_frames().take(2).flatten().count() > 1).then_some("an animated GIF")
        }
        ImageFormat::Png => {
            let decoder = PngDecoder::with_limits(reader(), limits).ok()?;
            decoder.is_apng().ok()?.then_some("an animated PNG")
        }
        ImageFormat::WebP => {
            WebPDecoder::new(reader()).ok()?.has_animation().then_some("an animated WebP")
        }
        ImageFormat::Tiff => (tiff_pages(bytes)? > 1).then_some("a TIFF of several pages"),
        _ => None,
    }
}

/// How many pages a TIFF has, two at most.
fn tiff_pages(bytes: &[u8]) -> Option<usize> {
    let little = bytes.starts_with(b"II");
    let number = |at: usize, size: usize| -> Option<usize> {
        let bytes = bytes.get(at..at.checked_add(size)?)?;
        let fold = |sum: usize, byte: &u8| sum << 8 | usize::from(*byte);
        Some(if little { bytes.iter().rev().fold(0, fold) } else { bytes.iter().fold(0, fold) })
    };
    let first = number(4, 4)?;
    let entries = number(first, 2)?;
    let next = number(first.checked_add(2 + 12 * entries)?, 4)?;
    Some(1 + usize::from(next != 0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_that_are_not_read_are_named() {
        let named = |bytes: &[u8]| not_read(bytes).unwrap();
        assert_eq!(named(b"\0\0\0\x20ftypavif\0\0"), "an AVIF image");
        assert_eq!(named(b"\0\0\0\x20ftypheic\0\0"), "a HEIC image");
        assert_eq!(named(b"%PDF-1.7"), "a PDF document");
        assert_eq!(named(b"<?xml version='1.0'?><svg>"), "an SVG drawing");
        assert_eq!(named(b"II+\0\x08\0"), "a BigTIFF image");
        assert_eq!(not_read(b"\x89PNG\r\n"), None);
        assert_eq!(not_read(b""), None);
    }

    #[test]
    fn pages_of_a_tiff_are_counted() {
        let mut one = b"II*\0\x08\0\0\0\0\0\0\0\0\0".to_vec();
        assert_eq!(tiff_pages(&one), Some(1));
        one[10] = 8;
        assert_eq!(tiff_pages(&one), Some(2));
        assert_eq!(tiff_pages(b"II*\0\xff\xff\xff\xff"), None);
    }
}
