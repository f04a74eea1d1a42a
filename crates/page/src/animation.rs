//! A page, or the frames of an animation and the pages of a TIFF, decoded within limits.

use std::io::Cursor;

use image::codecs::gif::GifDecoder;
use image::codecs::png::PngDecoder;
use image::codecs::webp::WebPDecoder;
use image::{AnimationDecoder, ImageDecoder, ImageFormat, RgbaImage};
use picture::{Format, ImageLimits};

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

/// Decodes a picture of a page; of an animated GIF, PNG or WebP every frame, and of a TIFF every
/// page, that differs from the one before it. All together have at most `limits.max_pixels`.
///
/// # Errors
/// [`AnimationError`] for what is no picture, is damaged or over the limits.
pub fn decode(
    bytes: &[u8],
    limits: &ImageLimits,
    max_frames: usize,
) -> Result<Vec<RgbaImage>, AnimationError> {
    let (format, width, height) = picture::inspect(bytes, limits)?;
    let pixels = u64::from(width) * u64::from(height);
    let most = (limits.max_pixels / pixels.max(1)).min(max_frames as u64) as usize;
    let frames = match format {
        Format::Pixels(ImageFormat::Gif) => {
            let mut decoder = GifDecoder::new(Cursor::new(bytes)).map_err(damaged)?;
            decoder.set_limits(ImageLimits::of_decoder(width, height)).map_err(damaged)?;
            distinct(animated(decoder), max_frames, most)?
        }
        Format::Pixels(ImageFormat::Png) => {
            let limits = ImageLimits::of_decoder(width, height);
            let decoder = PngDecoder::with_limits(Cursor::new(bytes), limits).map_err(damaged)?;
            if decoder.is_apng().map_err(damaged)? {
                distinct(animated(decoder.apng().map_err(damaged)?), max_frames, most)?
            } else {
                Vec::new()
            }
        }
        Format::Pixels(ImageFormat::WebP) => {
            let decoder = WebPDecoder::new(Cursor::new(bytes)).map_err(damaged)?;
            if decoder.has_animation() {
                distinct(animated(decoder), max_frames, most)?
            } else {
                Vec::new()
            }
        }
        Format::Pixels(ImageFormat::Tiff) => {
            let pages = picture::tiff_pages_apart(bytes);
            distinct(pages.map(|page| picture::decode_color(&page, limits)), max_frames, most)?
        }
        Format::Pixels(_) | Format::Svg => Vec::new(),
    };
    if frames.is_empty() { Ok(vec![picture::decode_color(bytes, limits)?]) } else { Ok(frames) }
}

fn damaged(error: image::ImageError) -> picture::ImageError {
    picture::ImageError::Damaged(error.to_string())
}

fn animated<'a>(
    decoder: impl AnimationDecoder<'a>,
) -> impl Iterator<Item = Result<RgbaImage, picture::ImageError>> {
    decoder.into_frames().map(|frame| Ok(frame.map_err(damaged)?.into_buffer()))
}

/// Frames that are not as the one before.
///
/// * `most`: with more, the file is refused.
fn distinct(
    all: impl Iterator<Item = Result<RgbaImage, picture::ImageError>>,
    max_frames: usize,
    most: usize,
) -> Result<Vec<RgbaImage>, AnimationError> {
    let mut frames: Vec<RgbaImage> = Vec::new();
    // Repeated frames are read too: so many in all.
    for (index, frame) in all.enumerate() {
        if index >= 8 * max_frames.max(1) {
            return Err(AnimationError::TooManyFrames { limit: 8 * max_frames });
        }
        let frame = frame?;
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

    fn levels(bytes: &[u8]) -> Vec<u8> {
        let frames = decode(bytes, &ImageLimits::default(), 36).unwrap();
        frames.iter().map(|frame| frame.get_pixel(3, 3).0[0]).collect()
    }

    /// An APNG of three frames, put together from three PNGs: fcTL before each picture, whose
    /// data is fdAT from the second on.
    fn apng(levels: &[u8]) -> Vec<u8> {
        let crc = |data: &[u8]| {
            let table = |byte: u32| (0..8).fold(byte, |c, _| c >> 1 ^ (0xedb8_8320 * (c & 1)));
            !data.iter().fold(!0_u32, |c, b| c >> 8 ^ table((c ^ u32::from(*b)) & 0xff))
        };
        let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
        let push = |file: &mut Vec<u8>, kind: &[u8], data: &[u8]| {
            let body = [kind, data].concat();
            file.extend((data.len() as u32).to_be_bytes());
            file.extend(&body);
            file.extend(crc(&body).to_be_bytes());
        };
        let mut sequence = 0_u32;
        for (index, level) in levels.iter().enumerate() {
            let picture = image::GrayImage::from_pixel(20, 10, image::Luma([*level]));
            let png = picture::png(&picture).unwrap();
            let chunk = |kind: &[u8]| {
                let mut at = 8;
                loop {
                    let length = u32::from_be_bytes(png[at..at + 4].try_into().unwrap()) as usize;
                    if &png[at + 4..at + 8] == kind {
                        return png[at + 8..at + 8 + length].to_vec();
                    }
                    at += 12 + length;
                }
            };
            if index == 0 {
                push(&mut file, b"IHDR", &chunk(b"IHDR"));
                let frames = levels.len() as u32;
                push(&mut file, b"acTL", &[frames.to_be_bytes(), [0; 4]].concat());
            }
            let mut control = Vec::new();
            [sequence, 20, 10, 0, 0].iter().for_each(|n: &u32| control.extend(n.to_be_bytes()));
            control.extend([0, 1, 0, 10, 0, 0]);
            push(&mut file, b"fcTL", &control);
            sequence += 1;
            if index == 0 {
                push(&mut file, b"IDAT", &chunk(b"IDAT"));
            } else {
                let data = [sequence.to_be_bytes().to_vec(), chunk(b"IDAT")].concat();
                push(&mut file, b"fdAT", &data);
                sequence += 1;
            }
        }
        push(&mut file, b"IEND", &[]);
        file
    }

    #[test]
    fn animated_pngs_are_read_frame_by_frame() {
        assert_eq!(levels(&apng(&[9, 90, 200])), [9, 90, 200]);
        assert_eq!(levels(&apng(&[9, 9, 200, 9])), [9, 200]);
        let limits = ImageLimits { max_pixels: 399, ..ImageLimits::default() };
        let refused = decode(&apng(&[9, 90, 200]), &limits, 36);
        assert_eq!(refused, Err(AnimationError::TooManyFrames { limit: 1 }));
    }

    /// An animated WebP of lossless frames.
    fn webp(levels: &[u8]) -> Vec<u8> {
        let chunk = |kind: &[u8], data: &[u8]| {
            let mut bytes = [kind, &(data.len() as u32).to_le_bytes(), data].concat();
            bytes.resize(bytes.len().next_multiple_of(2), 0);
            bytes
        };
        let three = |number: u32| number.to_le_bytes()[..3].to_vec();
        let size = [three(19), three(9)].concat();
        let mut body = b"WEBP".to_vec();
        body.extend(chunk(b"VP8X", &[vec![2, 0, 0, 0], size.clone()].concat()));
        body.extend(chunk(b"ANIM", &[0; 6]));
        for level in levels {
            let picture = image::RgbImage::from_pixel(20, 10, image::Rgb([*level; 3]));
            let mut still = Cursor::new(Vec::new());
            picture.write_to(&mut still, ImageFormat::WebP).unwrap();
            let frame = [three(0), three(0), size.clone(), three(100), vec![2]].concat();
            // Past RIFF, size and WEBP: the picture's own chunk.
            body.extend(chunk(b"ANMF", &[&frame, &still.get_ref()[12..]].concat()));
        }
        chunk(b"RIFF", &body)
    }

    #[test]
    fn animated_webps_are_read_frame_by_frame() {
        assert_eq!(levels(&webp(&[9, 90, 200])), [9, 90, 200]);
        assert_eq!(levels(&webp(&[90])), [90]);
    }

    /// A TIFF of several pages, each of one strip of grey bytes.
    fn tiff(levels: &[u8]) -> Vec<u8> {
        let mut file = b"II*\0".to_vec();
        let mut link = file.len();
        file.extend([0; 4]);
        for level in levels {
            let strip = file.len() as u32;
            file.extend(vec![*level; 200]);
            let page = file.len() as u32;
            file[link..link + 4].copy_from_slice(&page.to_le_bytes());
            let tags: [(u16, u32); 9] = [
                (256, 20),
                (257, 10),
                (258, 8),
                (259, 1),
                (262, 1),
                (273, strip),
                (277, 1),
                (278, 10),
                (279, 200),
            ];
            file.extend((tags.len() as u16).to_le_bytes());
            for (tag, value) in tags {
                file.extend(tag.to_le_bytes());
                file.extend([4, 0, 1, 0, 0, 0]);
                file.extend(value.to_le_bytes());
            }
            link = file.len();
            file.extend([0; 4]);
        }
        file
    }

    #[test]
    fn pages_of_a_tiff_are_read_one_by_one() {
        assert_eq!(levels(&tiff(&[9, 90, 200])), [9, 90, 200]);
        assert_eq!(levels(&tiff(&[90])), [90]);
        // A circle of pages ends.
        let mut circle = tiff(&[9, 90]);
        let end = circle.len() - 4;
        let first: [u8; 4] = circle[4..8].try_into().unwrap();
        circle[end..].copy_from_slice(&first);
        let refused = decode(&circle, &ImageLimits::default(), 36);
        assert!(matches!(refused, Err(AnimationError::TooManyFrames { .. })), "{refused:?}");
    }
}
