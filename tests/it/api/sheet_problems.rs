//! Every way the upload of a model can be wrong: status, kind of problem, the part to blame, and
//! that nothing was stored.

use drawing::DrawOptions;
use mesh::read;
use options::OptionSet;
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};
use turnaround::http::{HttpLimits, ServerTimeouts};

use crate::api::harness::{Service, problem, views};
use crate::api::sheets::{OBJ, builtin, gltf, json_at, model, post, triangle_uri};

/// Uploads and expects this problem, and nothing stored.
async fn refused(service: &Service, form: Form, status: u16, name: &str) -> Value {
    let body = problem(post(service, form).await, status, name).await;
    service.assert_nothing_stored().await;
    body
}

async fn refused_by(limits: HttpLimits, form: Form, status: u16, name: &str) -> Value {
    let service = Service::start_with(limits, ServerTimeouts::default()).await;
    refused(&service, form, status, name).await
}
#[tokio::test]
async fn options_and_their_schema() {
    let service = Service::start().await;
    let served = json_at(&service, "/v1/sheet-options").await;
    assert_eq!(served, DrawOptions::schema().document);
    assert_eq!(served["properties"]["scale"]["default"], 7.3);
    for (option, value) in [
        ("width_px", "15"),
        ("scale", "0"),
        ("scale", "null"),
        ("elevation_deg", "90"),
        ("degrade.jpeg_quality", "101"),
        ("degrade.preset", "awful"),
        ("contours", "wavy"),
        ("fit", "1"),
    ] {
        let form = builtin("cube").text("options", "{}");
        let form = if option == "width_px" {
            Form::new().text("model", "builtin:cube").text(option, value)
        } else {
            form.text(option, value)
        };
        let body = refused(&service, form, 422, "invalid-option").await;
        let named = body["errors"].as_array().unwrap().iter().any(|e| e["option"] == option);
        assert!(named, "{option}={value}: {body}");
    }
    let unknown = builtin("cube").text("options", json!({"degrade": {"mood": 1}}).to_string());
    let body = refused(&service, unknown, 422, "unknown-option").await;
    assert_eq!(body["errors"][0]["option"], "degrade.mood");
    let detail = body["errors"][0]["detail"].as_str().unwrap();
    assert!(detail.contains("/v1/sheet-options"), "{body}");
    let list = builtin("cube").text("options", "[]");
    assert_eq!(refused(&service, list, 422, "invalid-option").await["part"], "options");
    let number = builtin("cube").text("options", "{\"scale\": NaN}");
    refused(&service, number, 400, "invalid-json").await;
    let sideways = model(OBJ, "a.obj").text("up_axis", "x");
    assert_eq!(refused(&service, sideways, 422, "invalid-option").await["part"], "up_axis");
}

#[tokio::test]
async fn missing_unknown_and_repeated_parts() {
    let service = Service::start().await;
    let nothing = Form::new().text("azimuths", "0");
    assert_eq!(refused(&service, nothing, 422, "missing-part").await["part"], "model");
    let drawn = views(&["0", "45", "90"]);
    assert_eq!(refused(&service, drawn, 422, "unknown-part").await["part"], "view[0]");
    for part in ["model", "azimuths", "scale"] {
        let form = builtin("cube").text("azimuths", "0").text("scale", "5");
        let body = refused(&service, form.text(part, "builtin:cube"), 422, "duplicate-part").await;
        assert_eq!(body["part"], part);
    }
}

#[tokio::test]
async fn azimuths_that_are_none() {
    let service = Service::start().await;
    for azimuths in ["", "left", "nan", "0:90", "90:0:5", "0:360:0.01", "1e999"] {
        let form = builtin("cube").text("azimuths", azimuths);
        let body = refused(&service, form, 422, "invalid-angle").await;
        assert_eq!(body["part"], "azimuths", "{azimuths}");
    }
}

#[tokio::test]
async fn models_of_no_known_name_or_format() {
    let service = Service::start().await;
    let body = refused(&service, builtin("bunny"), 422, "unknown-model").await;
    assert!(body["detail"].as_str().unwrap().contains("teapot"), "{body}");
    for name in ["model.fbx", "model", "obj", "model.obj.zip", "../.."] {
        let body = refused(&service, model(OBJ, name), 422, "unknown-model-format").await;
        assert_eq!(body["part"], "model");
    }
    let nameless = Form::new().part("model", Part::bytes(OBJ.as_bytes().to_vec()));
    refused(&service, nameless, 422, "unknown-model-format").await;
    let long = format!("{}.obj", "x".repeat(300));
    refused(&service, model(OBJ, &long), 400, "invalid-part-name").await;
}

#[tokio::test]
async fn malformed_models_of_every_format() {
    let service = Service::start().await;
    let cut = &OBJ[..20];
    for (bytes, name) in [
        (b"\0\x01\x02 nothing".to_vec(), "a.glb"),
        (b"glTF\x02\0\0\0\xff\xff\xff\xff".to_vec(), "a.glb"),
        (b"{\"asset\": {}}".to_vec(), "a.gltf"),
        (b"{".to_vec(), "a.gltf"),
        (cut.into(), "a.obj"),
        (b"f 1 2 3\n".to_vec(), "a.obj"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n".to_vec(), "a.obj"),
        (b"ply\nformat ascii 1.0\nelement vertex 3\n".to_vec(), "a.ply"),
        (b"no stl at all".to_vec(), "a.stl"),
        (vec![0; 84], "a.stl"),
        (OBJ.into(), "a.glb"),
        (OBJ.into(), "a.ply"),
    ] {
        let body = refused(&service, model(bytes, name), 422, "invalid-model").await;
        assert_eq!(body["part"], "model", "{name}");
    }
    for name in ["a.glb", "a.gltf", "a.obj", "a.ply", "a.stl"] {
        let body = refused(&service, model(Vec::new(), name), 422, "empty-file").await;
        assert_eq!(body["part"], "model");
    }
}

#[tokio::test]
async fn models_without_finite_coordinates_or_area() {
    let service = Service::start().await;
    for bad in ["nan", "inf", "-inf", "1e999", "1e300"] {
        let obj = OBJ.replacen("v 1 0 -1", &format!("v {bad} 0 -1"), 1);
        refused(&service, model(obj, "a.obj"), 422, "invalid-model").await;
    }
    let flat = "v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\nf 1 1 2\n";
    let body = refused(&service, model(flat, "a.obj"), 422, "invalid-model").await;
    assert!(body["detail"].as_str().unwrap().contains("area"), "{body}");
    let nan = triangle_uri([[f32::NAN, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let gltf = gltf(&nan).to_string();
    refused(&service, model(gltf, "a.gltf"), 422, "invalid-model").await;
}

#[tokio::test]
async fn models_that_need_what_is_not_there() {
    let service = Service::start().await;
    for uri in ["triangle.bin", "../secret.bin", "file:///etc/passwd", "http://127.0.0.1/a.bin"] {
        let body = model(gltf(uri).to_string(), "a.gltf");
        let body = refused(&service, body, 422, "external-reference").await;
        assert!(body["detail"].as_str().unwrap().contains(uri), "{body}");
    }
    let mut compressed = gltf("data:,");
    compressed["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
    compressed["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    let body = model(compressed.to_string(), "a.gltf");
    let body = refused(&service, body, 422, "unsupported-model").await;
    assert!(body["detail"].as_str().unwrap().contains("KHR_draco_mesh_compression"), "{body}");
}

#[tokio::test]
async fn models_over_the_limits() {
    let limits = |model: read::Limits| HttpLimits { model, ..HttpLimits::default() };
    let bytes = read::Limits { max_bytes: 50, ..read::Limits::default() };
    let body = refused_by(limits(bytes), model(OBJ, "a.obj"), 413, "part-too-large").await;
    assert_eq!(body["part"], "model");
    let triangles = read::Limits { max_triangles: 3, ..read::Limits::default() };
    refused_by(limits(triangles), model(OBJ, "a.obj"), 413, "model-too-large").await;
    let vertices = read::Limits { max_vertices: 3, ..read::Limits::default() };
    refused_by(limits(vertices), model(OBJ, "a.obj"), 413, "model-too-large").await;
    // Promises that the bytes do not hold are not believed.
    let service = Service::start().await;
    let mut stl = vec![0; 84];
    stl[80..].copy_from_slice(&u32::MAX.to_le_bytes());
    let response = post(&service, model(stl, "a.stl")).await;
    assert!(response.status().is_client_error(), "{}", response.status());
    let ply = "ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
    refused(&service, model(ply, "a.ply"), 413, "model-too-large").await;
    let body = HttpLimits { max_body_bytes: 300, ..HttpLimits::default() };
    refused_by(body, model(OBJ.repeat(10), "a.obj"), 413, "body-too-large").await;
}

#[tokio::test]
async fn sheets_over_the_limits() {
    let service = Service::start().await;
    let many = builtin("cube").text("azimuths", "0:359:1");
    assert_eq!(refused(&service, many, 422, "too-many-views").await["part"], "azimuths");
    let large = |width: &'static str, supersampling: &'static str, azimuths: &'static str| {
        let form = Form::new().text("model", "builtin:cube").text("azimuths", azimuths);
        form.text("width_px", width).text("height_px", "4096").text("supersampling", supersampling)
    };
    refused(&service, large("4096", "2", "0"), 422, "sheet-too-large").await;
    let body = refused(&service, large("8192", "1", "0,90,180"), 422, "sheet-too-large").await;
    assert!(body["detail"].as_str().unwrap().contains("100663296 pixels"), "{body}");
    let near = builtin("cube").text("distance", "1");
    let body = refused(&service, near, 422, "camera-inside-model").await;
    assert!(body["detail"].as_str().unwrap().contains("fitted"), "{body}");
}
