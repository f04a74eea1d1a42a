//! Maps of one float a pixel: disparity, depth.

use image::{ImageBuffer, Luma};
use serde::Serialize;

/// One value a pixel; NaN where there is none.
pub type FloatImage = ImageBuffer<Luma<f32>, Vec<f32>>;

/// The smallest and largest value of a map.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ValueRange {
    /// The smallest finite value, in the map's unit.
    pub min: f32,
    /// The largest finite value, in the map's unit.
    pub max: f32,
}

impl ValueRange {
    /// `None` if the map has no finite value.
    pub fn of(map: &FloatImage) -> Option<Self> {
        map.iter().filter(|value| value.is_finite()).fold(None, |range, &value| {
            let Self { min, max } = range.unwrap_or(Self { min: value, max: value });
            Some(Self { min: min.min(value), max: max.max(value) })
        })
    }
}
