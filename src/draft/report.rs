//! The metrics artifact.

use artifacts::{AbsentArtifact, DepthPicture};
use evaluation::TruthReport;
use picture::EncodeError;
use serde::Serialize;

use super::options::Options;

/// The metrics artifact; `M` is what the method measures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct MetricsDocument<'a, M> {
    /// Of this program.
    pub version: &'a str,
    pub width_px: u32,
    pub height_px: u32,
    /// All of them, defaults filled in.
    pub options: &'a Options,
    #[serde(flatten)]
    pub metrics: &'a M,
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

impl<M: Serialize> MetricsDocument<'_, M> {
    pub(super) fn to_json(&self) -> Result<Vec<u8>, EncodeError> {
        serde_json::to_vec_pretty(self).map_err(|error| EncodeError::new("metrics", error))
    }
}
