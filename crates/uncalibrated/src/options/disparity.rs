//! Options of dense stereo.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Dense stereo algorithm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DisparityAlgorithm {
    /// Semi-global matching (Hirschmüller 2008, OpenCV's `StereoSGBM`).
    #[default]
    Sgbm,
    /// Local block matching (`StereoBM`); fails in empty regions.
    BlockMatching,
}

/// Directions along which semi-global matching sums its costs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SgbmMode {
    /// One pass, five directions.
    #[default]
    FivePath,
    /// Two passes, eight directions; memory grows with the picture.
    EightPath,
    /// Three directions.
    ThreeWay,
    /// Two passes, four directions.
    Hh4,
}

/// What block matching does to the pictures first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PreFilter {
    /// The horizontal derivative, clipped.
    #[default]
    XSobel,
    /// Grey levels normalised by their surroundings.
    NormalizedResponse,
}

/// The disparity map of each rectified pair (Arys 2020, §2.2.6, table 4.5).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[expect(missing_docs, reason = "the schema describes it")]
pub struct DisparityOptions {
    pub algorithm: DisparityAlgorithm,
    pub mode: SgbmMode,
    /// The smallest disparity searched, px.
    #[schemars(range(min = -1024, max = 1024))]
    pub min_disparity_px: i32,
    /// How many whole-pixel disparities are searched; a multiple of 16.
    #[schemars(range(min = 16, max = 1024), extend("multipleOf" = 16))]
    pub num_disparities: i32,
    /// Side of the matched window, px; odd (block matching takes 5 and up).
    #[schemars(range(min = 1, max = 255), extend("not" = {"multipleOf": 2}))]
    pub block_size: i32,
    /// Block sizes whose maps are fused, per pixel, by what each block could see
    /// and how well it agrees; odd, px. Empty takes `block_size` alone.
    #[schemars(
        length(max = 8),
        extend("items" = {
            "type": "integer", "minimum": 1, "maximum": 255, "not": {"multipleOf": 2}
        })
    )]
    pub block_sizes: Vec<i32>,
    /// Penalty of a disparity step of one.
    #[schemars(range(min = 0, max = 100000))]
    pub p1: i32,
    /// Penalty of a larger step; above `p1`.
    #[schemars(range(min = 1, max = 200000))]
    pub p2: i32,
    /// The largest accepted left-right difference, px; negative switches the
    /// check off.
    #[schemars(range(min = -1, max = 1024))]
    pub max_left_right_difference_px: i32,
    /// What block matching does to the pictures first; semi-global matching takes
    /// the clipped horizontal derivative.
    pub pre_filter: PreFilter,
    /// Window of the pre-filter `normalized_response`, px; odd.
    #[schemars(range(min = 5, max = 255), extend("not" = {"multipleOf": 2}))]
    pub pre_filter_size_px: i32,
    /// Clip of the pre-filter, grey levels.
    #[schemars(range(min = 1, max = 63))]
    pub pre_filter_cap: i32,
    /// Margin by which the best cost must win, percent.
    #[schemars(range(min = 0, max = 100))]
    pub uniqueness_percent: i32,
    /// Largest region dropped as a speckle, px; 0 switches the filter off.
    #[schemars(range(min = 0, max = 100000))]
    pub speckle_window_px: i32,
    /// Disparity step that parts regions, px.
    #[schemars(range(min = 0, max = 1024))]
    pub speckle_range_px: i32,
    /// Gradient sum below which block matching gives up on a window.
    #[schemars(range(min = 0, max = 100000))]
    pub texture_threshold: i32,
}

impl Default for DisparityOptions {
    fn default() -> Self {
        Self {
            algorithm: DisparityAlgorithm::default(),
            mode: SgbmMode::default(),
            min_disparity_px: 0,
            num_disparities: 32,
            block_size: 37,
            block_sizes: Vec::new(),
            p1: 970,
            p2: 5970,
            max_left_right_difference_px: 14,
            pre_filter: PreFilter::default(),
            pre_filter_size_px: 9,
            pre_filter_cap: 15,
            uniqueness_percent: 0,
            speckle_window_px: 200,
            speckle_range_px: 2,
            texture_threshold: 10,
        }
    }
}
