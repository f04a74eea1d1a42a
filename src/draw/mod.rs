//! Draws model sheets from 3D models, with ground truth.
//!
//! Orthographic line drawings on a turntable (METHOD.md, section 7): occluding contours, borders,
//! creases and material boundaries, hidden lines removed, as anti-aliased pictures and as vector
//! strokes, together with what is true of each view: depth, disparity, mask, normals.

mod artifacts;
mod bvh;
mod camera;
mod chain;
mod degrade;
mod degrade_options;
mod documents;
mod error;
mod features;
mod ink;
mod lettering;
mod obj;
mod options;
mod page;
mod prepared;
mod raster;
mod rules;
mod sheet;
mod svg;
mod truth;
mod view;
mod visibility;
mod wobble;

#[cfg(test)]
mod tests;

pub use artifacts::{Artifact, ArtifactKind};
pub use camera::Camera;
pub use chain::Stroke;
pub use degrade::{Degradation, ViewError};
pub use degrade_options::{DegradeOptions, DegradePreset};
pub use error::DrawError;
pub use features::LineKind;
pub use options::{Background, ContourStyle, DrawOptions};
pub use prepared::PreparedModel;
pub use sheet::draw_sheet;
pub use svg::svg;
pub use truth::{GroundTruth, disparity_towards, normalised_inverse_depth};
pub use view::{Drawer, DrawnView};
