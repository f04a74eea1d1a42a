//! The draft's quads as Wavefront OBJ, with its material and texture.

use std::fmt::Write;

use frames::{FileAxes, Placement};
use nalgebra::Point3;

use crate::texture::Textured;

/// The quads in the frame of `axes`, metres, with texture coordinates and
/// normals.
///
/// Vertices are shared over the seams of texture and shading, as modelling
/// programs want them.
///
/// * `material_file`, `material`: the file that has the material of that name.
pub(super) fn quad_obj(
    textured: &Textured,
    placement: &Placement,
    axes: &FileAxes,
    material_file: &str,
    material: &str,
) -> String {
    let Textured { mesh, coordinates, quads, .. } = textured;
    let mut obj = format!("mtllib {material_file}\no model\n");
    // Writing to a String cannot fail.
    let places = mesh.sources.iter().zip(&mesh.positions);
    let count = mesh.sources.iter().max().map_or(0, |&last| last as usize + 1);
    let mut points = vec![Point3::origin(); count];
    places.for_each(|(&source, point)| points[source as usize] = *point);
    for point in &points {
        let [x, y, z] = axes.file_from_gltf(placement.gltf_from_turntable(point));
        let _ = writeln!(obj, "v {x} {y} {z}");
    }
    for [u, v] in coordinates {
        // OBJ counts up from the bottom.
        let _ = writeln!(obj, "vt {u} {}", 1.0 - v);
    }
    for normal in &mesh.normals {
        let [x, y, z] = axes.file_from_gltf(Placement::gltf_direction(normal));
        let _ = writeln!(obj, "vn {x} {y} {z}");
    }
    let _ = writeln!(obj, "usemtl {material}");
    for quad in quads {
        obj.push('f');
        for &corner in quad {
            let (vertex, own) = (mesh.sources[corner as usize] + 1, corner + 1);
            let _ = write!(obj, " {vertex}/{own}/{own}");
        }
        obj.push('\n');
    }
    obj
}

/// The material of that name: the texture's colours, without gloss.
pub(super) fn mtl(material: &str, texture_file: &str) -> String {
    format!("newmtl {material}\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd {texture_file}\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use frames::{ExportOptions, UpAxis};
    use image::RgbImage;
    use mesh::shading::ShadedMesh;
    use nalgebra::Vector3;

    #[test]
    fn quads_share_vertices_over_seams() {
        // Two squares side by side whose common edge is a seam.
        let at = |x: f64, z: f64| Point3::new(x, 0.0, z);
        let mesh = ShadedMesh {
            positions: vec![
                at(0.0, 0.0),
                at(2.0, 0.0),
                at(2.0, 2.0),
                at(0.0, 2.0),
                at(2.0, 0.0),
                at(4.0, 0.0),
                at(4.0, 2.0),
                at(2.0, 2.0),
            ],
            normals: vec![-Vector3::y(); 8],
            sources: vec![0, 1, 2, 3, 1, 4, 5, 2],
            triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
        };
        let textured = Textured {
            mesh,
            coordinates: vec![[0.25, 0.25]; 8],
            quads: vec![[0, 1, 2, 3], [4, 5, 6, 7]],
            texture: RgbImage::new(8, 8),
        };
        let options = ExportOptions { pixels_per_metre: Some(2.0), ..ExportOptions::default() };
        let bounds = (Point3::origin(), at(4.0, 2.0));
        let placement = Placement::new(bounds, &options);
        let axes = options.file_axes(UpAxis::Y).unwrap();
        let obj = quad_obj(&textured, &placement, &axes, "solid.mtl", "drawn");
        let lines = |start: &str| obj.lines().filter(|line| line.starts_with(start)).count();
        assert_eq!((lines("v "), lines("vt "), lines("vn "), lines("f ")), (6, 8, 8, 2));
        assert!(obj.contains("vt 0.25 0.75\n") && obj.contains("vn 0 0 1\n"), "{obj}");
        assert!(obj.contains("f 1/1/1 2/2/2 3/3/3 4/4/4\nf 2/5/5 5/6/6 6/7/7 3/8/8\n"), "{obj}");
    }
}
