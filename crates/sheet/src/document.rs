//! The sheet document as JSON: `sheet.json`, and the part `sheet` of an upload.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::matches::PairMatchesDocument;

use frames::{Azimuth, Elevation, UpAxis, Viewpoint};

/// The sheet document: `sheet.json` on disk, the part `sheet` of an upload and
/// the stored description of a job. Image names are relative to the document.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "the schema describes it")]
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
    /// Matches that a person corrected or made, by pair of neighbouring views.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub matches: Vec<PairMatchesDocument>,
    /// Options, nested by stage; see `/v1/options`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub options: Option<Value>,
}

/// One drawn view.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ViewDocument {
    /// Name of the drawing: PNG, JPEG, WebP, TIFF, GIF or SVG.
    pub image: String,
    /// Degrees, the camera moving counter-clockwise seen from above; 0 is the
    /// front, 90 shows the subject's left side.
    pub azimuth_deg: f64,
    /// How likely the azimuth is, where it is a guess: that of a figure found on a page. A warning
    /// says where it is uncertain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 1))]
    pub azimuth_confidence: Option<f64>,
    /// How far the camera is raised, degrees from -90 to 90: 0 is level, 90 looks straight down.
    /// There the azimuth only turns the picture: at 0 the front is at its bottom edge; from
    /// below, at -90, at its top edge.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = -90, max = 90))]
    pub elevation_deg: Option<f64>,
    /// Name of the subject's mask: white inside.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mask: Option<String>,
    /// Whether the mask covers the outline's stroke, as masks that are found do; else it ends in
    /// the stroke's middle.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub mask_with_outline: bool,
    /// How wide that stroke is, px of the drawing; 0 if the outline is not drawn. Measured if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 100))]
    pub outline_px: Option<f64>,
    /// Whether the mask leaves out what one sees through, so that no holes need be looked for, as
    /// masks found in painted drawings do.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub mask_has_holes: bool,
    /// The subject's outline by hand, px from the drawing's top left corner.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub polygon: Vec<[f64; 2]>,
    /// Areas that are paper, whatever is drawn there: polygons, px.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub erase: Vec<Vec<[f64; 2]>>,
    /// Points in pieces of the drawing that are of the subject, px.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub attach: Vec<[f64; 2]>,
    /// Points in pieces of the drawing that are not of the subject, px.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ignore: Vec<[f64; 2]>,
    /// The column of the turning axis in the drawing, px from its left edge.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis_x: Option<f64>,
    /// The row of the point where the axis meets the ground, px from the drawing's top edge: where
    /// the subject stands in a level view.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ground_y: Option<f64>,
    /// By what the drawing is multiplied to fit the others: 2 for one drawn at half their size.
    /// What is not said of a view's place is found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.125, max = 8))]
    pub scale: Option<f64>,
    /// Whether the drawing is mirrored: it is turned back before it is used.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub mirrored: bool,
    /// Name of the true depth picture: distance from the camera plane, as an 8-
    /// or 16-bit PNG (counts, 0 is background), PFM or EXR (units).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<String>,
    /// Name of the true disparity picture: PNG, PFM or EXR. A view has a depth
    /// or a disparity picture, not both.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub disparity: Option<String>,
}

/// Of azimuths guessed with less confidence about every second one is wrong; of the others 3 %.
const SURE: f64 = 0.8;

/// What a person should be told of an azimuth that was guessed, if it is uncertain.
pub fn azimuth_doubt(azimuth_deg: f64, confidence: f64) -> Option<String> {
    (confidence < SURE).then(|| {
        format!(
            "its azimuth of {azimuth_deg} degrees is a guess that is {:.0} % sure, which is often wrong; look whether the drawing shows the subject from there, and else give the azimuth by hand",
            100.0 * confidence.max(0.0)
        )
    })
}

/// Places by hand are at most so far from a drawing's corner, px.
const MAX_PLACE_PX: f64 = 65_536.0;

/// What a picture of true values holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TruthKind {
    /// Distance from the camera plane: nearer is smaller.
    Depth,
    /// Disparity, or a ramp of nearness: nearer is larger.
    Disparity,
}

impl SheetDocument {
    /// Whether something is known that drafts are compared with.
    pub fn has_truth(&self) -> bool {
        self.truth.is_some() || self.views.iter().any(|view| view.truth().is_some())
    }
}

impl ViewDocument {
    /// Where it is drawn from; `None` if its angles are none.
    pub fn viewpoint(&self) -> Option<Viewpoint> {
        let azimuth = Azimuth::from_degrees(self.azimuth_deg).ok()?;
        let elevation = Elevation::from_degrees(self.elevation_deg.unwrap_or(0.0)).ok()?;
        Some(Viewpoint { azimuth, elevation })
    }

    /// What to say if its azimuth is an uncertain guess.
    pub fn doubt(&self) -> Option<String> {
        let doubt = azimuth_doubt(self.azimuth_deg, self.azimuth_confidence?)?;
        Some(format!("view {}: {doubt}", self.viewpoint()?))
    }

    /// What is wrong with the view's place or sureness: the field, its value, what would be accepted.
    pub fn wrong_place(&self) -> Option<(&'static str, f64, &'static str)> {
        let wrong = |field, value: Option<f64>, is_good: &dyn Fn(f64) -> bool, accepted| {
            value.filter(|&value| !is_good(value)).map(|value| (field, value, accepted))
        };
        let on_page = |v: f64| v.is_finite() && v.abs() <= MAX_PLACE_PX;
        wrong("axis_x", self.axis_x, &on_page, "a place on the drawing, px")
            .or_else(|| wrong("ground_y", self.ground_y, &on_page, "a place on the drawing, px"))
            .or_else(|| {
                let is_good = |v| (0.125..=8.0).contains(&v);
                wrong("scale", self.scale, &is_good, "a factor from 0.125 to 8")
            })
            .or_else(|| {
                let is_good = |v| (0.0..=100.0).contains(&v);
                wrong("outline_px", self.outline_px, &is_good, "a width from 0 to 100")
            })
            .or_else(|| {
                let is_good = |v| (0.0..=1.0).contains(&v);
                wrong(
                    "azimuth_confidence",
                    self.azimuth_confidence,
                    &is_good,
                    "a share from 0 to 1",
                )
            })
    }

    /// The picture of true values and what it holds.
    pub fn truth(&self) -> Option<(TruthKind, &str)> {
        let depth = self.depth.as_deref().map(|name| (TruthKind::Depth, name));
        depth.or(self.disparity.as_deref().map(|name| (TruthKind::Disparity, name)))
    }

    /// Names the picture of true values, or that there is none.
    pub fn set_truth(&mut self, truth: Option<(TruthKind, String)>) {
        (self.depth, self.disparity) = match truth {
            Some((TruthKind::Depth, name)) => (Some(name), None),
            Some((TruthKind::Disparity, name)) => (None, Some(name)),
            None => (None, None),
        };
    }
}

/// What is known of the subject, for measuring.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TruthDocument {
    /// Name of the true model: OBJ, PLY, STL, GLB or glTF, its origin on the
    /// turntable axis at the pictures' middle row; needs `pixels_per_unit`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// Which axis of the model points up; glTF has y, the others are read as z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model_up_axis: Option<UpAxis>,
    /// Counts of PNG depth pictures a unit; PFM and EXR hold units. Without it,
    /// `camera_distance` and `pixels_per_unit`, depths count up to scale only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_counts_per_unit: Option<f64>,
    /// Distance of the camera plane from the turntable axis, units.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_distance: Option<f64>,
    /// Signed angle from each view to the one that disparity pictures are
    /// towards, degrees; they tell in px how far left each point moves then.
    /// Without it they are ramps, nearer being larger, that count up to scale
    /// and offset only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub disparity_pair_deg: Option<f64>,
}

/// A hole through the subject, pointed at in one view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "the schema describes it")]
pub struct HoleDocument {
    pub azimuth_deg: f64,
    /// Of a view from above or below; views that are level have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub elevation_deg: Option<f64>,
    /// Pixels right of the view's left edge.
    pub x: f64,
    /// Pixels below the view's top edge.
    pub y: f64,
}
