//! The parts `matches` of an upload: matches that a person corrected.

use serde_json::Value;

use crate::draft::options::Options;
use crate::http::problem::{INVALID_SHEET, Problem};
use frames::Azimuth;
use sheet::{PairMatchesDocument, PictureSize};

/// Reads the parts `matches`: each one pair's document, or a list of them.
pub(super) fn parse(parts: Vec<Value>) -> Result<Vec<PairMatchesDocument>, Problem> {
    let mut pairs = Vec::new();
    for part in parts {
        let entries = match part {
            Value::Array(entries) => entries,
            entry => vec![entry],
        };
        for entry in entries {
            pairs.push(serde_path_to_error::deserialize(entry).map_err(|error| {
                let index = pairs.len();
                let detail = format!(
                    "in the part `matches`, in pair {index}, at `{}`: {}",
                    error.path(),
                    error.inner()
                );
                Problem::new(INVALID_SHEET, detail).part("matches")
            })?);
        }
    }
    Ok(pairs)
}

/// Lays pairs over a document's own; those of other pairs stay.
pub(super) fn lay_over(own: &mut Vec<PairMatchesDocument>, given: Vec<PairMatchesDocument>) {
    let pair = |one: &PairMatchesDocument| {
        [one.left_azimuth_deg, one.right_azimuth_deg].map(Azimuth::from_degrees)
    };
    own.retain(|old| !given.iter().any(|new| pair(new) == pair(old)));
    own.extend(given);
}

/// Holds all matches against the views they are for, given by rising azimuth.
pub(super) fn check(
    documents: &[PairMatchesDocument],
    views: &[(Azimuth, PictureSize)],
    options: &Options,
) -> Result<(), Problem> {
    sheet::check_matches(documents, views, options.max_pair_angle_deg)
        .map(|_| ())
        .map_err(|error| Problem::new(INVALID_SHEET, error.to_string()).part("matches"))
}
