//! Every option of a reconstruction: type, range, unit, default and meaning.
//!
//! The types below are the one source: the JSON Schema made from them is what
//! `/v1/options` serves, what uploads are checked against and what the command
//! line accepts. Defaults are those of Arys 2020, tables 4.3 and 4.5.

mod disparity;
mod evaluation;
mod features;
mod geometry;
mod parse;
mod turntable;

pub use disparity::{DisparityAlgorithm, DisparityOptions, PreFilter, SgbmMode};
pub use evaluation::EvaluationOptions;
pub use features::{
    Descriptor, DetectionOptions, Detector, FastOptions, FlannOptions, HarrisOptions, Matcher,
    MatchingOptions, OrbOptions, ShiTomasiOptions, SiftOptions, SurfOptions,
};
pub use geometry::{
    CloudOptions, CloudSource, CoplanarPairs, DepthRelation, EpipolarOptions, Estimator,
    ExportOptions, Feedback, MergeOptions, MetricWeights, Origin,
};
pub use parse::{
    OptionProblem, OptionProblemKind, OptionProblems, OptionSet, Schema, check_set, merge, nested,
    parse, parse_set, schema,
};
pub use turntable::{
    DepthFrom, DepthOptions, Holes, SilhouetteOptions, SolidKind, SolidOptions, Switch,
    TurntableOptions,
};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a sheet becomes a 3D draft.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Epipolar geometry estimated from the drawings (Arys 2020); at least
    /// three views of one size.
    Uncalibrated,
    /// Depth from matched lines and a solid from silhouettes, at the angles
    /// given; at least two level views of one size.
    #[default]
    Turntable,
}

/// The options of one reconstruction, nested by stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// How the sheet becomes a 3D draft.
    pub method: Method,
    /// Seed of every random choice.
    #[schemars(range(min = 0, max = 4_294_967_295_u32))]
    pub seed: u32,
    /// Neighbouring views farther apart than this, in degrees, are not paired.
    #[schemars(range(min = 0.1, max = 180.0))]
    pub max_pair_angle_deg: f64,
    pub detection: DetectionOptions,
    pub matching: MatchingOptions,
    pub epipolar: EpipolarOptions,
    pub disparity: DisparityOptions,
    pub cloud: CloudOptions,
    pub merge: MergeOptions,
    pub turntable: TurntableOptions,
    pub export: ExportOptions,
    pub evaluation: EvaluationOptions,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            method: Method::default(),
            seed: 0,
            max_pair_angle_deg: 30.0,
            detection: DetectionOptions::default(),
            matching: MatchingOptions::default(),
            epipolar: EpipolarOptions::default(),
            disparity: DisparityOptions::default(),
            cloud: CloudOptions::default(),
            merge: MergeOptions::default(),
            turntable: TurntableOptions::default(),
            export: ExportOptions::default(),
            evaluation: EvaluationOptions::default(),
        }
    }
}

impl Method {
    /// The fewest views the method works from.
    pub fn minimum_views(self) -> usize {
        match self {
            Self::Uncalibrated => 3,
            Self::Turntable => 2,
        }
    }

    /// Whether every view must have the same width and height.
    pub fn needs_equal_sizes(self) -> bool {
        match self {
            Self::Uncalibrated | Self::Turntable => true,
        }
    }
}

#[cfg(test)]
mod tests;
