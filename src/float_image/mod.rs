//! Pictures of one float a pixel, and PFM, the format they are kept in.

mod pfm;

pub use pfm::{PfmError, decode_pfm, encode_pfm};

use image::{ImageBuffer, Luma};

/// One value a pixel; NaN where there is none.
pub type FloatImage = ImageBuffer<Luma<f32>, Vec<f32>>;
