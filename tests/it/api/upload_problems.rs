//! Every way an upload can be wrong: status, kind of problem, the part to
//! blame, and that nothing was stored.

use std::time::Duration;

use crate::api::harness::{Service, drawing, encode, file, problem, views};
use image::ImageFormat;
use picture::ImageLimits;
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};
use turnaround::http::{HttpLimits, ServerTimeouts};

/// Uploads and expects this problem, and nothing stored.
async fn refused(service: &Service, form: Form, status: u16, name: &str) -> Value {
    let body = problem(service.upload(form).await, status, name).await;
    service.assert_nothing_stored().await;
    body
}

async fn refused_by(limits: HttpLimits, form: Form, status: u16, name: &str) -> Value {
    let service = Service::start_with(limits, ServerTimeouts::default()).await;
    refused(&service, form, status, name).await
}

/// Sends a body as it is.
async fn refused_raw(body: Vec<u8>, content_type: &str, status: u16, name: &str) -> Value {
    let service = Service::start().await;
    let request = service.post("/v1/reconstructions").header("content-type", content_type);
    let body = problem(request.body(body).send().await.unwrap(), status, name).await;
    service.assert_nothing_stored().await;
    body
}

fn small_images(limits: ImageLimits) -> HttpLimits {
    HttpLimits { image: limits, ..HttpLimits::default() }
}

fn sheet(angles: &[(&str, f64)]) -> Value {
    let views: Vec<_> =
        angles.iter().map(|(image, angle)| json!({"image": image, "azimuth_deg": angle})).collect();
    json!({ "views": views })
}

fn with_files(form: Form, names: &[&str]) -> Form {
    names.iter().enumerate().fold(form, |form, (index, name)| {
        form.part("image", file(drawing(32, 24, index as u32), name))
    })
}

const THREE: [(&str, f64); 3] = [("a.png", 0.0), ("b.png", 45.0), ("c.png", 90.0)];
const FILES: [&str; 3] = ["a.png", "b.png", "c.png"];

#[tokio::test]
async fn other_media_types() {
    let json = "application/json";
    let body = refused_raw(b"{}".to_vec(), json, 415, "unsupported-media-type").await;
    assert!(body["detail"].as_str().unwrap().contains("application/json"));
    let form = "application/x-www-form-urlencoded";
    refused_raw(b"a=b".to_vec(), form, 415, "unsupported-media-type").await;
    let bare = "multipart/form-data";
    refused_raw(b"".to_vec(), bare, 415, "unsupported-media-type").await;
}

#[tokio::test]
async fn bodies_that_are_no_multipart() {
    let content_type = "multipart/form-data; boundary=cut";
    refused_raw(b"not multipart".to_vec(), content_type, 400, "malformed-multipart").await;
    let mut body =
        b"--cut\r\nContent-Disposition: form-data; name=\"view[0]\"; filename=\"a.png\"\r\n\r\n"
            .to_vec();
    body.extend(drawing(32, 24, 0));
    refused_raw(body, content_type, 400, "malformed-multipart").await;
}

#[tokio::test]
async fn part_names_that_are_not_utf_8_or_missing() {
    let content_type = "multipart/form-data; boundary=b";
    let part = |disposition: &[u8]| {
        [b"--b\r\nContent-Disposition: ", disposition, b"\r\n\r\nx\r\n--b--\r\n"].concat()
    };
    let latin_1 = part(b"form-data; name=\"gr\xf6\xdfe\"");
    refused_raw(latin_1, content_type, 400, "invalid-part-name").await;
    refused_raw(part(b"form-data"), content_type, 400, "invalid-part-name").await;
    let long = part(format!("form-data; name=\"{}\"", "a.".repeat(500)).as_bytes());
    refused_raw(long, content_type, 400, "invalid-part-name").await;
}

#[tokio::test]
async fn missing_parts() {
    let service = Service::start().await;
    let nothing = Form::new().text("method", "uncalibrated");
    refused(&service, nothing, 422, "missing-part").await;
    let body = refused(&service, with_files(Form::new(), &FILES), 422, "missing-part").await;
    assert_eq!(body["part"], "sheet");
    let mask = views(&["0", "45", "90"]).part("mask[10]", file(drawing(32, 24, 0), "m.png"));
    let body = refused(&service, mask, 422, "missing-part").await;
    assert_eq!(body["part"], "mask[10]");
}

#[tokio::test]
async fn duplicate_azimuths() {
    let service = Service::start().await;
    for (angles, part) in [
        (["0", "45", "45"], "view[45]"),
        (["0", "45", "360"], "view[360]"),
        (["-45", "0", "315"], "view[315]"),
        (["22.5", "0", "22.50"], "view[22.50]"),
    ] {
        let body = refused(&service, views(&angles), 422, "duplicate-azimuth").await;
        assert_eq!(body["part"], part);
    }
    let twice = sheet(&[("a.png", 0.0), ("b.png", 45.0), ("c.png", -360.0)]);
    let form = with_files(Form::new().text("sheet", twice.to_string()), &FILES);
    let body = refused(&service, form, 422, "duplicate-azimuth").await;
    assert_eq!(body["part"], "sheet");
}

#[tokio::test]
async fn fewer_views_than_the_method_takes() {
    let service = Service::start().await;
    let two = views(&["0", "45"]).text("method", "uncalibrated");
    let body = refused(&service, two, 422, "too-few-views").await;
    assert!(body["detail"].as_str().unwrap().contains("3 or more"), "{body}");
    let body = refused(&service, views(&["0"]), 422, "too-few-views").await;
    assert!(body["detail"].as_str().unwrap().contains("2 or more"), "{body}");
    let form = Form::new().text("sheet", sheet(&THREE[..1]).to_string());
    refused(&service, with_files(form, &FILES[..1]), 422, "too-few-views").await;
}

#[tokio::test]
async fn more_views_than_the_limit() {
    let limits = HttpLimits { max_views: 3, ..HttpLimits::default() };
    let body = refused_by(limits, views(&["0", "15", "30", "45"]), 422, "too-many-views").await;
    assert_eq!(body["part"], "view[45]");
    let four = [("a.png", 0.0), ("b.png", 45.0), ("c.png", 90.0), ("d.png", 135.0)];
    let form = Form::new().text("sheet", sheet(&four).to_string());
    let form = with_files(form, &["a.png", "b.png", "c.png", "d.png"]);
    refused_by(limits, form, 422, "too-many-views").await;
}

#[tokio::test]
async fn angles_that_are_not_finite() {
    let service = Service::start().await;
    for angle in ["nan", "inf", "-infinity", "1e999", "left", ""] {
        let body = refused(&service, views(&["0", "45", angle]), 422, "invalid-angle").await;
        assert_eq!(body["part"], format!("view[{angle}]"));
    }
    let mut bad = sheet(&THREE);
    bad["views"][1]["elevation_deg"] = json!(91);
    let form = with_files(Form::new().text("sheet", bad.to_string()), &FILES);
    let body = refused(&service, form, 422, "invalid-sheet").await;
    assert!(body["detail"].as_str().unwrap().contains("views[1].elevation_deg"), "{body}");
    // JSON has no way to write NaN, and a number out of range is no JSON number here.
    for number in ["NaN", "1e999"] {
        let text = sheet(&THREE).to_string().replace("45.0", number);
        let form = with_files(Form::new().text("sheet", text), &FILES);
        refused(&service, form, 400, "invalid-json").await;
    }
}

#[tokio::test]
async fn differing_sizes() {
    let service = Service::start().await;
    let other = views(&["0", "45"])
        .text("method", "uncalibrated")
        .part("view[90]", file(drawing(33, 24, 0), "c.png"));
    let body = refused(&service, other, 422, "differing-sizes").await;
    assert_eq!(body["part"], "view[90]");
    assert!(body["detail"].as_str().unwrap().contains("33x24"), "{body}");
    let mask = views(&["0", "45", "90"]).part("mask[45]", file(drawing(32, 23, 0), "m.png"));
    let body = refused(&service, mask, 422, "differing-sizes").await;
    assert_eq!(body["part"], "mask[45]");
}

#[tokio::test]
async fn files_that_are_no_images() {
    let service = Service::start().await;
    let filtered = b"<svg xmlns='http://www.w3.org/2000/svg'><filter id='f'/></svg>";
    for bytes in [b"hello".to_vec(), filtered.to_vec(), vec![0; 9000]] {
        let form = views(&["0", "45"]).part("view[90]", file(bytes, "c.png"));
        let body = refused(&service, form, 422, "not-an-image").await;
        assert_eq!(body["part"], "view[90]");
    }
    let gif = b"GIF89a\x01\x00\x01\x00\x00\x00\x00;".to_vec();
    let form = views(&["0", "45"]).part("view[90]", file(gif, "c.gif"));
    refused(&service, form, 422, "damaged-image").await;
    let avif = b"\0\0\0\x20ftypavif\0\0\0\0".to_vec();
    let form = views(&["0", "45"]).part("view[90]", file(avif, "c.avif"));
    let body = refused(&service, form, 422, "not-an-image").await;
    assert!(body["detail"].as_str().unwrap().contains("an AVIF image"), "{body}");
}

#[tokio::test]
async fn truncated_images_of_every_format() {
    let service = Service::start().await;
    for format in [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::WebP, ImageFormat::Tiff] {
        let whole = encode(32, 24, 0, format);
        let cut = whole[..whole.len() * 2 / 3].to_vec();
        let form = views(&["0", "45"]).part("view[90]", file(cut, "c.png"));
        let body = refused(&service, form, 422, "damaged-image").await;
        assert_eq!(body["part"], "view[90]", "{format:?}");
    }
}

#[tokio::test]
async fn empty_files() {
    let service = Service::start().await;
    let form = views(&["0", "45"]).part("view[90]", file(Vec::new(), "c.png"));
    let body = refused(&service, form, 422, "empty-file").await;
    assert_eq!(body["part"], "view[90]");
}

#[tokio::test]
async fn images_over_the_pixel_limit_are_refused_by_their_header() {
    let limits = small_images(ImageLimits { max_pixels: 1000, ..ImageLimits::default() });
    // Nothing but the header is there, so it cannot have been decoded.
    let header = drawing(100, 100, 0)[..64].to_vec();
    let form = views(&["0", "45"]).part("view[90]", file(header, "c.png"));
    let body = refused_by(limits, form, 413, "too-many-pixels").await;
    assert_eq!(body["part"], "view[90]");
    let limits = small_images(ImageLimits { max_side_px: 64, ..ImageLimits::default() });
    let form = views(&["0", "45"]).part("view[90]", file(drawing(100, 2, 0), "c.png"));
    refused_by(limits, form, 413, "too-many-pixels").await;
}

#[tokio::test]
async fn parts_and_bodies_over_the_byte_limit() {
    let limits = small_images(ImageLimits { max_bytes: 2000, ..ImageLimits::default() });
    let form = views(&["0", "45"]).part("view[90]", file(drawing(200, 200, 0), "c.png"));
    let body = refused_by(limits, form, 413, "part-too-large").await;
    assert_eq!(body["part"], "view[90]");
    let limits = HttpLimits { max_body_bytes: 2000, ..HttpLimits::default() };
    let form = views(&["0", "45"]).part("view[90]", file(drawing(200, 200, 0), "c.png"));
    refused_by(limits, form, 413, "body-too-large").await;
    let limits = HttpLimits { max_document_bytes: 100, ..HttpLimits::default() };
    let form = Form::new().text("options", " ".repeat(101));
    let body = refused_by(limits, form, 413, "part-too-large").await;
    assert_eq!(body["part"], "options");
}

#[tokio::test]
async fn bodies_over_the_limit_that_do_not_say_their_length() {
    let limits = HttpLimits { max_body_bytes: 100_000, ..HttpLimits::default() };
    let service = Service::start_with(limits, ServerTimeouts::default()).await;
    let head = b"--b\r\nContent-Disposition: form-data; name=\"options\"\r\n\r\n".to_vec();
    let chunks = std::iter::once(head).chain((0..20).map(|_| vec![b' '; 10_000]));
    let body =
        reqwest::Body::wrap_stream(futures::stream::iter(chunks.map(Ok::<_, std::io::Error>)));
    let request = service
        .post("/v1/reconstructions")
        .header("content-type", "multipart/form-data; boundary=b")
        .body(body);
    problem(request.send().await.unwrap(), 413, "body-too-large").await;
    service.assert_nothing_stored().await;
}

#[tokio::test]
async fn unknown_options() {
    let service = Service::start().await;
    let dotted = views(&["0", "45", "90"]).text("disparity.blocksize", "15");
    let body = refused(&service, dotted, 422, "unknown-option").await;
    assert_eq!(body["errors"][0]["option"], "disparity.blocksize");
    let part = views(&["0", "45", "90"]).text("options", json!({"speed": 1}).to_string());
    let body = refused(&service, part, 422, "unknown-option").await;
    assert_eq!(body["errors"][0]["option"], "speed");
    let mut in_sheet = sheet(&THREE);
    in_sheet["options"] = json!({"cloud": {"strides": 3}});
    let form = with_files(Form::new().text("sheet", in_sheet.to_string()), &FILES);
    let body = refused(&service, form, 422, "unknown-option").await;
    assert_eq!(body["errors"][0]["option"], "cloud.strides");
}

#[tokio::test]
async fn options_out_of_range() {
    let service = Service::start().await;
    for (option, value) in [
        ("disparity.block_size", "8"),
        ("disparity.block_size", "999"),
        ("disparity.block_size", "wide"),
        ("method", "magic"),
        ("disparity.p2", "1"),
    ] {
        let form = views(&["0", "45", "90"]).text(option, value);
        let body = refused(&service, form, 422, "invalid-option").await;
        let named = body["errors"].as_array().unwrap().iter().any(|e| e["option"] == option);
        assert!(named, "{option}={value}: {body}");
    }
    let list = views(&["0", "45", "90"]).text("options", "[1]");
    let body = refused(&service, list, 422, "invalid-option").await;
    assert_eq!(body["part"], "options");
}

#[tokio::test]
async fn unknown_parts() {
    let service = Service::start().await;
    let picture = views(&["0", "45", "90"]).part("picture", file(drawing(32, 24, 0), "p.png"));
    let body = refused(&service, picture, 422, "unknown-part").await;
    assert_eq!(body["part"], "picture");
    let text = views(&["0", "45", "90"]).text("veiw[135]", "x");
    let body = refused(&service, text, 422, "unknown-part").await;
    assert_eq!(body["part"], "veiw[135]");
    let form = Form::new().text("sheet", sheet(&THREE).to_string());
    let form = with_files(form, &["a.png", "b.png", "c.png", "d.png"]);
    let body = refused(&service, form, 422, "unknown-part").await;
    assert_eq!(body["part"], "d.png");
}

#[tokio::test]
async fn files_of_the_sheet_form() {
    let service = Service::start().await;
    let form = || Form::new().text("sheet", sheet(&THREE).to_string());
    let body = refused(&service, with_files(form(), &FILES[..2]), 422, "missing-file").await;
    assert_eq!(body["part"], "c.png");
    let twice = with_files(form(), &["a.png", "b.png", "b.png"]);
    let body = refused(&service, twice, 422, "duplicate-part").await;
    assert!(body["detail"].as_str().unwrap().contains("b.png"), "{body}");
    let nameless = form().part("image", Part::bytes(drawing(32, 24, 0)));
    refused(&service, nameless, 400, "invalid-part-name").await;
    let clash = sheet(&[("x/a.png", 0.0), ("y/a.png", 45.0), ("b.png", 90.0)]);
    let clash = with_files(Form::new().text("sheet", clash.to_string()), &["a.png", "b.png"]);
    refused(&service, clash, 422, "invalid-sheet").await;
}

#[tokio::test]
async fn mixed_and_repeated_parts() {
    let service = Service::start().await;
    let mixed = views(&["0", "45", "90"]).text("sheet", sheet(&THREE).to_string());
    refused(&service, mixed, 422, "conflicting-parts").await;
    let twice = views(&["0", "45", "90"]).text("seed", "1").text("seed", "2");
    let body = refused(&service, twice, 422, "duplicate-part").await;
    assert_eq!(body["part"], "seed");
}

#[tokio::test]
async fn documents_that_are_no_json_or_no_sheet() {
    let service = Service::start().await;
    for part in ["sheet", "options"] {
        let form = views(&["0", "45", "90"]).text(part, "{views:");
        let body = refused(&service, form, 400, "invalid-json").await;
        assert_eq!(body["part"], part);
    }
    let binary = views(&["0", "45", "90"]).part("seed", Part::bytes(vec![0xff, 0xfe]));
    refused(&service, binary, 400, "invalid-json").await;
    let long = json!({"name": "x".repeat(201), "views": []});
    for bad in
        [long, json!([]), json!({}), json!({"views": [], "colour": 1}), json!({"views": [{}]})]
    {
        let form = Form::new().text("sheet", bad.to_string());
        let body = refused(&service, form, 422, "invalid-sheet").await;
        assert_eq!(body["part"], "sheet");
    }
}

#[tokio::test]
async fn unknown_sources() {
    let service = Service::start().await;
    for source in ["none", "0191d6c1-7b1a-7c3e-8f00-0123456789ab"] {
        let form = Form::new().text("source", source);
        let body = refused(&service, form, 422, "unknown-source").await;
        assert_eq!(body["part"], "source");
    }
}

#[tokio::test]
async fn bodies_that_stop_coming() {
    let timeouts =
        ServerTimeouts { body_idle: Duration::from_millis(200), ..ServerTimeouts::default() };
    let service = Service::start_with(HttpLimits::default(), timeouts).await;
    let head = b"--b\r\nContent-Disposition: form-data; name=\"options\"\r\n\r\n{".to_vec();
    let body = async_stream::stream! {
        yield Ok::<_, std::io::Error>(head);
        std::future::pending::<()>().await;
    };
    let request = service
        .post("/v1/reconstructions")
        .header("content-type", "multipart/form-data; boundary=b")
        .body(reqwest::Body::wrap_stream(body));
    problem(request.send().await.unwrap(), 408, "request-timeout").await;
    service.assert_nothing_stored().await;
}

#[tokio::test]
async fn more_uploads_than_memory_is_set_aside_for() {
    let limits = HttpLimits {
        max_body_bytes: 10_000,
        max_upload_memory_bytes: 10_000,
        ..HttpLimits::default()
    };
    let service = Service::start_with(limits, ServerTimeouts::default()).await;
    let request = || {
        let content_type = "multipart/form-data; boundary=b";
        service.post("/v1/reconstructions").header("content-type", content_type)
    };
    let mut head = b"--b\r\nContent-Disposition: form-data; name=\"options\"\r\n\r\n".to_vec();
    head.resize(9_500, b' ');
    let (sent, waits) = tokio::sync::oneshot::channel();
    let (_open, ends) = tokio::sync::oneshot::channel::<()>();
    let first = head.clone();
    let body = async_stream::stream! {
        yield Ok::<_, std::io::Error>(first);
        let _ = sent.send(());
        let _ = ends.await;
    };
    tokio::spawn(request().body(reqwest::Body::wrap_stream(body)).send());
    waits.await.unwrap();
    tokio::time::sleep(Duration::from_millis(100)).await;
    let response = request().body(head).send().await.unwrap();
    assert_eq!(response.headers()["retry-after"], "5");
    problem(response, 503, "busy").await;
    service.assert_nothing_stored().await;
}
