//! One attempt at a claimed job, from its claim to its ending.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use serde_json::Value;
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;

use super::signal::{Signal, StopReason};
use super::uploads::Uploads;
use super::work::ProgressSender;
use super::{Attempt, Shared, WorkError};
use jobs::{Claim, Failure, JobId, JobState, JobStore, StoreError};

/// Writes of an ending are tried this often before the lease is left to end.
const ENDING_TRIES: u32 = 4;

/// Runs a claimed job to its end on this thread.
pub(super) fn run(shared: &Shared, claim: &Claim, claimed: Instant) {
    let (id, attempt) = (claim.job.id, claim.attempt);
    let signal = shared.heart.keep(id, attempt, claimed);
    if claim.job.cancel_requested {
        signal.stop(StopReason::Cancel);
    }
    tracing::info!(job = %id, attempt, kind = claim.job.kind, "started");
    let uploads = Uploads::new(id, attempt, shared.bytes.clone(), shared.runtime.clone());
    let result = work(shared, claim, &signal, &uploads);
    // Waited for in any case: nothing may be written after a clean-up.
    let stored = shared.runtime.block_on(uploads.finish());
    let ending = match (result, stored) {
        (Ok(summary), Ok(artifacts)) => Ending::Succeeded(artifacts, summary),
        (Ok(_), Err(error)) => Ending::Broken(error.to_string()),
        (Err(WorkError::Input(failure)), _) => Ending::Failed(failure),
        (Err(WorkError::Broken(detail)), _) => Ending::Broken(detail),
        (Err(WorkError::Cancelled), _) => Ending::Stopped(signal.reason()),
    };
    end(shared, id, attempt, ending);
    shared.heart.forget(id, attempt);
}

/// What an attempt came to.
#[derive(Clone)]
enum Ending {
    Succeeded(Vec<jobs::ArtifactEntry>, Option<Value>),
    Failed(Failure),
    Broken(String),
    Stopped(Option<StopReason>),
}

/// Runs the work itself, with panics caught and progress written beside it.
fn work(
    shared: &Shared,
    claim: &Claim,
    signal: &Arc<Signal>,
    uploads: &Uploads,
) -> Result<Option<Value>, WorkError> {
    let Some(work) = shared.works.iter().find(|work| work.kind() == claim.job.kind) else {
        let detail = format!("this version has no work for jobs of kind {}", claim.job.kind);
        return Err(WorkError::Broken(detail));
    };
    let (progress, latest) = ProgressSender::new();
    let done = CancellationToken::new();
    let writer = shared.runtime.spawn(write_progress(
        Arc::clone(&shared.store),
        (claim.job.id, claim.attempt),
        latest,
        shared.config.progress_interval,
        done.clone(),
    ));
    let attempt = Attempt {
        job: &claim.job,
        threads: shared.config.threads_per_job,
        bytes: &shared.bytes,
        runtime: &shared.runtime,
        signal,
        uploads,
        progress,
        summary: OnceLock::new(),
    };
    // What the work shares with the pool is behind locks that heal.
    let result = catch_unwind(AssertUnwindSafe(|| work.run(&attempt)));
    let summary = attempt.into_summary();
    done.cancel();
    if let Err(error) = shared.runtime.block_on(writer) {
        tracing::error!(job = %claim.job.id, %error, "progress writer broke");
    }
    let result =
        result.unwrap_or_else(|panic| Err(WorkError::Broken(panic_message(panic.as_ref()))));
    result.map(|()| summary)
}

/// Writes the latest progress, at most once an `interval`, and once more at the
/// end of the work.
async fn write_progress(
    store: Arc<dyn JobStore>,
    (id, attempt): (JobId, u32),
    mut latest: watch::Receiver<Option<Value>>,
    interval: Duration,
    done: CancellationToken,
) {
    while latest.changed().await.is_ok() {
        let progress = latest.borrow_and_update().clone();
        let Some(progress) = progress else { continue };
        match store.progress(id, attempt, progress).await {
            Ok(()) => {}
            Err(StoreError::LeaseLost { .. } | StoreError::NotFound(_)) => return,
            Err(error) => tracing::warn!(job = %id, attempt, %error, "could not write progress"),
        }
        // The end of the work does not wait for the interval to be over.
        let _ = tokio::time::timeout(interval, done.cancelled()).await;
    }
}

fn panic_message(panic: &(dyn Any + Send)) -> String {
    let text = panic
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    format!("the work panicked: {}", text.unwrap_or("no message"))
}

/// Writes the ending and deletes what the attempt stored unless it is published.
fn end(shared: &Shared, id: JobId, attempt: u32, ending: Ending) {
    let written = shared.runtime.block_on(write_ending(shared, id, attempt, ending));
    match written {
        Ok(state) => {
            tracing::info!(job = %id, attempt, ?state, "ended");
            if state == JobState::Succeeded {
                return;
            }
        }
        Err(StoreError::LeaseLost { .. } | StoreError::NotFound(_)) => {
            tracing::warn!(job = %id, attempt, "lost its lease, result thrown away");
        }
        // It may have been written all the same: the bytes stay until the
        // collector knows.
        Err(error) => {
            tracing::error!(job = %id, attempt, %error, "could not write how it ended");
            return;
        }
    }
    if let Err(error) = shared.runtime.block_on(shared.bytes.delete_attempt(id, attempt)) {
        tracing::warn!(job = %id, attempt, %error, "could not delete the attempt's bytes");
    }
}

async fn write_ending(
    shared: &Shared,
    id: JobId,
    attempt: u32,
    ending: Ending,
) -> Result<JobState, StoreError> {
    let mut pause = Duration::from_millis(100);
    for _ in 1..ENDING_TRIES {
        match try_ending(shared, id, attempt, ending.clone()).await {
            Err(StoreError::Backend(error)) => {
                tracing::warn!(job = %id, attempt, %error, "trying again to write how it ended");
                tokio::time::sleep(pause).await;
                pause *= 4;
            }
            written => return written,
        }
    }
    try_ending(shared, id, attempt, ending).await
}

async fn try_ending(
    shared: &Shared,
    id: JobId,
    attempt: u32,
    ending: Ending,
) -> Result<JobState, StoreError> {
    let store = &shared.store;
    match ending {
        Ending::Succeeded(artifacts, summary) => {
            store.succeed(id, attempt, artifacts, summary).await
        }
        Ending::Failed(failure) => store.fail(id, attempt, failure).await,
        Ending::Broken(detail) => {
            let failure = Failure { code: "internal".to_owned(), detail };
            store.retry(id, attempt, failure, shared.config.retry_pause).await
        }
        Ending::Stopped(Some(StopReason::Cancel)) => store.cancelled(id, attempt).await,
        Ending::Stopped(Some(StopReason::LeaseLost)) => Err(StoreError::LeaseLost { id, attempt }),
        Ending::Stopped(Some(StopReason::Shutdown)) => store.release(id, attempt).await,
        Ending::Stopped(None) => {
            let detail = "the work stopped without being asked to".to_owned();
            let failure = Failure { code: "internal".to_owned(), detail };
            store.retry(id, attempt, failure, shared.config.retry_pause).await
        }
    }
}
