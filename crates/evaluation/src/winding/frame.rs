//! A mesh on an integer grid, on which orientation tests are exact.

use nalgebra::Point3;

use mesh::Mesh;

/// A vertex on the integer grid.
pub(super) type Vertex = [i32; 3];

/// Vertices lie within this of the frame's origin on each axis: sums of two
/// products of differences then fit 64 bits, so orientations are exact.
pub(super) const HALF_RANGE: i32 = 1 << 28;

/// The integer frame of a mesh: origin at the middle of its box, the longest
/// side from `-HALF_RANGE` to `HALF_RANGE`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    middle: Point3<f64>,
    per_unit: f64,
}

impl Frame {
    /// `None` if `mesh` has no extent or none that is finite.
    pub(super) fn around(mesh: &Mesh) -> Option<Self> {
        if mesh.positions.iter().flat_map(|p| p.iter()).any(|value| !value.is_finite()) {
            return None;
        }
        let (low, high) = mesh.bounds()?;
        let per_unit = 2.0 * f64::from(HALF_RANGE) / (high - low).max();
        let frame = Self { middle: nalgebra::center(&low, &high), per_unit };
        (per_unit.is_normal() && frame.middle.iter().all(|value| value.is_finite()))
            .then_some(frame)
    }

    /// In units of the grid, not rounded.
    pub(super) fn local(&self, point: &Point3<f64>) -> Point3<f64> {
        Point3::from((point - self.middle) * self.per_unit)
    }

    pub(super) fn local_length(&self, length: f64) -> f64 {
        length * self.per_unit
    }

    pub(super) fn vertex(&self, point: &Point3<f64>) -> Vertex {
        let limit = f64::from(HALF_RANGE);
        // Within the range but for rounding.
        self.local(point).coords.map(|value| value.round().clamp(-limit, limit) as i32).into()
    }
}

pub(super) fn position(vertex: Vertex) -> Point3<f64> {
    Point3::from(vertex.map(f64::from))
}
