//! The one rasteriser: the nearest triangle at each sample of a grid.

use nalgebra::Point3;

/// The nearest surface at each sample of a view.
pub struct SampleBuffer {
    /// Samples a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row by row.
    pub samples: Vec<Sample>,
}

/// What is nearest at one sample.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// z of the view frame, refined pixels; infinite where nothing is.
    pub z: f32,
    /// The triangle; meaningless where nothing is.
    pub face: u32,
}

const NOTHING: Sample = Sample { z: f32::INFINITY, face: 0 };

/// Triangles hide each other too often.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the triangles hide each other too often: over {limit} samples were visited")]
pub struct Overdrawn {
    /// Samples that one picture may visit.
    pub limit: u64,
}

/// Samples that one view may visit, overdraw included: some seconds' work.
const MAX_VISITED: u64 = 1 << 32;

impl SampleBuffer {
    /// Nothing is drawn yet.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, samples: vec![NOTHING; width * height] }
    }

    /// Draws triangles given in the frame of the samples (sample centres at half integers), seen
    /// from both sides.
    ///
    /// # Errors
    /// [`Overdrawn`] if the triangles cover each other too many times.
    pub fn draw(
        &mut self,
        triangles: impl Iterator<Item = [Point3<f64>; 3]>,
    ) -> Result<(), Overdrawn> {
        let mut visited = 0_u64;
        for (face, corners) in triangles.enumerate() {
            visited += self.draw_triangle(face as u32, corners);
            if visited > MAX_VISITED {
                return Err(Overdrawn { limit: MAX_VISITED });
            }
        }
        Ok(())
    }

    /// Finds the samples with a surface among those of one pixel.
    ///
    /// * `first`: the pixel's first sample.
    /// * `factor`: samples of the pixel on each axis.
    pub fn hits(&self, first: usize, factor: usize, hits: &mut Vec<usize>) {
        hits.clear();
        for row in 0..factor {
            let first = first + row * self.width;
            for (column, sample) in self.samples[first..first + factor].iter().enumerate() {
                if sample.z.is_finite() {
                    hits.push(first + column);
                }
            }
        }
    }

    /// Returns the number of samples and rows visited.
    fn draw_triangle(&mut self, face: u32, corners: [Point3<f64>; 3]) -> u64 {
        let [a, b, c] = corners;
        let area = (b - a).xy().perp(&(c - a).xy());
        if area == 0.0 {
            return 1;
        }
        let slope_x = ((b.z - a.z) * (c.y - a.y) - (c.z - a.z) * (b.y - a.y)) / area;
        let slope_y = ((c.z - a.z) * (b.x - a.x) - (b.z - a.z) * (c.x - a.x)) / area;
        if !(slope_x.is_finite() && slope_y.is_finite()) {
            return 1;
        }
        let low = a.y.min(b.y).min(c.y);
        let high = a.y.max(b.y).max(c.y);
        let rows = samples_between(low, high, self.height);
        let mut visited = 1 + rows.len() as u64;
        let sides = [Side::new(a, b), Side::new(b, c), Side::new(c, a)];
        // Interpolated depths stay within the corners' even on slivers.
        let nearest = a.z.min(b.z).min(c.z);
        let farthest = a.z.max(b.z).max(c.z);
        for row in rows {
            let y = row as f64 + 0.5;
            let [left, right] = span(&sides, y);
            let columns = samples_between(left, right, self.width);
            visited += columns.len() as u64;
            let z_row = a.z + slope_y * (y - a.y) + slope_x * (0.5 - a.x);
            let first = row * self.width;
            let samples = &mut self.samples[first + columns.start..first + columns.end];
            for (sample, column) in samples.iter_mut().zip(columns) {
                let z = (z_row + slope_x * column as f64).clamp(nearest, farthest) as f32;
                if z < sample.z {
                    *sample = Sample { z, face };
                }
            }
        }
        visited
    }
}

/// The samples (at half integers) in [low, high] within `count`.
///
/// Rounds by casts: baseline x86-64 has no instruction for `ceil` and `floor`, and this runs for
/// every row of every triangle.
fn samples_between(low: f64, high: f64, count: usize) -> std::ops::Range<usize> {
    // Within the range of the casts, and beyond the samples wherever it was beyond them.
    let within = |x: f64| x.clamp(-2.0, count as f64 + 1.0);
    let (low, high) = (within(low - 0.5), within(high - 0.5));
    let (truncated_low, truncated_high) = (low as i64, high as i64);
    let first = truncated_low + i64::from((truncated_low as f64) < low);
    let end = truncated_high - i64::from((truncated_high as f64) > high) + 1;
    let first = first.max(0) as usize;
    let end = (end.max(0) as usize).min(count);
    first.min(end)..end
}

/// A triangle's side, prepared for crossing it with many rows.
struct Side {
    top: Point3<f64>,
    bottom: Point3<f64>,
    x_per_row: f64,
}

impl Side {
    /// From top to bottom, so that both triangles at a side find the same crossings.
    fn new(p: Point3<f64>, q: Point3<f64>) -> Self {
        let (top, bottom) = if (q.y, q.x) < (p.y, p.x) { (q, p) } else { (p, q) };
        Self { top, bottom, x_per_row: (bottom.x - top.x) / (bottom.y - top.y) }
    }

    /// Widens a span by what the row at `y` has in common with the side.
    fn widen(&self, span: &mut [f64; 2], y: f64) {
        if y < self.top.y || y > self.bottom.y {
            return;
        }
        let [first, last] = if self.top.y == self.bottom.y {
            [self.top.x, self.bottom.x]
        } else {
            [self.top.x + self.x_per_row * (y - self.top.y); 2]
        };
        *span = [span[0].min(first), span[1].max(last)];
    }
}

/// Where a row crosses a triangle; empty (from infinity to its negative) if it does not.
fn span(sides: &[Side; 3], y: f64) -> [f64; 2] {
    let mut span = [f64::INFINITY, f64::NEG_INFINITY];
    sides.iter().for_each(|side| side.widen(&mut span, y));
    span
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_lie_at_half_integers() {
        assert_eq!(samples_between(0.5, 2.5, 9), 0..3);
        assert_eq!(samples_between(0.6, 2.4, 9), 1..2);
        assert_eq!(samples_between(-0.5, 0.49, 9), 0..0);
        assert_eq!(samples_between(-7.0, 70.0, 9), 0..9);
        assert_eq!(samples_between(8.5, 8.5, 9), 8..9);
        assert!(samples_between(9.1, 70.0, 9).is_empty());
        assert!(samples_between(-70.0, -9.0, 9).is_empty());
        assert_eq!(samples_between(-1e300, 1e300, 9), 0..9);
        assert!(samples_between(f64::INFINITY, f64::NEG_INFINITY, 9).is_empty());
        assert!(samples_between(1e300, 1e301, 9).is_empty());
    }
}
