//! Traces that a service sends to a collector.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use axum::Router;
use axum::body::Bytes;
use axum::routing::post;
use tokio::net::TcpListener;

use crate::faults::process::{PATIENCE, Process, command, sheet};

/// Bodies as they came: protobuf, in which texts are as they are.
type Bodies = Arc<Mutex<Vec<u8>>>;

async fn collector() -> (String, Bodies) {
    let bodies = Bodies::default();
    let taken = Arc::clone(&bodies);
    let take = post(async move |body: Bytes| taken.lock().unwrap().extend(body));
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    let router = Router::new().route("/v1/traces", take);
    tokio::spawn(async move { axum::serve(listener, router).await.unwrap() });
    (url, bodies)
}

fn count(bodies: &Bodies, text: &str) -> usize {
    let bodies = bodies.lock().unwrap();
    bodies.windows(text.len()).filter(|found| *found == text.as_bytes()).count()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_request_is_followed_into_its_job() {
    let (url, bodies) = collector().await;
    let folder = tempfile::tempdir().unwrap();
    let mut command = command(folder.path(), &[]);
    command.env("OTEL_EXPORTER_OTLP_ENDPOINT", url).env("OTEL_BSP_SCHEDULE_DELAY", "200");
    let service = Process::spawn(command);
    let request = service.post("/v1/reconstructions").header("x-request-id", "shot-12-take-3");
    let job: serde_json::Value =
        request.multipart(sheet()).send().await.unwrap().json().await.unwrap();
    let path = job["links"]["self"].as_str().unwrap();
    service.until(path, |_, job| job["state"] == "succeeded").await;
    let begun = Instant::now();
    // In the request's span and in the job's; the stages of the work are spans too.
    while count(&bodies, "shot-12-take-3") < 2 || count(&bodies, "silhouettes") == 0 {
        assert!(begun.elapsed() < PATIENCE, "{} bytes came", bodies.lock().unwrap().len());
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    assert!(count(&bodies, job["id"].as_str().unwrap()) > 0);
    assert!(count(&bodies, "turnaround") > 0);
}
