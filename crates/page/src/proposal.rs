//! What is proposed for a page: its figures with their azimuths, and what was
//! left out.

use std::fmt;

use frames::Azimuth;
use image::GrayImage;
use serde::{Serialize, Serializer};
use subject::raster::{Bits, Raster};
use subject::{Box2, Paper, PaperSummary, Point};

/// What was found on a page. Places are in its pixels.
#[derive(Clone, Debug, Serialize)]
pub struct PageProposal {
    /// Columns of the page.
    pub width: u32,
    /// Rows of the page.
    pub height: u32,
    /// The paper.
    pub paper: PaperSummary,
    /// The views, in reading order.
    pub figures: Vec<Figure>,
    /// How likely all azimuths together are, 0 to 1, as far as was looked.
    pub confidence: f64,
    /// What is on the page and no view.
    pub left_out: Vec<LeftOut>,
    /// Whose each working pixel is.
    #[serde(skip)]
    pub(crate) owners: Raster<u16>,
    /// Working pixels of frames and straight lines that are of no view, with the blur about them.
    #[serde(skip)]
    pub(crate) rubbed: Bits,
    /// A working pixel is so many page pixels wide.
    #[serde(skip)]
    pub(crate) factor: usize,
    /// The paper's colour everywhere.
    #[serde(skip)]
    pub(crate) field: Paper,
    /// Whether the paper is transparent.
    #[serde(skip)]
    pub(crate) is_clear: bool,
}

/// Owners of working pixels: nothing, what is left out, the first figure.
pub(crate) const NOBODY: u16 = 0;
pub(crate) const LEFT: u16 = 1;
pub(crate) const FIRST: u16 = 2;

/// One view on the page.
#[derive(Clone, Debug, Serialize)]
pub struct Figure {
    /// Its bounds, px.
    #[serde(rename = "box")]
    pub place: Box2,
    /// Its outline as a polygon, px.
    pub outline: Vec<Point>,
    /// 255 inside, of the size of the box.
    #[serde(skip)]
    pub mask: GrayImage,
    /// The row on which it stands: the first below it, px.
    pub baseline_row: u32,
    /// The column of its turning axis, px.
    pub axis_column: f64,
    /// Its height as a share of the views' median height.
    pub scale: f64,
    /// Which row of figures it is in, from the top, 0 the first.
    pub row: usize,
    /// Where its camera is thought to stand.
    #[serde(serialize_with = "degrees", rename = "azimuth_deg")]
    pub azimuth: Azimuth,
    /// How likely the azimuth is, 0 to 1; 1 if it was given.
    pub confidence: f64,
    /// Which way it faces on the page: -1 to the left, 1 to the right, 0 if
    /// that could not be told.
    pub facing: f64,
}

impl Figure {
    /// How likely its azimuth is, if that is a guess.
    pub fn guessed(&self) -> Option<f64> {
        (self.confidence < 1.0).then_some(self.confidence)
    }
}

fn degrees<S: Serializer>(azimuth: &Azimuth, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_f64(azimuth.degrees())
}

/// Something on the page that is no view.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LeftOut {
    /// What it is thought to be.
    pub kind: LeftOutKind,
    /// Its bounds, px.
    #[serde(rename = "box")]
    pub place: Box2,
    /// Why it is no view.
    pub why: &'static str,
}

/// What was left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LeftOutKind {
    /// Lettering.
    Caption,
    /// A rectangle around drawings.
    Frame,
    /// A long straight line.
    Guide,
    /// A line on which figures stand.
    GroundLine,
    /// A measured distance.
    DimensionLine,
    /// A small area of one colour.
    Swatch,
    /// The upper part of the subject, drawn again.
    Head,
    /// Something smaller than the views.
    Prop,
    /// As tall as the views, of another shape.
    ExtraPose,
}

impl fmt::Display for LeftOutKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Caption => "caption",
            Self::Frame => "frame",
            Self::Guide => "guide",
            Self::GroundLine => "ground",
            Self::DimensionLine => "dimension",
            Self::Swatch => "swatch",
            Self::Head => "head",
            Self::Prop => "prop",
            Self::ExtraPose => "pose",
        })
    }
}
