use std::borrow::Cow;
use std::collections::BTreeMap;

use gltf::binary::{Glb, Header};
use gltf::json::validation::{Checked, USize64};
use gltf::json::{self, Index, Root, accessor, buffer, material, mesh};
use serde::Serialize;

use super::frame::ExportFrame;
use super::png::EncodeError;
use crate::geometry::Mesh;

/// What a mesh's node says about its origin.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeshExtras {
    /// Azimuths of the sheet's views.
    pub azimuths_deg: Vec<f64>,
    /// Sheet pixels a metre.
    pub pixels_per_metre: f64,
    pub method: String,
    /// Version of this program.
    pub version: String,
}

/// A mesh of the turntable frame as binary glTF: Y up, front facing +Z, metres,
/// transforms baked in.
///
/// # Errors
/// [`EncodeError`] if the mesh is empty or too large for the format.
pub fn glb(
    mesh: &Mesh,
    name: &str,
    frame: &ExportFrame,
    extras: &MeshExtras,
) -> Result<Vec<u8>, EncodeError> {
    let positions: Vec<[f32; 3]> =
        mesh.positions.iter().map(|point| frame.gltf_from_turntable(point)).collect();
    if positions.is_empty() || mesh.triangles.is_empty() {
        return Err(EncodeError::new("a mesh", "it is empty"));
    }
    let mut bytes: Vec<u8> =
        positions.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
    let position_bytes = bytes.len();
    bytes.extend(mesh.triangles.as_flattened().iter().flat_map(|index| index.to_le_bytes()));
    let mut root = Root::default();
    root.asset.generator = Some(format!("turnaround {}", extras.version));
    let primitive =
        primitive(&mut root, &positions, mesh.triangles.len() * 3, position_bytes, bytes.len());
    let mesh = root.push(json::Mesh {
        extensions: None,
        extras: None,
        name: Some(name.to_owned()),
        primitives: vec![primitive],
        weights: None,
    });
    let extras = serde_json::value::to_raw_value(extras)
        .map_err(|error| EncodeError::new("a mesh", error))?;
    let node = root.push(json::Node {
        mesh: Some(mesh),
        name: Some(name.to_owned()),
        extras: Some(extras),
        ..json::Node::default()
    });
    let scene = json::Scene { extensions: None, extras: None, name: None, nodes: vec![node] };
    root.scene = Some(root.push(scene));
    pack(&root, bytes)
}

fn primitive(
    root: &mut Root,
    positions: &[[f32; 3]],
    indices: usize,
    position_bytes: usize,
    total_bytes: usize,
) -> mesh::Primitive {
    let buffer = root.push(json::Buffer {
        byte_length: USize64::from(total_bytes),
        extensions: None,
        extras: None,
        name: None,
        uri: None,
    });
    let position_view = view(root, buffer, 0..position_bytes, buffer::Target::ArrayBuffer);
    let index_view =
        view(root, buffer, position_bytes..total_bytes, buffer::Target::ElementArrayBuffer);
    let extreme = |pick: fn(f32, f32) -> f32| {
        let fold = |a: [f32; 3], b: &[f32; 3]| [0, 1, 2].map(|axis| pick(a[axis], b[axis]));
        Some(serde_json::json!(positions.iter().fold(positions[0], fold)))
    };
    let position_accessor = root.push(json::Accessor {
        min: extreme(f32::min),
        max: extreme(f32::max),
        ..accessor(
            position_view,
            positions.len(),
            accessor::ComponentType::F32,
            accessor::Type::Vec3,
        )
    });
    let index_accessor = root.push(accessor(
        index_view,
        indices,
        accessor::ComponentType::U32,
        accessor::Type::Scalar,
    ));
    let material = root.push(clay());
    mesh::Primitive {
        attributes: BTreeMap::from([(
            Checked::Valid(mesh::Semantic::Positions),
            position_accessor,
        )]),
        extensions: None,
        extras: None,
        indices: Some(index_accessor),
        material: Some(material),
        mode: Checked::Valid(mesh::Mode::Triangles),
        targets: None,
    }
}

fn view(
    root: &mut Root,
    buffer: Index<json::Buffer>,
    range: std::ops::Range<usize>,
    target: buffer::Target,
) -> Index<buffer::View> {
    root.push(buffer::View {
        buffer,
        byte_length: USize64::from(range.len()),
        byte_offset: Some(USize64::from(range.start)),
        byte_stride: None,
        extensions: None,
        extras: None,
        name: None,
        target: Some(Checked::Valid(target)),
    })
}

fn accessor(
    view: Index<buffer::View>,
    count: usize,
    component: accessor::ComponentType,
    shape: accessor::Type,
) -> json::Accessor {
    json::Accessor {
        buffer_view: Some(view),
        byte_offset: None,
        count: USize64::from(count),
        component_type: Checked::Valid(accessor::GenericComponentType(component)),
        extensions: None,
        extras: None,
        type_: Checked::Valid(shape),
        min: None,
        max: None,
        name: None,
        normalized: false,
        sparse: None,
    }
}

/// Matt grey: a draft to be modelled on.
fn clay() -> json::Material {
    json::Material {
        name: Some("clay".to_owned()),
        pbr_metallic_roughness: material::PbrMetallicRoughness {
            base_color_factor: material::PbrBaseColorFactor([0.8, 0.8, 0.8, 1.0]),
            metallic_factor: material::StrengthFactor(0.0),
            roughness_factor: material::StrengthFactor(0.9),
            ..material::PbrMetallicRoughness::default()
        },
        ..json::Material::default()
    }
}

fn pack(root: &Root, bytes: Vec<u8>) -> Result<Vec<u8>, EncodeError> {
    let json = root.to_vec().map_err(|error| EncodeError::new("a mesh", error))?;
    // 64 bytes cover all headers and padding.
    let length = u32::try_from(json.len() + bytes.len() + 64)
        .map_err(|error| EncodeError::new("a mesh", error))?;
    let header = Header { magic: *b"glTF", version: 2, length };
    Glb { header, json: Cow::Owned(json), bin: Some(Cow::Owned(bytes)) }
        .to_vec()
        .map_err(|error| EncodeError::new("a mesh", error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::ExportOptions;
    use crate::vision::convex_hull;
    use nalgebra::Point3;

    fn cube_glb() -> (Mesh, Vec<u8>) {
        let corners: Vec<_> = (0..8_u32)
            .map(|i| {
                let at = |bit: u32| if i >> bit & 1 == 1 { 90.0 } else { -90.0 };
                Point3::new(at(0), at(1), at(2))
            })
            .collect();
        let cube = convex_hull(&corners).unwrap();
        let frame = ExportFrame::new(cube.bounds().unwrap(), &ExportOptions::default());
        let extras = MeshExtras {
            azimuths_deg: vec![0.0, 22.5],
            pixels_per_metre: frame.pixels_per_metre(),
            method: "uncalibrated".to_owned(),
            version: "1.2.3".to_owned(),
        };
        let bytes = glb(&cube, "hull", &frame, &extras).unwrap();
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
        let frame =
            ExportFrame::new((Point3::origin(), Point3::origin()), &ExportOptions::default());
        let extras = MeshExtras {
            azimuths_deg: vec![],
            pixels_per_metre: 1.0,
            method: String::new(),
            version: String::new(),
        };
        assert!(glb(&Mesh::default(), "hull", &frame, &extras).is_err());
    }
}
