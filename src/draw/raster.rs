use nalgebra::Point3;

use super::DrawError;

/// The nearest surface at each sample of a view.
pub(super) struct SampleBuffer {
    pub width: usize,
    pub height: usize,
    /// Row by row.
    pub samples: Vec<Sample>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// z of the view frame, refined pixels; infinite where nothing is.
    pub z: f32,
    /// The triangle; meaningless where nothing is.
    pub face: u32,
}

const NOTHING: Sample = Sample { z: f32::INFINITY, face: 0 };

/// Samples that one view may visit, overdraw included: some seconds' work.
const MAX_VISITED: u64 = 1 << 32;

impl SampleBuffer {
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, samples: vec![NOTHING; width * height] }
    }

    /// Draws triangles given in the frame of the samples (sample centres at half integers), seen
    /// from both sides.
    ///
    /// # Errors
    /// [`DrawError::TooComplex`] if the triangles cover each other too many times.
    pub fn draw(
        &mut self,
        triangles: impl Iterator<Item = [Point3<f64>; 3]>,
    ) -> Result<(), DrawError> {
        let mut visited = 0_u64;
        for (face, corners) in triangles.enumerate() {
            visited += self.draw_triangle(face as u32, corners);
            if visited > MAX_VISITED {
                return Err(DrawError::TooComplex { limit: MAX_VISITED });
            }
        }
        Ok(())
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
            let Some([left, right]) = span(&sides, y) else {
                continue;
            };
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
fn samples_between(low: f64, high: f64, count: usize) -> std::ops::Range<usize> {
    // The casts saturate.
    let first = (low - 0.5).ceil().max(0.0) as usize;
    let end = ((high - 0.5).floor() + 1.0).clamp(0.0, count as f64) as usize;
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

    /// The leftmost and rightmost x that a row has in common with the side.
    fn crossings(&self, y: f64) -> Option<[f64; 2]> {
        if y < self.top.y || y > self.bottom.y {
            return None;
        }
        if self.top.y == self.bottom.y {
            return Some([self.top.x, self.bottom.x]);
        }
        Some([self.top.x + self.x_per_row * (y - self.top.y); 2])
    }
}

/// Where a row crosses a triangle.
fn span(sides: &[Side; 3], y: f64) -> Option<[f64; 2]> {
    let crossings = sides.iter().filter_map(|side| side.crossings(y));
    crossings.reduce(|[left, right], [first, last]| [left.min(first), right.max(last)])
}
