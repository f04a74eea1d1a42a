//! A page, or the frames of an animated GIF, decoded within limits.

use std::io::Cursor;

use image::codecs::gif::GifDecoder;
use image::{AnimationDecoder, ImageDecoder, ImageFormat, RgbaImage};
use picture::ImageLimits;

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

/// Decodes a picture of a page; of an animated GIF every frame that differs from
/// the one before it. All frames together have at most `limits.max_pixels`.
///
/// # Errors
/// [`AnimationError`] for what is no picture, is damaged or over the limits.
pub fn decode(
    bytes: &[u8],
    limits: &ImageLimits,
    max_frames: usize,
) -> Result<Vec<RgbaImage>, AnimationError> {
    let frames = match image::guess_format(bytes) {
        Ok(ImageFormat::Gif) => frames(bytes, limits, max_frames)?,
        _ => Vec::new(),
    };
    if frames.is_empty() { Ok(vec![picture::decode_color(bytes, limits)?]) } else { Ok(frames) }
}

fn frames(
    bytes: &[u8],
    limits: &ImageLimits,
    max_frames: usize,
) -> Result<Vec<RgbaImage>, AnimationError> {
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
    Ok(frames)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::codecs::gif::GifEncoder;
    use image::{Frame, Rgba};

    fn gif(levels: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = GifEncoder::new(&mut bytes);
        for level in levels {
            let picture = RgbaImage::from_pixel(20, 10, Rgba([*level, *level, *level, 255]));
            encoder.encode_frame(Frame::new(picture)).unwrap();
        }
        drop(encoder);
        bytes
    }

    #[test]
    fn frames_that_repeat_count_once_and_too_many_are_refused() {
        let limits = ImageLimits::default();
        assert_eq!(decode(&gif(&[0, 0, 90, 200, 0]), &limits, 36).unwrap().len(), 3);
        assert_eq!(decode(&gif(&[7]), &limits, 36).unwrap().len(), 1);
        let refused = decode(&gif(&[0, 90, 200]), &limits, 2);
        assert_eq!(refused, Err(AnimationError::TooManyFrames { limit: 2 }));
        let tight = ImageLimits { max_pixels: 399, ..limits };
        assert!(decode(&gif(&[0, 90]), &tight, 36).is_err());
        assert!(decode(b"GIF89a", &limits, 36).is_err());
        assert!(decode(b"", &limits, 36).is_err());
    }
}
