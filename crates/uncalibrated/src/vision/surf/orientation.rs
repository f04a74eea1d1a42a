//! SURF's orientation of a keypoint.

use super::haar::HaarWavelets;
use super::integral::IntegralImage;
use super::{SurfKeypoint, scale_px};

/// Radius of the surroundings that vote, in σ (Bay et al., §4.1).
const RADIUS: i32 = 6;

/// Votes are weighed by a Gaussian of this many σ: 2.5 in OpenCV, 2 in the
/// paper.
const GAUSSIAN: f64 = 2.5;

/// Votes within this angle are summed, degrees.
const WINDOW_DEG: f64 = 60.0;

const WINDOW_STEP_DEG: usize = 5;

/// The direction in which most of the surroundings grows lighter, degrees
/// from the x axis towards the y axis in [0, 360); 0 where they are flat.
pub(super) fn angle_deg(integral: &IntegralImage, keypoint: &SurfKeypoint) -> f32 {
    let votes = votes(integral, keypoint);
    let mut best = (0.0, 0.0, 0.0);
    for middle in (0..360).step_by(WINDOW_STEP_DEG) {
        let (mut x, mut y) = (0.0, 0.0);
        for vote in &votes {
            let off = (vote.angle_deg - middle as f64 + 540.0).rem_euclid(360.0) - 180.0;
            if off.abs() <= WINDOW_DEG / 2.0 {
                x += vote.x;
                y += vote.y;
            }
        }
        let length = x * x + y * y;
        if length > best.2 {
            best = (x, y, length);
        }
    }
    let angle = best.1.atan2(best.0).to_degrees().rem_euclid(360.0) as f32;
    // A tiny negative angle rounds up to a full turn.
    if angle < 360.0 { angle } else { 0.0 }
}

struct Vote {
    x: f64,
    y: f64,
    angle_deg: f64,
}

fn votes(integral: &IntegralImage, keypoint: &SurfKeypoint) -> Vec<Vote> {
    let scale = scale_px(keypoint);
    let wavelets = HaarWavelets::new(integral, 4.0 * scale);
    let mut votes = Vec::new();
    for row in -RADIUS..=RADIUS {
        for column in -RADIUS..=RADIUS {
            let square = row * row + column * column;
            if square > RADIUS * RADIUS {
                continue;
            }
            let weight = (-f64::from(square) / (2.0 * GAUSSIAN * GAUSSIAN)).exp();
            let (right, down) = wavelets.at(
                f64::from(keypoint.x) + f64::from(column) * scale,
                f64::from(keypoint.y) + f64::from(row) * scale,
            );
            let (x, y) = (f64::from(right) * weight, f64::from(down) * weight);
            if x != 0.0 || y != 0.0 {
                votes.push(Vote { x, y, angle_deg: y.atan2(x).to_degrees() });
            }
        }
    }
    votes
}
