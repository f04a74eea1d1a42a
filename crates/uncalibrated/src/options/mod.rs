//! What the method `uncalibrated` does, nested by stage. Defaults are those of
//! Arys 2020, tables 4.3 and 4.5.

use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

mod disparity;
mod features;
mod geometry;

use ::options::{OptionProblem, OptionProblemKind, OptionSet, Schema};
pub use disparity::{DisparityAlgorithm, DisparityOptions, PreFilter, SgbmMode};
pub use features::{
    Descriptor, DetectionOptions, Detector, FastOptions, FlannOptions, HarrisOptions, Matcher,
    MatchingOptions, OrbOptions, ShiTomasiOptions, SiftOptions, SurfOptions,
};
pub use geometry::{
    CloudOptions, CloudSource, CoplanarPairs, DepthRelation, EpipolarOptions, Estimator, Feedback,
    MergeOptions, MetricWeights,
};

/// The options of the method's stages.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Seed of every random choice.
    pub seed: u32,
    /// Neighbouring views farther apart than this, in degrees, are not paired.
    pub max_pair_angle_deg: f64,
    /// Keypoints and descriptors.
    pub detection: DetectionOptions,
    /// Matches between neighbouring views.
    pub matching: MatchingOptions,
    /// The fundamental matrix of each pair.
    pub epipolar: EpipolarOptions,
    /// The disparity map of each rectified pair.
    pub disparity: DisparityOptions,
    /// Each view's point cloud.
    pub cloud: CloudOptions,
    /// Merging neighbouring clouds.
    pub merge: MergeOptions,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            seed: 0,
            max_pair_angle_deg: 30.0,
            detection: DetectionOptions::default(),
            matching: MatchingOptions::default(),
            epipolar: EpipolarOptions::default(),
            disparity: DisparityOptions::default(),
            cloud: CloudOptions::default(),
            merge: MergeOptions::default(),
        }
    }
}

impl OptionSet for Options {
    const LISTED_AT: &'static str = "/v1/options";

    fn schema() -> &'static Schema {
        static SCHEMA: LazyLock<Schema> = LazyLock::new(Schema::of::<Options>);
        &SCHEMA
    }

    fn conflicts(&self) -> Vec<OptionProblem> {
        let problem = |option: &str, detail: String| OptionProblem {
            option: option.to_owned(),
            kind: OptionProblemKind::Invalid,
            detail,
        };
        let mut problems = Vec::new();
        if self.detection.detector == Detector::Sift && self.detection.descriptor == Descriptor::Orb
        {
            problems.push(problem(
                "detection.descriptor",
                "SIFT keypoints cannot take ORB descriptors: their pyramids differ; use sift or surf"
                    .to_owned(),
            ));
        }
        let weights = &self.epipolar.weights;
        let sum = weights.mean_sampson
            + weights.smallest_eigenvalue
            + weights.outlier_ratio
            + weights.orthogonality
            + weights.aspect_ratio;
        if sum <= 0.0 {
            let detail = "all weights are 0; give at least one above".to_owned();
            problems.push(problem("epipolar.weights", detail));
        }
        let disparity = &self.disparity;
        if disparity.p2 <= disparity.p1 {
            problems.push(problem(
                "disparity.p2",
                format!("{} must be above disparity.p1, {}", disparity.p2, disparity.p1),
            ));
        }
        for (option, size) in [
            ("detection.shi_tomasi.gradient_size_px", self.detection.shi_tomasi.gradient_size_px),
            ("detection.harris.gradient_size_px", self.detection.harris.gradient_size_px),
        ] {
            if size % 2 == 0 {
                problems.push(problem(option, format!("{size} is not one of 1, 3, 5, 7")));
            }
        }
        if self.detection.orb.first_level >= self.detection.orb.levels {
            problems.push(problem(
                "detection.orb.first_level",
                format!("must be below detection.orb.levels, {}", self.detection.orb.levels),
            ));
        }
        problems
    }
}
