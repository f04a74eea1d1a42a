//! The one PNG encoder.

use std::io::Cursor;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{DynamicImage, ExtendedColorType, ImageBuffer, ImageEncoder, PixelWithColorType};

/// A file could not be encoded.
#[derive(Debug, thiserror::Error)]
#[error("{what} could not be encoded: {reason}")]
pub struct EncodeError {
    /// What was to be encoded, such as `matches`.
    pub what: &'static str,
    /// The encoder's own message.
    pub reason: String,
}

impl EncodeError {
    /// `what` could not be encoded, for the `reason` that the encoder gives.
    pub fn new(what: &'static str, reason: impl ToString) -> Self {
        Self { what, reason: reason.to_string() }
    }
}

/// Encodes a picture of 8-bit channels.
pub fn png<P>(picture: &ImageBuffer<P, Vec<u8>>) -> Result<Vec<u8>, EncodeError>
where
    P: PixelWithColorType<Subpixel = u8>,
{
    let (width, height) = picture.dimensions();
    encode(picture.as_raw(), width, height, P::COLOR_TYPE)
}

/// Encodes a picture of any kind that PNG knows.
///
/// # Errors
/// [`EncodeError`] for float pictures, which PNG has none of.
pub fn dynamic_png(picture: &DynamicImage) -> Result<Vec<u8>, EncodeError> {
    encode(picture.as_bytes(), picture.width(), picture.height(), picture.color().into())
}

fn encode(
    bytes: &[u8],
    width: u32,
    height: u32,
    color: ExtendedColorType,
) -> Result<Vec<u8>, EncodeError> {
    let mut png = Cursor::new(Vec::new());
    PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Sub)
        .write_image(bytes, width, height, color)
        .map_err(|error| EncodeError::new("a picture", error))?;
    Ok(png.into_inner())
}
