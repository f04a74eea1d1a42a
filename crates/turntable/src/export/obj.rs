//! The turntable method's solid as Wavefront OBJ, quads where they fit.

use std::fmt::Write;

use frames::{FileAxes, Placement};
use mesh::Mesh;
use mesh::quads::{Face, quad_dominant};

/// The mesh in the frame of `axes`, metres: shared vertices, quads and the
/// triangles left.
pub(super) fn quad_obj(mesh: &Mesh, placement: &Placement, axes: &FileAxes) -> String {
    let mut obj = String::from("o model\n");
    for point in &mesh.positions {
        let [x, y, z] = axes.file_from_gltf(placement.gltf_from_turntable(point));
        // Writing to a String cannot fail.
        let _ = writeln!(obj, "v {x} {y} {z}");
    }
    for face in quad_dominant(mesh) {
        obj.push('f');
        let corners: &[u32] = match &face {
            Face::Triangle(corners) => corners,
            Face::Quad(corners) => corners,
        };
        for corner in corners {
            let _ = write!(obj, " {}", corner + 1);
        }
        obj.push('\n');
    }
    obj
}

#[cfg(test)]
mod tests {
    use super::*;
    use frames::{ExportOptions, UpAxis};
    use nalgebra::Point3;

    #[test]
    fn writes_quads_and_what_is_left() {
        let mesh = Mesh {
            positions: [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (1.0, 5.0)]
                .map(|(x, z)| Point3::new(x, 0.0, z))
                .to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3], [3, 2, 4]],
        };
        let options = ExportOptions { pixels_per_metre: Some(2.0), ..ExportOptions::default() };
        let placement = Placement::new(mesh.bounds().unwrap(), &options);
        let axes = options.file_axes(UpAxis::Y).unwrap();
        let obj = quad_obj(&mesh, &placement, &axes);
        assert!(obj.contains("v 1 1 0\n"));
        assert_eq!(obj.lines().filter(|line| line.starts_with('f')).count(), 2);
        assert_eq!(obj.lines().filter(|line| line.split(' ').count() == 5).count(), 1);
    }
}
