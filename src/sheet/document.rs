use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The sheet document: `sheet.json` on disk, the part `sheet` of an upload and
/// the stored description of a job. Image names are relative to the document.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SheetDocument {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Width of every view, px; the images themselves decide.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub width: Option<u32>,
    /// Height of every view, px; the images themselves decide.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height: Option<u32>,
    /// Sheet pixels a unit of the true model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pixels_per_unit: Option<f64>,
    /// Camera elevation of views that state none, degrees, up positive.
    #[serde(default)]
    pub elevation_deg: f64,
    pub views: Vec<ViewDocument>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth: Option<TruthDocument>,
    /// Points that lie in a hole through the subject.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub holes: Vec<HoleDocument>,
    /// Options, nested by stage; see `/v1/options`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub options: Option<Value>,
}

/// One drawn view.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ViewDocument {
    /// Name of the drawing: PNG, JPEG, WebP or TIFF.
    pub image: String,
    /// Degrees, the camera moving counter-clockwise seen from above; 0 is the
    /// front, 90 shows the subject's left side.
    pub azimuth_deg: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub elevation_deg: Option<f64>,
    /// Name of the subject's mask: white inside.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mask: Option<String>,
    /// Name of the true depth picture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<String>,
    /// Name of the true disparity picture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub disparity: Option<String>,
}

/// What is known of the subject, for measuring.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TruthDocument {
    /// Name of the true model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// Counts of 16-bit depth pictures a unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_counts_per_unit: Option<f64>,
    /// Distance of the camera plane from the turntable axis, units.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_distance: Option<f64>,
}

/// A hole through the subject, pointed at in one view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HoleDocument {
    pub azimuth_deg: f64,
    /// Pixels right of the view's left edge.
    pub x: f64,
    /// Pixels below the view's top edge.
    pub y: f64,
}
