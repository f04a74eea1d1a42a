//! Typed options and the one JSON Schema that documents and checks them.
//!
//! A struct of options derives its schema from its types and doc comments; the
//! same document is what the service lists, what uploads are checked against
//! and what the command line accepts. Each crate owns its own options.

use std::fmt;

use jsonschema::error::ValidationErrorKind;
use jsonschema::{ValidationError, Validator};
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

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
    /// Whether it is unknown or its value is not accepted.
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
    /// The schema as JSON.
    pub document: Value,
    validator: Validator,
}

impl Schema {
    /// The schema that `T` derives, ready to check values.
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

/// Reads options from JSON; what is not given has its default.
///
/// ```
/// use std::sync::LazyLock;
///
/// use options::{OptionProblem, OptionSet, Schema, parse_set};
///
/// #[derive(Default, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
/// #[serde(default, deny_unknown_fields)]
/// struct Pencil {
///     #[schemars(range(min = 1, max = 9))]
///     width_px: u32,
/// }
///
/// impl OptionSet for Pencil {
///     const LISTED_AT: &'static str = "/pencil-options";
///
///     fn schema() -> &'static Schema {
///         static SCHEMA: LazyLock<Schema> = LazyLock::new(Schema::of::<Pencil>);
///         &SCHEMA
///     }
///
///     fn conflicts(&self) -> Vec<OptionProblem> {
///         Vec::new()
///     }
/// }
///
/// let problems = parse_set::<Pencil>(&serde_json::json!({"width_px": 12})).err().unwrap();
/// assert_eq!(problems.to_string(), "width_px: 12 is out of range; give 1 to 9");
/// ```
///
/// # Errors
/// [`OptionProblems`]: every unknown option, wrong type and value out of range,
/// and combinations that cannot work.
pub fn parse_set<T: OptionSet>(value: &Value) -> Result<T, OptionProblems> {
    let errors = T::schema().validator.iter_errors(value);
    let problems: Vec<_> = errors.flat_map(|e| problems_of::<T>(&e)).collect();
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

fn problems_of<T: OptionSet>(error: &ValidationError<'_>) -> Vec<OptionProblem> {
    let at = error.instance_path().to_string().trim_start_matches('/').replace('/', ".");
    let ValidationErrorKind::AdditionalProperties { unexpected } = error.kind() else {
        let detail = remedy(error, &T::schema().document).unwrap_or_else(|| error.to_string());
        return vec![OptionProblem { option: at, kind: OptionProblemKind::Invalid, detail }];
    };
    let place = if at.is_empty() { "the options".to_owned() } else { format!("`{at}`") };
    let problem = |name: &String| OptionProblem {
        option: if at.is_empty() { name.clone() } else { format!("{at}.{name}") },
        kind: OptionProblemKind::Unknown,
        detail: format!("there is no such option in {place}; {} lists all", T::LISTED_AT),
    };
    unexpected.iter().map(problem).collect()
}

/// What would be accepted in place of a refused value: both ends of its range,
/// or all words that the option takes.
fn remedy(error: &ValidationError<'_>, document: &Value) -> Option<String> {
    let keyword = error.schema_path().to_string();
    let of_value = document.pointer(keyword.rsplit_once('/')?.0)?;
    match error.kind() {
        ValidationErrorKind::Minimum { .. } | ValidationErrorKind::Maximum { .. } => {
            let (low, high) = (of_value.get("minimum")?, of_value.get("maximum")?);
            Some(format!("{} is out of range; give {low} to {high}", error.instance()))
        }
        ValidationErrorKind::OneOfNotValid { .. }
        | ValidationErrorKind::AnyOf { .. }
        | ValidationErrorKind::Constant { .. }
        | ValidationErrorKind::Enum { .. } => {
            let words: Vec<_> = words_of(of_value).into_iter().map(Value::to_string).collect();
            let listed = || format!("{} is not one of {}", error.instance(), words.join(", "));
            (!words.is_empty()).then(listed)
        }
        _ => None,
    }
}

/// All constants that a schema of alternatives accepts.
fn words_of(schema: &Value) -> Vec<&Value> {
    let lists = ["oneOf", "anyOf"].iter().filter_map(|key| schema.get(key)?.as_array());
    let alternatives = lists.flatten().flat_map(words_of);
    let listed = schema.get("enum").and_then(Value::as_array).into_iter().flatten();
    schema.get("const").into_iter().chain(listed).chain(alternatives).collect()
}

/// The same schema with every choice of words as one `enum`, for generators of
/// clients that cannot read a word's own description. What the words mean goes
/// into the description of the whole.
///
/// ```
/// let words = serde_json::json!({"description": "Line ends.", "oneOf": [
///     {"type": "string", "const": "round", "description": "As a pen."},
///     {"type": "string", "const": "flat"},
/// ]});
/// let folded = options::with_enums(&words);
/// assert_eq!(folded["enum"], serde_json::json!(["round", "flat"]));
/// assert_eq!(folded["description"], "Line ends.\n\n* `round`: As a pen.");
/// ```
pub fn with_enums(schema: &Value) -> Value {
    match schema {
        Value::Array(items) => items.iter().map(with_enums).collect(),
        Value::Object(entries) => {
            let mut entries: Map<String, Value> =
                entries.iter().map(|(key, value)| (key.clone(), with_enums(value))).collect();
            if let Some(alternatives) = entries.get("oneOf").and_then(Value::as_array)
                && let Some((words, told)) = folded(alternatives)
            {
                let own = entries.get("description").and_then(Value::as_str).unwrap_or_default();
                let told = told.join("\n");
                let parts = [own, told.as_str()].into_iter().filter(|it| !it.is_empty());
                let whole = parts.collect::<Vec<_>>().join("\n\n");
                entries.remove("oneOf");
                entries.insert("type".to_owned(), "string".into());
                entries.insert("enum".to_owned(), words.into());
                if !whole.is_empty() {
                    entries.insert("description".to_owned(), whole.into());
                }
            }
            Value::Object(entries)
        }
        other => other.clone(),
    }
}

/// The words of alternatives that are words alone, and a line for each that has
/// a description.
fn folded(alternatives: &[Value]) -> Option<(Vec<Value>, Vec<String>)> {
    let (mut words, mut told) = (Vec::new(), Vec::new());
    for alternative in alternatives {
        let own = words_of(alternative);
        if own.is_empty() || !own.iter().all(|word| word.is_string()) {
            return None;
        }
        if let (Some(text), [word]) = (alternative["description"].as_str(), own.as_slice()) {
            let word = word.as_str().unwrap_or_default();
            told.push(format!("* `{word}`: {}", text.replace('\n', " ")));
        }
        words.extend(own.into_iter().cloned());
    }
    Some((words, told))
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

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use serde::Deserialize;
    use serde_json::json;

    use super::*;

    #[derive(Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case")]
    enum Paper {
        /// As it comes.
        #[default]
        Rough,
        /// Pressed.
        Smooth,
    }

    #[derive(Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    struct Pencil {
        /// How wide it draws, px.
        #[schemars(range(min = 1, max = 9))]
        width_px: u32,
        paper: Paper,
    }

    impl OptionSet for Pencil {
        const LISTED_AT: &'static str = "/pencil-options";

        fn schema() -> &'static Schema {
            static SCHEMA: LazyLock<Schema> = LazyLock::new(Schema::of::<Pencil>);
            &SCHEMA
        }

        fn conflicts(&self) -> Vec<OptionProblem> {
            Vec::new()
        }
    }

    fn detail(value: Value) -> String {
        parse_set::<Pencil>(&value).unwrap_err().0[0].detail.clone()
    }

    #[test]
    fn a_range_is_told_from_low_to_high_out_of_the_option_s_own_schema() {
        assert_eq!(detail(json!({"width_px": 12})), "12 is out of range; give 1 to 9");
        assert_eq!(detail(json!({"width_px": 0})), "0 is out of range; give 1 to 9");
    }

    #[test]
    fn a_wrong_word_is_answered_with_the_words_that_are_taken() {
        let told = detail(json!({"paper": "rogh"}));
        assert_eq!(told, r#""rogh" is not one of "rough", "smooth""#);
    }

    #[test]
    fn an_unknown_option_is_named_with_the_place_that_lists_all() {
        let told = detail(json!({"hardness": 2}));
        assert_eq!(told, "there is no such option in the options; /pencil-options lists all");
    }
}
