//! Jobs that reconstruct a sheet.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use sheet::SheetDocument;

/// The kind of jobs that reconstruct a sheet.
pub const RECONSTRUCTION: &str = "reconstruction";

/// The input that holds the matches of a sheet: a list of
/// [`sheet::PairMatchesDocument`].
pub const MATCHES_INPUT: &str = "matches.json";

/// What a reconstruction job needs apart from its stored inputs. The image
/// names of the document are the inputs' names.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReconstructionPayload {
    /// The sheet: its views, options and truth.
    pub document: SheetDocument,
    /// Whether matches lie among the inputs, as [`MATCHES_INPUT`]: too large to
    /// be read with every status.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub has_matches: bool,
    /// The earlier job whose inputs were taken over.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<Uuid>,
    /// The page whose figures its views are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub page: Option<Uuid>,
}

/// What a draft came to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ReconstructionSummary {
    /// How well the draft, drawn again, matches each drawing, level
    /// ones by rising azimuth, then those from above and below;
    /// empty for a method that makes no solid.
    pub fit: Vec<FitSummary>,
    /// What a person should look at, in sentences.
    pub warnings: Vec<String>,
}

/// How well the draft, drawn again, matches one drawing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FitSummary {
    /// Degrees in [0, 360).
    #[schema(minimum = 0, exclusive_maximum = 360)]
    pub azimuth_deg: f64,
    /// Degrees from -90 to 90; 0 for a level view.
    #[serde(default)]
    #[schema(minimum = -90, maximum = 90)]
    pub elevation_deg: f64,
    /// Intersection over union of the draft's silhouette with the drawing's.
    #[schema(minimum = 0, maximum = 1)]
    pub silhouette_iou: f64,
    /// Mean distance between both outlines, px; null if one is empty.
    pub outline_distance_px: Option<f64>,
    /// Share of the drawing's ink that lies at an edge of the draft.
    #[schema(minimum = 0, maximum = 1)]
    pub ink_explained: f64,
}
