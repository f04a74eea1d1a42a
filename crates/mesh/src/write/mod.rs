//! Models and clouds as files.

pub mod glb;
mod ply;

pub use ply::cloud_ply;
