//! What workers count and time.

use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use metrics::{Unit, describe_counter, describe_histogram};
use serde_json::Value;
use tracing::Span;

/// Says what the metrics mean.
pub(crate) fn describe() {
    let seconds = Unit::Seconds;
    describe_counter!("turnaround_attempts_total", "Ended attempts at jobs by kind and outcome");
    describe_histogram!(
        "turnaround_attempt_duration_seconds",
        seconds,
        "From a job's claim to its end, by kind"
    );
    describe_histogram!(
        "turnaround_stage_duration_seconds",
        seconds,
        "Of each stage of the work, by kind"
    );
    describe_histogram!(
        "turnaround_queue_wait_seconds",
        seconds,
        "From a job's arrival to its first claim, by kind"
    );
    describe_counter!("turnaround_leases_lost_total", "Attempts whose lease another one took");
    // There from the start: the increase of what appears with its first one is 0.
    metrics::counter!("turnaround_leases_lost_total").absolute(0);
    describe_histogram!(
        "turnaround_database_duration_seconds",
        seconds,
        "Of the workers' claims and endings"
    );
    describe_histogram!(
        "turnaround_store_duration_seconds",
        seconds,
        "Of inputs read and artifacts stored by workers"
    );
    describe_counter!(
        "turnaround_store_bytes_total",
        Unit::Bytes,
        "Of inputs read and artifacts stored by workers"
    );
}

/// Times a statement of a worker.
pub(super) fn database(operation: &'static str, begun: Instant) {
    metrics::histogram!("turnaround_database_duration_seconds", "operation" => operation)
        .record(begun.elapsed().as_secs_f64());
}

/// Times bytes read or stored.
pub(super) fn store(operation: &'static str, begun: Instant, bytes: u64) {
    metrics::histogram!("turnaround_store_duration_seconds", "operation" => operation)
        .record(begun.elapsed().as_secs_f64());
    metrics::counter!("turnaround_store_bytes_total", "operation" => operation).increment(bytes);
}

/// The stage that work is at, and since when.
pub(super) struct Stages {
    kind: String,
    now: Mutex<Option<(String, Instant, Span)>>,
}

impl Stages {
    pub(super) fn of(kind: &str) -> Self {
        Self { kind: kind.to_owned(), now: Mutex::default() }
    }

    /// Takes a report: the stage before has ended when another one reports.
    pub(super) fn see(&self, progress: &Value) {
        let Some(stage) = progress["stage"].as_str() else { return };
        let mut now = self.now.lock().unwrap_or_else(PoisonError::into_inner);
        if now.as_ref().is_some_and(|(current, ..)| current == stage) {
            return;
        }
        let span = tracing::info_span!("stage", stage);
        let before = now.replace((stage.to_owned(), Instant::now(), span));
        self.record(before);
    }

    fn record(&self, ended: Option<(String, Instant, Span)>) {
        let Some((stage, begun, _)) = ended else { return };
        let labels = [("kind", self.kind.clone()), ("stage", stage)];
        metrics::histogram!("turnaround_stage_duration_seconds", &labels)
            .record(begun.elapsed().as_secs_f64());
    }
}

impl Drop for Stages {
    fn drop(&mut self) {
        let last = self.now.get_mut().unwrap_or_else(PoisonError::into_inner).take();
        self.record(last);
    }
}
