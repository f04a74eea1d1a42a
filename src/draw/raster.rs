use nalgebra::Point3;

use super::DrawError;

/// The nearest surface at each sample of a view.
pub(super) struct SampleBuffer {
    pub width: usize,
    pub height: usize,
    /// z of the view frame, refined pixels; infinite where nothing is.
    pub z: Vec<f64>,
    /// The triangle; meaningless where nothing is.
    pub face: Vec<u32>,
}

/// Samples that one view may visit, overdraw included: some seconds' work.
const MAX_VISITED: u64 = 1 << 32;

impl SampleBuffer {
    pub fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            z: vec![f64::INFINITY; width * height],
            face: vec![0; width * height],
        }
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
        // Interpolated depths stay within the corners' even on slivers.
        let nearest = a.z.min(b.z).min(c.z);
        let farthest = a.z.max(b.z).max(c.z);
        for row in rows {
            let y = row as f64 + 0.5;
            let Some([left, right]) = span(corners, y) else {
                continue;
            };
            let columns = samples_between(left, right, self.width);
            visited += columns.len() as u64;
            let z_row = a.z + slope_y * (y - a.y) + slope_x * (0.5 - a.x);
            for column in columns {
                let z = (z_row + slope_x * column as f64).clamp(nearest, farthest);
                let index = row * self.width + column;
                if z < self.z[index] {
                    self.z[index] = z;
                    self.face[index] = face;
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

/// Where a horizontal line crosses a triangle.
fn span(corners: [Point3<f64>; 3], y: f64) -> Option<[f64; 2]> {
    let mut span: Option<[f64; 2]> = None;
    for index in 0..3 {
        let (mut p, mut q) = (corners[index], corners[(index + 1) % 3]);
        // From top to bottom, so that neighbours find the same crossing.
        if (q.y, q.x) < (p.y, p.x) {
            (p, q) = (q, p);
        }
        if y < p.y || y > q.y {
            continue;
        }
        let crossings = if p.y == q.y {
            [p.x.min(q.x), p.x.max(q.x)]
        } else {
            [p.x + (q.x - p.x) * ((y - p.y) / (q.y - p.y)); 2]
        };
        let [left, right] = span.unwrap_or(crossings);
        span = Some([left.min(crossings[0]), right.max(crossings[1])]);
    }
    span
}
