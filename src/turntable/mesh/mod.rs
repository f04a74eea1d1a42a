//! From the solid's field to a mesh that a modeller can use.

pub mod components;
pub mod decimate;
pub mod occupancy;
pub mod repair;
pub mod surface;
pub mod topology;
