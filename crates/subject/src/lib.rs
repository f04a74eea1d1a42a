//! From one decoded drawing to the subject in it, and from several subjects to
//! aligned ones.
//!
//! [`find`] reads a drawing of any kind (line art, ink on a transparent layer,
//! flat or shaded colour, a cut-out) on any even paper, cleans it and returns
//! the subject's mask, its lines and its colours. [`align`] reconciles scale,
//! height and turning axis of several views. [`hypotheses`] tests whether views
//! fit better at other azimuths. [`Marks`] is what is drawn on a whole page, for
//! those who look for several subjects there. All of it is pure: no files, no clock.
//!
//! Azimuths are degrees, 0 the front, growing so that at 90 the subject's left
//! side is seen and it faces the image's left.

mod align;
mod alpha;
mod clutter;
mod cutting;
mod edges;
mod gaps;
mod holes;
mod hypotheses;
mod ink;
mod lettering;
mod linear;
mod marks;
pub mod mosaic;
mod options;
mod paper;
mod pieces;
pub mod raster;
mod refine;
mod report;
mod straight;
mod strokes;
mod structure;
mod subject;
mod tone;
mod widths;

pub use align::{
    AlignOptions, Aligned, Alignment, ByHand, Canvas, Transform, View, ViewAlignment, align, apply,
    median, place_by_hand, reduced, reduced_mask, trust,
};
pub use hypotheses::{Hypotheses, HypothesisOptions, Suggestion, Verdict, hypotheses};
pub use marks::{Marks, enclosed};
pub use options::{CleanOptions, Hints, HolePolicy, Removal, SubjectOptions};
pub use paper::{Paper, PaperRow};
pub use report::{
    Box2, DrawingKind, Gap, PaperSummary, Piece, PieceRole, Point, Polarity, Removed, RemovedKind,
    Side, Warning,
};
pub use subject::{Subject, SubjectError, find};
