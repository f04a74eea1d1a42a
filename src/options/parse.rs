use std::fmt;
use std::sync::LazyLock;

use jsonschema::error::ValidationErrorKind;
use jsonschema::{ValidationError, Validator};
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use super::{Descriptor, Detector, Options};

/// What kind of thing is wrong with an option.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OptionProblemKind {
    /// There is no such option.
    Unknown,
    /// Its type or value is not accepted, or does not go with another's.
    Invalid,
}

/// One thing wrong with the options, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OptionProblem {
    /// Dotted name, such as `disparity.block_size`; empty for the whole.
    pub option: String,
    pub kind: OptionProblemKind,
    /// What is wrong and what would be accepted.
    pub detail: String,
}

/// Everything wrong with the options; never empty.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct OptionProblems(pub Vec<OptionProblem>);

impl fmt::Display for OptionProblems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines: Vec<_> = self
            .0
            .iter()
            .map(|p| match p.option.as_str() {
                "" => p.detail.clone(),
                option => format!("{option}: {}", p.detail),
            })
            .collect();
        f.write_str(&lines.join("; "))
    }
}

/// Options that a JSON Schema describes and checks, the schema being made from their types.
pub trait OptionSet: Serialize + DeserializeOwned + PartialEq {
    /// Where the service lists them.
    const LISTED_AT: &'static str;

    /// The schema with its validator, made once: a `static` of [`Schema::of`].
    fn schema() -> &'static Schema;

    /// Combinations that the schema cannot express.
    fn conflicts(&self) -> Vec<OptionProblem>;
}

/// A JSON Schema (draft 2020-12) of options, definitions inlined, each property with its type,
/// range, default and meaning.
#[derive(Debug)]
pub struct Schema {
    pub document: Value,
    validator: Validator,
}

impl Schema {
    pub fn of<T: JsonSchema>() -> Self {
        let document: Value = SchemaSettings::draft2020_12()
            .with(|settings| settings.inline_subschemas = true)
            .into_generator()
            .into_root_schema_for::<T>()
            .into();
        let validator = jsonschema::validator_for(&document).expect("our own schema is valid");
        Self { document, validator }
    }
}

/// The schema of a reconstruction's options.
pub fn schema() -> &'static Value {
    &Options::schema().document
}

/// Reads the options of a reconstruction from JSON; what is not given has its default.
///
/// # Errors
/// As [`parse_set`].
pub fn parse(value: &Value) -> Result<Options, OptionProblems> {
    parse_set(value)
}

/// Reads options from JSON; what is not given has its default.
///
/// # Errors
/// [`OptionProblems`]: every unknown option, wrong type and value out of range,
/// and combinations that cannot work.
pub fn parse_set<T: OptionSet>(value: &Value) -> Result<T, OptionProblems> {
    let errors = T::schema().validator.iter_errors(value);
    let problems: Vec<_> = errors.flat_map(|e| problems_of(&e, T::LISTED_AT)).collect();
    if !problems.is_empty() {
        return Err(OptionProblems(problems));
    }
    let options = T::deserialize(value).map_err(|error| OptionProblems::whole(&error))?;
    let problems = options.conflicts();
    if problems.is_empty() { Ok(options) } else { Err(OptionProblems(problems)) }
}

/// Checks options that were made in code as [`parse_set`] checks what comes as JSON.
///
/// # Errors
/// [`OptionProblems`]; a number that JSON cannot hold, such as NaN, is one too.
pub fn check_set<T: OptionSet>(options: &T) -> Result<(), OptionProblems> {
    let value = serde_json::to_value(options).map_err(|error| OptionProblems::whole(&error))?;
    if parse_set::<T>(&value)? == *options {
        return Ok(());
    }
    Err(OptionProblems::whole(&"a number is not finite"))
}

impl OptionProblems {
    fn whole(problem: &dyn fmt::Display) -> Self {
        Self(vec![OptionProblem {
            option: String::new(),
            kind: OptionProblemKind::Invalid,
            detail: problem.to_string(),
        }])
    }
}

fn problems_of(error: &ValidationError<'_>, listed_at: &str) -> Vec<OptionProblem> {
    let at = error.instance_path().to_string().trim_start_matches('/').replace('/', ".");
    let ValidationErrorKind::AdditionalProperties { unexpected } = error.kind() else {
        let detail = outside_range(error).unwrap_or_else(|| error.to_string());
        return vec![OptionProblem { option: at, kind: OptionProblemKind::Invalid, detail }];
    };
    let place = if at.is_empty() { "the options".to_owned() } else { format!("`{at}`") };
    let problem = |name: &String| OptionProblem {
        option: if at.is_empty() { name.clone() } else { format!("{at}.{name}") },
        kind: OptionProblemKind::Unknown,
        detail: format!("there is no such option in {place}; {listed_at} lists all"),
    };
    unexpected.iter().map(problem).collect()
}

/// Both ends of the range that a value lies outside of.
fn outside_range(error: &ValidationError<'_>) -> Option<String> {
    let is_range = matches!(
        error.kind(),
        ValidationErrorKind::Minimum { .. } | ValidationErrorKind::Maximum { .. }
    );
    let keyword = error.schema_path().to_string();
    let of_value = schema().pointer(keyword.rsplit_once('/').filter(|_| is_range)?.0)?;
    let (low, high) = (of_value.get("minimum")?, of_value.get("maximum")?);
    Some(format!("{} is out of range; give {low} to {high}", error.instance()))
}

/// The nested object of a dotted option: `("a.b", 1)` is `{"a": {"b": 1}}`.
/// Text that is not JSON is taken as a string, so `method=uncalibrated` works.
pub fn nested(dotted: &str, text: &str) -> Value {
    let leaf = serde_json::from_str(text).unwrap_or_else(|_| Value::String(text.to_owned()));
    dotted
        .rsplit('.')
        .fold(leaf, |inner, key| Value::Object(Map::from_iter([(key.to_owned(), inner)])))
}

/// Lays `over` on `base`, object by object; other values replace.
pub fn merge(base: &mut Value, over: Value) {
    match (base, over) {
        (Value::Object(base), Value::Object(over)) => {
            for (key, value) in over {
                merge(base.entry(key).or_insert(Value::Null), value);
            }
        }
        (base, over) => *base = over,
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

#[cfg(test)]
mod tests {
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
    }

    #[test]
    fn dotted_fields_nest_and_lie_over_each_other() {
        let mut options = json!({});
        merge(&mut options, nested("disparity.block_size", "15"));
        merge(&mut options, nested("disparity.mode", "eight_path"));
        merge(&mut options, nested("method", "uncalibrated"));
        let options = parse(&options).unwrap();
        assert_eq!(options.disparity.block_size, 15);
        assert_eq!(options.disparity.mode, super::super::SgbmMode::EightPath);
    }
}
