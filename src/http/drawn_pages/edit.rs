//! A page as clients edit it.

use serde::Deserialize;
use serde::de::IgnoredAny;
use utoipa::ToSchema;

use super::document::PixelBox;

/// The page as it should be: its figures, in order. What the service finds out by
/// itself may be left as it was and is not read.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct PageEdit {
    pub figures: Vec<FigureEdit>,
    #[serde(default, rename = "id")]
    #[schema(ignore)]
    _id: IgnoredAny,
    #[serde(default, rename = "version")]
    #[schema(ignore)]
    _version: IgnoredAny,
    #[serde(default, rename = "name")]
    #[schema(ignore)]
    _name: IgnoredAny,
    #[serde(default, rename = "labels")]
    #[schema(ignore)]
    _labels: IgnoredAny,
    #[serde(default, rename = "expires_at")]
    #[schema(ignore)]
    _expires_at: IgnoredAny,
    #[serde(default, rename = "pinned")]
    #[schema(ignore)]
    _pinned: IgnoredAny,
    #[serde(default, rename = "created_at")]
    #[schema(ignore)]
    _created_at: IgnoredAny,
    #[serde(default, rename = "changed_at")]
    #[schema(ignore)]
    _changed_at: IgnoredAny,
    #[serde(default, rename = "pictures")]
    #[schema(ignore)]
    _pictures: IgnoredAny,
    #[serde(default, rename = "left_out")]
    #[schema(ignore)]
    _left_out: IgnoredAny,
    #[serde(default, rename = "confidence")]
    #[schema(ignore)]
    _confidence: IgnoredAny,
    #[serde(default, rename = "sheet")]
    #[schema(ignore)]
    _sheet: IgnoredAny,
    #[serde(default, rename = "links")]
    #[schema(ignore)]
    _links: IgnoredAny,
}

/// One figure as it should be.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct FigureEdit {
    /// Which of the pictures it is on, from 0.
    #[serde(default)]
    pub picture: usize,
    /// Its bounds, px; inside of the picture.
    #[serde(rename = "box")]
    pub place: PixelBox,
    /// Degrees: 0 is the front, 90 shows the subject's left side.
    pub azimuth_deg: f64,
    /// How far the camera is raised, degrees: 0 is level, 90 looks straight down.
    #[serde(default)]
    #[schema(minimum = -90, maximum = 90)]
    pub elevation_deg: f64,
    /// Whether it is a view of the sheet.
    #[serde(default = "yes")]
    #[schema(default = true)]
    pub kept: bool,
    /// Whether the drawing is mirrored.
    #[serde(default)]
    pub mirrored: bool,
    /// The outline by hand, px.
    #[serde(default)]
    #[schema(value_type = Vec<Vec<f64>>)]
    pub polygon: Vec<[f64; 2]>,
    /// Areas that are paper: polygons, px.
    #[serde(default)]
    #[schema(value_type = Vec<Vec<Vec<f64>>>)]
    pub erase: Vec<Vec<[f64; 2]>>,
    /// Points in pieces that are of the subject, px.
    #[serde(default)]
    #[schema(value_type = Vec<Vec<f64>>)]
    pub attach: Vec<[f64; 2]>,
    /// Points in pieces that are not of the subject, px.
    #[serde(default)]
    #[schema(value_type = Vec<Vec<f64>>)]
    pub ignore: Vec<[f64; 2]>,
    /// The column of its turning axis, px; null has it found.
    #[serde(default)]
    pub axis_x: Option<f64>,
    /// The row where the axis meets the ground, px; null has it found.
    #[serde(default)]
    pub ground_y: Option<f64>,
    /// By what it is multiplied to fit the others: 2 for a figure drawn at half their size; null
    /// has it found.
    #[serde(default)]
    #[schema(minimum = 0.125, maximum = 8)]
    pub scale_by_hand: Option<f64>,
    /// Points in holes through the subject, px.
    #[serde(default)]
    #[schema(value_type = Vec<Vec<f64>>)]
    pub holes: Vec<[f64; 2]>,
    /// Keep the mask that was sent for the figure of this number. A new one comes
    /// as a part `mask[N]`, N from 0 in the order of this list.
    #[serde(default)]
    pub mask_given: bool,
    /// Whether that mask covers the outline's stroke, as masks that are found do; else it ends in
    /// the stroke's middle.
    #[serde(default)]
    pub mask_with_outline: bool,
    #[serde(default, rename = "crop")]
    #[schema(ignore)]
    _crop: IgnoredAny,
    #[serde(default, rename = "confidence")]
    #[schema(ignore)]
    pub confidence: Option<f64>,
    #[serde(default, rename = "outline")]
    #[schema(ignore)]
    _outline: IgnoredAny,
    #[serde(default, rename = "baseline_row")]
    #[schema(ignore)]
    _baseline_row: IgnoredAny,
    #[serde(default, rename = "axis_column")]
    #[schema(ignore)]
    _axis_column: IgnoredAny,
    #[serde(default, rename = "facing")]
    #[schema(ignore)]
    _facing: IgnoredAny,
    #[serde(default, rename = "scale")]
    #[schema(ignore)]
    _scale: IgnoredAny,
    #[serde(default, rename = "row")]
    #[schema(ignore)]
    _row: IgnoredAny,
    #[serde(default, rename = "warnings")]
    #[schema(ignore)]
    _warnings: IgnoredAny,
    #[serde(default, rename = "crop_picture")]
    #[schema(ignore)]
    _crop_picture: IgnoredAny,
    #[serde(default, rename = "mask_picture")]
    #[schema(ignore)]
    _mask_picture: IgnoredAny,
}

fn yes() -> bool {
    true
}
