//! Smooth noise along a line, for lines drawn by hand.

use std::f64::consts::TAU;

use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Smooth noise of zero mean and unit variance along a line.
pub(super) struct Noise {
    /// Angular frequency per pixel and phase of each wave.
    waves: [(f64, f64); WAVES],
}

const WAVES: usize = 5;

impl Noise {
    /// * `wavelength_px`: of the middle wave; the others are up to 1.4 times shorter or longer.
    pub(crate) fn new(wavelength_px: f64, random: &mut ChaCha8Rng) -> Self {
        let waves = std::array::from_fn(|_| {
            let stretch = 1.4_f64.powf(random.random_range(-1.0..=1.0));
            (TAU / (wavelength_px * stretch), random.random_range(0.0..TAU))
        });
        Self { waves }
    }

    pub(crate) fn at(&self, distance_px: f64) -> f64 {
        let sum: f64 = self
            .waves
            .iter()
            .map(|(frequency, phase)| (frequency * distance_px + phase).sin())
            .sum();
        // Each sine has a variance of a half.
        sum * (2.0 / WAVES as f64).sqrt()
    }
}
