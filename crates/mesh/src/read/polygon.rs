//! Polygons cut into triangles by ear clipping.

use earcut::Earcut;
use earcut::utils3d::project3d_to_2d;
use nalgebra::Vector3;

/// Cuts polygons into triangles; also concave ones and, up to rounding, ones that are not flat.
#[derive(Default)]
pub(super) struct Triangulator {
    earcut: Earcut<f64>,
    corners: Vec<[f64; 3]>,
    flat: Vec<[f64; 2]>,
    indices: Vec<u32>,
}

impl Triangulator {
    /// Appends triangles of positions in `polygon`: pass each corner's place.
    ///
    /// Polygons with fewer than three corners give nothing. What cannot be cut, such as polygons
    /// that cross themselves, becomes a fan.
    pub(super) fn triangulate(&mut self, corners: &[Vector3<f64>], triangles: &mut Vec<[u32; 3]>) {
        match corners.len() {
            0..=2 => {}
            3 => triangles.push([0, 1, 2]),
            count => {
                if !self.cut(corners, triangles) {
                    triangles.extend((1..count as u32 - 1).map(|i| [0, i, i + 1]));
                }
            }
        }
    }

    /// Whether the whole polygon was cut.
    fn cut(&mut self, corners: &[Vector3<f64>], triangles: &mut Vec<[u32; 3]>) -> bool {
        if !corners.iter().all(|c| c.iter().all(|v| v.is_finite())) {
            return false;
        }
        self.corners.clear();
        self.corners.extend(corners.iter().map(|&c| <[f64; 3]>::from(c)));
        self.flat.clear();
        if !project3d_to_2d(&self.corners, corners.len(), &mut self.flat) {
            return false;
        }
        self.indices.clear();
        let points = self.flat.iter().copied();
        self.earcut.earcut(points, &[] as &[u32], &mut self.indices);
        let complete = self.indices.len() == 3 * (corners.len() - 2);
        if complete {
            triangles.extend(self.indices.as_chunks::<3>().0);
        }
        complete
    }
}
