//! SURF's descriptor of a keypoint.

use super::haar::HaarWavelets;
use super::integral::IntegralImage;
use super::{DESCRIPTOR_LENGTH, SurfKeypoint, scale_px};

/// Fields a side, and samples a side of each field (Bay et al., §4.2).
const FIELDS: usize = 4;
const SAMPLES: usize = 5;

/// Samples are weighed by a Gaussian of this many σ.
const GAUSSIAN: f64 = 3.3;

/// The descriptor of the square of 20 σ around a keypoint, turned by
/// `angle_deg`: per field, row by row, `Σdx Σdy Σ|dx| Σ|dy|` of wavelet
/// responses along the turned axes.
pub(super) fn describe(
    integral: &IntegralImage,
    keypoint: &SurfKeypoint,
    angle_deg: f32,
) -> [f32; DESCRIPTOR_LENGTH] {
    let scale = scale_px(keypoint);
    let wavelets = HaarWavelets::new(integral, 2.0 * scale);
    let (sin, cos) = f64::from(angle_deg).to_radians().sin_cos();
    let mut descriptor = [0.0_f64; DESCRIPTOR_LENGTH];
    for row in 0..FIELDS * SAMPLES {
        for column in 0..FIELDS * SAMPLES {
            let (along, across) = (from_middle(column), from_middle(row));
            let weight = (-(along * along + across * across) / (2.0 * GAUSSIAN * GAUSSIAN)).exp();
            let (right, down) = wavelets.at(
                f64::from(keypoint.x) + scale * (along * cos - across * sin),
                f64::from(keypoint.y) + scale * (along * sin + across * cos),
            );
            let (right, down) = (f64::from(right) * weight, f64::from(down) * weight);
            let (dx, dy) = (right * cos + down * sin, down * cos - right * sin);
            let field = 4 * (row / SAMPLES * FIELDS + column / SAMPLES);
            for (value, sum) in [dx, dy, dx.abs(), dy.abs()].iter().zip(&mut descriptor[field..]) {
                *sum += value;
            }
        }
    }
    unit_length(&descriptor)
}

/// From the middle of the square to a sample, in σ.
fn from_middle(sample: usize) -> f64 {
    sample as f64 - (FIELDS * SAMPLES - 1) as f64 / 2.0
}

fn unit_length(descriptor: &[f64; DESCRIPTOR_LENGTH]) -> [f32; DESCRIPTOR_LENGTH] {
    let length = descriptor.iter().map(|value| value * value).sum::<f64>().sqrt();
    descriptor.map(|value| if length > 0.0 { (value / length) as f32 } else { 0.0 })
}
