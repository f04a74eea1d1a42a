//! Draws model sheets from 3D models, with ground truth.
//!
//! Orthographic line drawings on a turntable (METHOD.md, section 7): occluding contours, borders,
//! creases and material boundaries, hidden lines removed, as anti-aliased pictures and as vector
//! strokes, in the model's colours if asked for, together with what is true of each view: depth,
//! disparity, mask, normals.

mod background;
mod bvh;
mod camera;
mod chain;
mod closing;
mod degrade;
mod degrade_options;
mod documents;
mod draw_sheet;
mod error;
mod features;
mod files;
mod ink;
mod lettering;
mod limits;
mod obj;
mod options;
mod page;
mod paint;
mod prepared;
mod rules;
mod svg;
mod truth;
mod view;
mod visibility;
mod wobble;

#[cfg(test)]
mod tests;

pub use background::Background;
pub use camera::Camera;
pub use chain::Stroke;
pub use degrade::{Degradation, ViewError};
pub use degrade_options::{DegradeOptions, DegradePreset};
pub use draw_sheet::{check_sheet, draw_sheet};
pub use error::DrawError;
pub use features::LineKind;
pub use files::ArtifactKind;
pub use limits::SheetLimits;
pub use options::{ContourStyle, DrawOptions, Ink};
pub use page::{PageDrawing, page};
pub use prepared::PreparedModel;
pub use svg::svg;
pub use truth::{GroundTruth, disparity_towards, normalised_inverse_depth};
pub use view::{Drawer, DrawnView};
