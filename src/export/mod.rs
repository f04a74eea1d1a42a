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
mod turntable_glb;
mod turntable_obj;

pub use artifact::{
    Artifact, ArtifactName, ArtifactSink, ArtifactWriter, PFM_MEDIA_TYPE, PairArtifact,
    ViewArtifact,
};
pub use bundle::Bundle;
pub use frame::ExportFrame;
pub use glb::{MeshExtras, glb};
pub use maps::{DepthEncoding, depth_png, disparity_png, normals_png, silhouette_png};
pub use pair_files::{matches_json, matches_png, rectified_png};
pub use ply::cloud_ply;
pub use png::EncodeError;
pub use report::{AbsentArtifact, DepthPicture, MetricsDocument};
pub use thumbnail::thumbnail;
pub use turntable_glb::{
    Placement, Sheet as TurntableSheet, TurntableGlbError, solid_glb, textured_glb,
};
pub use turntable_obj::quad_obj;
