//! The frames of an animated GIF, decoded within limits.

use std::io::Cursor;

use image::codecs::gif::GifDecoder;
use image::{AnimationDecoder, ImageDecoder, ImageFormat, RgbaImage};
use picture::ImageLimits;

/// An animation's frames that differ from the ones before them.
#[derive(Clone, Debug)]
pub struct Animation {
    /// In order, each of the animation's size.
    pub frames: Vec<RgbaImage>,
}

/// Why an animation is not read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AnimationError {
    /// It is no picture, or a larger one than is read.
    #[error(transparent)]
    Picture(#[from] picture::ImageError),
    /// There are more frames than are read.
    #[error("has more than {limit} frames")]
    TooManyFrames {
        /// The most.
        limit: usize,
    },
}

/// Decodes an animated GIF; `None` if `bytes` are something else, or have one
/// frame. All frames together have at most `limits.max_pixels`.
///
/// # Errors
/// [`AnimationError`] for damaged files and those over the limits.
pub fn animation(
    bytes: &[u8],
    limits: &ImageLimits,
    max_frames: usize,
) -> Result<Option<Animation>, AnimationError> {
    if image::guess_format(bytes).ok() != Some(ImageFormat::Gif) {
        return Ok(None);
    }
    let (_, width, height) = picture::inspect(bytes, limits)?;
    let damaged = |error: image::ImageError| picture::ImageError::Damaged(error.to_string());
    let mut decoder = GifDecoder::new(Cursor::new(bytes)).map_err(damaged)?;
    decoder.set_limits(ImageLimits::of_decoder(width, height)).map_err(damaged)?;
    let pixels = u64::from(width) * u64::from(height);
    let most = (limits.max_pixels / pixels.max(1)).min(max_frames as u64) as usize;
    let mut frames: Vec<RgbaImage> = Vec::new();
    // Repeated frames are read too: so many in all.
    for (index, frame) in decoder.into_frames().enumerate() {
        if index >= 8 * max_frames.max(1) {
            return Err(AnimationError::TooManyFrames { limit: 8 * max_frames });
        }
        let frame = frame.map_err(damaged)?.into_buffer();
        if frames.last() == Some(&frame) {
            continue;
        }
        if frames.len() >= most {
            return Err(AnimationError::TooManyFrames { limit: most });
        }
        frames.push(frame);
    }
    // A loop often ends as it began.
    if frames.len() > 2 && frames.first() == frames.last() {
        frames.pop();
    }
    Ok((frames.len() > 1).then_some(Animation { frames }))
}
