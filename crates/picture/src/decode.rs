//! Untrusted image files as 8-bit drawings, held against limits before a pixel is decoded.

use std::io::Cursor;

use super::inflation::expect_bounded_tiff;
use super::kinds;
use super::svg::{Svg, is_svg};

use image::metadata::Orientation;
use image::{
    DynamicImage, GrayImage, ImageDecoder, ImageError as DecodeError, ImageFormat, ImageReader,
    Limits, RgbaImage,
};
use serde::{Deserialize, Serialize};

/// What an uploaded picture may cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ImageLimits {
    /// Encoded size, bytes.
    pub max_bytes: u64,
    /// Width times height.
    pub max_pixels: u64,
    /// Width or height, px.
    pub max_side_px: u32,
}

impl Default for ImageLimits {
    fn default() -> Self {
        Self { max_bytes: 32 << 20, max_pixels: 64_000_000, max_side_px: 16_384 }
    }
}

impl ImageLimits {
    /// Whether a picture of this size, as its header states it, may be decoded.
    pub fn admit(&self, width: u32, height: u32) -> bool {
        let pixels = u64::from(width) * u64::from(height);
        pixels <= self.max_pixels && width.max(height) <= self.max_side_px
    }

    /// Refuses a picture of a size that is not [admitted](Self::admit).
    pub(crate) fn expect(&self, width: u32, height: u32) -> Result<(), ImageError> {
        if self.admit(width, height) {
            return Ok(());
        }
        let Self { max_pixels, max_side_px, .. } = *self;
        Err(ImageError::TooManyPixels { width, height, max_pixels, max_side_px })
    }

    fn expect_bytes(&self, bytes: &[u8]) -> Result<(), ImageError> {
        let size = bytes.len() as u64;
        if size > self.max_bytes {
            return Err(ImageError::TooManyBytes { bytes: size, limit: self.max_bytes });
        }
        Ok(())
    }

    /// What reading a header may take: profiles and texts that inflate to more
    /// are refused.
    fn of_header() -> Limits {
        let mut limits = Limits::default();
        limits.max_alloc = Some(MAX_METADATA_BYTES);
        limits
    }

    /// As [`of_decoder`](Self::of_decoder), whichever way the picture lies.
    fn of_picture(width: u32, height: u32) -> Limits {
        let mut limits = Self::of_decoder(width, height);
        limits.max_image_width = Some(width.max(height));
        limits.max_image_height = Some(width.max(height));
        limits
    }

    /// What a decoder may take for a picture whose header states this size.
    pub fn of_decoder(width: u32, height: u32) -> Limits {
        let mut limits = Limits::default();
        limits.max_image_width = Some(width);
        limits.max_image_height = Some(height);
        // 16 bytes a pixel is the widest layout (32-bit float RGBA), twice for
        // the decoder's own copy.
        limits.max_alloc = Some(u64::from(width) * u64::from(height) * 32 + (1 << 20));
        limits
    }
}

/// The most that profiles and texts of a picture may inflate to, bytes.
const MAX_METADATA_BYTES: u64 = 8 << 20;

/// Why bytes are not a usable drawing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ImageError {
    /// The file is too large to be read.
    #[error("has {bytes} bytes, over the limit of {limit}")]
    TooManyBytes {
        /// Its size, bytes.
        bytes: u64,
        /// The most that is read, bytes.
        limit: u64,
    },
    /// The bytes begin as none of the accepted formats does.
    #[error("is not a PNG, JPEG, WebP, TIFF, GIF or SVG image")]
    NotAnImage,
    /// It is a picture, but of a kind that is not read.
    #[error("is {kind}, which is not read; {remedy}")]
    Unsupported {
        /// What it is.
        kind: &'static str,
        /// What to send instead.
        remedy: &'static str,
    },
    /// The picture is too large to be decoded.
    #[error("is {width}x{height}, over the limit of {max_pixels} pixels and {max_side_px} a side")]
    TooManyPixels {
        /// As the header states it, px.
        width: u32,
        /// As the header states it, px.
        height: u32,
        /// The most pixels that are decoded.
        max_pixels: u64,
        /// The longest side that is decoded, px.
        max_side_px: u32,
    },
    /// Its parts unpack to far more than its pixels need.
    #[error("has parts that unpack to {unpacked} bytes, over the limit of {limit} for its size")]
    Inflates {
        /// What they unpack to, bytes.
        unpacked: u64,
        /// The most for a picture of its size, bytes.
        limit: u64,
    },
    /// The decoder failed; its own message.
    #[error("is damaged or truncated: {0}")]
    Damaged(String),
}

/// The format of a picture, by its first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// One that has pixels of its own.
    Pixels(ImageFormat),
    /// SVG, which is drawn at its own size; small ones larger.
    Svg,
}

impl Format {
    /// The usual ending of such a file's name.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Svg => "svg",
            Self::Pixels(ImageFormat::Jpeg) => "jpg",
            Self::Pixels(ImageFormat::WebP) => "webp",
            Self::Pixels(ImageFormat::Tiff) => "tiff",
            Self::Pixels(ImageFormat::Gif) => "gif",
            Self::Pixels(_) => "png",
        }
    }
}

/// A decoded drawing.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    /// 8-bit grey, transparency laid on white.
    pub gray: GrayImage,
    /// Alpha, where the file has one that is not opaque everywhere.
    pub alpha: Option<GrayImage>,
}

/// Reads format and size from the header and holds them against `limits`,
/// without decoding any pixel. Width and height are those of the picture as it
/// is looked at, after the turn that its EXIF orientation asks for.
///
/// # Errors
/// All of [`ImageError`]; [`ImageError::Damaged`] if the header itself is cut.
pub fn inspect(bytes: &[u8], limits: &ImageLimits) -> Result<(Format, u32, u32), ImageError> {
    limits.expect_bytes(bytes)?;
    if is_svg(bytes) {
        let svg = Svg::parse(bytes, limits)?;
        return Ok((Format::Svg, svg.width, svg.height));
    }
    let (format, width, height) = inspect_pixels(bytes, limits)?;
    Ok((Format::Pixels(format), width, height))
}

fn inspect_pixels(
    bytes: &[u8],
    limits: &ImageLimits,
) -> Result<(ImageFormat, u32, u32), ImageError> {
    if let Some(kind) = kinds::not_read(bytes) {
        return Err(ImageError::Unsupported { kind, remedy: kinds::remedy(kind) });
    }
    let format = image::guess_format(bytes).map_err(|_| ImageError::NotAnImage)?;
    use ImageFormat::{Gif, Jpeg, Png, Tiff, WebP};
    if !matches!(format, Png | Jpeg | WebP | Tiff | Gif) {
        return Err(ImageError::NotAnImage);
    }
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(ImageLimits::of_header());
    let mut decoder = reader.into_decoder().map_err(damaged)?;
    let (width, height) = decoder.dimensions();
    limits.expect(width, height)?;
    if format == Tiff {
        expect_bounded_tiff(bytes)?;
    }
    if width == 0 || height == 0 {
        return Err(ImageError::Damaged("it has no pixels".to_owned()));
    }
    let (width, height) =
        if is_turned(orientation(&mut decoder)) { (height, width) } else { (width, height) };
    Ok((format, width, height))
}

/// Decodes a drawing to 8-bit grey after [`inspect`]ing it.
///
/// Grey is the Rec. 601 luma that OpenCV uses; what is transparent is laid on
/// white, the paper.
///
/// ```
/// use picture::{ImageError, ImageLimits, decode, png};
///
/// let paper = image::GrayImage::from_pixel(40, 30, image::Luma([255]));
/// let bytes = png(&paper).unwrap();
/// assert_eq!(decode(&bytes, &ImageLimits::default()).unwrap().gray, paper);
/// let tight = ImageLimits { max_side_px: 39, ..ImageLimits::default() };
/// assert!(matches!(decode(&bytes, &tight), Err(ImageError::TooManyPixels { .. })));
/// ```
///
/// # Errors
/// All of [`ImageError`].
pub fn decode(bytes: &[u8], limits: &ImageLimits) -> Result<Drawing, ImageError> {
    Ok(match decoded(bytes, limits)? {
        DynamicImage::ImageLuma8(gray) => Drawing { gray, alpha: None },
        other => flatten(&other.to_rgba8()),
    })
}

/// Decodes a drawing in colour, 8-bit sRGB with alpha, after [`inspect`]ing it.
///
/// # Errors
/// All of [`ImageError`].
pub fn decode_color(bytes: &[u8], limits: &ImageLimits) -> Result<RgbaImage, ImageError> {
    Ok(decoded(bytes, limits)?.into_rgba8())
}

/// The picture as it is looked at: turned as its EXIF orientation says.
fn decoded(bytes: &[u8], limits: &ImageLimits) -> Result<DynamicImage, ImageError> {
    limits.expect_bytes(bytes)?;
    if is_svg(bytes) {
        return Ok(Svg::parse(bytes, limits)?.rendered()?.into());
    }
    let (format, width, height) = inspect_pixels(bytes, limits)?;
    if let Some(kind) = kinds::several(bytes, format, ImageLimits::of_picture(width, height)) {
        return Err(ImageError::Unsupported { kind, remedy: kinds::ONE_BY_ONE });
    }
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(ImageLimits::of_header());
    let mut decoder = reader.into_decoder().map_err(damaged)?;
    let orientation = orientation(&mut decoder);
    decoder.set_limits(ImageLimits::of_picture(width, height)).map_err(damaged)?;
    let mut decoded = DynamicImage::from_decoder(decoder).map_err(damaged)?;
    if format == ImageFormat::Jpeg && is_cut_jpeg(bytes) {
        return Err(ImageError::Damaged("the end marker of the JPEG is missing".to_owned()));
    }
    decoded.apply_orientation(orientation);
    Ok(decoded)
}

/// How the picture must be turned to be looked at; as it is, where that cannot
/// be read.
fn orientation(decoder: &mut impl ImageDecoder) -> Orientation {
    decoder.orientation().unwrap_or(Orientation::NoTransforms)
}

/// Whether width and height change places.
fn is_turned(orientation: Orientation) -> bool {
    use Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
    matches!(orientation, Rotate90 | Rotate270 | Rotate90FlipH | Rotate270FlipH)
}

/// Lays a drawing on white paper: grey, and alpha where it is not opaque.
pub fn flatten(rgba: &RgbaImage) -> Drawing {
    let (width, height) = rgba.dimensions();
    let gray = GrayImage::from_fn(width, height, |x, y| {
        let [r, g, b, a] = rgba.get_pixel(x, y).0.map(u32::from);
        let luma = (299 * r + 587 * g + 114 * b + 500) / 1000;
        image::Luma([((luma * a + 255 * (255 - a) + 127) / 255) as u8])
    });
    let transparent = rgba.pixels().any(|pixel| pixel.0[3] < 255);
    let alpha = transparent.then(|| {
        GrayImage::from_fn(width, height, |x, y| image::Luma([rgba.get_pixel(x, y).0[3]]))
    });
    Drawing { gray, alpha }
}

/// Whether a JPEG has no end marker. The decoder fills what is missing with
/// grey and says nothing.
fn is_cut_jpeg(bytes: &[u8]) -> bool {
    const END: [u8; 2] = [0xff, 0xd9];
    const START_OF_SCAN: u8 = 0xda;
    let mut at = 2;
    // Past the segments before the picture: embedded previews end there too.
    while let Some(&[0xff, marker, high, low]) = bytes.get(at..at + 4) {
        if marker == START_OF_SCAN {
            break;
        }
        at += if marker == 0xff { 1 } else { 2 + usize::from(u16::from_be_bytes([high, low])) };
    }
    !bytes.get(at..).is_some_and(|rest| rest.windows(2).any(|pair| pair == END))
}

fn damaged(error: DecodeError) -> ImageError {
    match error {
        DecodeError::Unsupported(_) => ImageError::NotAnImage,
        other => ImageError::Damaged(other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Rgba, RgbaImage};

    fn encode(image: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image.into().write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    fn gradient() -> GrayImage {
        GrayImage::from_fn(32, 20, |x, y| image::Luma([(x * 7 + y) as u8]))
    }

    #[test]
    fn grey_png_comes_back_as_it_is() {
        let drawing =
            decode(&encode(gradient(), ImageFormat::Png), &ImageLimits::default()).unwrap();
        assert_eq!(drawing, Drawing { gray: gradient(), alpha: None });
    }

    #[test]
    fn transparency_becomes_paper_and_a_mask() {
        let image = RgbaImage::from_fn(4, 1, |x, _| match x {
            0 => Rgba([0, 0, 0, 0]),
            1 => Rgba([0, 0, 0, 255]),
            2 => Rgba([255, 0, 0, 255]),
            _ => Rgba([0, 0, 0, 51]),
        });
        let drawing = decode(&encode(image, ImageFormat::Png), &ImageLimits::default()).unwrap();
        assert_eq!(drawing.gray.as_raw(), &[255, 0, 76, 204]);
        assert_eq!(drawing.alpha.unwrap().as_raw(), &[0, 255, 255, 51]);
    }

    #[test]
    fn size_is_refused_from_the_header() {
        let png = encode(gradient(), ImageFormat::Png);
        let limits = ImageLimits { max_pixels: 639, ..ImageLimits::default() };
        let error = decode(&png[..64], &limits).unwrap_err();
        assert!(
            matches!(error, ImageError::TooManyPixels { width: 32, height: 20, .. }),
            "{error}"
        );
        let limits = ImageLimits { max_bytes: 10, ..ImageLimits::default() };
        assert!(matches!(decode(&png, &limits), Err(ImageError::TooManyBytes { .. })));
    }

    #[test]
    fn cut_files_are_damaged_whatever_the_format() {
        for format in [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::WebP, ImageFormat::Tiff] {
            let bytes = encode(gradient(), format);
            decode(&bytes, &ImageLimits::default()).unwrap();
            for kept in [bytes.len() / 2, bytes.len() * 2 / 3, bytes.len() - 20] {
                let error = decode(&bytes[..kept], &ImageLimits::default()).unwrap_err();
                assert!(matches!(error, ImageError::Damaged(_)), "{format:?} {kept}: {error}");
            }
        }
    }

    #[test]
    fn text_is_not_an_image() {
        let error = decode(b"a letter", &ImageLimits::default()).unwrap_err();
        assert_eq!(error, ImageError::NotAnImage);
        assert_eq!(decode(b"", &ImageLimits::default()).unwrap_err(), ImageError::NotAnImage);
    }
}
