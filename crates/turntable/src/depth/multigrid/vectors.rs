//! Sums over the cells of a level.

use std::ops::Range;

use super::grid::Links;

impl Links {
    /// The scalar product of two vectors over the cells.
    pub(super) fn dot(&self, a: &[f32], b: &[f32]) -> f64 {
        const LANES: usize = 8;
        let of_range = |range: Range<usize>| -> f64 {
            let (a, b) = (&a[range.clone()], &b[range]);
            let mut sums = [0.0_f32; LANES];
            let (whole_a, whole_b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
            let rest = whole_a.remainder().iter().zip(whole_b.remainder());
            let rest: f32 = rest.map(|(a, b)| a * b).sum();
            for (a, b) in whole_a.zip(whole_b) {
                for lane in 0..LANES {
                    sums[lane] += a[lane] * b[lane];
                }
            }
            sums.iter().map(|&sum| f64::from(sum)).sum::<f64>() + f64::from(rest)
        };
        self.ranges().map(of_range).sum()
    }

    /// `to += factor * values`.
    pub(super) fn add_scaled(&self, factor: f32, values: &[f32], to: &mut [f32]) {
        for range in self.ranges() {
            for (to, value) in to[range.clone()].iter_mut().zip(&values[range]) {
                *to += factor * value;
            }
        }
    }

    /// `to = factor * to + values`.
    pub(super) fn scale_and_add(&self, factor: f32, values: &[f32], to: &mut [f32]) {
        for range in self.ranges() {
            for (to, value) in to[range.clone()].iter_mut().zip(&values[range]) {
                *to = value + factor * *to;
            }
        }
    }
}
