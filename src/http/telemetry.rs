//! Counts and times of requests.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError, RwLock};
use std::time::Instant;

use axum::Router;
use axum::extract::{MatchedPath, Request};
use axum::http::{Method, header};
use axum::response::Response;
use axum::routing::get;
use metrics::{Counter, Histogram};
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

/// The series of requests that were recorded so far, by route: to look one up in
/// the recorder takes longer than a short answer.
#[derive(Default)]
pub(super) struct Series(RwLock<HashMap<String, Vec<Recorded>>>);

struct Recorded {
    method: &'static str,
    status: u16,
    requests: Counter,
    seconds: Histogram,
}

/// A request that is being answered.
pub(super) struct Timing<'s> {
    series: &'s Series,
    begun: Instant,
    method: &'static str,
    route: Option<MatchedPath>,
}

impl Series {
    /// Begins to time a request.
    pub(super) fn begin(&self, request: &Request) -> Timing<'_> {
        Timing {
            series: self,
            begun: Instant::now(),
            method: method_label(request.method()),
            route: request.extensions().get().cloned(),
        }
    }

    /// Keeps a series for the requests that come, unless another request was as fast.
    fn keep(&self, route: &str, recorded: Recorded) {
        let mut known = self.0.write().unwrap_or_else(PoisonError::into_inner);
        let all = known.entry(route.to_owned()).or_default();
        if !all.iter().any(|it| it.is_of(recorded.method, recorded.status)) {
            all.push(recorded);
        }
    }
}

impl Timing<'_> {
    /// Counts and times the request. Routes are labels, not paths: ids would make
    /// a series each.
    pub(super) fn end(self, response: &Response) {
        let (seconds, status) = (self.begun.elapsed().as_secs_f64(), response.status().as_u16());
        let route = self.route.as_ref().map_or("unmatched", MatchedPath::as_str);
        let known = self.series.0.read().unwrap_or_else(PoisonError::into_inner);
        let mut all = known.get(route).into_iter().flatten();
        if let Some(found) = all.find(|it| it.is_of(self.method, status)) {
            found.record(seconds);
            return;
        }
        drop(known);
        let recorded = Recorded::new(self.method, route, status);
        recorded.record(seconds);
        self.series.keep(route, recorded);
    }
}

impl Recorded {
    fn new(method: &'static str, route: &str, status: u16) -> Self {
        let labels = [("method", method.to_owned()), ("route", route.to_owned())];
        let seconds = metrics::histogram!("turnaround_http_request_duration_seconds", &labels);
        let [method_label, route_label] = labels;
        let labels = [method_label, route_label, ("status", status.to_string())];
        let requests = metrics::counter!("turnaround_http_requests_total", &labels);
        Self { method, status, requests, seconds }
    }

    fn is_of(&self, method: &str, status: u16) -> bool {
        self.method == method && self.status == status
    }

    fn record(&self, seconds: f64) {
        self.requests.increment(1);
        self.seconds.record(seconds);
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_series_is_kept_once() {
        let series = Series::default();
        // Two requests that both found none of theirs.
        for (method, status) in [("GET", 200), ("GET", 200), ("GET", 404), ("HEAD", 200)] {
            series.keep("/v1/sheets", Recorded::new(method, "/v1/sheets", status));
        }
        let known = series.0.read().unwrap();
        let kept: Vec<_> = known["/v1/sheets"].iter().map(|it| (it.method, it.status)).collect();
        assert_eq!(kept, [("GET", 200), ("GET", 404), ("HEAD", 200)]);
    }
}
