//! Depth maps: from the drawn lines of neighbouring views, and read off the solid.

mod blocks;
mod border_side;
mod contours;
mod estimate;
mod fill;
mod filters;
mod from_solid;
mod graph;
mod hull;
mod line_of_sight;
mod lines;
mod multigrid;
mod normals;
mod owners;
mod points;
mod predicted_lines;
mod steps;
mod triples;

pub use estimate::{
    DepthError, DepthOptions, DepthSource, Fallback, LineEstimate, ViewDepth, estimate,
};
pub(crate) use from_solid::of_elevated as depth_of_elevated;
pub use from_solid::read as read_depth;
pub use normals::normals_from_depth;

#[cfg(test)]
mod tests;
