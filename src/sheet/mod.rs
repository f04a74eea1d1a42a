//! The model sheet: views of one subject, each drawn at a known angle.

mod azimuth;
mod check;
mod document;
mod image;
mod matches;
mod reconstruction;
mod view;

pub use self::image::{Drawing, ImageError, ImageLimits, decode, inspect};
pub use azimuth::{Azimuth, NotFinite};
pub use check::{
    PictureSize, PlacedView, SheetProblem, SheetRequirements, check_document, check_mask_size,
    check_sizes, check_truth_size,
};
pub use document::{HoleDocument, SheetDocument, TruthDocument, TruthKind, ViewDocument};
pub use matches::{
    MATCHES_FRAME, MatchDocument, MatchEdit, MatchesProblem, PairEdit, PairMatchesDocument,
    SheetMatch, check_matches,
};
pub use reconstruction::{RECONSTRUCTION, ReconstructionPayload};
pub use view::{Sheet, SheetError, View};
