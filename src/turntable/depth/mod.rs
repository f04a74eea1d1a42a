//! Depth maps from the drawn lines of neighbouring views.

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
mod owners;
mod points;
mod release;
mod sight;
mod steps;
mod triples;

pub use estimate::{
    Confidence, DepthError, DepthOptions, DepthStage, Fallback, ViewDepth, estimate, estimate_some,
};
pub use normals::normals_from_depth;

#[cfg(test)]
mod tests;
