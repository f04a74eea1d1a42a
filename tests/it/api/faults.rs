//! What clients may do to the service, and what it does in trouble.

use std::time::{Duration, Instant};

use reqwest::StatusCode;
use reqwest::multipart::Form;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpSocket, TcpStream};

use crate::api::harness::{Service, file, problem, views};
use jobs::JobStore;
use turnaround::draft::DraftLimits;
use turnaround::http::{HttpLimits, ServerTimeouts};

async fn with_limits(limits: HttpLimits) -> Service {
    Service::start_with(limits, ServerTimeouts::default()).await
}

#[tokio::test]
async fn many_documents_count_against_one_limit() {
    let service = Service::start().await;
    let zeros = format!("[0{}]", ",0".repeat(500_000)).into_bytes();
    let bomb = (0..200).fold(views(&["0", "10", "20"]), |form, _| {
        form.part("matches", file(zeros.clone(), "zeros.json"))
    });
    let body = problem(service.upload(bomb).await, 413, "part-too-large").await;
    assert_eq!(body["part"], "matches");
    service.assert_nothing_stored().await;
}

#[tokio::test]
async fn statuses_and_lists_do_not_grow_with_the_matches() {
    let service = Service::start().await;
    let one = json!({"left": [1, 2], "right": [3, 4]});
    let pair = json!({"left_azimuth_deg": 0, "right_azimuth_deg": 10, "add": vec![one; 10_000]});
    let form = views(&["0", "10", "20"]).text("matches", pair.to_string());
    let response = service.upload(form).await;
    assert_eq!(response.status(), StatusCode::ACCEPTED);
    let id = service.claim().await.0;
    let payload = service.store.get(id).await.unwrap().payload.to_string();
    assert!(payload.len() < 20_000, "{} bytes are read with every status", payload.len());
    let stored = &service.stored_inputs(id, &["matches.json"]).await[0];
    let stored: Value = serde_json::from_slice(stored).unwrap();
    assert_eq!(stored[0]["add"].as_array().unwrap().len(), 10_000);
}

#[tokio::test]
async fn uploads_are_refused_while_the_disk_is_about_full() {
    let limits = HttpLimits { min_free_bytes: u64::MAX, ..HttpLimits::default() };
    let service = with_limits(limits).await;
    let response = service.upload(views(&["0", "45", "90"])).await;
    assert!(response.headers().contains_key("retry-after"));
    problem(response, 507, "insufficient-storage").await;
    let model = Form::new().text("model", "builtin:teapot");
    let response = service.post("/v1/sheets").multipart(model).send().await.unwrap();
    problem(response, 507, "insufficient-storage").await;
    service.assert_nothing_stored().await;
}

#[tokio::test]
async fn a_refused_upload_leaves_its_connection_in_order() {
    let limits = HttpLimits { min_free_bytes: u64::MAX, ..HttpLimits::default() };
    let service = with_limits(limits).await;
    let mut connection = TcpStream::connect(&service.url["http://".len()..]).await.unwrap();
    let body = "x".repeat(300_000);
    let head = format!(
        "POST /v1/reconstructions HTTP/1.1\r\nHost: a\r\nContent-Length: {}\r\n\r\n",
        body.len()
    );
    // Half of the body comes late, when the answer is long known.
    connection.write_all(format!("{head}{}", &body[..150_000]).as_bytes()).await.unwrap();
    tokio::time::sleep(Duration::from_millis(100)).await;
    connection.write_all(&body.as_bytes()[150_000..]).await.unwrap();
    let next = b"GET /health/live HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n";
    connection.write_all(next).await.unwrap();
    let mut answers = String::new();
    connection.read_to_string(&mut answers).await.unwrap();
    assert!(answers.starts_with("HTTP/1.1 507 "), "{answers}");
    assert!(answers.contains("HTTP/1.1 200 "), "{answers}");
}

#[tokio::test]
async fn one_that_stops_takes_no_uploads_and_is_not_ready() {
    let service = Service::start().await;
    service.draining.cancel();
    let response = service.upload(views(&["0", "45", "90"])).await;
    assert!(response.headers().contains_key("retry-after"));
    problem(response, 503, "unavailable").await;
    problem(service.get("/health/ready").send().await.unwrap(), 503, "unavailable").await;
    let live = service.get("/health/live").send().await.unwrap();
    assert_eq!(live.status(), StatusCode::OK);
}

#[tokio::test]
async fn open_event_streams_are_bounded() {
    let service = with_limits(HttpLimits { max_streams: 2, ..HttpLimits::default() }).await;
    let path = format!("/v1/reconstructions/{}/events", service.queue().await);
    let open = || async { service.get(&path).send().await.unwrap() };
    let (first, _second) = (open().await, open().await);
    let third = open().await;
    assert!(third.headers().contains_key("retry-after"));
    problem(third, 503, "busy").await;
    drop(first);
    let begun = Instant::now();
    while open().await.status() != StatusCode::OK {
        assert!(begun.elapsed() < Duration::from_secs(20), "a closed stream keeps its place");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

/// Sends `request` as it is and reads all that comes back.
async fn raw(service: &Service, request: &str) -> String {
    let mut connection = TcpStream::connect(&service.url["http://".len()..]).await.unwrap();
    connection.write_all(request.as_bytes()).await.unwrap();
    let mut answer = Vec::new();
    let reading = connection.read_to_end(&mut answer);
    tokio::time::timeout(Duration::from_secs(20), reading).await.unwrap().unwrap();
    String::from_utf8(answer).unwrap()
}

#[tokio::test]
async fn headers_are_bounded_and_held_to_their_rules() {
    let service = Service::start().await;
    let get =
        |headers: &str| format!("GET /health/live HTTP/1.1\r\nConnection: close\r\n{headers}\r\n");
    let two = raw(&service, &get("Host: a\r\nHost: b\r\n")).await;
    assert!(two.starts_with("HTTP/1.1 400 "), "{two}");
    assert!(two.contains("application/problem+json") && two.contains("one Host header"), "{two}");
    let long = format!("Host: a\r\nX-Long: {}\r\n", "x".repeat(100_000));
    let answer = raw(&service, &get(&long)).await;
    assert!(answer.starts_with("HTTP/1.1 431 "), "{answer}");
    assert!(answer.contains("/problems/header-too-large"), "{answer}");
    for nonsense in ["GET /health/live HTTP/1.1\r\nHo st: a\r\n\r\n", "\x16\x03\x01\r\n\r\n"] {
        let answer = raw(&service, nonsense).await;
        assert!(answer.starts_with("HTTP/1.1 400 "), "{answer}");
        let (head, body) = answer.split_once("\r\n\r\n").unwrap();
        assert!(head.contains("application/problem+json"), "{answer}");
        let body: Value = serde_json::from_str(body).unwrap();
        assert_eq!(body["type"], "/problems/bad-request");
    }
    let id = format!("Host: a\r\nX-Request-Id: {}\r\n", "x".repeat(1000));
    let answer = raw(&service, &get(&id)).await;
    assert!(answer.starts_with("HTTP/1.1 200 ") && !answer.contains("xxxx"), "{answer}");
}

#[tokio::test]
async fn compressed_uploads_and_pages_of_others_are_refused() {
    let service = Service::start().await;
    let gzip = service.post("/v1/reconstructions").header("content-encoding", "gzip");
    let response = gzip.multipart(views(&["0", "45", "90"])).send().await.unwrap();
    assert_eq!(response.headers()["accept-encoding"], "identity");
    problem(response, 415, "unsupported-media-type").await;
    let foreign = service.post("/v1/reconstructions").header("origin", "https://evil.example");
    let response = foreign.multipart(views(&["0", "45", "90"])).send().await.unwrap();
    problem(response, 403, "foreign-origin").await;
    service.assert_nothing_stored().await;
}

#[tokio::test]
async fn answers_say_how_they_may_be_kept_and_framed() {
    let service = Service::start().await;
    for path in ["/docs", "/v1/options", "/v1/reconstructions", "/health/live", "/v1/nothing"] {
        let response = service.get(path).send().await.unwrap();
        let headers = response.headers();
        let policy = headers["content-security-policy"].to_str().unwrap();
        assert!(policy.contains("frame-ancestors 'none'"), "{path}: {policy}");
        assert!(headers.contains_key("cache-control"), "{path}");
    }
}

/// A client that asks for a large file and never reads it.
#[tokio::test]
async fn a_reader_that_is_stuck_is_let_go() {
    let timeouts =
        ServerTimeouts { write: Duration::from_millis(300), ..ServerTimeouts::default() };
    let service = Service::start_with(HttpLimits::default(), timeouts).await;
    let large = vec![7; 32 << 20];
    let id = service.finished(&[("hull.glb", "model/gltf-binary", large.clone())]).await;
    let path = format!("/v1/reconstructions/{id}/artifacts/hull.glb");
    let socket = TcpSocket::new_v4().unwrap();
    socket.set_recv_buffer_size(4096).unwrap();
    let address = service.url["http://".len()..].parse().unwrap();
    let mut stuck = socket.connect(address).await.unwrap();
    let request = format!("GET {path} HTTP/1.1\r\nHost: a\r\n\r\n");
    stuck.write_all(request.as_bytes()).await.unwrap();
    tokio::time::sleep(Duration::from_secs(2)).await;
    let mut taken = Vec::new();
    let reading = tokio::time::timeout(Duration::from_secs(20), stuck.read_to_end(&mut taken));
    let _ = reading.await.expect("the connection is closed");
    assert!(taken.len() < large.len(), "all was sent");
    // One that reads slowly but reads gets it all.
    let whole = service.get(&path).send().await.unwrap().bytes().await.unwrap();
    assert_eq!(whole.len(), large.len());
}

#[tokio::test]
async fn what_could_not_run_is_refused_at_once() {
    let draft = DraftLimits { max_working_bytes: 100_000, ..DraftLimits::default() };
    let service = with_limits(HttpLimits { draft, ..HttpLimits::default() }).await;
    let body = problem(service.upload(views(&["0", "45", "90"])).await, 422, "job-too-large").await;
    assert!(body["detail"].as_str().unwrap().contains("100000"), "{body}");
    service.assert_nothing_stored().await;
}
