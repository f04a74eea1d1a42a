//! Depth maps: from the drawn lines of neighbouring views, and read off the solid.

mod adoption;
mod blocks;
mod contours;
mod estimate;
mod fill;
mod filters;
mod graph;
mod hull;
mod lines;
mod multigrid;
mod normals;
mod of_solid;
mod owners;
mod points;
mod release;
mod sight;
mod steps;
mod triples;

pub use estimate::{
    Confidence, DepthError, DepthMap, DepthOptions, DepthSource, DepthStage, Fallback,
    LineEstimate, ViewDepth, estimate,
};
pub use normals::normals_from_depth;
pub use of_solid::read as read_depth;

#[cfg(test)]
mod tests;
