//! The subject of one drawing: its mask, its lines, its colours, and how they
//! were found.

use image::{GrayImage, RgbaImage};
use serde::Serialize;

use crate::alpha::{Meaning, laid_on_paper};
use crate::ink;
use crate::options::{Hints, SubjectOptions};
use crate::paper::Paper;
use crate::raster::Bits;
use crate::refine;
use crate::report::{
    DrawingKind, Gap, PaperSummary, Piece, Polarity, Removed, RemovedKind, Warning,
};
use crate::structure::{Area, Structure};
use crate::tone::Tone;

/// A subject smaller than this is none, px.
const LEAST_AREA_PX: usize = 16;

/// What was found in one drawing. All images have the drawing's size.
#[derive(Clone, Debug, Serialize)]
pub struct Subject {
    /// 255 inside, with the outline's stroke; 0 outside.
    #[serde(skip)]
    pub mask: GrayImage,
    /// Dark lines on white paper: the cleaned drawing. Of flat, shaded and cut
    /// out drawings also the edges between colours and the mask's boundary.
    #[serde(skip)]
    pub ink: GrayImage,
    /// The drawing's colours, alpha is the mask.
    #[serde(skip)]
    pub colour: RgbaImage,
    /// What sort of drawing it is.
    pub kind: DrawingKind,
    /// Whether its lines are dark or light.
    pub polarity: Polarity,
    /// The paper.
    pub paper: PaperSummary,
    /// The width of most strokes, px.
    pub stroke_px: f64,
    /// The width of the outline's stroke in what is painted, px, 0 if it has none; `None` if the
    /// subject is drawn in lines.
    pub outline_px: Option<f64>,
    /// What is not of the subject.
    pub removed: Vec<Removed>,
    /// The connected parts, largest first.
    pub pieces: Vec<Piece>,
    /// Gaps in the outline that were closed.
    pub closed_gaps: Vec<Gap>,
    /// What a person should look at.
    pub warnings: Vec<Warning>,
}

impl Subject {
    /// The mask's area, px².
    pub fn area_px(&self) -> usize {
        self.mask.as_raw().iter().filter(|level| **level != 0).count()
    }
}

/// Why no subject was found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SubjectError {
    /// The drawing has no pixels.
    #[error("the drawing is {width}x{height} px: it has no pixels")]
    NoPixels {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// The hint's mask does not lie on the drawing.
    #[error("the given mask is {found:?} px, the drawing {expected:?} px")]
    MaskSizeDiffers {
        /// The mask's size, px.
        found: (u32, u32),
        /// The drawing's size, px.
        expected: (u32, u32),
    },
    /// An outline or an area by hand has too few corners.
    #[error("a polygon has {found} points, 3 are required")]
    TooFewPoints {
        /// So many.
        found: usize,
    },
    /// Nothing is drawn.
    #[error("nothing is drawn: {found_px} px differ from the paper, {required_px} are required")]
    Empty {
        /// The subject's area, px².
        found_px: usize,
        /// What is required, px².
        required_px: usize,
    },
    /// No paper is left.
    #[error("the subject covers the whole image: no paper is left around it")]
    CoversImage,
    /// The caller no longer wants the result.
    #[error("the search for the subject was cancelled")]
    Cancelled,
}

/// Finds the subject in `drawing`.
///
/// Structure (lines, lettering, gaps, pieces) is looked for on an image of at
/// most [`SubjectOptions::working_side_px`]; the boundary is refined at full
/// size. Linear in the number of pixels; the same input gives the same output.
///
/// * `drawing`: sRGB with alpha, upright.
/// * `cancelled`: asked between stages.
///
/// # Errors
/// [`SubjectError`] if there are no pixels, nothing is drawn, everything is, a
/// hint does not fit, or `cancelled` says so.
pub fn find(
    drawing: &RgbaImage,
    hints: &Hints,
    options: &SubjectOptions,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Subject, SubjectError> {
    let (width, height) = drawing.dimensions();
    if width == 0 || height == 0 {
        return Err(SubjectError::NoPixels { width, height });
    }
    check_hints(drawing, hints)?;
    let going_on = || if cancelled() { Err(SubjectError::Cancelled) } else { Ok(()) };
    going_on()?;
    let opaque = laid_on_paper(drawing);
    let image = opaque.image.as_ref();
    let paper = Paper::under(drawing, image, &opaque.meaning);
    let tone = Tone::new(image, &paper);
    going_on()?;
    let given = given_mask(drawing, hints);
    let cut_out = match (&given, &opaque.meaning) {
        (Some(mask), _) => Some((mask, DrawingKind::Given)),
        (None, Meaning::CutOut(mask)) => Some((mask, DrawingKind::CutOut)),
        _ => None,
    };
    let factor = width.max(height).div_ceil(options.working_side_px.max(64)).max(1) as usize;
    let mut structure = match cut_out {
        Some((mask, kind)) => Structure::of_mask(mask, kind, &tone, factor, hints, options),
        None => Structure::of_drawing(&tone, factor, hints, options),
    };
    going_on()?;
    if matches!(opaque.meaning, Meaning::InkLayer) && structure.kind == DrawingKind::LineArt {
        structure.kind = DrawingKind::InkLayer;
    }
    let mask = match cut_out {
        Some((mask, _)) => refine::selected(mask, &structure, hints),
        None => refine::boundary(&tone, &structure, hints),
    };
    going_on()?;
    finished(drawing, image, &tone, &paper, structure, mask, factor)
}

fn finished(
    drawing: &RgbaImage,
    image: &RgbaImage,
    tone: &Tone<'_>,
    paper: &Paper,
    structure: Structure,
    mask: GrayImage,
    factor: usize,
) -> Result<Subject, SubjectError> {
    let found_px = mask.as_raw().iter().filter(|level| **level != 0).count();
    if found_px < LEAST_AREA_PX {
        return Err(SubjectError::Empty { found_px, required_px: LEAST_AREA_PX });
    }
    if found_px == mask.as_raw().len() && structure.kind != DrawingKind::Given {
        return Err(SubjectError::CoversImage);
    }
    let lines = ink::of_kind(image, tone, &structure, &mask);
    let colour = ink::cut_out(drawing, image, &mask);
    let (width, height) = drawing.dimensions();
    let scale = factor as u32;
    let gap = |gap: &Gap| Gap {
        place: crate::report::Point {
            x: gap.place.x * factor as f64,
            y: gap.place.y * factor as f64,
        },
        width_px: gap.width_px * factor as f64,
    };
    let warning = |warning: &Warning| match *warning {
        Warning::WideGap { gap: wide } => Warning::WideGap { gap: gap(&wide) },
        Warning::OpenOutline { share, gap: open } => {
            Warning::OpenOutline { share, gap: open.as_ref().map(gap) }
        }
        Warning::PieceDropped { place, share } => {
            Warning::PieceDropped { place: place.scaled(scale, width, height), share }
        }
        other => other,
    };
    let piece = |piece: &Piece| Piece {
        place: piece.place.scaled(scale, width, height),
        area_px: piece.area_px * u64::from(scale) * u64::from(scale),
        ..*piece
    };
    let removed =
        |r: &Removed| Removed { kind: r.kind, place: r.place.scaled(scale, width, height) };
    Ok(Subject {
        mask,
        ink: lines,
        colour,
        kind: structure.kind,
        polarity: tone.polarity,
        paper: paper.summary(),
        stroke_px: structure.stroke * factor as f64,
        outline_px: structure.outline.map(|outline| outline * factor as f64),
        removed: structure.removed.iter().map(removed).collect(),
        pieces: structure.pieces.iter().map(piece).collect(),
        closed_gaps: structure.gaps.iter().map(gap).collect(),
        warnings: structure.warnings.iter().map(warning).collect(),
    })
}

fn check_hints(drawing: &RgbaImage, hints: &Hints) -> Result<(), SubjectError> {
    if let Some(mask) = &hints.mask
        && mask.dimensions() != drawing.dimensions()
    {
        let (found, expected) = (mask.dimensions(), drawing.dimensions());
        return Err(SubjectError::MaskSizeDiffers { found, expected });
    }
    let polygons = hints.erase.iter().chain(&hints.polygon);
    match polygons.map(Vec::len).find(|found| *found < 3) {
        Some(found) => Err(SubjectError::TooFewPoints { found }),
        None => Ok(()),
    }
}

/// The mask that the hints give, if they give one.
fn given_mask(drawing: &RgbaImage, hints: &Hints) -> Option<GrayImage> {
    if let Some(mask) = &hints.mask {
        return Some(mask.clone());
    }
    let polygon = hints.polygon.as_ref()?;
    let (width, height) = drawing.dimensions();
    let mut inside = Area::filled(width as usize, height as usize, false);
    inside.fill_polygon(polygon, true);
    Some(image_of(&inside))
}

pub(crate) fn image_of(bits: &Bits) -> GrayImage {
    let levels = bits.data.iter().map(|is| if *is { 255 } else { 0 }).collect();
    GrayImage::from_raw(bits.width as u32, bits.height as u32, levels).unwrap_or_default()
}

pub(crate) fn erased(place: crate::report::Box2) -> Removed {
    Removed { kind: RemovedKind::Erased, place }
}
