use image::GrayImage;
use nalgebra::Point2;
use opencv::core::{
    KeyPoint, KeyPointTraitConst, Mat, MatTraitConst, MatTraitConstManual, Ptr, ToInputArray,
    Vector,
};
use opencv::features2d::{
    FastFeatureDetector, FastFeatureDetector_DetectorType, Feature2DTrait, GFTTDetector, ORB,
    ORB_ScoreType, SIFT,
};
use serde::Serialize;

use super::cv::{self, OpenCvError};
use crate::options::{Descriptor, DetectionOptions, Detector, OrbOptions, SiftOptions};

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
    Binary { length: usize, bytes: Vec<u8> },
    /// Vectors of `length` values, compared by Euclidean distance.
    Float { length: usize, values: Vec<f32> },
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
    pub keypoints: Vec<Keypoint>,
    /// Row i describes keypoint i.
    pub descriptors: Descriptors,
}

/// Why a view has no features.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, thiserror::Error)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum FeatureError {
    #[error("{detector:?} keypoints cannot take {descriptor:?} descriptors")]
    Incompatible { detector: Detector, descriptor: Descriptor },
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
/// Arys 2020, §3.3, table 4.3; Shi & Tomasi 1994; Rublee et al. 2011; Lowe 2004.
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
    let mut keypoints = detect(&picture, options)?;
    let mut rows = Mat::default();
    match descriptor {
        Descriptor::Orb => orb_describer(options)?.compute(&picture, &mut keypoints, &mut rows),
        Descriptor::Sift => sift(&options.sift)?.compute(&picture, &mut keypoints, &mut rows),
    }
    .map_err(OpenCvError::from)?;
    let descriptors = read_descriptors(&rows, descriptor)?;
    Ok(Features {
        keypoints: keypoints.iter().map(|point| keypoint(&point)).collect(),
        descriptors,
    })
}

fn detect(
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
    }
    Ok(found)
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

fn read_descriptors(rows: &Mat, descriptor: Descriptor) -> Result<Descriptors, OpenCvError> {
    let length = rows.cols().max(0) as usize;
    let empty = rows.rows() <= 0;
    Ok(match descriptor {
        Descriptor::Orb => Descriptors::Binary {
            length,
            bytes: if empty { Vec::new() } else { rows.data_typed::<u8>()?.to_vec() },
        },
        Descriptor::Sift => Descriptors::Float {
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

    /// White rectangles on black at known corners.
    fn rectangles() -> GrayImage {
        GrayImage::from_fn(200, 160, |x, y| {
            let inside = |x0, y0, x1, y1| (x0..x1).contains(&x) && (y0..y1).contains(&y);
            let white = inside(50, 50, 90, 80) || inside(110, 60, 150, 110);
            Luma([if white { 255 } else { 0 }])
        })
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
        use Detector::{Fast, Harris, Orb, ShiTomasi, Sift};
        for detector in [Fast, Orb, Harris, ShiTomasi, Sift] {
            for descriptor in [Descriptor::Orb, Descriptor::Sift] {
                let options = with(detector, descriptor);
                let found = detect_and_describe(&rectangles(), &options);
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
    fn blank_and_tiny_pictures_have_no_keypoints() {
        for (width, height) in [(1, 1), (3, 200), (120, 100)] {
            let blank = GrayImage::from_pixel(width, height, Luma([255]));
            for detector in [Detector::Fast, Detector::Harris, Detector::ShiTomasi, Detector::Orb] {
                let features =
                    detect_and_describe(&blank, &with(detector, Descriptor::Orb)).unwrap();
                assert_eq!((features.keypoints.len(), features.descriptors.count()), (0, 0));
            }
        }
    }
}
