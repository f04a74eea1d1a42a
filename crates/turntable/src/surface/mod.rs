//! From the solid's field of signed distances to a mesh that a modeller can use.

pub mod clusters;
pub mod decimate;
pub mod field;
pub mod marching;
pub mod occupancy;
pub mod projection;
pub mod quad_mesh;
mod quadrics;
pub mod support;
