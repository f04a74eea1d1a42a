//! Ground truth with an upload: what is kept of it, and every way it can be
//! wrong.

use std::io::Cursor;

use crate::api::harness::{Service, drawing, encode, file, problem, views};
use image::{DynamicImage, ImageBuffer, ImageFormat, Luma, Rgb, Rgb32FImage};
use jobs::{JobId, JobStore};
use mesh::read;
use picture::ImageLimits;
use reqwest::StatusCode;
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};
use sheet::SheetDocument;
use turnaround::http::{HttpLimits, ServerTimeouts};
use turnaround::kinds::ReconstructionPayload;

const CUBE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";

fn three() -> Form {
    views(&["0", "45", "90"])
}

fn bytes_of(image: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.into().write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// A 16-bit depth picture of the drawings' size, all of this count.
fn depth(width: u32, height: u32, count: u16) -> Vec<u8> {
    let counts = ImageBuffer::from_pixel(width, height, Luma([count]));
    bytes_of(DynamicImage::ImageLuma16(counts), ImageFormat::Png)
}

fn pfm(width: u32, height: u32, value: f32) -> Vec<u8> {
    let mut bytes = format!("Pf\n{width} {height}\n-1\n").into_bytes();
    bytes.extend((0..width * height).flat_map(|_| value.to_le_bytes()));
    bytes
}

fn exr(width: u32, height: u32) -> Vec<u8> {
    bytes_of(Rgb32FImage::from_pixel(width, height, Rgb([7.0; 3])), ImageFormat::OpenExr)
}

async fn accepted(service: &Service, form: Form) -> (JobId, Value) {
    let response = service.upload(form).await;
    let (status, body) = (response.status(), response.json::<Value>().await.unwrap());
    assert_eq!(status, StatusCode::ACCEPTED, "{body}");
    (body["id"].as_str().unwrap().parse().unwrap(), body)
}

async fn document(service: &Service, id: JobId) -> SheetDocument {
    let job = service.store.get(id).await.unwrap();
    serde_json::from_value::<ReconstructionPayload>(job.payload).unwrap().document
}

/// Uploads and expects this problem with this part, and nothing stored.
async fn refused(form: Form, status: u16, name: &str, part: &str) -> Value {
    refused_by(HttpLimits::default(), form, status, name, part).await
}

async fn refused_by(limits: HttpLimits, form: Form, status: u16, name: &str, part: &str) -> Value {
    let service = Service::start_with(limits, ServerTimeouts::default()).await;
    let body = problem(service.upload(form).await, status, name).await;
    assert_eq!(body["part"], part, "{body}");
    service.assert_nothing_stored().await;
    body
}

#[tokio::test]
async fn truth_by_azimuth_is_stored_with_the_views() {
    let service = Service::start().await;
    let fields = json!({
        "pixels_per_unit": 131.5, "depth_counts_per_unit": 4096, "camera_distance": 8,
        "model_up_axis": "y",
    });
    let files = [depth(32, 24, 7 * 4096), pfm(32, 24, 7.5), encode(32, 24, 1, ImageFormat::Png)];
    let form = three()
        .part("truth[0]", file(files[0].clone(), "depth.png"))
        .part("truth[45]", file(files[1].clone(), "depth.pfm"))
        .part("truth[-270]", file(files[2].clone(), "ramp.png"))
        .part("truth_model", file(CUBE.into(), "cube.OBJ"))
        .text("truth", fields.to_string());
    let (id, body) = accepted(&service, form).await;
    assert_eq!((&body["truth_model"], &body["views"][1]["truth"]), (&json!(true), &json!(true)));
    let document = document(&service, id).await;
    let named: Vec<_> =
        document.views.iter().map(|v| (v.depth.as_deref(), v.disparity.as_deref())).collect();
    // An 8-bit picture is a ramp unless the upload says otherwise.
    let expected =
        [(Some("truth/0.png"), None), (Some("truth/45.pfm"), None), (None, Some("truth/90.png"))];
    assert_eq!(named, expected);
    let truth = document.truth.unwrap();
    assert_eq!(document.pixels_per_unit, Some(131.5));
    assert_eq!((truth.depth_counts_per_unit, truth.camera_distance), (Some(4096.0), Some(8.0)));
    assert_eq!(truth.model.as_deref(), Some("truth/model.obj"));
    let names = ["truth/0.png", "truth/45.pfm", "truth/90.png", "truth/model.obj"];
    let stored = service.stored_inputs(id, &names).await;
    assert_eq!(stored[..3], files);
    assert_eq!(stored[3], CUBE.as_bytes());
}

#[tokio::test]
async fn truth_that_a_sheet_names_is_stored_if_it_is_sent() {
    let service = Service::start().await;
    let sheet = json!({
        "pixels_per_unit": 131.5,
        "views": [
            {"image": "a.png", "azimuth_deg": 0, "depth": "depth_000.png"},
            {"image": "b.png", "azimuth_deg": 45, "disparity": "maps/b.exr"},
            {"image": "c.png", "azimuth_deg": 90, "depth": "not_sent.png"},
        ],
        "truth": {"model": "model.obj", "depth_counts_per_unit": 4096, "camera_distance": 8},
    });
    let form = || {
        ["a.png", "b.png", "c.png"]
            .into_iter()
            .enumerate()
            .fold(Form::new().text("sheet", sheet.to_string()), |form, (i, name)| {
                form.part("image", file(drawing(32, 24, i as u32), name))
            })
    };
    let with_truth = form()
        .part("truth", file(depth(32, 24, 9), "depth_000.png"))
        .part("b.exr", file(exr(32, 24), "b.exr"))
        .part("truth_model", file(CUBE.into(), "model.obj"));
    let (id, body) = accepted(&service, with_truth).await;
    let sent: Vec<_> = (0..3).map(|i| body["views"][i]["truth"].clone()).collect();
    assert_eq!(sent, [true, true, false]);
    let kept = document(&service, id).await;
    assert_eq!(kept.views[1].disparity.as_deref(), Some("truth/45.exr"));
    assert_eq!(kept.views[2].depth, None);
    assert_eq!(kept.truth.unwrap().depth_counts_per_unit, Some(4096.0));
    let names = ["truth/0.png", "truth/45.exr", "truth/model.obj"];
    let inputs = service.stored_inputs(id, &names).await;
    assert_eq!(inputs, [depth(32, 24, 9), exr(32, 24), CUBE.into()]);
    // The drawings alone make a job without truth.
    let (id, body) = accepted(&service, form()).await;
    assert_eq!(body["truth_model"], false);
    assert_eq!(document(&service, id).await.truth, None);
}

#[tokio::test]
async fn a_rerun_takes_the_truth_along() {
    let service = Service::start().await;
    let form = three()
        .part("truth[45]", file(depth(32, 24, 9), "d.png"))
        .part("truth_model", file(CUBE.into(), "cube.obj"))
        .text("truth", json!({"pixels_per_unit": 10}).to_string());
    let (first, _) = accepted(&service, form).await;
    let (second, _) = accepted(&service, Form::new().text("source", first.to_string())).await;
    let deleted = service.delete(&format!("/v1/reconstructions/{first}")).send().await.unwrap();
    assert_eq!(deleted.status(), StatusCode::NO_CONTENT);
    let inputs = service.stored_inputs(second, &["truth/45.png", "truth/model.obj"]).await;
    assert_eq!(inputs, [depth(32, 24, 9), CUBE.into()]);
    let mixed = Form::new()
        .text("source", second.to_string())
        .part("truth_model", file(CUBE.into(), "cube.obj"));
    problem(service.upload(mixed).await, 422, "conflicting-parts").await;
}

#[tokio::test]
async fn pictures_that_cannot_be_read() {
    let whole = [depth(32, 24, 9), exr(32, 24), pfm(32, 24, 1.0)];
    let cut = whole.map(|bytes| bytes[..bytes.len() / 2].to_vec());
    let none = [b"hello".to_vec(), encode(32, 24, 0, ImageFormat::Jpeg)];
    for bytes in cut.into_iter().chain(none) {
        let form = three().part("truth[45]", file(bytes, "d.png"));
        refused(form, 422, "invalid-truth", "truth[45]").await;
    }
    let empty = three().part("truth[45]", file(Vec::new(), "d.png"));
    refused(empty, 422, "empty-file", "truth[45]").await;
}

#[tokio::test]
async fn pictures_without_a_value() {
    let nothing = [depth(32, 24, 0), pfm(32, 24, f32::NAN), pfm(32, 24, 1e10)];
    for bytes in nothing {
        let form = three().part("truth[0]", file(bytes, "d"));
        let body = refused(form, 422, "invalid-truth", "truth[0]").await;
        assert!(body["detail"].as_str().unwrap().contains("no value"), "{body}");
    }
    // Depths behind the camera plane are none.
    let behind = three().part("truth[0]", file(pfm(32, 24, -1.0), "d"));
    refused(behind, 422, "invalid-truth", "truth[0]").await;
    let service = Service::start().await;
    let disparity = three()
        .part("truth[0]", file(pfm(32, 24, -1.0), "d"))
        .text("truth", json!({"kind": "disparity"}).to_string());
    accepted(&service, disparity).await;
}

#[tokio::test]
async fn pictures_of_another_size_than_the_view() {
    let form = three().part("truth[90]", file(depth(32, 23, 9), "d.png"));
    let body = refused(form, 422, "differing-sizes", "truth[90]").await;
    let detail = body["detail"].as_str().unwrap();
    assert!(detail.contains("32x23") && detail.contains("32x24"), "{body}");
}

#[tokio::test]
async fn pictures_over_the_limits() {
    let limits = |image| HttpLimits { image, ..HttpLimits::default() };
    let few = limits(ImageLimits { max_pixels: 1000, ..ImageLimits::default() });
    let form = || three().part("truth[45]", file(pfm(40, 30, 1.0), "d.pfm"));
    refused_by(few, form(), 422, "invalid-truth", "truth[45]").await;
    let png = three().part("truth[45]", file(depth(40, 30, 1), "d.png"));
    refused_by(few, png, 413, "too-many-pixels", "truth[45]").await;
    let short = limits(ImageLimits { max_bytes: 4000, ..ImageLimits::default() });
    refused_by(short, form(), 413, "part-too-large", "truth[45]").await;
}

#[tokio::test]
async fn truth_without_a_drawing_or_given_twice() {
    let alone = three().part("truth[10]", file(depth(32, 24, 9), "d.png"));
    refused(alone, 422, "missing-part", "truth[10]").await;
    let twice = three()
        .part("truth[0]", file(depth(32, 24, 9), "d.png"))
        .part("truth[360]", file(depth(32, 24, 9), "e.png"));
    refused(twice, 422, "duplicate-part", "truth[360]").await;
    let both = json!({"views": [
        {"image": "a.png", "azimuth_deg": 0, "depth": "d.png", "disparity": "e.png"},
        {"image": "b.png", "azimuth_deg": 45}, {"image": "c.png", "azimuth_deg": 90},
    ]});
    let form = Form::new().text("sheet", both.to_string());
    refused(form, 422, "invalid-sheet", "sheet").await;
    let mixed = Form::new()
        .text("sheet", json!({"views": []}).to_string())
        .part("truth[0]", file(depth(32, 24, 9), "d.png"));
    refused(mixed, 422, "conflicting-parts", "truth[0]").await;
}

#[tokio::test]
async fn models_that_cannot_be_used() {
    let scale = json!({"pixels_per_unit": 10}).to_string();
    let with = |bytes: &[u8], name: &str| {
        three().part("truth_model", file(bytes.to_vec(), name)).text("truth", scale.clone())
    };
    for (bytes, name) in [
        (&b"f 1 2 3\n"[..], "m.obj"),
        (b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "flat.obj"),
        (b"not a model", "m.glb"),
        (b"ply\n", "m.ply"),
        (CUBE.as_bytes(), "m.blend"),
    ] {
        refused(with(bytes, name), 422, "invalid-truth", "truth_model").await;
    }
    let nameless = three().part("truth_model", Part::bytes(CUBE.as_bytes()));
    refused(nameless, 400, "invalid-part-name", "truth_model").await;
    let service = Service::start().await;
    let unscaled = three().part("truth_model", file(CUBE.into(), "m.obj"));
    let body = problem(service.upload(unscaled).await, 422, "invalid-truth").await;
    assert!(body["detail"].as_str().unwrap().contains("pixels_per_unit"), "{body}");
    service.assert_nothing_stored().await;
    let model = read::Limits { max_bytes: 20, ..read::Limits::default() };
    let limits = HttpLimits { model, ..HttpLimits::default() };
    refused_by(limits, with(CUBE.as_bytes(), "m.obj"), 413, "part-too-large", "m.obj").await;
}

#[tokio::test]
async fn fields_that_are_not_accepted() {
    for (fields, name) in [
        (json!({"scale": 3}), "invalid-truth"),
        (json!({"kind": "height"}), "invalid-truth"),
        (json!([]), "invalid-truth"),
    ] {
        let form = three().text("truth", fields.to_string());
        refused(form, 422, name, "truth").await;
    }
    let service = Service::start().await;
    for fields in [
        json!({"pixels_per_unit": 0}),
        json!({"depth_counts_per_unit": -1}),
        json!({"camera_distance": -1}),
        json!({"disparity_pair_deg": 0}),
    ] {
        let form = three().text("truth", fields.to_string());
        problem(service.upload(form).await, 422, "invalid-sheet").await;
        service.assert_nothing_stored().await;
    }
    let form = three().text("truth", "{pixels");
    refused(form, 400, "invalid-json", "truth").await;
}
