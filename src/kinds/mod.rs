//! The kinds of jobs: what each is called and what its payload holds.

mod drawing;
mod reconstruction;

pub use self::drawing::{DRAWING, DrawPayload, ModelFile, ModelSource};
pub use reconstruction::{
    FitSummary, MATCHES_INPUT, RECONSTRUCTION, ReconstructionPayload, ReconstructionSummary,
};
