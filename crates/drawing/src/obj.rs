//! The model as it was drawn, written as Wavefront OBJ.

use std::fmt::Write as _;

use super::PreparedModel;

/// The drawn model as a Wavefront OBJ, Z up, with a material name for each material.
pub(super) fn obj(model: &PreparedModel) -> String {
    let mesh = model.mesh();
    let mut text = String::with_capacity(40 * (mesh.positions.len() + mesh.triangles.len()));
    // Writing to a string cannot fail.
    for p in &mesh.positions {
        let _ = writeln!(text, "v {} {} {}", p.x, p.y, p.z);
    }
    let several = model.materials.iter().any(|&m| m != model.materials[0]);
    let mut current = None;
    for (triangle, &material) in mesh.triangles.iter().zip(&model.materials) {
        if several && current != Some(material) {
            let _ = writeln!(text, "usemtl material_{material}");
            current = Some(material);
        }
        let [a, b, c] = triangle.map(|vertex| vertex + 1);
        let _ = writeln!(text, "f {a} {b} {c}");
    }
    text
}
