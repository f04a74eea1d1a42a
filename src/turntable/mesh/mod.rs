//! From the solid's field to a mesh that a modeller can use.

pub mod clusters;
pub mod components;
pub mod confidence;
pub mod decimate;
pub mod faces;
pub mod marching;
pub mod occupancy;
pub mod quads;
pub mod repair;
pub mod shading;
pub mod surface;
pub mod texture;
pub mod topology;
