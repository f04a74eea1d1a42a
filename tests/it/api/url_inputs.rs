//! Drawings that a sheet document names by URL.

use axum::Router;
use axum::http::{StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};
use tokio::net::TcpListener;
use turnaround::http::{HttpLimits, ServerTimeouts};

use crate::api::harness::{Service, drawing, problem};

/// Somebody on the loopback who has drawings: `/N.png`, and things that are none.
async fn host() -> String {
    async fn file(uri: Uri) -> Response {
        match uri.path() {
            "/text.png" => "no picture".into_response(),
            "/empty.png" => Vec::new().into_response(),
            "/large.png" => vec![0; 2 << 20].into_response(),
            "/moved.png" => (StatusCode::FOUND, [("location", "/0.png")]).into_response(),
            "/gone.png" => StatusCode::NOT_FOUND.into_response(),
            path => {
                let seed = path.trim_matches(|c: char| !c.is_ascii_digit()).parse().unwrap_or(0);
                drawing(32, 24, seed).into_response()
            }
        }
    }
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    let router = Router::new().fallback(file);
    tokio::spawn(async move { axum::serve(listener, router).await.unwrap() });
    url
}

/// A sheet of these drawings at 0, 45 and 90 degrees.
fn sheet(images: [&str; 3]) -> Form {
    let views: Vec<Value> = [0, 45, 90]
        .iter()
        .zip(images)
        .map(|(azimuth, image)| json!({"azimuth_deg": azimuth, "image": image}))
        .collect();
    Form::new().text("sheet", json!({ "views": views }).to_string())
}

async fn start(inputs_by_url: bool) -> Service {
    let image = picture::ImageLimits { max_bytes: 1 << 20, ..Default::default() };
    let limits = HttpLimits { inputs_by_url, image, ..HttpLimits::default() };
    Service::start_with(limits, ServerTimeouts::default()).await
}

#[tokio::test]
async fn drawings_are_fetched_where_that_is_allowed() {
    let (service, host) = (start(true).await, host().await);
    let [front, side] =
        ["0", "2"].map(|name| format!("{host}/{name}.png?token={}", "x".repeat(999)));
    let sent = Part::bytes(drawing(32, 24, 1)).file_name("quarter.png");
    let form = sheet([&front, "quarter.png", &side]).part("image", sent);
    let queued = service.upload(form).await;
    assert_eq!(queued.status(), 202);
    let queued: Value = queued.json().await.unwrap();
    let id = queued["id"].as_str().unwrap().parse().unwrap();
    let stored = service.stored_inputs(id, &["views/0.png", "views/45.png", "views/90.png"]).await;
    assert_eq!(stored, [0, 1, 2].map(|seed| drawing(32, 24, seed)));
}

#[tokio::test]
async fn what_is_no_drawing_or_not_to_be_called_is_refused() {
    let (service, host) = (start(true).await, host().await);
    let upload = async |image: &str| {
        let others = [1, 2].map(|n| format!("{host}/{n}.png"));
        service.upload(sheet([&others[0], image, &others[1]])).await
    };
    for (name, status, kind) in [
        ("text.png", 422, "not-an-image"),
        ("empty.png", 422, "empty-file"),
        ("large.png", 413, "part-too-large"),
        ("moved.png", 422, "not-fetched"),
        ("gone.png", 422, "not-fetched"),
    ] {
        let refused = problem(upload(&format!("{host}/{name}")).await, status, kind).await;
        assert_eq!(refused["part"], "views[1].image", "{refused}");
    }
    for url in [
        "https://localhost:1/a.png",
        "https://169.254.169.254/latest/meta-data",
        "https://[::1]/a.png",
        "http://studio.example/a.png",
    ] {
        problem(upload(url).await, 422, "not-fetched").await;
    }
    service.assert_nothing_stored().await;
}

#[tokio::test]
async fn nothing_is_fetched_unless_that_is_allowed() {
    let (service, host) = (start(false).await, host().await);
    let images = [0, 1, 2].map(|n| format!("{host}/{n}.png"));
    let refused = service.upload(sheet([&images[0], &images[1], &images[2]])).await;
    let refused = problem(refused, 422, "missing-file").await;
    assert!(refused["detail"].as_str().unwrap().contains("--inputs-by-url"), "{refused}");
}
