//! The model sheet: views of one subject, each drawn at a known angle.

mod check;
mod document;
mod matches;
mod problem;
mod view;

pub use check::{
    PlacedView, SheetRequirements, check_document, check_mask_size, check_sizes, check_truth_size,
};
pub use document::{
    HoleDocument, SheetDocument, TruthDocument, TruthKind, ViewDocument, azimuth_doubt,
};
pub use matches::{
    MATCHES_FRAME, MatchDocument, MatchEdit, MatchesProblem, PairEdit, PairMatchesDocument,
    SheetMatch, check_matches,
};
pub use problem::{PictureSize, SheetProblem};
pub use view::{Sheet, SheetError, View};
