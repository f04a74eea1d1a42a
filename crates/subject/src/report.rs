//! What is reported about a drawing: its kind, what was removed, which pieces
//! were kept, which gaps were closed and what to look at.

use std::fmt;

use serde::Serialize;

/// A place in an image, pixels from the top left corner; pixel `(0, 0)` has
/// its centre at `(0.5, 0.5)`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, serde::Deserialize)]
pub struct Point {
    /// To the right, px.
    pub x: f64,
    /// Downward, px.
    pub y: f64,
}

/// A rectangle of pixels; `right` and `bottom` are the first outside.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Box2 {
    /// The first column, px.
    pub left: u32,
    /// The first row, px.
    pub top: u32,
    /// The column after the last, px.
    pub right: u32,
    /// The row after the last, px.
    pub bottom: u32,
}

impl Box2 {
    /// Columns covered, px.
    pub fn width(&self) -> u32 {
        self.right.saturating_sub(self.left)
    }

    /// Rows covered, px.
    pub fn height(&self) -> u32 {
        self.bottom.saturating_sub(self.top)
    }

    /// The smallest rectangle around both.
    #[must_use]
    pub fn joined(&self, other: &Self) -> Self {
        Self {
            left: self.left.min(other.left),
            top: self.top.min(other.top),
            right: self.right.max(other.right),
            bottom: self.bottom.max(other.bottom),
        }
    }

    /// As many pixels of `factor` times the size, on an image of `width` by
    /// `height`.
    #[must_use]
    pub fn scaled(&self, factor: u32, width: u32, height: u32) -> Self {
        Self {
            left: self.left * factor,
            top: self.top * factor,
            right: (self.right * factor).min(width),
            bottom: (self.bottom * factor).min(height),
        }
    }
}

impl fmt::Display for Box2 {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "columns {} to {}, rows {} to {}", self.left, self.right, self.top, self.bottom)
    }
}

/// What sort of drawing it is, as far as the silhouette is concerned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DrawingKind {
    /// Lines on paper; what they enclose looks like paper.
    LineArt,
    /// Lines on a transparent layer.
    InkLayer,
    /// Areas of few colours.
    Flat,
    /// Areas whose colours change smoothly.
    Shaded,
    /// The alpha channel is the subject's mask.
    CutOut,
    /// A mask or an outline was given by hand.
    Given,
}

/// Whether lines are darker or lighter than the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Polarity {
    /// Dark on light.
    DarkOnLight,
    /// Light on dark.
    LightOnDark,
}

/// What the paper looks like.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PaperSummary {
    /// Its mean colour, sRGB 0 to 255.
    pub colour: [u8; 3],
    /// How much its brightness changes over the page, grey levels.
    pub unevenness: f64,
    /// Grain and noise, standard deviation, grey levels.
    pub noise: f64,
}

/// What sort of thing was removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RemovedKind {
    /// A rectangle around the drawing.
    Frame,
    /// A long straight line through or beside the figure.
    Guide,
    /// The line on which the figure stands.
    GroundLine,
    /// Lettering.
    Caption,
    /// A measured distance: line, ends and figures.
    DimensionLine,
    /// Dots and dirt.
    Speck,
    /// What the hints said to erase.
    Erased,
}

impl fmt::Display for RemovedKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Frame => "frame",
            Self::Guide => "guide line",
            Self::GroundLine => "ground line",
            Self::Caption => "caption",
            Self::DimensionLine => "dimension line",
            Self::Speck => "speck",
            Self::Erased => "erased area",
        })
    }
}

/// Something that is on the page and not of the subject.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Removed {
    /// What it is.
    pub kind: RemovedKind,
    /// Where it was, px.
    #[serde(rename = "box")]
    pub place: Box2,
}

/// What was done with a connected part of the drawing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PieceRole {
    /// The largest one.
    Main,
    /// Apart from the largest, but of the subject.
    Attached,
    /// Not of the subject.
    Dropped,
}

/// A connected part of the silhouette.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Piece {
    /// What was done with it.
    pub role: PieceRole,
    /// Its bounds, px.
    #[serde(rename = "box")]
    pub place: Box2,
    /// Its area, px².
    pub area_px: u64,
}

/// A gap in the outline that was closed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gap {
    /// Its middle, px.
    pub place: Point,
    /// From one end of the line to the other, px.
    pub width_px: f64,
}

/// A side of the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Row 0.
    Top,
    /// The last row.
    Bottom,
    /// Column 0.
    Left,
    /// The last column.
    Right,
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Top => "top",
            Self::Bottom => "bottom",
            Self::Left => "left",
            Self::Right => "right",
        })
    }
}

/// Something that a person should look at.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Warning {
    /// The figure leaves the page; it was closed along the page's edge.
    CutByEdge {
        /// Where.
        side: Side,
    },
    /// A gap wider than is closed without a word was closed.
    WideGap {
        /// The gap.
        gap: Gap,
    },
    /// The outline does not close: little is enclosed.
    OpenOutline {
        /// The silhouette's area as a share of its bounds'.
        share: f64,
        /// The widest opening that was seen, if one was.
        gap: Option<Gap>,
    },
    /// A large part was taken for something else than the subject.
    PieceDropped {
        /// Its bounds, px.
        place: Box2,
        /// Its area as a share of the subject's.
        share: f64,
    },
    /// The subject is in many parts that do not touch.
    Scattered {
        /// So many.
        pieces: usize,
        /// The largest part's share of the area.
        main_share: f64,
    },
    /// The subject is hardly darker or lighter than the paper.
    LowContrast {
        /// Grey levels between paper and subject.
        contrast: f64,
        /// The paper's noise, grey levels.
        noise: f64,
    },
    /// The paper is so uneven that it may be a backdrop.
    BusyPaper {
        /// The share of the page's border that is not paper.
        share: f64,
    },
    /// A point of the hints met nothing.
    HintMissed {
        /// The point, px.
        point: Point,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::CutByEdge { side } => {
                write!(f, "the figure is cut by the page's {side} edge and was closed there")
            }
            Self::WideGap { gap } => write!(
                f,
                "a gap of {:.0} px in the outline at column {:.0}, row {:.0} was closed by a guess",
                gap.width_px, gap.place.x, gap.place.y
            ),
            Self::OpenOutline { share, gap } => {
                write!(
                    f,
                    "the outline does not close: it encloses {:.0} % of its bounds",
                    share * 100.0
                )?;
                match gap {
                    Some(gap) => write!(
                        f,
                        "; it is open at column {:.0}, row {:.0} over {:.0} px",
                        gap.place.x, gap.place.y, gap.width_px
                    ),
                    None => Ok(()),
                }
            }
            Self::PieceDropped { place, share } => write!(
                f,
                "a part of {:.0} % of the figure's area at {place} was not taken for the figure",
                share * 100.0
            ),
            Self::Scattered { pieces, main_share } => write!(
                f,
                "the figure is in {pieces} parts that do not touch; the largest has {:.0} % of the area",
                main_share * 100.0
            ),
            Self::LowContrast { contrast, noise } => write!(
                f,
                "the figure differs from the paper by {contrast:.0} grey levels only, the paper's noise is {noise:.1}"
            ),
            Self::BusyPaper { share } => write!(
                f,
                "{:.0} % of the page's border does not look like paper: the backdrop may be taken for the figure",
                share * 100.0
            ),
            Self::HintMissed { point } => {
                write!(f, "nothing is drawn at the hinted point ({:.0}, {:.0})", point.x, point.y)
            }
        }
    }
}
