//! Keypoints and their descriptors.

use image::GrayImage;
use nalgebra::Point2;
use opencv::core::{
    KeyPoint, KeyPointTraitConst, Mat, MatTraitConst, MatTraitConstManual, Ptr, ToInputArray,
    Vector,
};
use opencv::features2d::{
    FastFeatureDetector, FastFeatureDetector_DetectorType, Feature2DTrait, GFTTDetector,
    KeyPointsFilter, ORB, ORB_ScoreType, SIFT,
};
use serde::Serialize;

use super::cv::{self, OpenCvError};
use super::surf::{self, SurfKeypoint};
use crate::options::{Descriptor, DetectionOptions, Detector, OrbOptions, SiftOptions};

/// Detectors without a limit of their own keep the strongest of this many, as
/// the options allow others at most.
const MAX_KEYPOINTS: usize = 100_000;

/// A distinctive place of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Keypoint {
    /// Pixels, pixel centres at integers.
    pub position: Point2<f32>,
    /// Diameter of the described neighbourhood, px.
    pub size_px: f32,
    /// Orientation, degrees clockwise from the x axis; -1 without.
    pub angle_deg: f32,
    /// The detector's own measure of strength.
    pub response: f32,
}

/// One descriptor a keypoint, rows one after the other.
#[derive(Clone, Debug, PartialEq)]
pub enum Descriptors {
    /// Bit strings of `length` bytes, compared by Hamming distance.
    Binary {
        /// Bytes a descriptor.
        length: usize,
        /// All descriptors, `length` bytes each.
        bytes: Vec<u8>,
    },
    /// Vectors of `length` values, compared by Euclidean distance.
    Float {
        /// Values a descriptor.
        length: usize,
        /// All descriptors, `length` values each.
        values: Vec<f32>,
    },
}

impl Descriptors {
    /// How many keypoints are described.
    pub fn count(&self) -> usize {
        match self {
            Self::Binary { length, bytes } => bytes.len() / (*length).max(1),
            Self::Float { length, values } => values.len() / (*length).max(1),
        }
    }
}

/// Described keypoints of one view, in the detector's order.
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    /// Where they are, in OpenCV's pixels.
    pub keypoints: Vec<Keypoint>,
    /// Row i describes keypoint i.
    pub descriptors: Descriptors,
}

/// Why a view has no features.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, thiserror::Error)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum FeatureError {
    /// The descriptor cannot describe what the detector finds.
    #[error("{detector:?} keypoints cannot take {descriptor:?} descriptors")]
    Incompatible {
        /// As the options choose it.
        detector: Detector,
        /// As the options choose it.
        descriptor: Descriptor,
    },
    /// The number of descriptors is not that of keypoints.
    #[error("{described} of {found} keypoints were described")]
    NotAllDescribed {
        /// How many descriptors there are.
        described: usize,
        /// How many keypoints there are.
        found: usize,
    },
    /// OpenCV refused a call.
    #[error(transparent)]
    OpenCv(#[from] OpenCvError),
}

/// Finds keypoints and describes them.
///
/// * `image`: the drawing, 8-bit grey.
/// * `options`: detector, descriptor and their parameters; thresholds in grey
///   levels, distances in pixels.
///
/// A blank picture has no keypoints, which is not an error. Keypoints too near
/// the border for their descriptor are dropped.
///
/// # Errors
/// [`FeatureError::Incompatible`] for SIFT keypoints with ORB descriptors.
///
/// # Source
/// Arys 2020, §3.3, table 4.3; Shi & Tomasi 1994; Rublee et al. 2011; Lowe 2004;
/// Bay et al. 2008.
pub fn detect_and_describe(
    image: &GrayImage,
    options: &DetectionOptions,
) -> Result<Features, FeatureError> {
    let (detector, descriptor) = (options.detector, options.descriptor);
    if (detector, descriptor) == (Detector::Sift, Descriptor::Orb) {
        return Err(FeatureError::Incompatible { detector, descriptor });
    }
    cv::single_threaded();
    let picture = cv::gray_mat(image)?;
    let mut keypoints = detect(image, &picture, options)?;
    let mut rows = Mat::default();
    match descriptor {
        Descriptor::Orb => orb_describer(options)?.compute(&picture, &mut keypoints, &mut rows),
        Descriptor::Sift => {
            keypoints = safe_for_sift(&keypoints, image, options)?;
            sift(&options.sift)?.compute(&picture, &mut keypoints, &mut rows)
        }
        Descriptor::Surf => return Ok(described_by_surf(image, &keypoints, options)),
    }
    .map_err(OpenCvError::from)?;
    let features = Features {
        keypoints: keypoints.iter().map(|point| keypoint(&point)).collect(),
        descriptors: read_descriptors(&rows, descriptor)?,
    };
    let (described, found) = (features.descriptors.count(), features.keypoints.len());
    if described == found {
        Ok(features)
    } else {
        Err(FeatureError::NotAllDescribed { described, found })
    }
}

fn detect(
    image: &GrayImage,
    picture: &impl ToInputArray,
    options: &DetectionOptions,
) -> Result<Vector<KeyPoint>, OpenCvError> {
    let mut found = Vector::new();
    match options.detector {
        Detector::Fast => FastFeatureDetector::create(
            options.fast.threshold,
            true,
            FastFeatureDetector_DetectorType::TYPE_9_16,
        )?
        .detect_def(picture, &mut found)?,
        Detector::Orb => orb(&options.orb)?.detect_def(picture, &mut found)?,
        Detector::Harris => {
            let o = &options.harris;
            corners(
                o.max_corners,
                o.quality,
                o.min_distance_px,
                o.block_size_px,
                o.gradient_size_px,
                Some(o.k),
            )?
            .detect_def(picture, &mut found)?;
        }
        Detector::ShiTomasi => {
            let o = &options.shi_tomasi;
            corners(
                o.max_corners,
                o.quality,
                o.min_distance_px,
                o.block_size_px,
                o.gradient_size_px,
                None,
            )?
            .detect_def(picture, &mut found)?;
        }
        Detector::Sift => sift(&options.sift)?.detect_def(picture, &mut found)?,
        Detector::Surf => found = surf_keypoints(image, options)?,
    }
    if found.len() > MAX_KEYPOINTS {
        KeyPointsFilter::retain_best(&mut found, MAX_KEYPOINTS as i32)?;
    }
    Ok(found)
}

fn surf_keypoints(
    image: &GrayImage,
    options: &DetectionOptions,
) -> Result<Vector<KeyPoint>, OpenCvError> {
    let found = surf::detect(image, &options.surf);
    let points = found.iter().take(MAX_KEYPOINTS).map(|point| {
        Ok(KeyPoint::new_coords(
            point.x,
            point.y,
            point.size,
            point.angle_deg.unwrap_or(-1.0),
            point.response,
            // ORB describes on this level of its pyramid, as with OpenCV's SURF.
            i32::from(point.octave),
            i32::from(point.laplacian_sign),
        )?)
    });
    points.collect()
}

/// As OpenCV's SURF does: other detectors' points get an orientation of their
/// own, or none if it is to be left out.
fn described_by_surf(
    image: &GrayImage,
    keypoints: &Vector<KeyPoint>,
    options: &DetectionOptions,
) -> Features {
    let upright = options.surf.upright.then_some(0.0);
    let points: Vec<_> = keypoints
        .iter()
        .map(|point| {
            let own = (options.detector == Detector::Surf).then(|| point.angle());
            let position = point.pt();
            SurfKeypoint {
                x: position.x,
                y: position.y,
                size: point.size(),
                angle_deg: own.or(upright),
                response: point.response(),
                laplacian_sign: 1,
                octave: 0,
            }
        })
        .collect();
    let values = surf::describe(image, &points).into_iter().flatten().collect();
    Features {
        keypoints: keypoints.iter().map(|point| keypoint(&point)).collect(),
        descriptors: Descriptors::Float { length: surf::DESCRIPTOR_LENGTH, values },
    }
}

/// Harris corners if `harris_k` is given, Shi-Tomasi corners otherwise.
fn corners(
    max_corners: i32,
    quality: f64,
    min_distance_px: f64,
    block_size_px: i32,
    gradient_size_px: i32,
    harris_k: Option<f64>,
) -> Result<Ptr<GFTTDetector>, OpenCvError> {
    Ok(GFTTDetector::create_with_gradient(
        max_corners,
        quality,
        min_distance_px,
        block_size_px,
        gradient_size_px,
        harris_k.is_some(),
        harris_k.unwrap_or(0.04),
    )?)
}

fn orb(options: &OrbOptions) -> Result<Ptr<ORB>, OpenCvError> {
    Ok(ORB::create(
        options.max_features,
        options.scale_factor,
        options.levels,
        options.edge_threshold_px,
        options.first_level,
        2,
        ORB_ScoreType::HARRIS_SCORE,
        options.patch_size_px,
        options.fast_threshold,
    )?)
}

/// ORB's own points keep its parameters; other detectors' points are described
/// with OpenCV's defaults (Arys 2020, table 4.3 is the detector's row).
fn orb_describer(options: &DetectionOptions) -> Result<Ptr<ORB>, OpenCvError> {
    match options.detector {
        Detector::Orb => orb(&options.orb),
        _ => Ok(ORB::create_def()?),
    }
}

fn sift(options: &SiftOptions) -> Result<Ptr<SIFT>, OpenCvError> {
    Ok(SIFT::create(
        options.max_features,
        options.octave_layers,
        options.contrast_threshold,
        options.edge_threshold,
        options.sigma_px,
    )?)
}

/// Keypoints of other detectors as OpenCV's SIFT can describe them; it does not
/// check, and writes out of bounds for some.
///
/// It takes the angle -1, "none", for an angle, and ORB's pyramid levels for its
/// own octaves. Without an angle they become upright; those with a scale get the
/// octave that SIFT would give a blob of their size.
fn safe_for_sift(
    keypoints: &Vector<KeyPoint>,
    image: &GrayImage,
    options: &DetectionOptions,
) -> Result<Vector<KeyPoint>, OpenCvError> {
    if options.detector == Detector::Sift {
        return Ok(keypoints.clone());
    }
    // The smallest octave keeps 8 px a side.
    let most = (f64::from(image.width().min(image.height())) / 8.0).log2().floor().max(0.0);
    let octave = |size_px: f32| {
        let natural = (f64::from(size_px) / (2.0 * options.sift.sigma_px)).log2().floor();
        natural.clamp(0.0, most) as i32 | 1 << 8
    };
    let described = keypoints.iter().map(|point| {
        let position = point.pt();
        let has_scale = matches!(options.detector, Detector::Orb | Detector::Surf);
        Ok(KeyPoint::new_coords(
            position.x,
            position.y,
            point.size(),
            point.angle().max(0.0),
            point.response(),
            if has_scale { octave(point.size()) } else { 0 },
            point.class_id(),
        )?)
    });
    described.collect()
}

/// About how much memory detecting and describing in one view takes, bytes.
pub fn detection_bytes(width_px: u32, height_px: u32, options: &DetectionOptions) -> u64 {
    let pixels = f64::from(width_px) * f64::from(height_px);
    let layers = f64::from(options.sift.octave_layers);
    let orb = &options.orb;
    let scale = f64::from(orb.scale_factor);
    let detection = match options.detector {
        Detector::Fast => 2.0,
        Detector::Harris | Detector::ShiTomasi => 32.0,
        // Levels below the first are magnified.
        Detector::Orb => {
            let magnified = scale.powi(2 * orb.first_level);
            3.0 * magnified / (1.0 - scale.powi(-2))
        }
        // Doubled floats, Gaussians and their differences, all octaves.
        Detector::Sift => 16.0 * (2.0 * layers + 5.0) * 4.0 / 3.0,
        // Sums and three layers of responses at a time.
        Detector::Surf => 4.0 + 3.0 * 4.0,
    };
    let description = match options.descriptor {
        Descriptor::Orb => 3.0,
        Descriptor::Sift => 4.0 * (layers + 3.0) * 4.0 / 3.0,
        Descriptor::Surf => 4.0,
    };
    (pixels * (detection + description)) as u64
}

fn read_descriptors(rows: &Mat, descriptor: Descriptor) -> Result<Descriptors, OpenCvError> {
    let length = rows.cols().max(0) as usize;
    let empty = rows.rows() <= 0;
    Ok(match descriptor {
        Descriptor::Orb => Descriptors::Binary {
            length,
            bytes: if empty { Vec::new() } else { rows.data_typed::<u8>()?.to_vec() },
        },
        Descriptor::Sift | Descriptor::Surf => Descriptors::Float {
            length,
            values: if empty { Vec::new() } else { rows.data_typed::<f32>()?.to_vec() },
        },
    })
}

fn keypoint(point: &KeyPoint) -> Keypoint {
    let position = point.pt();
    Keypoint {
        position: Point2::new(position.x, position.y),
        size_px: point.size(),
        angle_deg: point.angle(),
        response: point.response(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;

    const CORNERS_AND_BLOBS: [Detector; 5] =
        [Detector::Fast, Detector::Harris, Detector::ShiTomasi, Detector::Orb, Detector::Surf];

    /// White rectangles on black at known corners, a little soft: ties between
    /// neighbours silence FAST.
    fn rectangles() -> GrayImage {
        let sharp = GrayImage::from_fn(200, 160, |x, y| {
            let inside = |x0, y0, x1, y1| (x0..x1).contains(&x) && (y0..y1).contains(&y);
            let white = inside(50, 50, 90, 80) || inside(110, 60, 150, 110);
            Luma([if white { 255 } else { 0 }])
        });
        imageproc::filter::gaussian_blur_f32(&sharp, 0.8)
    }

    fn with(detector: Detector, descriptor: Descriptor) -> DetectionOptions {
        DetectionOptions { detector, descriptor, ..DetectionOptions::default() }
    }

    #[test]
    fn corner_detectors_find_the_corners() {
        for detector in [Detector::ShiTomasi, Detector::Harris] {
            let features =
                detect_and_describe(&rectangles(), &with(detector, Descriptor::Orb)).unwrap();
            for corner in [(50.0, 50.0), (89.0, 79.0), (110.0, 60.0), (149.0, 109.0)] {
                let distance = features
                    .keypoints
                    .iter()
                    .map(|k| (k.position - Point2::new(corner.0, corner.1)).norm())
                    .fold(f32::INFINITY, f32::min);
                assert!(distance < 6.0, "{detector:?}: nearest to {corner:?} is {distance} px off");
            }
        }
    }

    #[test]
    fn every_keypoint_is_described_whatever_the_combination() {
        use Detector::{Fast, Harris, Orb, ShiTomasi, Sift, Surf};
        // With a blob: rectangles alone have none of SURF's sizes.
        let drawn = rectangles();
        let picture = GrayImage::from_fn(200, 160, |x, y| {
            let square = (f64::from(x) - 70.0).powi(2) + (f64::from(y) - 100.0).powi(2);
            let bump = 200.0 * (-square / 50.0).exp();
            Luma([drawn.get_pixel(x, y).0[0].max(bump as u8)])
        });
        for detector in [Fast, Orb, Harris, ShiTomasi, Sift, Surf] {
            for descriptor in [Descriptor::Orb, Descriptor::Sift, Descriptor::Surf] {
                let mut options = with(detector, descriptor);
                options.surf.hessian_threshold = 100.0;
                let found = detect_and_describe(&picture, &options);
                if (detector, descriptor) == (Sift, Descriptor::Orb) {
                    assert_eq!(found, Err(FeatureError::Incompatible { detector, descriptor }));
                    continue;
                }
                let features = found.unwrap();
                assert_eq!(features.descriptors.count(), features.keypoints.len(), "{options:?}");
                assert!(detector == Sift || !features.keypoints.is_empty(), "{detector:?}");
            }
        }
    }

    #[test]
    fn a_magnified_pyramid_costs_what_it_weighs() {
        let mut options = with(Detector::Orb, Descriptor::Orb);
        assert!(detection_bytes(960, 540, &options) < 16_000_000);
        options.orb = OrbOptions { scale_factor: 2.0, levels: 32, first_level: 31, ..options.orb };
        assert!(detection_bytes(960, 540, &options) > 1 << 60);
    }

    #[test]
    fn blank_pictures_have_no_keypoints() {
        for (width, height) in [(64, 200), (120, 100)] {
            let blank = GrayImage::from_pixel(width, height, Luma([255]));
            for detector in CORNERS_AND_BLOBS {
                let features =
                    detect_and_describe(&blank, &with(detector, Descriptor::Orb)).unwrap();
                assert_eq!((features.keypoints.len(), features.descriptors.count()), (0, 0));
            }
        }
    }

    #[test]
    fn tiny_pictures_have_none_or_an_error() {
        for (width, height) in [(1, 1), (3, 200), (17, 17)] {
            let tiny = GrayImage::from_fn(width, height, |x, y| Luma([(x * 91 + y * 57) as u8]));
            for detector in CORNERS_AND_BLOBS {
                match detect_and_describe(&tiny, &with(detector, Descriptor::Orb)) {
                    Ok(features) => assert_eq!(features.keypoints.len(), 0, "{detector:?}"),
                    Err(error) => assert!(matches!(error, FeatureError::OpenCv(_)), "{error}"),
                }
            }
        }
    }
}
