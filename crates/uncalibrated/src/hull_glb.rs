//! The hull as binary glTF.

use frames::Placement;
use gltf::json::mesh::Semantic;
use mesh::Mesh;
use mesh::write::glb::{GlbWriter, matte, triangle_primitive};
use picture::EncodeError;
use serde::Serialize;

/// What a mesh's node says about its origin.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeshExtras {
    /// Azimuths of the sheet's views.
    pub azimuths_deg: Vec<f64>,
    /// Sheet pixels a metre.
    pub pixels_per_metre: f64,
    /// The method that made it, as the option `method` names it.
    pub method: String,
    /// Version of this program.
    pub version: String,
}

/// Matt grey: a draft to be modelled on.
const CLAY: [f32; 4] = [0.8, 0.8, 0.8, 1.0];

/// A mesh of the turntable frame as binary glTF: Y up, front facing +Z, metres,
/// transforms baked in.
///
/// # Errors
/// [`EncodeError`] if the mesh is empty or too large for the format.
pub fn hull_glb(
    mesh: &Mesh,
    placement: &Placement,
    extras: &MeshExtras,
) -> Result<Vec<u8>, EncodeError> {
    let positions: Vec<[f32; 3]> =
        mesh.positions.iter().map(|point| placement.gltf_from_turntable(point)).collect();
    if positions.is_empty() || mesh.triangles.is_empty() {
        return Err(EncodeError::new("a mesh", "it is empty"));
    }
    let mut file = GlbWriter::new(format!("turnaround {}", extras.version));
    let attributes = [(Semantic::Positions, file.positions(&positions))];
    let triangles = file.triangles(&mesh.triangles);
    let material = file.material(matte("clay", CLAY));
    file.node("hull", vec![triangle_primitive(attributes, triangles, material)], Some(extras))?;
    file.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::convex_hull;
    use frames::ExportOptions;
    use nalgebra::Point3;

    fn cube_glb() -> (Mesh, Vec<u8>) {
        let corners: Vec<_> = (0..8_u32)
            .map(|i| {
                let at = |bit: u32| if i >> bit & 1 == 1 { 90.0 } else { -90.0 };
                Point3::new(at(0), at(1), at(2))
            })
            .collect();
        let cube = convex_hull(&corners).unwrap();
        let frame = Placement::new(cube.bounds().unwrap(), &ExportOptions::default());
        let extras = MeshExtras {
            azimuths_deg: vec![0.0, 22.5],
            pixels_per_metre: frame.pixels_per_metre(),
            method: "uncalibrated".to_owned(),
            version: "1.2.3".to_owned(),
        };
        let bytes = hull_glb(&cube, &frame, &extras).unwrap();
        (cube, bytes)
    }

    #[test]
    fn a_cube_comes_back_in_metres_standing_on_the_ground() {
        let (cube, bytes) = cube_glb();
        let (document, buffers, _) = gltf::import_slice(&bytes).unwrap();
        let node = document.nodes().next().unwrap();
        let primitive = node.mesh().unwrap().primitives().next().unwrap();
        let reader = primitive.reader(|buffer| Some(&buffers[buffer.index()]));
        let read = Mesh {
            positions: reader
                .read_positions()
                .unwrap()
                .map(|p| Point3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2])))
                .collect(),
            triangles: reader
                .read_indices()
                .unwrap()
                .into_u32()
                .collect::<Vec<_>>()
                .chunks_exact(3)
                .map(|t| [t[0], t[1], t[2]])
                .collect(),
        };
        assert_eq!(read.triangles, cube.triangles);
        assert!((read.signed_volume() - 1.8_f64.powi(3)).abs() < 1e-5);
        let (low, high) = read.bounds().unwrap();
        assert!((low - Point3::new(-0.9, 0.0, -0.9)).norm() < 1e-6);
        assert!((high - Point3::new(0.9, 1.8, 0.9)).norm() < 1e-6);
    }

    #[test]
    fn the_node_says_where_it_comes_from() {
        let (_, bytes) = cube_glb();
        let (document, _, _) = gltf::import_slice(&bytes).unwrap();
        let node = document.nodes().next().unwrap();
        let extras: serde_json::Value =
            serde_json::from_str(node.extras().as_ref().unwrap().get()).unwrap();
        assert_eq!(extras["azimuths_deg"], serde_json::json!([0.0, 22.5]));
        assert_eq!(extras["pixels_per_metre"], 100.0);
        assert_eq!(extras["version"], "1.2.3");
    }

    #[test]
    fn nothing_is_not_a_mesh() {
        let frame = Placement::new((Point3::origin(), Point3::origin()), &ExportOptions::default());
        let extras = MeshExtras {
            azimuths_deg: vec![],
            pixels_per_metre: 1.0,
            method: String::new(),
            version: String::new(),
        };
        assert!(hull_glb(&Mesh::default(), &frame, &extras).is_err());
    }
}
