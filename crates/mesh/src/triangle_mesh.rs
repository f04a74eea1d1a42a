//! Vertices and triangles.

use nalgebra::Point3;

/// A triangle mesh with shared vertices.
///
/// The frame and unit are the owner's: the turntable frame (Z up, sheet
/// pixels) inside the pipeline, the glTF frame (Y up, metres) in exports.
/// Triangles are counter-clockwise seen from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// The vertices.
    pub positions: Vec<Point3<f64>>,
    /// Indices into `positions`.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// The corners of triangle `index`.
    ///
    /// # Panics
    /// If `index` or one of the triangle's indices is out of range.
    pub fn corners(&self, index: usize) -> [Point3<f64>; 3] {
        self.triangles[index].map(|vertex| self.positions[vertex as usize])
    }

    /// The smallest and largest coordinate on each axis; `None` without vertices.
    pub fn bounds(&self) -> Option<(Point3<f64>, Point3<f64>)> {
        let first = *self.positions.first()?;
        Some(self.positions.iter().fold((first, first), |(low, high), p| (low.inf(p), high.sup(p))))
    }

    /// The signed volume in cubed units: positive when a closed mesh's
    /// triangles face outward (divergence theorem).
    pub fn signed_volume(&self) -> f64 {
        (0..self.triangles.len())
            .map(|index| {
                let [a, b, c] = self.corners(index);
                a.coords.dot(&b.coords.cross(&c.coords)) / 6.0
            })
            .sum()
    }
}
