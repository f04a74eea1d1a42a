//! Options of epipolar geometry, clouds and their merging.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Estimator of the fundamental matrix.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Estimator {
    /// RANSAC over 7-point samples; least median of squares below 15 matches,
    /// as in OpenCV.
    #[default]
    Ransac,
    /// RANSAC over normalised 8-point samples, refitted to all that agree.
    EightPointRansac,
    /// Least median of squares.
    Lmeds,
    /// Normalised 8-point over all matches, none rejected.
    EightPoint,
}

/// What a pair's tries with varied parameters are for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Feedback {
    /// Detection is varied until the inliers' mean Sampson distance is at most
    /// `max_mean_sampson_px2`; the try with the least goes on.
    #[default]
    MeanSampson,
    /// Detection and inlier threshold are varied `tries` times; the try with the
    /// least weighed sum of all five metrics goes on.
    FiveMetrics,
}

/// How the five metrics of a pair are weighed in one cost:
/// `Σ weight · value / (value + scale) / Σ weight`, so that each counts from 0,
/// perfect, to 1. The scales, at which a metric counts half: mean Sampson distance
/// 1 px², smallest absolute eigenvalue 0.0001, outlier ratio 0.5, deviations of
/// orthogonality and aspect ratio 0.1 each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MetricWeights {
    /// Of the inliers' mean Sampson distance.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub mean_sampson: f64,
    /// Of the smallest absolute eigenvalue of F.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub smallest_eigenvalue: f64,
    /// Of the share of matches that the estimator rejected.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub outlier_ratio: f64,
    /// Of the rectification's mean relative deviation from right angles.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub orthogonality: f64,
    /// Of the rectification's mean relative deviation from the aspect ratio.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub aspect_ratio: f64,
}

impl Default for MetricWeights {
    fn default() -> Self {
        Self {
            mean_sampson: 1.0,
            smallest_eigenvalue: 1.0,
            outlier_ratio: 1.0,
            orthogonality: 1.0,
            aspect_ratio: 1.0,
        }
    }
}

/// What becomes of a pair whose matches all fit one plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CoplanarPairs {
    /// It fails: one plane leaves the epipolar geometry open.
    #[default]
    Refuse,
    /// It is used, with a warning.
    Use,
}

/// The fundamental matrix of each pair (Arys 2020, §2.2.4, §3.4).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[expect(missing_docs, reason = "the schema describes it")]
pub struct EpipolarOptions {
    pub estimator: Estimator,
    /// RANSAC's inlier threshold: distance to the epipolar line, px; not used
    /// by the other estimators.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub max_error_px: f64,
    /// Confidence that the estimate is right, as a share.
    #[schemars(range(min = 0.5, max = 0.999999))]
    pub confidence: f64,
    /// Samples that RANSAC draws at most.
    #[schemars(range(min = 1, max = 20000))]
    pub max_iterations: u32,
    pub coplanar: CoplanarPairs,
    pub feedback: Feedback,
    pub weights: MetricWeights,
    /// Mean Sampson distance of the inliers, px², above which a pair's
    /// detection is tried again by the feedback `mean_sampson`.
    #[schemars(range(min = 0.0, max = 1000000.0))]
    pub max_mean_sampson_px2: f64,
    /// How often a pair's detection is tried at most, with varied parameters.
    #[schemars(range(min = 1, max = 50))]
    pub tries: u32,
}

impl Default for EpipolarOptions {
    fn default() -> Self {
        Self {
            estimator: Estimator::default(),
            max_error_px: 2.0,
            confidence: 0.99,
            max_iterations: 1000,
            coplanar: CoplanarPairs::default(),
            feedback: Feedback::default(),
            weights: MetricWeights::default(),
            max_mean_sampson_px2: 100.0,
            tries: 1,
        }
    }
}

/// How disparity becomes depth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DepthRelation {
    /// Depth is the inverse of disparity, as for perspective pictures; pixels
    /// whose disparity is not positive are dropped (Arys 2020, §3.7).
    #[default]
    Inverse,
    /// Depth is affine in disparity, as for orthographic pictures.
    Affine,
}

/// Which places of a view make up its cloud.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CloudSource {
    /// Every pixel that has a disparity.
    #[default]
    Dense,
    /// The matched corners alone, by the disparity of their matches (Arys 2020,
    /// ch. 6).
    Corners,
}

/// Each view's point cloud (Arys 2020, §3.7).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[expect(missing_docs, reason = "the schema describes it")]
pub struct CloudOptions {
    pub source: CloudSource,
    pub depth: DepthRelation,
    /// Numerator of the inverse relation: depth in px = this / disparity in px.
    #[schemars(range(min = 0.001, max = 1000000.0))]
    pub inverse_scale_px2: f64,
    /// Every n-th pixel of a row and every n-th row goes into cloud.ply.
    #[schemars(range(min = 1, max = 64))]
    pub stride_px: u32,
}

impl Default for CloudOptions {
    fn default() -> Self {
        Self {
            source: CloudSource::default(),
            depth: DepthRelation::default(),
            inverse_scale_px2: 100.0,
            stride_px: 1,
        }
    }
}

/// Merging neighbouring clouds by their shared matches (Arys 2020, §3.7).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MergeOptions {
    /// A shared match agrees with a similarity within this distance, px.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub max_error_px: f64,
    /// Samples of three matches tried for the similarity.
    #[schemars(range(min = 1, max = 100000))]
    pub iterations: u32,
}

impl Default for MergeOptions {
    fn default() -> Self {
        Self { max_error_px: 5.0, iterations: 500 }
    }
}
