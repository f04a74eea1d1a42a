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
mod limits;
mod obj;
mod options;
mod page;
mod payload;
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

pub use artifacts::ArtifactKind;
pub use camera::Camera;
pub use chain::Stroke;
pub use degrade::{Degradation, ViewError};
pub use degrade_options::{DegradeOptions, DegradePreset};
pub use error::DrawError;
pub use features::LineKind;
pub use limits::SheetLimits;
pub use options::{Background, ContourStyle, DrawOptions};
pub use payload::{DRAWING, DrawPayload, ModelFile, ModelSource};
pub use prepared::PreparedModel;
pub use sheet::{check_sheet, draw_sheet};
pub use svg::svg;
pub use truth::{GroundTruth, disparity_towards, normalised_inverse_depth};
pub use view::{Drawer, DrawnView};
