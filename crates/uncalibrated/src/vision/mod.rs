//! Computer vision stages: pure functions from typed data to typed data.
//!
//! Pixel coordinates in this module are OpenCV's: the centre of the top left
//! pixel is (0, 0). What is served to users adds a half (the sheet frame).
//!
//! OpenCV's own types stay inside; results do not depend on thread counts:
//! OpenCV runs single-threaded and callers run pairs and views in parallel.

mod cloud;
mod combine;
mod corner_disparity;
mod cv;
mod disparity;
mod eight_point;
mod epipolar;
mod epipolar_metrics;
mod features;
mod fusion;
mod hull;
mod matching;
mod optimal_correction;
mod rectification;
mod rectification_metrics;
mod similarity;
pub mod surf;

pub use cloud::{PartneredMap, ViewCloud, affine_depth, inverse_depth};
pub use combine::mean_map;
pub use corner_disparity::corner_disparity;
pub use cv::OpenCvError;
pub use disparity::{DisparityError, derectify, left_disparity, right_disparity, working_bytes};
pub use epipolar::{EpipolarError, EpipolarGeometry, EstimatorRun, estimate_fundamental};
pub use epipolar_metrics::{
    mean_distance, sampson_distance_px2, smallest_absolute_eigenvalue,
    symmetric_epipolar_distance_px2,
};
pub use features::{
    Descriptors, FeatureError, Features, Keypoint, detect_and_describe, detection_bytes,
};
pub use fusion::disparity_maps;
pub use hull::{HullError, convex_hull, row_extremes};
pub use matching::{Match, match_descriptors};
pub use optimal_correction::{OptimalCorrection, optimal_correction, reprojection_error_px2};
pub use rectification::{Rectification, RectificationError, rectify, warp};
pub use rectification_metrics::{PairDistortion, RectificationDistortion};
pub use similarity::{SimilarityError, SimilarityFit, robust_similarity, umeyama};

use nalgebra::Point2;

/// A pair of pixels said to show the same point of the subject.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correspondence {
    /// In the left view, px.
    pub left: Point2<f64>,
    /// In the right view, px.
    pub right: Point2<f64>,
}
