//! Results as files: pictures, clouds, meshes and reports in standard formats.
//!
//! The same results give the same bytes.

mod artifact;
mod bundle;
mod frame;
mod glb;
mod maps;
mod pair_files;
mod ply;
mod png;
mod report;
mod thumbnail;

pub use artifact::{Artifact, ArtifactName, PairArtifact, ViewArtifact};
pub use bundle::Bundle;
pub use frame::ExportFrame;
pub use glb::{MeshExtras, glb};
pub use maps::{DepthEncoding, depth_png, disparity_png};
pub use pair_files::{matches_json, matches_png, rectified_png};
pub use ply::cloud_ply;
pub use png::EncodeError;
pub use report::{AbsentArtifact, DepthPicture, MetricsDocument};
pub use thumbnail::thumbnail;
