//! Every option of a reconstruction: type, range, unit, default and meaning.
//!
//! The types below and those of the methods' crates are the one source: the
//! JSON Schema made from them is what `/v1/options` serves, what uploads are
//! checked against and what the command line accepts.

use std::sync::LazyLock;

use evaluation::EvaluationOptions;
use frames::{ExportOptions, UpAxis};
use options::{OptionProblem, OptionProblemKind, OptionProblems, OptionSet, Schema};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use subject::CleanOptions;
use turntable::options::TurntableOptions;
use uncalibrated::options::{
    CloudOptions, DetectionOptions, DisparityOptions, EpipolarOptions, MatchingOptions,
    MergeOptions,
};

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

/// Whether drawings are cleaned and laid on one canvas first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Preparation {
    /// Where a drawing is more than clean lines on white.
    #[default]
    Auto,
    /// Drawings are taken as they are: dark lines on light paper, one size.
    Off,
}

/// A drawing that is decoded and about to be reduced, with its mask.
const DECODING_BYTES_PER_PIXEL: u64 = 12;

/// What is done about views that fit better at another angle or mirrored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Repair {
    /// They are named, nothing is changed.
    #[default]
    Report,
    /// The best suggestion is followed, and named.
    Apply,
}

/// How a sheet's drawings become views that fit together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SheetOptions {
    /// Whether the subject is looked for in each drawing, and views of differing
    /// size or place are laid on one canvas.
    pub prepare: Preparation,
    /// What is done about views that fit better otherwise.
    pub repair: Repair,
    /// Larger drawings are all reduced, by one factor, until the largest has about so
    /// many megapixels; maps and pictures are of that size then. Nothing is reduced if there is a
    /// truth to compare with, nor with `prepare=off`. The canvas on which views of differing sizes
    /// are laid is reduced likewise, unless the drawings themselves are larger.
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub max_megapixels: f64,
}

impl Default for SheetOptions {
    fn default() -> Self {
        Self { prepare: Preparation::default(), repair: Repair::default(), max_megapixels: 4.0 }
    }
}

/// The options of one reconstruction, nested by stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[expect(missing_docs, reason = "the schema describes it")]
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
    /// What is removed from drawings before the default method uses them.
    pub clean: CleanOptions,
    /// How the default method reads the sheet as a whole.
    pub sheet: SheetOptions,
    pub export: ExportOptions,
    pub evaluation: EvaluationOptions,
}

impl Default for Options {
    fn default() -> Self {
        let own = uncalibrated::Options::default();
        Self {
            method: Method::default(),
            seed: own.seed,
            max_pair_angle_deg: own.max_pair_angle_deg,
            detection: own.detection,
            matching: own.matching,
            epipolar: own.epipolar,
            disparity: own.disparity,
            cloud: own.cloud,
            merge: own.merge,
            turntable: TurntableOptions::default(),
            clean: CleanOptions::default(),
            sheet: SheetOptions::default(),
            export: ExportOptions::default(),
            evaluation: EvaluationOptions::default(),
        }
    }
}

impl Method {
    /// The fewest views the method works from.
    pub fn minimum_views(self) -> usize {
        match self {
            Self::Uncalibrated => uncalibrated::MINIMUM_VIEWS,
            Self::Turntable => turntable::views::MINIMUM_VIEWS,
        }
    }

    /// Whether every view must have the same width and height.
    pub fn needs_equal_sizes(self) -> bool {
        match self {
            Self::Uncalibrated => true,
            Self::Turntable => false,
        }
    }

    /// Whether it takes views from above and below beside level ones.
    pub fn takes_elevated(self) -> bool {
        match self {
            Self::Uncalibrated => false,
            Self::Turntable => true,
        }
    }
}

impl Options {
    /// Those of the method `uncalibrated`.
    pub fn uncalibrated(&self) -> uncalibrated::Options {
        uncalibrated::Options {
            seed: self.seed,
            max_pair_angle_deg: self.max_pair_angle_deg,
            detection: self.detection.clone(),
            matching: self.matching.clone(),
            epipolar: self.epipolar.clone(),
            disparity: self.disparity.clone(),
            cloud: self.cloud.clone(),
            merge: self.merge.clone(),
        }
    }

    /// By how much drawings are reduced whose largest width and height make so many pixels; 1
    /// for not at all.
    ///
    /// * `has_truth`: whether there is something to compare with, pixel by pixel.
    pub fn reduction(&self, pixels: u64, has_truth: bool) -> f64 {
        let prepares = self.method == Method::Turntable && self.sheet.prepare == Preparation::Auto;
        if has_truth || !prepares {
            return 1.0;
        }
        (pixels as f64 / (self.sheet.max_megapixels * 1e6)).sqrt().max(1.0)
    }

    /// About how much memory `views` of one size take, bytes.
    ///
    /// * `has_truth`: see [`reduction`](Self::reduction).
    pub fn working_bytes(
        &self,
        views: usize,
        (width_px, height_px): (u32, u32),
        threads: usize,
        has_truth: bool,
    ) -> u64 {
        match self.method {
            Method::Turntable => {
                let pixels = u64::from(width_px) * u64::from(height_px);
                let reduction = self.reduction(pixels, has_truth);
                let worked_on = (pixels as f64 / (reduction * reduction)).ceil() as u64;
                let working = turntable::working_bytes(views, worked_on);
                if reduction <= 1.0 {
                    return working;
                }
                // Each thread holds a drawing as it was sent at a time; one that waits may begin
                // with another.
                let whole = pixels.saturating_mul(DECODING_BYTES_PER_PIXEL);
                working.saturating_add(whole.saturating_mul((2 * threads).min(views) as u64))
            }
            Method::Uncalibrated => {
                let options = self.uncalibrated();
                uncalibrated::working_bytes(views, width_px, height_px, &options, threads)
            }
        }
    }
}

/// The schema of a reconstruction's options.
pub fn schema() -> &'static Value {
    &Options::schema().document
}

/// Reads the options of a reconstruction from JSON; what is not given has its default.
///
/// # Errors
/// As [`options::parse_set`].
pub fn parse(value: &Value) -> Result<Options, OptionProblems> {
    options::parse_set(value)
}

impl OptionSet for Options {
    const LISTED_AT: &'static str = "/v1/options";

    fn schema() -> &'static Schema {
        static SCHEMA: LazyLock<Schema> = LazyLock::new(Schema::of::<Options>);
        &SCHEMA
    }

    fn conflicts(&self) -> Vec<OptionProblem> {
        let mut conflicts = self.uncalibrated().conflicts();
        // Of OBJ, and of STL and 3MF.
        if [UpAxis::Y, UpAxis::Z].iter().any(|auto| self.export.file_axes(*auto).is_none()) {
            conflicts.push(OptionProblem {
                option: "export.forward".to_owned(),
                kind: OptionProblemKind::Invalid,
                detail: "the subject would look up or down in OBJ or in STL and 3MF; name another \
                         axis than export.up_axis, and say export.up_axis if forward is y or z"
                    .to_owned(),
            });
        }
        conflicts
    }
}

#[cfg(test)]
mod tests {
    use options::{merge, nested};
    use uncalibrated::options::SgbmMode;

    use super::*;
    use serde_json::json;

    fn problems(value: Value) -> Vec<OptionProblem> {
        parse(&value).unwrap_err().0
    }

    #[test]
    fn nothing_given_is_the_defaults() {
        assert_eq!(parse(&json!({})).unwrap(), Options::default());
    }

    #[test]
    fn the_schema_accepts_the_defaults_it_states() {
        let all = serde_json::to_value(Options::default()).unwrap();
        assert_eq!(parse(&all).unwrap(), Options::default());
    }

    #[test]
    fn names_an_unknown_option() {
        let found = problems(json!({"disparity": {"blocksize": 5}}));
        assert_eq!(found[0].option, "disparity.blocksize");
        assert_eq!(found[0].kind, OptionProblemKind::Unknown);
    }

    #[test]
    fn says_the_range_of_a_value_outside_it() {
        let found = problems(json!({"epipolar": {"confidence": 1.5}}));
        assert_eq!(found[0].option, "epipolar.confidence");
        assert_eq!(found[0].kind, OptionProblemKind::Invalid);
        assert_eq!(found[0].detail, "1.5 is out of range; give 0.5 to 0.999999");
    }

    #[test]
    fn refuses_even_blocks_and_odd_disparity_counts() {
        assert_eq!(
            problems(json!({"disparity": {"block_size": 8}}))[0].option,
            "disparity.block_size"
        );
        assert_eq!(
            problems(json!({"disparity": {"num_disparities": 40}}))[0].option,
            "disparity.num_disparities"
        );
    }

    #[test]
    fn refuses_combinations_that_cannot_work() {
        assert_eq!(
            problems(json!({"detection": {"detector": "sift"}}))[0].option,
            "detection.descriptor"
        );
        assert_eq!(problems(json!({"disparity": {"p1": 6000}}))[0].option, "disparity.p2");
        for export in [json!({"forward": "z"}), json!({"forward": "-y", "up_axis": "y"})] {
            assert_eq!(problems(json!({ "export": export }))[0].option, "export.forward");
        }
        let unreal = json!({"export": {"forward": "x", "up_axis": "z"}});
        assert!(parse(&unreal).is_ok());
    }

    #[test]
    fn dotted_fields_nest_and_lie_over_each_other() {
        let mut options = json!({});
        merge(&mut options, nested("disparity.block_size", "15"));
        merge(&mut options, nested("disparity.mode", "eight_path"));
        merge(&mut options, nested("method", "uncalibrated"));
        let options = parse(&options).unwrap();
        assert_eq!(options.disparity.block_size, 15);
        assert_eq!(options.disparity.mode, SgbmMode::EightPath);
    }
}

#[cfg(test)]
#[path = "options_tests.rs"]
mod schema_tests;
