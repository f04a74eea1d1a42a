//! Pictures of true depth or disparity, decoded from untrusted bytes.

use std::io::Cursor;

use image::{DynamicImage, ImageFormat, ImageReader};
use serde::Serialize;

use super::view::{ViewTruth, disparity_from_depth, disparity_from_pairs};
use picture::{FloatImage, ImageError, ImageLimits, PfmError, decode_pfm};
use sheet::{SheetDocument, TruthKind};

/// Float pictures write "nothing here" as a number this large or larger.
const FLOAT_NOTHING: f32 = 1e9;

/// How a picture of true values stores them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TruthEncoding {
    /// PNG of 8 bits a channel.
    Png8,
    /// PNG of 16 bits a channel.
    Png16,
    /// Portable float map of one channel.
    Pfm,
    /// OpenEXR.
    Exr,
}

/// A picture of true values as stored: counts of a PNG or floats.
#[derive(Clone, Debug, PartialEq)]
pub struct RawTruth {
    /// The format it was stored in.
    pub encoding: TruthEncoding,
    /// NaN where the picture has nothing: 0 in a PNG, what is transparent, and
    /// what is not finite or at least 1e9 in a float picture.
    pub values: FloatImage,
}

/// Why bytes are not a picture of true values.
#[derive(Debug, thiserror::Error)]
pub enum TruthError {
    /// The file is too large to be read.
    #[error("has {bytes} bytes, over the limit of {limit}")]
    TooManyBytes {
        /// Its size, bytes.
        bytes: u64,
        /// The most that is read, bytes.
        limit: u64,
    },
    /// The bytes begin as none of the accepted formats does.
    #[error("is not a PNG, PFM or EXR picture")]
    UnknownFormat,
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
    /// The PFM picture is malformed or too large.
    #[error(transparent)]
    Pfm(#[from] PfmError),
    /// Its parts unpack to far more than its pixels need.
    #[error(transparent)]
    Inflates(ImageError),
    /// The decoder failed; its own message.
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
    if format == ImageFormat::OpenExr {
        picture::expect_bounded_exr(bytes).map_err(|error| match error {
            ImageError::Damaged(cause) => TruthError::Damaged(cause),
            other => TruthError::Inflates(other),
        })?;
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
        // Depths from the axis plane itself have either sign.
        let signed = scale.is_some_and(|scale| scale.camera_distance == 0.0);
        let depth = |to_px: &dyn Fn(f64) -> f64| {
            let mut map = self.values.clone();
            for image::Luma([value]) in map.pixels_mut() {
                let in_front = *value > 0.0 || signed;
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

    /// Reads the values as disparity.
    ///
    /// * `pair_deg`: the signed angle from the view to the one that the
    ///   disparity is towards: how far to the left each point moves, px. `None`
    ///   for an 8-bit ramp or the like, nearer being larger.
    pub fn as_disparity(&self, pair_deg: Option<f64>) -> ViewTruth {
        let Some(pair_deg) = pair_deg else { return ViewTruth::Relative(self.values.clone()) };
        let mut values = self.values.clone();
        if pair_deg < 0.0 {
            // Towards a view behind, nearer is smaller.
            values.iter_mut().for_each(|value| *value = -*value);
        }
        ViewTruth::Metric(disparity_from_pairs(&values, &[pair_deg]))
    }

    /// Reads the values as the sheet says: in px where its scale is known.
    pub fn of_sheet(&self, kind: TruthKind, document: &SheetDocument) -> ViewTruth {
        let truth = document.truth.clone().unwrap_or_default();
        match kind {
            TruthKind::Disparity => self.as_disparity(truth.disparity_pair_deg),
            TruthKind::Depth => {
                let counts_per_unit = match self.encoding {
                    TruthEncoding::Png8 | TruthEncoding::Png16 => truth.depth_counts_per_unit,
                    TruthEncoding::Pfm | TruthEncoding::Exr => Some(1.0),
                };
                let scale = counts_per_unit.zip(truth.camera_distance);
                let scale = scale.zip(document.pixels_per_unit);
                self.as_depth(scale.map(|((counts_per_unit, camera_distance), pixels_per_unit)| {
                    DepthScale { counts_per_unit, camera_distance, pixels_per_unit }
                }))
            }
        }
    }
}

impl TruthEncoding {
    /// The usual ending of such a file's name.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Png8 | Self::Png16 => "png",
            Self::Pfm => "pfm",
            Self::Exr => "exr",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayImage, ImageBuffer, Luma, Rgb, Rgb32FImage, RgbaImage};
    use sheet::TruthDocument;

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
        let ViewTruth::Relative(map) = raw.as_disparity(None) else { panic!("not relative") };
        assert_eq!(map.as_raw()[..2], [0.0, -1.5]);
        assert!(map.as_raw()[2].is_nan());
    }

    /// A point at x and d moves by x (1 - cos t) - d sin t towards the view at t.
    #[test]
    fn disparity_towards_a_neighbour_is_depth_again() {
        let (x, d) = ([-1.0, 0.0, 1.0], [40.0, -30.0, 7.0]);
        for t in [15.0_f64, -10.0] {
            let (sin, cos) = t.to_radians().sin_cos();
            let towards = |i: usize| (x[i] * (1.0 - cos) - d[i] * sin) as f32;
            let values = FloatImage::from_raw(3, 1, (0..3).map(towards).collect()).unwrap();
            let raw = RawTruth { encoding: TruthEncoding::Pfm, values };
            let ViewTruth::Metric(map) = raw.as_disparity(Some(t)) else { panic!("not metric") };
            for (found, d) in map.iter().zip(d) {
                let expected = -d * 5.0_f64.to_radians().sin();
                assert!((f64::from(*found) - expected).abs() < 1e-4, "{found} for {expected}");
            }
        }
    }

    #[test]
    fn the_sheet_says_how_pictures_are_read() {
        let values = FloatImage::from_raw(2, 1, vec![7.0, 9.0]).unwrap();
        let read = |encoding, kind, truth: TruthDocument| {
            let document = SheetDocument {
                pixels_per_unit: Some(10.0),
                truth: Some(truth),
                ..SheetDocument::default()
            };
            RawTruth { encoding, values: values.clone() }.of_sheet(kind, &document)
        };
        let placed = TruthDocument { camera_distance: Some(8.0), ..TruthDocument::default() };
        let units = read(TruthEncoding::Pfm, TruthKind::Depth, placed.clone());
        let near = (10.0 * 5.0_f64.to_radians().sin()) as f32;
        let ViewTruth::Metric(map) = units else { panic!("not metric") };
        assert!((map.as_raw()[0] - near).abs() < 1e-5 && (map.as_raw()[1] + near).abs() < 1e-5);
        // Counts of a PNG are of no known size.
        let counts = read(TruthEncoding::Png16, TruthKind::Depth, placed);
        assert!(matches!(counts, ViewTruth::Relative(map) if map.as_raw() == &[-7.0, -9.0]));
        let ramp = read(TruthEncoding::Png8, TruthKind::Disparity, TruthDocument::default());
        assert_eq!(ramp, ViewTruth::Relative(values.clone()));
    }

    #[test]
    fn depths_from_the_axis_plane_have_either_sign() {
        let values = FloatImage::from_raw(2, 1, vec![-3.0, 4.0]).unwrap();
        let raw = RawTruth { encoding: TruthEncoding::Pfm, values };
        let scale = DepthScale { counts_per_unit: 1.0, camera_distance: 0.0, pixels_per_unit: 1.0 };
        let ViewTruth::Metric(map) = raw.as_depth(Some(scale)) else { panic!("not metric") };
        assert!(map.iter().all(|value| value.is_finite()));
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
