//! Small models written by hand in every format, and files that are wrong in every way.

use super::*;

fn load_plain(bytes: &[u8], format: ModelFormat) -> Result<Model, ModelError> {
    load(bytes, format, None, &Limits::default())
}

fn malformed(result: Result<Model, ModelError>) -> bool {
    matches!(result, Err(ModelError::Malformed { .. }))
}

fn corners(model: &Model) -> Vec<[[f64; 3]; 3]> {
    let faces = 0..model.mesh.triangles.len();
    faces.map(|face| model.mesh.corners(face).map(|p| [p.x, p.y, p.z])).collect()
}

mod obj {
    use super::*;

    #[test]
    fn reads_polygons_of_any_shape() {
        // An L-shaped hexagon: fans from its first corner would cover the notch.
        let file = b"v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nf 3 4 5 6 1 2\n";
        let model = load_plain(file, ModelFormat::Obj).unwrap();
        let area: f64 = (0..model.mesh.triangles.len())
            .map(|face| {
                let [a, b, c] = model.mesh.corners(face);
                (b - a).cross(&(c - a)).norm() / 2.0
            })
            .sum();
        assert!((area - 3.0).abs() < 1e-12, "{area}");
        assert_eq!(model.mesh.triangles.len(), 4);
    }

    #[test]
    fn tells_materials_apart_without_their_library() {
        let file = b"mtllib missing.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n\
                     usemtl red\nf 1 2 3\nusemtl blue sky\nf 2 4 3\n";
        let model = load_plain(file, ModelFormat::Obj).unwrap();
        assert_ne!(model.materials[0], model.materials[1]);
        assert_eq!(model.mesh.positions.len(), 4, "the parts still share their edge");
    }

    #[test]
    fn reads_normals_and_indices_from_the_end() {
        let file = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 2\nf -3//-1 -2//-1 -1//-1\n";
        let model = load_plain(file, ModelFormat::Obj).unwrap();
        assert_eq!(model.corner_normals.unwrap()[0], [Vector3::z(); 3]);
    }

    #[test]
    fn reads_colours_behind_positions() {
        let file = b"v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 0.5\nf 1 2 3\n";
        let colours = load_plain(file, ModelFormat::Obj).unwrap().corner_colours.unwrap();
        assert_eq!(colours[0][..2], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        assert!((colours[0][2][2] - 0.2140).abs() < 1e-3, "sRGB to linear: {colours:?}");
    }

    #[test]
    fn turns_y_up_into_z_up_when_told() {
        let file = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        let model = load(file, ModelFormat::Obj, Some(UpAxis::Y), &Limits::default()).unwrap();
        assert_eq!(corners(&model)[0], [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
    }

    #[test]
    fn refuses_what_is_wrong() {
        let load_obj = |text: &str| load_plain(text.as_bytes(), ModelFormat::Obj);
        assert_eq!(load_obj(""), Err(ModelError::NoTriangles { degenerate: 0 }));
        let line = "v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\n";
        assert_eq!(load_obj(line), Err(ModelError::NoTriangles { degenerate: 1 }));
        assert!(malformed(load_obj("v 0 0 0\nf 1 2 3\n")));
        assert!(malformed(load_obj("v 0 zero 0\n")));
        let not_finite = "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        assert!(matches!(load_obj(not_finite), Err(ModelError::NonFiniteVertex { .. })));
        assert!(malformed(load_plain(b"\xff\xfe v", ModelFormat::Obj)));
    }
}

mod stl {
    use super::*;

    fn binary(header: &[u8], triangles: u32) -> Vec<u8> {
        let mut bytes = vec![0; 80];
        bytes[..header.len()].copy_from_slice(header);
        bytes.extend(triangles.to_le_bytes());
        for number in [0.0_f32, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend([0, 0]);
        bytes
    }

    #[test]
    fn reads_ascii_and_binary_alike() {
        let ascii = b"solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n\
                      vertex 0 1 0\nendloop\nendfacet\nendsolid s\n";
        let expected = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let binary_that_says_solid = binary(b"solid exported", 1);
        for file in [ascii.as_slice(), &binary(b"", 1), &binary_that_says_solid] {
            assert_eq!(corners(&load_plain(file, ModelFormat::Stl).unwrap())[0], expected);
        }
    }

    #[test]
    fn refuses_promises_that_the_bytes_do_not_keep() {
        assert!(malformed(load_plain(&binary(b"", 2), ModelFormat::Stl)));
        let promised = load_plain(&binary(b"", u32::MAX), ModelFormat::Stl);
        assert!(matches!(promised, Err(ModelError::TooManyTriangles { .. })));
        assert!(malformed(load_plain(b"solid \nfacet normal 0 0\n", ModelFormat::Stl)));
        assert!(malformed(load_plain(b"", ModelFormat::Stl)));
    }
}

mod ply {
    use super::*;

    const HEADER: &str = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                          element face 1\nproperty list uchar int vertex_indices\nend_header\n";

    fn ascii(body: &str) -> Vec<u8> {
        format!("ply\nformat ascii 1.0\n{HEADER}{body}").into_bytes()
    }

    #[test]
    fn reads_ascii_and_binary_alike() {
        let text = ascii("0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n");
        let mut little = format!("ply\nformat binary_little_endian 1.0\n{HEADER}").into_bytes();
        let mut big = format!("ply\nformat binary_big_endian 1.0\n{HEADER}").into_bytes();
        for number in [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0] {
            little.extend(number.to_le_bytes());
            big.extend(number.to_be_bytes());
        }
        little.push(4);
        big.push(4);
        for index in 0..4_i32 {
            little.extend(index.to_le_bytes());
            big.extend(index.to_be_bytes());
        }
        let read = |bytes: &[u8]| load_plain(bytes, ModelFormat::Ply).unwrap();
        assert_eq!(read(&text).mesh.triangles.len(), 2);
        assert_eq!(read(&text), read(&little));
        assert_eq!(read(&text), read(&big));
    }

    #[test]
    fn refuses_what_is_wrong() {
        let load_ply = |bytes: &[u8]| load_plain(bytes, ModelFormat::Ply);
        assert!(malformed(load_ply(b"")));
        let out_of_range = load_ply(&ascii("0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 7\n"));
        let expected = ModelError::IndexOutOfRange { triangle: 0, vertex: 7, vertices: 4 };
        assert_eq!(out_of_range, Err(expected));
        assert!(malformed(load_ply(&ascii("0 0 0\n1 0 0\n"))));
        let many =
            "ply\nformat ascii 1.0\nelement vertex 99999999999\nproperty float x\nend_header\n";
        assert!(matches!(load_ply(many.as_bytes()), Err(ModelError::TooManyVertices { .. })));
        let endless = "ply\nformat binary_little_endian 1.0\nelement nothing 3\nend_header\n";
        assert!(malformed(load_ply(endless.as_bytes())));
    }
}

/// Red, green and blue corners, and a property that is none of them.
#[test]
fn ply_gives_colours() {
    let file = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
                 property float z\nproperty uchar red\nproperty uchar green\n\
                 property uchar blue\nproperty uchar alpha\nelement face 1\n\
                 property list uchar int vertex_indices\nend_header\n\
                 0 0 0 255 0 0 9\n1 0 0 0 255 0 9\n0 1 0 0 0 255 9\n3 0 1 2\n";
    let colours = load_plain(file, ModelFormat::Ply).unwrap().corner_colours.unwrap();
    assert_eq!(colours, [[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]]);
}

mod gltf {
    use base64::Engine;
    use serde_json::{Value, json};

    use super::*;

    /// A triangle in the XY plane with its normal, then its indices.
    fn buffer() -> Vec<u8> {
        let mut bytes = Vec::new();
        for number in [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
            bytes.extend(number.to_le_bytes());
        }
        for number in [0.0_f32, 0.0, 1.0].repeat(3) {
            bytes.extend(number.to_le_bytes());
        }
        for index in 0..3_u16 {
            bytes.extend(index.to_le_bytes());
        }
        bytes.extend([0, 0]);
        bytes
    }

    fn document(nodes: Value) -> Value {
        json!({
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": nodes,
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2}]}],
            "buffers": [{"byteLength": 80}],
            "bufferViews": [
                {"buffer": 0, "byteOffset": 0, "byteLength": 36},
                {"buffer": 0, "byteOffset": 36, "byteLength": 36},
                {"buffer": 0, "byteOffset": 72, "byteLength": 6},
            ],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                 "min": [0, 0, 0], "max": [1, 1, 0]},
                {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3"},
                {"bufferView": 2, "componentType": 5123, "count": 3, "type": "SCALAR"},
            ],
        })
    }

    fn glb(document: &Value) -> Vec<u8> {
        let mut json = serde_json::to_vec(document).unwrap();
        json.resize(json.len().next_multiple_of(4), b' ');
        let binary = buffer();
        let mut bytes = b"glTF".to_vec();
        let length = 12 + 8 + json.len() + 8 + binary.len();
        for number in [2, length as u32, json.len() as u32] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend(b"JSON");
        bytes.extend(json);
        bytes.extend((binary.len() as u32).to_le_bytes());
        bytes.extend(b"BIN\0");
        bytes.extend(binary);
        bytes
    }

    fn load_document(document: &Value) -> Result<Model, ModelError> {
        load_plain(&glb(document), ModelFormat::Glb)
    }

    #[test]
    fn colours_are_the_materials_times_the_vertices() {
        let mut document = document(json!([{"mesh": 0}]));
        assert_eq!(load_document(&document).unwrap().corner_colours, None);
        document["materials"] =
            json!([{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 1.0, 0.25, 1.0]}}]);
        document["meshes"][0]["primitives"][0]["material"] = json!(0);
        let colours = load_document(&document).unwrap().corner_colours.unwrap();
        assert_eq!(colours, [[[0.5, 1.0, 0.25]; 3]]);
        // The normals, (0, 0, 1) each, taken for colours.
        document["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(1);
        let colours = load_document(&document).unwrap().corner_colours.unwrap();
        assert_eq!(colours, [[[0.0, 0.0, 0.25]; 3]]);
    }

    #[test]
    fn honours_transforms_of_nested_and_repeated_meshes() {
        let nodes = json!([
            {"children": [1, 2], "translation": [0, 0, 3]},
            {"mesh": 0},
            {"mesh": 0, "scale": [2, 2, 2], "translation": [5, 0, 0]},
        ]);
        let model = load_document(&document(nodes)).unwrap();
        // Y up to Z up: (x, y, z) becomes (x, -z, y).
        let expected = vec![
            [[0.0, -3.0, 0.0], [1.0, -3.0, 0.0], [0.0, -3.0, 1.0]],
            [[5.0, -3.0, 0.0], [7.0, -3.0, 0.0], [5.0, -3.0, 2.0]],
        ];
        assert_eq!(corners(&model), expected);
        assert_eq!(model.corner_normals.unwrap()[0], [-Vector3::y(); 3]);
    }

    #[test]
    fn a_mirrored_triangle_still_faces_along_its_normal() {
        let nodes = json!([{"mesh": 0, "scale": [-1, 1, 1]}]);
        let model = load_document(&document(nodes)).unwrap();
        let [a, b, c] = model.mesh.corners(0);
        let facing = (b - a).cross(&(c - a));
        assert!(facing.dot(&model.corner_normals.unwrap()[0][0]) > 0.0);
    }

    #[test]
    fn skins_move_vertices_with_their_joints() {
        let mut document = document(json!([
            {"children": [1, 2]},
            {"mesh": 0, "skin": 0, "translation": [100, 0, 0]},
            {"translation": [0, 0, 7]},
        ]));
        document["skins"] = json!([{"joints": [2]}]);
        // Joint 0 with a weight of 1 for every vertex: the first vertex is all zeros.
        document["accessors"].as_array_mut().unwrap().extend([
            json!({"bufferView": 0, "componentType": 5121, "count": 3, "type": "VEC4"}),
            json!({"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3"}),
        ]);
        let attributes = &mut document["meshes"][0]["primitives"][0]["attributes"];
        attributes["JOINTS_0"] = json!(3);
        attributes["WEIGHTS_0"] = json!(4);
        assert!(malformed(load_document(&document)), "weights come in fours");
        document["accessors"][4] = json!({
            "componentType": 5126, "count": 3, "type": "VEC4",
            "sparse": {"count": 3,
                "indices": {"bufferView": 2, "componentType": 5123},
                "values": {"bufferView": 3}},
        });
        document["bufferViews"]
            .as_array_mut()
            .unwrap()
            .push(json!({"buffer": 0, "byteOffset": 12, "byteLength": 48}));
        let model = load_document(&document).unwrap();
        // The skin replaces the mesh node's own place.
        assert_eq!(corners(&model)[0][0], [0.0, -7.0, 0.0]);
    }

    #[test]
    fn reads_json_with_an_embedded_buffer_but_follows_no_reference() {
        let mut document = document(json!([{"mesh": 0}]));
        let encoded = base64::engine::general_purpose::STANDARD.encode(buffer());
        document["buffers"][0]["uri"] =
            json!(format!("data:application/octet-stream;base64,{encoded}"));
        let text = document.to_string();
        let model = load_plain(text.as_bytes(), ModelFormat::Gltf).unwrap();
        assert_eq!(model.mesh.triangles.len(), 1);
        document["buffers"][0]["uri"] = json!("http://example.org/mesh.bin");
        let refused = load_plain(document.to_string().as_bytes(), ModelFormat::Gltf);
        assert!(matches!(refused, Err(ModelError::ExternalReference { .. })));
    }

    #[test]
    fn refuses_graphs_that_are_no_trees() {
        let cycle = json!([{"mesh": 0, "children": [1]}, {"children": [0]}]);
        assert!(malformed(load_document(&document(cycle))));
        let chain: Vec<_> = (1..1000).map(|child| json!({"children": [child]})).collect();
        let mut nodes = Value::from(chain);
        nodes.as_array_mut().unwrap().push(json!({"mesh": 0}));
        assert!(malformed(load_document(&document(nodes))));
    }

    #[test]
    fn refuses_accessors_that_promise_more_than_there_is() {
        let single = || document(json!([{"mesh": 0}]));
        let mut beyond = single();
        beyond["accessors"][0]["count"] = json!(4);
        assert!(malformed(load_document(&beyond)));
        let mut huge = single();
        huge["accessors"][0]["count"] = json!(4_000_000_000_u32);
        assert!(matches!(load_document(&huge), Err(ModelError::TooManyVertices { .. })));
        let mut view = single();
        view["bufferViews"][0]["byteOffset"] = json!(u64::MAX);
        assert!(malformed(load_document(&view)));
        let mut wide = single();
        wide["accessors"][2]["componentType"] = json!(5125);
        assert!(malformed(load_document(&wide)));
        let mut index = single();
        index["accessors"][0]["count"] = json!(2);
        let expected = ModelError::IndexOutOfRange { triangle: 0, vertex: 2, vertices: 2 };
        assert_eq!(load_document(&index), Err(expected));
    }

    #[test]
    fn refuses_required_extensions_that_change_the_surface() {
        let mut compressed = document(json!([{"mesh": 0}]));
        compressed["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
        assert!(matches!(load_document(&compressed), Err(ModelError::Unsupported { .. })));
        compressed["extensionsRequired"] = json!(["KHR_materials_clearcoat"]);
        assert!(load_document(&compressed).is_ok());
    }

    #[test]
    fn refuses_headers_that_are_too_short_or_lie() {
        let whole = glb(&document(json!([{"mesh": 0}])));
        for length in 0..whole.len() {
            assert!(load_plain(&whole[..length], ModelFormat::Glb).is_err(), "{length} bytes");
        }
        let mut lying = whole.clone();
        lying[8..12].copy_from_slice(&3_u32.to_le_bytes());
        assert!(malformed(load_plain(&lying, ModelFormat::Glb)));
    }
}

#[test]
fn limits_are_checked_before_anything_else() {
    let limits = Limits { max_bytes: 10, ..Limits::default() };
    let refused = load(&[0; 11], ModelFormat::Obj, None, &limits);
    assert_eq!(refused, Err(ModelError::TooManyBytes { found: 11, limit: 10 }));
}

#[test]
fn formats_go_by_the_extension() {
    assert_eq!(ModelFormat::from_file_name("a.b.GLB"), Some(ModelFormat::Glb));
    assert_eq!(ModelFormat::from_file_name("model.fbx"), None);
    assert_eq!(ModelFormat::from_file_name("obj"), None);
}
