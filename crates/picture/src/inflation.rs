//! What the parts of EXR and TIFF files unpack to, told from their headers before a part is
//! unpacked. Decoders hold pictures against limits, but not the parts that pictures are made of:
//! tiles, data windows and samples that nobody asked for cost as much as pixels.

use std::io::Cursor;

use exr::meta::MetaData;
use image::ImageDecoder;
use image::codecs::jpeg::JpegDecoder;

use super::decode::ImageError;
use super::kinds::Tiff;

/// The most bytes that parts may unpack to for each declared pixel of an EXR: sixteen times what
/// RGBA of floats needs, for files of a renderer hold more channels than are read.
const EXR_BYTES_A_PIXEL: u64 = 256;
/// The same of a TIFF: twice what RGBA of 64 bits needs.
const TIFF_BYTES_A_PIXEL: u64 = 64;
/// What parts may unpack to whatever the picture's size: a small one may be a single large tile.
const FREE_BYTES: u64 = 16 << 20;
/// Tables that all JPEGs of a TIFF have in common are copied to each of them.
const MAX_TABLES_BYTES: usize = 64 << 10;

/// Refuses an EXR whose layers unpack to far more than its display window needs.
///
/// # Errors
/// [`ImageError::Inflates`], and [`ImageError::Damaged`] if the header cannot be read.
pub fn expect_bounded_exr(bytes: &[u8]) -> Result<(), ImageError> {
    let damaged = |error: exr::error::Error| ImageError::Damaged(error.to_string());
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(damaged)?;
    for header in &meta.headers {
        let size = |size: exr::math::Vec2<usize>| size.width() as u64 * size.height() as u64;
        let channels = header.channels.bytes_per_pixel as u64;
        let pixels = size(header.shared_attributes.display_window.size);
        let whole = size(header.layer_size).saturating_mul(channels);
        let block = header.max_block_pixel_size();
        // A block may be larger than the layer that it is of.
        let unpacked = whole.max(size(block).saturating_mul(channels));
        expect(unpacked, pixels, EXR_BYTES_A_PIXEL)?;
    }
    Ok(())
}

/// Refuses a TIFF whose first page unpacks to far more than its pixels need, and one whose strips
/// or tiles lie over each other: few bytes would be unpacked again and again.
///
/// # Errors
/// [`ImageError::Inflates`] and [`ImageError::Damaged`]. What cannot be told is left to the
/// decoder.
pub(crate) fn expect_bounded_tiff(bytes: &[u8]) -> Result<(), ImageError> {
    match TiffParts::of(bytes) {
        Some(parts) => parts.expect_bounded(bytes),
        None => Ok(()),
    }
}

fn expect(unpacked: u64, pixels: u64, bytes_a_pixel: u64) -> Result<(), ImageError> {
    let limit = pixels.saturating_mul(bytes_a_pixel).saturating_add(FREE_BYTES);
    if unpacked <= limit { Ok(()) } else { Err(ImageError::Inflates { unpacked, limit }) }
}

/// How the first page of a TIFF is cut up.
struct TiffParts<'a> {
    tiff: Tiff<'a>,
    page: usize,
    width: u64,
    height: u64,
    /// Bits of all samples of a pixel.
    bits: u64,
    /// Columns and rows of a tile; `None` if the page is in strips.
    tile: Option<(u64, u64)>,
    rows_per_strip: u64,
    is_jpeg: bool,
    /// What JPEG parts have in common.
    tables: &'a [u8],
}

impl<'a> TiffParts<'a> {
    fn of(bytes: &'a [u8]) -> Option<Self> {
        const WIDTH: usize = 256;
        const HEIGHT: usize = 257;
        const BITS_PER_SAMPLE: usize = 258;
        const COMPRESSION: usize = 259;
        const SAMPLES_PER_PIXEL: usize = 277;
        const ROWS_PER_STRIP: usize = 278;
        const TILE_WIDTH: usize = 322;
        const TILE_HEIGHT: usize = 323;
        const JPEG_TABLES: usize = 347;
        const JPEG: u64 = 7;
        let tiff = Tiff::of(bytes)?;
        let page = tiff.first_page()?;
        let one = |tag| tiff.values(page, tag).next();
        let tile = one(TILE_WIDTH).zip(one(TILE_HEIGHT));
        let samples = one(SAMPLES_PER_PIXEL).unwrap_or(1);
        Some(Self {
            width: one(WIDTH)?,
            height: one(HEIGHT)?,
            bits: samples.checked_mul(one(BITS_PER_SAMPLE).unwrap_or(1))?,
            tile,
            rows_per_strip: one(ROWS_PER_STRIP).unwrap_or(u64::MAX),
            is_jpeg: one(COMPRESSION) == Some(JPEG),
            tables: tiff.bytes_of(page, JPEG_TABLES).unwrap_or_default(),
            page,
            tiff,
        })
    }

    /// Where each part begins, and how many bytes it has.
    fn ranges(&self) -> impl Iterator<Item = (u64, u64)> + '_ {
        const STRIPS: [usize; 2] = [273, 279];
        const TILES: [usize; 2] = [324, 325];
        let tags = if self.tile.is_some() { TILES } else { STRIPS };
        let [offsets, counts] = tags.map(|tag| self.tiff.values(self.page, tag));
        offsets.zip(counts)
    }

    fn expect_bounded(&self, bytes: &[u8]) -> Result<(), ImageError> {
        let pixels = self.width.saturating_mul(self.height);
        let unpacked = match self.tile {
            Some((columns, rows)) if columns > 0 && rows > 0 => {
                let tiles = self.width.div_ceil(columns).saturating_mul(self.height.div_ceil(rows));
                tiles.saturating_mul(columns.saturating_mul(rows))
            }
            _ => pixels,
        };
        expect(unpacked.saturating_mul(self.bits) / 8, pixels, TIFF_BYTES_A_PIXEL)?;
        let packed = self.ranges().fold(0, |sum: u64, range| sum.saturating_add(range.1));
        if packed > bytes.len() as u64 {
            let detail = format!("its parts have {packed} bytes, the file {}", bytes.len());
            return Err(ImageError::Damaged(detail));
        }
        if self.is_jpeg { self.expect_bounded_jpegs(bytes) } else { Ok(()) }
    }

    /// A JPEG in a TIFF has a size of its own, which the decoder believes.
    fn expect_bounded_jpegs(&self, bytes: &[u8]) -> Result<(), ImageError> {
        // Of blocks of 8, with chroma at half the resolution.
        const BLOCK: u64 = 16;
        let (columns, rows) =
            self.tile.unwrap_or((self.width, self.rows_per_strip.min(self.height)));
        let most = |side: u64| side.saturating_add(BLOCK);
        if self.tables.len() > MAX_TABLES_BYTES {
            let detail = format!("its JPEG tables have {} bytes", self.tables.len());
            return Err(ImageError::Damaged(detail));
        }
        for (offset, count) in self.ranges() {
            let start = usize::try_from(offset).unwrap_or(usize::MAX);
            let part = usize::try_from(count).ok().and_then(|count| start.checked_add(count));
            let Some(part) = part.and_then(|end| bytes.get(start..end)) else { continue };
            let Ok(jpeg) = JpegDecoder::new(Cursor::new(self.whole_jpeg(part))) else { continue };
            let (width, height) = jpeg.dimensions();
            let (width, height) = (u64::from(width), u64::from(height));
            if width > most(columns) || height > most(rows) {
                let [unpacked, limit] = [width * height, columns.saturating_mul(rows)]
                    .map(|pixels| pixels.saturating_mul(self.bits.max(8)) / 8);
                return Err(ImageError::Inflates { unpacked, limit });
            }
        }
        Ok(())
    }

    /// A part behind the tables that all have in common, without the marks between them.
    fn whole_jpeg(&self, part: &[u8]) -> Vec<u8> {
        match (self.tables.len().checked_sub(2), part.get(2..)) {
            (Some(end), Some(rest)) if end > 0 => [&self.tables[..end], rest].concat(),
            _ => part.to_vec(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ImageLimits, decode};
    use exr::prelude::*;
    use image::{DynamicImage, GrayImage, ImageFormat};

    /// An EXR of zeros, with a window of `layer` by `layer` shown in one of `shown` by `shown`.
    fn exr(layer: usize, shown: usize) -> Vec<u8> {
        let channels = SpecificChannels::rgb(|_| (0.0_f32, 0.0_f32, 0.0_f32));
        let encoding = Encoding { compression: Compression::ZIP16, ..Encoding::default() };
        let mut image = Image::empty(ImageAttributes::with_size((shown, shown)))
            .with_layer(Layer::new((layer, layer), LayerAttributes::default(), encoding, channels));
        image.attributes.display_window = IntegerBounds::from_dimensions((shown, shown));
        let mut bytes = Cursor::new(Vec::new());
        image.write().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn an_exr_of_much_more_than_is_shown_is_refused() {
        expect_bounded_exr(&exr(64, 64)).unwrap();
        // A renderer's margin about what is shown.
        expect_bounded_exr(&exr(600, 500)).unwrap();
        let hostile = exr(2048, 2);
        assert!(hostile.len() < 300_000, "{} bytes are not small", hostile.len());
        let error = expect_bounded_exr(&hostile).unwrap_err();
        assert!(matches!(error, ImageError::Inflates { unpacked: 50_331_648, .. }), "{error}");
    }

    /// Its window is said to be larger than anything could hold: nothing of that size is taken.
    #[test]
    fn windows_of_an_exr_are_held_against_its_size_before_they_are_believed() {
        let mut bytes = exr(2, 2);
        let name = b"dataWindow\0box2i\0";
        let at = bytes.windows(name.len()).position(|part| part == name).unwrap();
        let last = at + name.len() + 4 + 8;
        bytes[last..last + 8].copy_from_slice(&[0xff, 0xff, 0xff, 0x1f, 0xff, 0xff, 0xff, 0]);
        let error = expect_bounded_exr(&bytes).unwrap_err();
        assert!(matches!(error, ImageError::Inflates { unpacked, .. } if unpacked > 1 << 50));
    }

    /// A little-endian TIFF of one page: its entries (tag, value), all of 32 bits, and what
    /// follows them.
    fn tiff(entries: &[(u16, u32)], rest: &[u8]) -> Vec<u8> {
        let mut bytes = b"II*\0\x08\0\0\0".to_vec();
        bytes.extend((entries.len() as u16).to_le_bytes());
        for (tag, value) in entries {
            // Some are read as 16 bits only.
            let kind = if matches!(tag, 258 | 259 | 262 | 277) { 3_u16 } else { 4 };
            bytes.extend(tag.to_le_bytes());
            bytes.extend(kind.to_le_bytes());
            bytes.extend(1_u32.to_le_bytes());
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend([0; 4]);
        bytes.extend(rest);
        bytes
    }

    /// Where what follows so many entries lies.
    fn behind(entries: u32) -> u32 {
        8 + 2 + 12 * entries + 4
    }

    fn refusal(bytes: &[u8]) -> ImageError {
        decode(bytes, &ImageLimits::default()).unwrap_err()
    }

    #[test]
    fn a_tiff_of_huge_tiles_is_refused() {
        let page = [(256, 16), (257, 16), (258, 8), (259, 5), (262, 1)];
        let tiles = |side| {
            let tile = [(322, side), (323, side), (324, behind(9)), (325, 4)];
            tiff(&[&page[..], &tile].concat(), &[0x80, 0, 0, 0])
        };
        let error = refusal(&tiles(1 << 20));
        assert!(matches!(error, ImageError::Inflates { unpacked, .. } if unpacked == 1 << 40));
        // Of a usual tile the decoder finds out by itself that it is empty.
        assert!(matches!(refusal(&tiles(512)), ImageError::Damaged(_)));
    }

    #[test]
    fn a_tiff_whose_parts_lie_over_each_other_is_refused() {
        // Two strips of the same bytes.
        let (offsets, counts) = (behind(9), behind(9) + 8);
        let mut bytes = tiff(
            &[
                (256, 4),
                (257, 2),
                (258, 8),
                (259, 1),
                (262, 1),
                (273, offsets),
                (277, 1),
                (278, 1),
                (279, counts),
            ],
            &[],
        );
        let entry = |tag: u16| {
            10 + 12
                * [256, 257, 258, 259, 262, 273, 277, 278, 279]
                    .iter()
                    .position(|it| *it == tag)
                    .unwrap()
        };
        for tag in [273, 279] {
            bytes[entry(tag) + 4] = 2;
        }
        let mut file = |count: u32| {
            bytes.truncate(behind(9) as usize);
            let data = counts + 8;
            bytes.extend([data, data].map(u32::to_le_bytes).concat());
            bytes.extend([count, count].map(u32::to_le_bytes).concat());
            bytes.extend([9; 80]);
            bytes.clone()
        };
        decode(&file(4), &ImageLimits::default()).unwrap();
        let error = refusal(&file(200));
        assert!(error.to_string().contains("its parts have 400 bytes"), "{error}");
    }

    #[test]
    fn a_jpeg_in_a_tiff_is_no_larger_than_its_strip() {
        let jpeg = |width, height| {
            let mut bytes = Cursor::new(Vec::new());
            let grey = DynamicImage::from(GrayImage::from_pixel(width, height, image::Luma([99])));
            grey.write_to(&mut bytes, ImageFormat::Jpeg).unwrap();
            bytes.into_inner()
        };
        let of = |jpeg: &[u8]| {
            let entries = [(256, 16), (257, 16), (258, 8), (259, 7), (262, 1)];
            let strip =
                [(273, behind(9)), (277, 1), (278, 16), (279, u32::try_from(jpeg.len()).unwrap())];
            tiff(&[&entries[..], &strip].concat(), jpeg)
        };
        let drawing = decode(&of(&jpeg(16, 16)), &ImageLimits::default()).unwrap();
        assert_eq!(drawing.gray.get_pixel(7, 7).0, [99]);
        let mut small = jpeg(16, 16);
        // The size in its header, height first, made 16 000 px a side.
        let at = small.windows(2).position(|pair| pair == [0xff, 0xc0]).unwrap() + 5;
        small[at..at + 4].copy_from_slice(&[0x3e, 0x80, 0x3e, 0x80]);
        let error = refusal(&of(&small));
        assert!(matches!(error, ImageError::Inflates { unpacked: 256_000_000, .. }), "{error}");
    }
}
