//! The metrics artifact.

use std::collections::BTreeMap;

use artifacts::{AbsentArtifact, DepthPicture};
use evaluation::TruthReport;
use picture::EncodeError;
use serde::Serialize;
use subject::Alignment;

use super::options::Options;
use super::subjects::{DrawingReport, Preparation, SuggestionReport};
use crate::provenance::Program;

/// The metrics artifact; `M` is what the method measures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct MetricsDocument<'a, M> {
    /// Of this program.
    pub version: &'a str,
    pub provenance: &'a Provenance,
    pub width_px: u32,
    pub height_px: u32,
    /// All of them, defaults filled in.
    pub options: &'a Options,
    #[serde(flatten)]
    pub metrics: &'a M,
    /// What was found in the drawings and done to them; null where they were
    /// taken as they are.
    pub sheet: Option<SheetReport<'a>>,
    /// Against what is known to be true; null without truth.
    pub truth: Option<&'a TruthReport>,
    /// Sheet pixels a metre of the exported meshes and clouds.
    pub pixels_per_metre: Option<f64>,
    /// `depth_px = offset_px + scale_px * value`; the value 0 is missing.
    pub depth_pictures: Vec<DepthPicture>,
    /// Names of the files made before this one.
    pub artifacts: &'a [String],
    pub absent_artifacts: &'a [AbsentArtifact],
}

/// What the draft was made of, and by what.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Provenance {
    pub program: Program,
    /// SHA-256 of the options as JSON without spaces, all of them, in their order.
    pub options_sha256: String,
    /// SHA-256 of the bytes of each picture and model that was read, by its name.
    pub inputs_sha256: BTreeMap<String, String>,
}

/// What was found in the drawings and done to them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct SheetReport<'a> {
    drawings: &'a [DrawingReport],
    /// How views were laid on one canvas; null where they were left in place.
    alignment: Option<&'a Alignment>,
    suggestions: &'a [SuggestionReport],
}

impl<'a> SheetReport<'a> {
    pub(super) fn of(preparation: &'a Preparation) -> Self {
        Self {
            drawings: &preparation.drawings,
            alignment: preparation.alignment.as_ref(),
            suggestions: &preparation.suggestions,
        }
    }
}

impl<M: Serialize> MetricsDocument<'_, M> {
    pub(super) fn to_json(&self) -> Result<Vec<u8>, EncodeError> {
        serde_json::to_vec_pretty(self).map_err(|error| EncodeError::new("metrics", error))
    }
}
