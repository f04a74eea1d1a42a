//! Whether the service lives and can take work.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::IntoResponse;
use bytes::Bytes;
use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;
use uuid::Uuid;

use super::Api;
use super::openapi::problem_responses;
use super::problem::{Problem, UNAVAILABLE};
use super::telemetry::TEXT_FORMAT;
use jobs::bytes::Key;
use jobs::{JobId, Queue};

const PROBE_TIMEOUT: Duration = Duration::from_secs(5);

problem_responses! { ReadyProblems: UNAVAILABLE }

/// How the service is.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Health {
    #[schema(example = "ok")]
    pub status: &'static str,
    /// Version of the service.
    pub version: &'static str,
}

const OK: Health = Health { status: "ok", version: env!("CARGO_PKG_VERSION") };

/// Whether the process answers.
#[utoipa::path(
    get,
    path = "/health/live",
    operation_id = "live",
    tag = "service",
    responses((status = 200, description = "It does", body = Health))
)]
pub(super) async fn live() -> Json<Health> {
    Json(OK)
}

/// Whether the service can take work.
///
/// Asks the job store to read and write, and writes a file to the byte store.
#[utoipa::path(
    get,
    path = "/health/ready",
    operation_id = "ready",
    tag = "service",
    responses((status = 200, description = "It can", body = Health), ReadyProblems)
)]
pub(super) async fn ready(State(api): State<Arc<Api>>) -> Result<Json<Health>, Problem> {
    if api.state.draining.is_cancelled() {
        return Err(Problem::stopping());
    }
    let probe = async {
        api.state.store.ping().await?;
        // Belongs to no job, and is written again each time.
        let key = Key::Input { job: JobId(Uuid::nil()), name: "probe" };
        api.state.bytes.put(&key, Bytes::from_static(b"ok")).await?;
        Ok::<_, Problem>(())
    };
    match tokio::time::timeout(PROBE_TIMEOUT, probe).await {
        Ok(result) => result.map(|()| Json(OK)),
        Err(elapsed) => Err(Problem::unavailable("job store or byte store", &elapsed)),
    }
}

/// Counters and gauges for Prometheus.
#[utoipa::path(
    get,
    path = "/metrics",
    operation_id = "prometheus",
    tag = "service",
    responses((status = 200, description = "Prometheus text format", body = String,
               content_type = "text/plain"), ReadyProblems)
)]
pub(super) async fn metrics(State(api): State<Arc<Api>>) -> Result<impl IntoResponse, Problem> {
    let counts = api.state.store.counts().await?;
    for (state, count) in [
        ("queued", counts.queued),
        ("running", counts.running),
        ("succeeded", counts.succeeded),
        ("failed", counts.failed),
        ("cancelled", counts.cancelled),
    ] {
        metrics::gauge!("turnaround_jobs", "state" => state).set(count as f64);
    }
    queues(&api.state.store.queues().await?);
    metrics::gauge!("turnaround_stored_bytes")
        .set(api.state.store.stored_bytes(None).await? as f64);
    if let Some(free) = api.state.bytes.free_bytes()? {
        metrics::gauge!("turnaround_disk_free_bytes").set(free as f64);
    }
    if let Some(budget) = api.limits.disk_budget_bytes {
        metrics::gauge!("turnaround_disk_budget_bytes").set(budget as f64);
    }
    api.state.metrics.run_upkeep();
    let content_type = [(header::CONTENT_TYPE, TEXT_FORMAT)];
    Ok((content_type, api.state.metrics.render()))
}

/// Tenants whose queue has become empty are told as such once they were not.
fn queues(queues: &[Queue]) {
    static SEEN: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    let mut seen = SEEN.lock().unwrap_or_else(PoisonError::into_inner);
    seen.extend(queues.iter().map(|queue| queue.tenant.as_str().to_owned()));
    for tenant in &*seen {
        let queue = queues.iter().find(|queue| queue.tenant.as_str() == tenant);
        let (jobs, age) = queue.map_or((0, Duration::ZERO), |queue| {
            let age = Timestamp::now().duration_since(queue.oldest);
            (queue.jobs, age.try_into().unwrap_or_default())
        });
        let tenant = tenant.clone();
        metrics::gauge!("turnaround_queued_jobs", "tenant" => tenant.clone()).set(jobs as f64);
        metrics::gauge!("turnaround_queue_age_seconds", "tenant" => tenant).set(age.as_secs_f64());
    }
}
