//! How a model is drawn: size, scale, lines, background.

use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::DrawError;
use super::background::Background;
use super::degrade_options::DegradeOptions;
use frames::{Azimuth, Elevation, Viewpoint};
use options::{OptionProblem, OptionSet, Schema, check_set};

/// How a model is drawn. The defaults are the dissertation's (METHOD.md, section 7).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DrawOptions {
    /// Width of a view in pixels.
    #[schemars(range(min = 16, max = 8192))]
    pub width_px: u32,
    /// Height of a view in pixels.
    #[schemars(range(min = 16, max = 8192))]
    pub height_px: u32,
    /// Scene units across the width of a view.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub scale: f64,
    /// Centre the model on the turntable axis and size it so that no view leaves the frame.
    pub fit: bool,
    /// Horizontal distance of the camera from the turntable axis in scene units. Views that have an
    /// elevation of their own are drawn from as far as the others.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub distance: f64,
    /// Elevation of the camera of views that have none of their own, degrees, up positive.
    #[schemars(range(min = -85, max = 85))]
    pub elevation_deg: f64,
    /// Samples of a pixel on each axis, for lines and ground truth.
    #[schemars(range(min = 1, max = 4))]
    pub supersampling: u32,
    /// Width of a line in pixels of the drawing.
    #[schemars(range(min = 0.1, max = 32))]
    pub line_width_px: f64,
    /// Edges whose faces make a smaller angle than this, in degrees, are creases; 180 is flat.
    #[schemars(range(min = 0, max = 180))]
    pub crease_angle_deg: f64,
    /// How occluding contours are found.
    pub contours: ContourStyle,
    /// What is drawn: lines alone, or on the model's colours.
    pub ink: Ink,
    /// What is behind the subject: white, grey, transparent, or a colour as #rrggbb. Lines alone are
    /// white where that is dark.
    pub background: Background,
    /// Imperfections as in drawings by hand.
    pub degrade: DegradeOptions,
}

/// How occluding contours are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ContourStyle {
    /// Smooth for models that give normals, otherwise polygonal.
    #[default]
    Auto,
    /// Where the interpolated normal is at right angles to the view.
    Smooth,
    /// Edges between a face that is seen from its front and one seen from its back.
    Polygonal,
}

/// What is drawn of the model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Ink {
    /// Its lines.
    #[default]
    Lines,
    /// Lines on its colours, which are those of vertices and materials; models that give none get
    /// one a material.
    Flat,
    /// The same, lit from the viewer's upper left.
    Shaded,
}

impl Default for DrawOptions {
    fn default() -> Self {
        Self {
            width_px: 960,
            height_px: 540,
            scale: 7.3,
            fit: false,
            distance: 8.0,
            elevation_deg: 0.0,
            supersampling: 2,
            line_width_px: 1.5,
            crease_angle_deg: 134.43,
            contours: ContourStyle::Auto,
            ink: Ink::Lines,
            background: Background::White,
            degrade: DegradeOptions::default(),
        }
    }
}

impl DrawOptions {
    /// Pixels of the drawing a unit of the model.
    pub fn pixels_per_unit(&self) -> f64 {
        f64::from(self.width_px) / self.scale
    }

    /// The camera's distance from the origin, scene units.
    pub fn camera_distance(&self) -> f64 {
        self.distance / self.elevation_deg.to_radians().cos()
    }

    /// The elevation of views that have none of their own; level for what no options may say.
    pub fn elevation(&self) -> Elevation {
        Elevation::from_degrees(self.elevation_deg).unwrap_or_default()
    }

    /// Where the camera of a view at `azimuth` stands if nothing else is said.
    pub fn viewpoint(&self, azimuth: Azimuth) -> Viewpoint {
        Viewpoint { azimuth, elevation: self.elevation() }
    }

    /// Pixels of a view.
    pub(super) fn pixels(&self) -> u64 {
        u64::from(self.width_px) * u64::from(self.height_px)
    }

    /// # Errors
    /// [`DrawError::Options`] for what the schema does not accept,
    /// [`DrawError::TooManySamples`] if size and supersampling together ask for more than `limit`.
    pub(super) fn check(&self, limit: u64) -> Result<(), DrawError> {
        check_set(self)?;
        let found = self.pixels() * u64::from(self.supersampling).pow(2);
        (found <= limit).then_some(()).ok_or(DrawError::TooManySamples { found, limit })
    }
}

impl OptionSet for DrawOptions {
    const LISTED_AT: &'static str = "/v1/sheet-options";

    fn schema() -> &'static Schema {
        static SCHEMA: LazyLock<Schema> = LazyLock::new(Schema::of::<DrawOptions>);
        &SCHEMA
    }

    fn conflicts(&self) -> Vec<OptionProblem> {
        Vec::new()
    }
}
