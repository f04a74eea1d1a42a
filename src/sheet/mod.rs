//! The model sheet: views of one subject, each drawn at a known angle.

mod azimuth;

pub use azimuth::{Azimuth, NotFinite};
