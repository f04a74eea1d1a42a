//! Results as files: pictures, clouds, meshes and reports in standard formats.

mod artifact;

pub use artifact::{Artifact, ArtifactName, PairArtifact, ViewArtifact};
