//! Disparity and depth maps as pictures and as raw values.

use image::{GrayImage, ImageBuffer, Luma, Rgb, RgbImage};
use serde::Serialize;

use super::png::{EncodeError, dynamic_png, png};
use crate::FloatImage;
use crate::ValueRange;

/// The largest value of a 16-bit picture.
const WHITE_16: f64 = 65_535.0;

/// How a 16-bit depth picture is read: `depth_px = offset_px + scale_px * value`;
/// the value 0 is missing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DepthEncoding {
    /// Depth that a value of 0 would have, px.
    pub offset_px: f64,
    /// Depth from one value to the next, px.
    pub scale_px: f64,
}

impl DepthEncoding {
    /// Spreads `range` over the values 1 to 65535.
    fn of(range: ValueRange) -> Self {
        let (min, max) = (f64::from(range.min), f64::from(range.max));
        let scale_px = if max > min { (max - min) / (WHITE_16 - 1.0) } else { 1.0 };
        Self { offset_px: min - scale_px, scale_px }
    }

    fn value(self, depth_px: f32) -> u16 {
        if !depth_px.is_finite() {
            return 0;
        }
        let value = (f64::from(depth_px) - self.offset_px) / self.scale_px;
        value.round().clamp(1.0, WHITE_16) as u16
    }
}

/// Disparity as an 8-bit picture: the nearest is white, the farthest 1, and
/// what is missing black.
pub fn disparity_png(disparity: &FloatImage) -> Result<Vec<u8>, EncodeError> {
    let range = ValueRange::of(disparity).unwrap_or(ValueRange { min: 0.0, max: 0.0 });
    let span = if range.max > range.min { range.max - range.min } else { 1.0 };
    let (width, height) = disparity.dimensions();
    let picture = GrayImage::from_fn(width, height, |x, y| {
        let value = disparity.get_pixel(x, y).0[0];
        let grey = 1.0 + (value - range.min) / span * 254.0;
        Luma([if value.is_finite() { grey.round() as u8 } else { 0 }])
    });
    png(&picture)
}

/// Depth as a 16-bit picture and how to read it.
pub fn depth_png(depth: &FloatImage) -> Result<(Vec<u8>, DepthEncoding), EncodeError> {
    let range = ValueRange::of(depth).unwrap_or(ValueRange { min: 0.0, max: 0.0 });
    let encoding = DepthEncoding::of(range);
    let (width, height) = depth.dimensions();
    let picture = ImageBuffer::from_fn(width, height, |x, y| {
        Luma([encoding.value(depth.get_pixel(x, y).0[0])])
    });
    Ok((dynamic_png(&picture.into())?, encoding))
}

/// Unit normals as an 8-bit picture: red, green and blue are x, y and z from -1
/// to 1; black where there is none.
pub fn normals_png(normals: &ImageBuffer<Rgb<f32>, Vec<f32>>) -> Result<Vec<u8>, EncodeError> {
    let (width, height) = normals.dimensions();
    let picture = RgbImage::from_fn(width, height, |x, y| {
        let level = |n: f32| if n.is_finite() { ((n + 1.0) * 127.5).round() as u8 } else { 0 };
        Rgb(normals.get_pixel(x, y).0.map(level))
    });
    png(&picture)
}

/// The area of the subject: white inside.
pub fn silhouette_png(mask: &GrayImage) -> Result<Vec<u8>, EncodeError> {
    png(mask)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map() -> FloatImage {
        FloatImage::from_raw(3, 2, vec![1.0, f32::NAN, 3.5, -2.0, 0.25, 8.0]).unwrap()
    }

    #[test]
    fn near_is_white_and_missing_black() {
        let picture = image::load_from_memory(&disparity_png(&map()).unwrap()).unwrap().to_luma8();
        assert_eq!(picture.as_raw(), &[77, 0, 141, 1, 58, 255]);
    }

    #[test]
    fn depth_comes_back_within_half_a_step() {
        let (bytes, encoding) = depth_png(&map()).unwrap();
        let picture = image::load_from_memory(&bytes).unwrap().to_luma16();
        for (value, truth) in picture.iter().zip(map().iter()) {
            if truth.is_nan() {
                assert_eq!(*value, 0);
            } else {
                let depth = encoding.offset_px + encoding.scale_px * f64::from(*value);
                assert!((depth - f64::from(*truth)).abs() <= encoding.scale_px / 2.0 + 1e-9);
            }
        }
    }

    #[test]
    fn a_constant_or_empty_map_has_no_zero_scale() {
        let (bytes, encoding) = depth_png(&FloatImage::from_pixel(2, 1, Luma([5.0]))).unwrap();
        let picture = image::load_from_memory(&bytes).unwrap().to_luma16();
        assert_eq!(picture.as_raw(), &[1, 1]);
        assert_eq!(encoding.offset_px + encoding.scale_px, 5.0);
        let nothing = FloatImage::from_pixel(2, 1, Luma([f32::NAN]));
        let picture = image::load_from_memory(&depth_png(&nothing).unwrap().0).unwrap();
        assert_eq!(picture.to_luma16().as_raw(), &[0, 0]);
    }
}
