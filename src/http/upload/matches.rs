//! The parts `matches` of an upload: matches that a person corrected.

use bytes::Bytes;

use super::document::Document;
use crate::draft::options::Options;
use crate::http::problem::{INVALID_SHEET, Problem};
use crate::kinds::MATCHES_INPUT;
use frames::{Azimuth, Viewpoint};
use sheet::{PairMatchesDocument, PictureSize, SheetDocument};

/// Reads the parts `matches`: each one pair's document, or a list of them.
pub(super) fn parse(parts: &[Document]) -> Result<Vec<PairMatchesDocument>, Problem> {
    let mut pairs = Vec::new();
    for part in parts {
        match part.first() {
            Some(b'[') => pairs.extend(part.parse::<Vec<_>>(INVALID_SHEET)?),
            _ => pairs.push(part.parse(INVALID_SHEET)?),
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

/// Holds all matches against the level views they are for, given by rising azimuth.
pub(super) fn check(
    documents: &[PairMatchesDocument],
    views: &[(Viewpoint, PictureSize)],
    options: &Options,
) -> Result<(), Problem> {
    let level = views.iter().filter(|(view, _)| view.is_level());
    let level: Vec<_> = level.map(|(view, size)| (view.azimuth, *size)).collect();
    sheet::check_matches(documents, &level, options.max_pair_angle_deg)
        .map(|_| ())
        .map_err(|error| Problem::new(INVALID_SHEET, error.to_string()).part("matches"))
}

/// Takes the matches out of a document, to be stored as an input beside the
/// pictures: they may be large, and a job's payload is read with every status.
pub(super) fn set_apart(document: &mut SheetDocument) -> Result<Option<(String, Bytes)>, Problem> {
    let matches = std::mem::take(&mut document.matches);
    if matches.is_empty() {
        return Ok(None);
    }
    let bytes =
        serde_json::to_vec(&matches).map_err(|error| Problem::internal("matches", &error))?;
    Ok(Some((MATCHES_INPUT.to_owned(), bytes.into())))
}
