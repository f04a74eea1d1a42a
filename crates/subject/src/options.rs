//! What a caller may say about a drawing: hints by hand and switches.

use image::GrayImage;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::report::Point;

/// What a person says about one drawing. Places are in its pixels.
#[derive(Clone, Debug, Default)]
pub struct Hints {
    /// The subject's mask, 128 and above inside, the drawing's size.
    pub mask: Option<GrayImage>,
    /// The subject's outline; used if no mask is given. At least 3 points.
    pub polygon: Option<Vec<Point>>,
    /// Areas that are paper whatever is drawn there.
    pub erase: Vec<Vec<Point>>,
    /// Points in pieces (or holes) that are of the subject.
    pub attach: Vec<Point>,
    /// Points in pieces (or holes) that are not of the subject.
    pub ignore: Vec<Point>,
}

/// Whether something is removed from drawings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Removal {
    /// It is looked for, removed and listed.
    #[default]
    On,
    /// It stays.
    Off,
}

impl Removal {
    pub(crate) fn is_on(self) -> bool {
        self == Self::On
    }
}

/// Which things on the page are looked for and removed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CleanOptions {
    /// Rectangles around the drawing.
    pub frames: Removal,
    /// Long straight lines through or beside the figure.
    pub guides: Removal,
    /// The line on which the figure stands.
    pub ground: Removal,
    /// Lettering outside the figure.
    pub captions: Removal,
    /// Dimension lines.
    pub dimensions: Removal,
}

/// How areas that show paper inside the outline are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum HolePolicy {
    /// Holes in coloured and shaded drawings, none in line art.
    #[default]
    ByKind,
    /// Always holes.
    Cut,
    /// Never holes.
    Fill,
}

/// How a subject is looked for. All lengths are shares of the figure's height.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SubjectOptions {
    /// What is removed.
    pub clean: CleanOptions,
    /// How holes are read.
    pub holes: HolePolicy,
    /// Gaps in lines up to this are closed without a word; 0 closes none.
    pub max_gap: f64,
    /// Gaps up to this are closed with a warning.
    pub max_guessed_gap: f64,
    /// Pieces up to this far from the figure belong to it.
    pub attach_distance: f64,
    /// The longest side at which structure is looked for, px; larger drawings
    /// are reduced for it and refined afterwards.
    pub working_side_px: u32,
}

impl Default for SubjectOptions {
    fn default() -> Self {
        Self {
            clean: CleanOptions::default(),
            holes: HolePolicy::ByKind,
            max_gap: 0.1,
            max_guessed_gap: 0.22,
            attach_distance: 0.1,
            working_side_px: 2048,
        }
    }
}
