//! Haar wavelets of an integral image.

use super::integral::IntegralImage;

/// Half sides beyond this see nothing but the whole picture.
const MOST_HALF_SIDE: f64 = 1e6;

/// A pair of Haar wavelets, twice `half` pixels wide.
pub(super) struct HaarWavelets<'a> {
    integral: &'a IntegralImage,
    half: i64,
}

impl<'a> HaarWavelets<'a> {
    /// Wavelets of about `side_px`.
    pub(super) fn new(integral: &'a IntegralImage, side_px: f64) -> Self {
        let half = (side_px / 2.0).round().clamp(1.0, MOST_HALF_SIDE) as i64;
        Self { integral, half }
    }

    /// The rise of grey to the right and downwards around `(x, y)`, in grey
    /// levels between the means of the halves; 0 where a half lies outside.
    pub(super) fn at(&self, x: f64, y: f64) -> (f32, f32) {
        // From pixel centres to corners; casts saturate.
        let (x, y) = ((x + 0.5).round() as i64, (y + 0.5).round() as i64);
        let (low, high) = (-self.half, self.half);
        let mean = |left: i64, top: i64, right: i64, bottom: i64| {
            self.integral.mean_within(
                x.saturating_add(left),
                y.saturating_add(top),
                x.saturating_add(right),
                y.saturating_add(bottom),
            )
        };
        let rise = |from: Option<f32>, to: Option<f32>| match (from, to) {
            (Some(from), Some(to)) => to - from,
            _ => 0.0,
        };
        (
            rise(mean(low, low, 0, high), mean(0, low, high, high)),
            rise(mean(low, low, high, 0), mean(low, 0, high, high)),
        )
    }
}
