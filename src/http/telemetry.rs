//! Counts and times of requests.

use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use axum::Router;
use axum::extract::{MatchedPath, Request};
use axum::http::{Method, header};
use axum::middleware::Next;
use axum::response::Response;
use axum::routing::get;
use metrics_exporter_prometheus::{BuildError, PrometheusBuilder, PrometheusHandle};

/// The media type of Prometheus' text format.
pub(super) const TEXT_FORMAT: &str = "text/plain; version=0.0.4; charset=utf-8";

const BUCKETS_S: [f64; 12] =
    [0.001, 0.0025, 0.005, 0.01, 0.02, 0.05, 0.1, 0.25, 1.0, 5.0, 30.0, 120.0];

/// The process's metrics; the first call begins to record them.
///
/// # Errors
/// If the process records its metrics elsewhere already.
pub fn prometheus() -> Result<PrometheusHandle, BuildError> {
    static HANDLE: Mutex<Option<PrometheusHandle>> = Mutex::new(None);
    let mut handle = HANDLE.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(handle) = &*handle {
        return Ok(handle.clone());
    }
    let recorder = PrometheusBuilder::new().set_buckets(&BUCKETS_S)?.build_recorder();
    let built = recorder.handle();
    metrics::set_global_recorder(recorder)?;
    describe();
    Ok(handle.insert(built).clone())
}

fn describe() {
    crate::worker::metrics::describe();
    use metrics::{Unit, describe_counter, describe_gauge, describe_histogram};
    describe_counter!("turnaround_http_requests_total", "Requests answered");
    describe_histogram!(
        "turnaround_http_request_duration_seconds",
        Unit::Seconds,
        "From a request's header to its answer's header"
    );
    describe_gauge!("turnaround_jobs", "Stored jobs by state");
    describe_gauge!("turnaround_queued_jobs", "Jobs that wait for a worker, by tenant");
    describe_gauge!(
        "turnaround_queue_age_seconds",
        Unit::Seconds,
        "How long the oldest of them has waited, by tenant"
    );
    describe_gauge!("turnaround_stored_bytes", Unit::Bytes, "Of all jobs and pages");
    describe_gauge!("turnaround_disk_free_bytes", Unit::Bytes, "Left on the data folder's disk");
    describe_gauge!("turnaround_disk_budget_bytes", Unit::Bytes, "What may be stored");
}

/// What a node of workers alone answers: `/metrics` and `/health/live`.
pub fn of_worker(metrics: PrometheusHandle) -> Router {
    let told = async move || {
        metrics.run_upkeep();
        ([(header::CONTENT_TYPE, TEXT_FORMAT)], metrics.render())
    };
    Router::new().route("/metrics", get(told)).route("/health/live", get(super::health::live))
}

/// Counts and times a request. Routes are labels, not paths: ids would make a
/// series each.
pub(super) async fn measure(request: Request, next: Next) -> Response {
    let begun = Instant::now();
    let method = method_label(request.method());
    let route = match request.extensions().get::<MatchedPath>() {
        Some(route) => route.as_str().to_owned(),
        None => "unmatched".to_owned(),
    };
    let response = next.run(request).await;
    let status = response.status().as_u16().to_string();
    let labels = [("method", method.to_owned()), ("route", route.clone()), ("status", status)];
    metrics::counter!("turnaround_http_requests_total", &labels).increment(1);
    let labels = [("method", method.to_owned()), ("route", route)];
    metrics::histogram!("turnaround_http_request_duration_seconds", &labels)
        .record(begun.elapsed().as_secs_f64());
    response
}

fn method_label(method: &Method) -> &'static str {
    match *method {
        Method::GET => "GET",
        Method::HEAD => "HEAD",
        Method::POST => "POST",
        Method::PUT => "PUT",
        Method::PATCH => "PATCH",
        Method::DELETE => "DELETE",
        Method::OPTIONS => "OPTIONS",
        _ => "other",
    }
}
