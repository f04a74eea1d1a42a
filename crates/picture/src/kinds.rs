//! Kinds of files that look like drawings and are refused by name: what they
//! are and what to send instead.

use std::io::Cursor;

use image::codecs::gif::GifDecoder;
use image::codecs::png::PngDecoder;
use image::codecs::webp::WebPDecoder;
use image::{AnimationDecoder, ImageDecoder, ImageFormat, Limits};

/// What to do about a format that is not read.
const REMEDY: &str = "export it as PNG, JPEG, WebP, TIFF or SVG";
const PDF: &str = "a PDF document";
/// What to do about one: how finely its pages are drawn has to be said.
const PDF_REMEDY: &str = "export its pages as PNG, or together as one TIFF, at 150 to 300 dots per \
     inch (pdftoppm -png -r 200 does)";

/// What to do about a format that [`not_read`] names.
pub(crate) fn remedy(kind: &str) -> &'static str {
    if kind == PDF { PDF_REMEDY } else { REMEDY }
}

/// What to do about several pictures in one file.
pub(crate) const ONE_BY_ONE: &str =
    "send each picture as a view of its own, or the file as a page with azimuths";

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
    if starts(b"%PDF") {
        // No renderer in pure Rust bounds what its streams unpack to or how long it takes.
        Some(PDF)
    } else if starts(b"8BPS") {
        Some("a Photoshop document")
    } else if starts(b"\x1f\x8b") {
        Some("a compressed file, such as SVGZ")
    } else if starts(b"II+\0") || starts(b"MM\0+") {
        Some("a BigTIFF image")
    } else if starts(b"\0\0\0\x0cJXL ") || starts(b"\xff\x0a") {
        Some("a JPEG XL image")
    } else {
        tiff_not_read(bytes)
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

/// What a TIFF is that is packed or numbered as is not read, by its first page's tags.
fn tiff_not_read(bytes: &[u8]) -> Option<&'static str> {
    const COMPRESSION: usize = 259;
    const SAMPLE_FORMAT: usize = 339;
    let tiff = Tiff::of(bytes)?;
    let page = tiff.first_page()?;
    match tiff.values(page, COMPRESSION).next() {
        Some(50_000) => return Some("a TIFF image compressed by Zstandard"),
        Some(50_001) => return Some("a TIFF image compressed by WebP"),
        Some(34_712) => return Some("a TIFF image compressed by JPEG 2000"),
        Some(34_887) => return Some("a TIFF image compressed by LERC"),
        Some(6) => return Some("a TIFF image compressed by old JPEG"),
        _ => {}
    }
    // 1 and 2 are whole numbers, 3 floating-point ones.
    match tiff.values(page, SAMPLE_FORMAT).next() {
        Some(3) => Some("a TIFF image of floating-point numbers"),
        _ => None,
    }
}

/// A TIFF's bytes, to look up where its pages are.
pub(crate) struct Tiff<'a> {
    bytes: &'a [u8],
    little: bool,
}

impl<'a> Tiff<'a> {
    pub(crate) fn of(bytes: &'a [u8]) -> Option<Self> {
        let little = bytes.starts_with(b"II*\0");
        (little || bytes.starts_with(b"MM\0*")).then_some(Self { bytes, little })
    }

    fn number(&self, at: usize, size: usize) -> Option<usize> {
        let bytes = self.bytes.get(at..at.checked_add(size)?)?;
        let fold = |sum: usize, byte: &u8| sum << 8 | usize::from(*byte);
        let little = bytes.iter().rev().fold(0, fold);
        Some(if self.little { little } else { bytes.iter().fold(0, fold) })
    }

    pub(crate) fn first_page(&self) -> Option<usize> {
        self.number(4, 4)
    }

    /// Where a page's bytes say where the next one is.
    fn link(&self, page: usize) -> Option<usize> {
        let entries = self.number(page, 2)?;
        page.checked_add(2 + 12 * entries)
    }

    /// A tag's values: their size each, bytes, where they begin, and how many there are.
    fn entry(&self, page: usize, wanted: usize) -> Option<(usize, usize, usize)> {
        let entries = self.number(page, 2)?;
        let mut starts = (0..entries).map(|entry| page + 2 + 12 * entry);
        let entry = starts.find(|&at| self.number(at, 2) == Some(wanted))?;
        let size = match self.number(entry + 2, 2)? {
            1 | 7 => 1,
            3 => 2,
            4 => 4,
            _ => return None,
        };
        let count = self.number(entry + 4, 4)?;
        // More than four bytes are elsewhere.
        let here = count.checked_mul(size)? <= 4;
        Some((size, if here { entry + 8 } else { self.number(entry + 8, 4)? }, count))
    }

    /// A tag's whole numbers; none if it is missing or of another kind. Ends with the file.
    pub(crate) fn values(&self, page: usize, wanted: usize) -> impl Iterator<Item = u64> + '_ {
        let (size, start, count) = self.entry(page, wanted).unwrap_or_default();
        let value = move |k: usize| self.number(start.checked_add(k.checked_mul(size)?)?, size);
        (0..count).map_while(value).map(|value| value as u64)
    }

    /// A tag's bytes, as they are.
    pub(crate) fn bytes_of(&self, page: usize, wanted: usize) -> Option<&'a [u8]> {
        let (size, start, count) = self.entry(page, wanted)?;
        self.bytes.get(start..start.checked_add(count.checked_mul(size)?)?)
    }
}

/// How many pages a TIFF has, two at most.
fn tiff_pages(bytes: &[u8]) -> Option<usize> {
    let tiff = Tiff::of(bytes)?;
    let next = tiff.number(tiff.link(tiff.first_page()?)?, 4)?;
    Some(1 + usize::from(next != 0))
}

/// Each page of a TIFF as a file of that page alone, one after the other; without end if the
/// pages name each other in a circle.
pub fn tiff_pages_apart(bytes: &[u8]) -> impl Iterator<Item = Vec<u8>> + '_ {
    let mut next = Tiff::of(bytes).and_then(|tiff| tiff.first_page());
    std::iter::from_fn(move || {
        let (tiff, page) = (Tiff::of(bytes)?, next?);
        let link = tiff.link(page)?;
        next = tiff.number(link, 4).filter(|&next| next != 0);
        let mut alone = bytes.to_vec();
        // Offsets in a TIFF have 32 bits.
        let first = page as u32;
        let first = if tiff.little { first.to_le_bytes() } else { first.to_be_bytes() };
        alone.get_mut(4..8)?.copy_from_slice(&first);
        alone.get_mut(link..link.checked_add(4)?)?.fill(0);
        Some(alone)
    })
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
        assert!(remedy(named(b"%PDF-1.7")).contains("pdftoppm"));
        assert!(remedy(named(b"8BPS")).contains("SVG"));
        assert_eq!(named(b"\x1f\x8b\x08\0"), "a compressed file, such as SVGZ");
        assert_eq!(named(b"II+\0\x08\0"), "a BigTIFF image");
        assert_eq!(not_read(b"\x89PNG\r\n"), None);
        assert_eq!(not_read(b""), None);
    }

    #[test]
    fn tiffs_that_are_not_read_are_named_by_their_tags() {
        // One entry of a page: tag, type, count, value.
        let tiff = |tag: u16, value: u16| {
            let mut bytes = b"II*\0\x08\0\0\0\x01\0".to_vec();
            bytes.extend(tag.to_le_bytes());
            bytes.extend([3, 0, 1, 0, 0, 0]);
            bytes.extend(value.to_le_bytes());
            bytes.extend([0; 6]);
            bytes
        };
        assert_eq!(not_read(&tiff(259, 50_000)), Some("a TIFF image compressed by Zstandard"));
        assert_eq!(not_read(&tiff(339, 3)), Some("a TIFF image of floating-point numbers"));
        assert_eq!(not_read(&tiff(339, 1)), None);
        assert_eq!(not_read(&tiff(259, 5)), None);
    }

    #[test]
    fn pages_of_a_tiff_come_apart() {
        // Two empty pages, at 8 and 14; the second names the first: a loop.
        let mut file = b"II*\0\x08\0\0\0\0\0\x0e\0\0\0\0\0\0\0\0\0".to_vec();
        let apart: Vec<_> = tiff_pages_apart(&file).collect();
        assert_eq!(apart.len(), 2);
        assert_eq!((apart[1][4], &apart[1][16..20]), (14, &[0; 4][..]));
        assert!(apart.iter().all(|page| tiff_pages(page) == Some(1)));
        file[16] = 8;
        assert_eq!(tiff_pages_apart(&file).take(9).count(), 9);
        assert_eq!(tiff_pages_apart(b"II*\0\xff\xff\xff\xff").count(), 0);
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
