//! How far a point is from many faces at once.

use nalgebra::{Point3, Vector3};

/// The share of faces' area that their directed area must be: more bent ones
/// hold creases.
const MIN_COHERENCE: f64 = 0.9;

/// The planes of faces, for distances from them.
///
/// # Source
/// Garland & Heckbert 1997, Surface simplification using quadric error metrics.
#[derive(Clone, Copy, Default)]
pub(super) struct Faces {
    /// Area-weighted sums of `n n'` (xx, yy, zz, xy, yz, zx), `d n` and `d d`
    /// over planes `n p + d = 0`.
    quadratic: [f64; 6],
    linear: Vector3<f64>,
    constant: f64,
    area: f64,
    directed: Vector3<f64>,
}

impl Faces {
    /// Of one quad.
    pub(super) fn of_quad(corners: [Point3<f64>; 4]) -> Self {
        let [a, b, c, d] = corners.map(|corner| corner.coords);
        let directed = (c - a).cross(&(d - b)) / 2.0;
        let area = directed.norm();
        let normal = directed / area.max(1e-12);
        let offset = -normal.dot(&(a + b + c + d)) / 4.0;
        let [n, v] = [normal, directed];
        Self {
            quadratic: [n.x * v.x, n.y * v.y, n.z * v.z, n.x * v.y, n.y * v.z, n.z * v.x],
            linear: directed * offset,
            constant: offset * offset * area,
            area,
            directed,
        }
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.quadratic.iter_mut().zip(other.quadratic).for_each(|(sum, entry)| *sum += entry);
        self.linear += other.linear;
        self.constant += other.constant;
        self.area += other.area;
        self.directed += other.directed;
    }

    /// The mean squared distance of `point` from the planes.
    pub(super) fn mean_squared(&self, point: &Vector3<f64>) -> f64 {
        let [x, y, z] = (*point).into();
        let products = [x * x, y * y, z * z, 2.0 * x * y, 2.0 * y * z, 2.0 * z * x];
        let squared: f64 = self.quadratic.iter().zip(products).map(|(entry, p)| entry * p).sum();
        (squared + 2.0 * self.linear.dot(point) + self.constant) / self.area.max(1e-12)
    }

    /// Whether the faces turn enough to hold a crease.
    pub(super) fn is_bent(&self) -> bool {
        self.directed.norm() < MIN_COHERENCE * self.area
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_from_the_planes() {
        let square = |at: [[f64; 3]; 4]| Faces::of_quad(at.map(Point3::from));
        let mut faces = square([[0., 0., 2.], [2., 0., 2.], [2., 2., 2.], [0., 2., 2.]]);
        assert!((faces.mean_squared(&Vector3::new(7.0, -3.0, 5.0)) - 9.0).abs() < 1e-12);
        assert!(!faces.is_bent());
        faces.add(&square([[1., 0., 0.], [1., 2., 0.], [1., 2., 2.], [1., 0., 2.]]));
        let expected = f64::midpoint(9.0, 36.0);
        assert!((faces.mean_squared(&Vector3::new(7.0, -3.0, 5.0)) - expected).abs() < 1e-12);
        assert!(faces.is_bent());
    }
}
