//! What work leaves behind: files with names and media types, one by one and
//! bundled.
//!
//! A job makes [`Artifact`]s in a fixed order and sends them through a
//! [`Delivery`], which stores each in the job's [`ArtifactSink`] and adds it to
//! the [`Bundle`] on a thread of its own.

mod artifact;
mod bundle;
mod delivery;
mod files;

pub use artifact::{
    Artifact, ArtifactName, ArtifactSink, ArtifactWriter, CleanArtifact, PFM_MEDIA_TYPE,
    PairArtifact, ViewArtifact,
};
pub use bundle::Bundle;
pub use delivery::{Delivered, Delivery};
pub use files::{AbsentArtifact, DepthPicture, Files};
