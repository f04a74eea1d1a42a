//! Logits at any place.

use super::Grid;
use super::tensor::Tensor;

/// What the network says far outside its grid.
pub(crate) const OUTSIDE: f32 = -20.0;

/// Logits of being inside the subject, at twice the grid.
#[derive(Clone, Debug)]
pub struct LogitField {
    grid: Grid,
    /// By Z (upward), Y, X, twice as many as the grid's voxels along each.
    values: Vec<f32>,
}

impl LogitField {
    /// * `logits`: eight a voxel by Y, X, Z, as the network gives them.
    pub(crate) fn new(grid: Grid, logits: &Tensor) -> Self {
        let [nx, ny, nz] = grid.size;
        let mut values = vec![0.0; logits.values.len()];
        for (index, octet) in logits.values.chunks_exact(8).enumerate() {
            let (z, x, y) = (index % nz, index / nz % nx, index / nz / nx);
            for (channel, &value) in octet.iter().enumerate() {
                let [dy, dx, dz] = [channel >> 2 & 1, channel >> 1 & 1, channel & 1];
                // Rows of the network grow downward.
                let up = 2 * nz - 1 - (2 * z + dz);
                values[(up * 2 * ny + 2 * y + dy) * 2 * nx + 2 * x + dx] = value;
            }
        }
        Self { grid, values }
    }

    /// The grid; logits lie at twice as many places along each axis.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// By Z (upward), Y and X.
    #[cfg(test)]
    pub(crate) fn values(&self) -> &[f32] {
        &self.values
    }

    /// From logit to logit, px.
    pub fn pitch_px(&self) -> f64 {
        self.grid.pitch_px / 2.0
    }

    /// The logit at a point of the turntable frame, px, between its eight
    /// neighbours; far below 0 beyond the grid.
    pub fn sample(&self, point: [f64; 3]) -> f32 {
        let count = self.grid.size.map(|side| 2 * side);
        let mut low = [0_isize; 3];
        let mut share = [0.0_f32; 3];
        for axis in 0..3 {
            let at = (point[axis] - self.grid.centre[axis]) / self.pitch_px()
                + count[axis] as f64 / 2.0
                - 0.5;
            let floor = at.floor();
            if floor < -1.0 || floor >= count[axis] as f64 {
                return OUTSIDE;
            }
            (low[axis], share[axis]) = (floor as isize, (at - floor) as f32);
        }
        let mut sum = 0.0;
        for corner in 0..8_usize {
            let (mut index, mut weight, mut inside) = (0, 1.0, true);
            for axis in [2, 1, 0] {
                let upper = corner >> axis & 1;
                let at = low[axis] + upper as isize;
                weight *= if upper == 1 { share[axis] } else { 1.0 - share[axis] };
                inside &= at >= 0 && (at as usize) < count[axis];
                index = index * count[axis] + at.max(0) as usize;
            }
            sum += weight * if inside { self.values[index] } else { OUTSIDE };
        }
        sum
    }
}
