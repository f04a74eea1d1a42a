//! Models and clouds as files.

pub mod glb;
mod ply;
mod print;

pub use ply::cloud_ply;
pub use print::{stl, three_mf};
