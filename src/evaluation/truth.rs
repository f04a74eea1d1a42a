use std::io::Cursor;

use image::{DynamicImage, ImageFormat, ImageReader};

use super::view::{ViewTruth, disparity_from_depth, disparity_from_pair};
use crate::float_image::{FloatImage, PfmError, decode_pfm};
use crate::sheet::ImageLimits;

/// Float pictures write "nothing here" as a number this large or larger.
const FLOAT_NOTHING: f32 = 1e9;

/// How a picture of true values stores them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TruthEncoding {
    Png8,
    Png16,
    Pfm,
    Exr,
}

/// A picture of true values as stored: counts of a PNG or floats.
#[derive(Clone, Debug, PartialEq)]
pub struct RawTruth {
    pub encoding: TruthEncoding,
    /// NaN where the picture has nothing: 0 in a PNG, what is transparent, and
    /// what is not finite or at least 1e9 in a float picture.
    pub values: FloatImage,
}

/// Why bytes are not a picture of true values.
#[derive(Debug, thiserror::Error)]
pub enum TruthError {
    #[error("has {bytes} bytes, over the limit of {limit}")]
    TooManyBytes { bytes: u64, limit: u64 },
    #[error("is not a PNG, PFM or EXR picture")]
    UnknownFormat,
    #[error("is {width}x{height}, over the limit of {max_pixels} pixels and {max_side_px} a side")]
    TooManyPixels { width: u32, height: u32, max_pixels: u64, max_side_px: u32 },
    #[error(transparent)]
    Pfm(#[from] PfmError),
    #[error("is damaged or of a kind that cannot be read: {0}")]
    Damaged(String),
}

/// Decodes a picture of true depth or disparity: 8- or 16-bit PNG, PFM, EXR.
///
/// Colour PNGs are read as grey, of an EXR the red channel.
///
/// # Errors
/// [`TruthError`] for anything else, for damaged files and over `limits`.
pub fn decode_truth(bytes: &[u8], limits: &ImageLimits) -> Result<RawTruth, TruthError> {
    let size = bytes.len() as u64;
    if size > limits.max_bytes {
        return Err(TruthError::TooManyBytes { bytes: size, limit: limits.max_bytes });
    }
    let (encoding, mut values) = if bytes.starts_with(b"Pf") || bytes.starts_with(b"PF") {
        (TruthEncoding::Pfm, decode_pfm(bytes, limits.max_pixels, limits.max_side_px)?)
    } else {
        floats_of(&decode_image(bytes, limits)?)
    };
    for image::Luma([value]) in values.pixels_mut() {
        let counted = matches!(encoding, TruthEncoding::Png8 | TruthEncoding::Png16);
        if !value.is_finite() || value.abs() >= FLOAT_NOTHING || (counted && *value == 0.0) {
            *value = f32::NAN;
        }
    }
    Ok(RawTruth { encoding, values })
}

fn decode_image(bytes: &[u8], limits: &ImageLimits) -> Result<DynamicImage, TruthError> {
    let format = image::guess_format(bytes)
        .ok()
        .filter(|format| matches!(format, ImageFormat::Png | ImageFormat::OpenExr))
        .ok_or(TruthError::UnknownFormat)?;
    let reader = || ImageReader::with_format(Cursor::new(bytes), format);
    let (width, height) = reader().into_dimensions().map_err(damaged)?;
    if !limits.admit(width, height) {
        return Err(TruthError::TooManyPixels {
            width,
            height,
            max_pixels: limits.max_pixels,
            max_side_px: limits.max_side_px,
        });
    }
    let mut reader = reader();
    reader.limits(ImageLimits::of_decoder(width, height));
    reader.decode().map_err(damaged)
}

fn damaged(error: image::ImageError) -> TruthError {
    TruthError::Damaged(error.to_string())
}

fn floats_of(image: &DynamicImage) -> (TruthEncoding, FloatImage) {
    let (width, height) = (image.width(), image.height());
    let from = |value: &dyn Fn(u32, u32) -> f32| {
        FloatImage::from_fn(width, height, |x, y| image::Luma([value(x, y)]))
    };
    let opaque = |alpha: f32, value: f32| if alpha >= 0.5 { value } else { f32::NAN };
    match image {
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
            let colours = image.to_rgba32f();
            (TruthEncoding::Exr, from(&|x, y| colours.get_pixel(x, y).0[0]))
        }
        DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_) => {
            let grey = image.to_luma_alpha16();
            let value = |x, y| {
                let [value, alpha] = grey.get_pixel(x, y).0.map(f32::from);
                opaque(alpha / 65535.0, value)
            };
            (TruthEncoding::Png16, from(&value))
        }
        _ => {
            let grey = image.to_luma_alpha8();
            let value = |x, y| {
                let [value, alpha] = grey.get_pixel(x, y).0.map(f32::from);
                opaque(alpha / 255.0, value)
            };
            (TruthEncoding::Png8, from(&value))
        }
    }
}

/// What turns stored depth into sheet pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthScale {
    /// Stored counts a scene unit.
    pub counts_per_unit: f64,
    /// From the camera plane to the turntable axis, scene units.
    pub camera_distance: f64,
    /// Sheet pixels a scene unit.
    pub pixels_per_unit: f64,
}

impl RawTruth {
    /// Reads the values as depth, the distance from the camera plane.
    ///
    /// Without a `scale` only the order of depths is known. What is not in
    /// front of the camera plane counts as missing.
    pub fn as_depth(&self, scale: Option<DepthScale>) -> ViewTruth {
        let depth = |to_px: &dyn Fn(f64) -> f64| {
            let mut map = self.values.clone();
            for image::Luma([value]) in map.pixels_mut() {
                let in_front = *value > 0.0;
                *value = if in_front { to_px(f64::from(*value)) as f32 } else { f32::NAN };
            }
            map
        };
        match scale {
            Some(scale) => ViewTruth::Metric(disparity_from_depth(&depth(&|count| {
                (count / scale.counts_per_unit - scale.camera_distance) * scale.pixels_per_unit
            }))),
            None => ViewTruth::Relative(depth(&|count| -count)),
        }
    }

    /// Reads the values as disparity, nearer being larger.
    ///
    /// * `pair_deg`: the angle of the pair whose disparity it is in px, 5 in
    ///   the dissertation's sheets; `None` for an 8-bit ramp or the like.
    pub fn as_disparity(&self, pair_deg: Option<f64>) -> ViewTruth {
        match pair_deg {
            Some(pair_deg) => ViewTruth::Metric(disparity_from_pair(&self.values, pair_deg)),
            None => ViewTruth::Relative(self.values.clone()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayImage, ImageBuffer, Luma, Rgb, Rgb32FImage, RgbaImage};

    fn encode(image: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image.into().write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    fn decode(bytes: &[u8]) -> RawTruth {
        decode_truth(bytes, &ImageLimits::default()).unwrap()
    }

    #[test]
    fn sixteen_bit_depth_becomes_disparity() {
        let counts: ImageBuffer<Luma<u16>, _> =
            ImageBuffer::from_raw(3, 1, vec![0, 7 * 4096, 9 * 4096]).unwrap();
        let raw = decode(&encode(counts, ImageFormat::Png));
        assert_eq!(raw.encoding, TruthEncoding::Png16);
        let scale =
            DepthScale { counts_per_unit: 4096.0, camera_distance: 8.0, pixels_per_unit: 100.0 };
        let ViewTruth::Metric(map) = raw.as_depth(Some(scale)) else { panic!("not metric") };
        let px = 100.0 * 5.0_f32.to_radians().sin();
        assert!(map.as_raw()[0].is_nan());
        assert!((map.as_raw()[1] - px).abs() < 1e-4);
        assert!((map.as_raw()[2] + px).abs() < 1e-4);
    }

    #[test]
    fn an_eight_bit_ramp_is_relative() {
        let ramp = GrayImage::from_raw(3, 1, vec![0, 100, 255]).unwrap();
        let raw = decode(&encode(ramp, ImageFormat::Png));
        assert_eq!(raw.encoding, TruthEncoding::Png8);
        let ViewTruth::Relative(map) = raw.as_disparity(None) else { panic!("not relative") };
        assert_eq!(map.as_raw()[1..], [100.0, 255.0]);
        let ViewTruth::Relative(map) = raw.as_depth(None) else { panic!("not relative") };
        assert_eq!(map.as_raw()[1..], [-100.0, -255.0]);
    }

    #[test]
    fn what_is_transparent_is_missing() {
        let image = RgbaImage::from_raw(2, 1, vec![9, 9, 9, 255, 9, 9, 9, 0]).unwrap();
        let raw = decode(&encode(image, ImageFormat::Png));
        assert_eq!(raw.values.as_raw()[0], 9.0);
        assert!(raw.values.as_raw()[1].is_nan());
    }

    #[test]
    fn float_pictures_keep_their_values() {
        let exr = Rgb32FImage::from_fn(2, 1, |x, _| Rgb([[2.5, 1e10][x as usize], 7.0, 7.0]));
        let raw = decode(&encode(exr, ImageFormat::OpenExr));
        assert_eq!(raw.encoding, TruthEncoding::Exr);
        assert_eq!(raw.values.as_raw()[0], 2.5);
        assert!(raw.values.as_raw()[1].is_nan());
        let mut pfm = b"Pf\n3 1\n-1\n".to_vec();
        pfm.extend([0.0_f32, -1.5, f32::INFINITY].into_iter().flat_map(f32::to_le_bytes));
        let raw = decode(&pfm);
        let ViewTruth::Metric(map) = raw.as_disparity(Some(5.0)) else { panic!("not metric") };
        assert_eq!(map.as_raw()[..2], [0.0, -1.5]);
        assert!(map.as_raw()[2].is_nan());
    }

    #[test]
    fn limits_and_damage_are_named() {
        let png = encode(GrayImage::new(30, 20), ImageFormat::Png);
        let small = ImageLimits { max_side_px: 29, ..ImageLimits::default() };
        let refuse = |bytes: &[u8], limits: &ImageLimits| decode_truth(bytes, limits).unwrap_err();
        assert!(matches!(refuse(&png, &small), TruthError::TooManyPixels { width: 30, .. }));
        let short = ImageLimits { max_bytes: 10, ..ImageLimits::default() };
        assert!(matches!(refuse(&png, &short), TruthError::TooManyBytes { .. }));
        let all = ImageLimits::default();
        assert!(matches!(refuse(b"Pf\n1 1\n", &all), TruthError::Pfm(_)));
        assert!(matches!(refuse(b"GIF89a", &all), TruthError::UnknownFormat));
        assert!(matches!(refuse(b"", &all), TruthError::UnknownFormat));
        let exr = encode(Rgb32FImage::new(30, 20), ImageFormat::OpenExr);
        for file in [&png, &exr] {
            let cut = &file[..file.len() / 2];
            assert!(matches!(refuse(cut, &all), TruthError::Damaged(_)));
        }
    }
}
