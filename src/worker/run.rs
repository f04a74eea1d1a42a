//! One attempt at a claimed job, from its claim to its ending.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};
use std::{io, thread};

use serde_json::Value;
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;

use super::attempt::{PoolAttempt, ProgressSender};
use super::metrics::Stages;
use super::signal::{Signal, StopReason};
use super::uploads::Uploads;
use super::{Shared, Task, WorkError};
use crate::failure_code::FailureCode;
use jobs::bytes::ByteStore;
use jobs::{Claim, Event, Failure, JobId, JobState, JobStore, StoreError};

/// For how long an ending is tried to be written before the lease is left to
/// end: longer than a database needs to start again.
const ENDING_PATIENCE: Duration = Duration::from_secs(300);
/// How often on a full disk.
const FULL_TRIES: u32 = 4;
/// The longest pause between two tries.
const ENDING_PAUSE: Duration = Duration::from_secs(2);

/// How long work has to notice that it should stop. A cancelled job has ended
/// within a second, whatever it was doing.
const STOP_PATIENCE: Duration = Duration::from_millis(400);
/// How often it is looked whether work should stop.
const TICK: Duration = Duration::from_millis(20);

/// What work came to: its summary, if it gave one.
pub(super) type Outcome = Result<Option<Value>, WorkError>;

/// Runs a claimed job to its end. The work has a thread of its own, so that work
/// that does not stop when it should can be left behind.
pub(super) fn run(shared: &Arc<Shared>, claim: Claim, claimed: Instant) {
    let (id, attempt) = (claim.job.id, claim.attempt);
    let signal = shared.heart.keep(id, attempt, claimed);
    if claim.job.cancel_requested {
        signal.stop(StopReason::Cancel);
    }
    let kind = claim.job.kind.clone();
    let request_id = claim.job.request_id.as_deref().unwrap_or_default();
    let span = tracing::info_span!("job", job = %id, attempt, kind, request_id);
    let _entered = span.enter();
    tracing::info!(job = %id, attempt, kind, request_id, "started");
    if attempt == 1 {
        let waited_ms = claim
            .job
            .started_at
            .map(|start| start.as_millisecond())
            .map(|start_ms| start_ms - claim.job.created_at.as_millisecond());
        metrics::histogram!("turnaround_queue_wait_seconds", "kind" => kind.clone())
            .record(waited_ms.unwrap_or(0).max(0) as f64 / 1000.0);
    }
    let bytes = shared.bytes.of(&claim.job.home());
    let uploads = Arc::new(Uploads::new(id, attempt, bytes.clone(), shared.runtime.clone()));
    let started = start(shared, claim, &signal, &uploads);
    let (result, left_behind) = match started {
        Err(error) => (Err(WorkError::Troubled(error.to_string())), None),
        Ok(outcome) => match wait(&outcome, &signal) {
            Some(result) => (result, None),
            None => {
                tracing::warn!(job = %id, attempt, "does not stop; its work is left behind");
                shared.runtime.block_on(uploads.close());
                (Err(WorkError::Cancelled), Some(outcome))
            }
        },
    };
    // Waited for in any case: nothing may be written after a clean-up.
    let stored = shared.runtime.block_on(uploads.finish());
    let ending = match (result, stored) {
        (Ok(summary), Ok(artifacts)) => Ending::Succeeded(artifacts, summary),
        (Ok(_), Err(error)) => Ending::Troubled(error.to_string()),
        (Err(WorkError::Input(failure)), _) => Ending::Failed(failure),
        (Err(WorkError::Broken(detail)), _) => Ending::Broken(detail),
        (Err(WorkError::Crashed(detail)), _) => Ending::Crashed(detail),
        (Err(WorkError::Troubled(cause)), _) => Ending::Troubled(cause),
        (Err(WorkError::Cancelled), _) => Ending::Stopped(signal.reason()),
    };
    let labels = [("kind", kind.clone()), ("outcome", ending.name().to_owned())];
    metrics::counter!("turnaround_attempts_total", &labels).increment(1);
    metrics::histogram!("turnaround_attempt_duration_seconds", "kind" => kind)
        .record(claimed.elapsed().as_secs_f64());
    end(shared, &bytes, (id, attempt), ending);
    shared.heart.forget(id, attempt);
    if let Some(outcome) = left_behind {
        shared.leave_behind(outcome);
    }
}

/// Begins the work on a thread of its own.
fn start(
    shared: &Arc<Shared>,
    claim: Claim,
    signal: &Arc<Signal>,
    uploads: &Arc<Uploads>,
) -> io::Result<Receiver<Outcome>> {
    let (sender, outcome) = sync_channel(1);
    let (shared, signal) = (Arc::clone(shared), Arc::clone(signal));
    let (uploads, span) = (Arc::clone(uploads), tracing::Span::current());
    thread::Builder::new().name(format!("job-{}", claim.job.id)).spawn(move || {
        let _entered = span.enter();
        // Nobody listens any more if the work was left behind.
        let _ = sender.send(work(&shared, claim, &signal, &uploads));
    })?;
    Ok(outcome)
}

/// What the work came to; `None` if it should stop and does not.
fn wait(outcome: &Receiver<Outcome>, signal: &Signal) -> Option<Outcome> {
    let mut told = None;
    loop {
        match outcome.recv_timeout(TICK) {
            Ok(result) => return Some(result),
            Err(RecvTimeoutError::Disconnected) => {
                return Some(Err(WorkError::Broken("the work's thread ended".to_owned())));
            }
            Err(RecvTimeoutError::Timeout) if signal.reason().is_none() => {}
            Err(RecvTimeoutError::Timeout) => {
                if told.get_or_insert_with(Instant::now).elapsed() >= STOP_PATIENCE {
                    return None;
                }
            }
        }
    }
}

/// What an attempt came to.
#[derive(Clone)]
enum Ending {
    Succeeded(Vec<jobs::ArtifactEntry>, Option<Value>),
    Failed(Failure),
    Broken(String),
    Crashed(String),
    /// With the cause, for the log.
    Troubled(String),
    Stopped(Option<StopReason>),
}

impl Ending {
    /// As a label.
    fn name(&self) -> &'static str {
        match self {
            Self::Succeeded(..) => "succeeded",
            Self::Failed(_) => "failed",
            Self::Broken(_) => "broken",
            Self::Crashed(_) => "crashed",
            Self::Troubled(_) => "troubled",
            Self::Stopped(Some(StopReason::TimeLimit)) => "too_long",
            Self::Stopped(Some(StopReason::Cancel)) => "cancelled",
            Self::Stopped(Some(StopReason::LeaseLost)) => "lease_lost",
            Self::Stopped(Some(StopReason::Shutdown) | None) => "stopped",
        }
    }
}

/// Runs the work itself, with panics caught and progress written beside it.
fn work(shared: &Shared, claim: Claim, signal: &Arc<Signal>, uploads: &Uploads) -> Outcome {
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
    let bytes = shared.bytes.of(&claim.job.home());
    let attempt = PoolAttempt {
        stages: Stages::of(&claim.job.kind),
        task: Task::new(claim, shared.config.threads_per_job),
        bytes: &bytes,
        runtime: &shared.runtime,
        signal,
        uploads,
        progress,
        summary: OnceLock::new(),
    };
    // What the work shares with the pool is behind locks that heal.
    let result = catch_unwind(AssertUnwindSafe(|| work.run(&attempt)));
    // The writer ends with it.
    let PoolAttempt { task, summary, progress, stages, .. } = attempt;
    drop((progress, stages));
    done.cancel();
    if let Err(error) = shared.runtime.block_on(writer) {
        tracing::error!(job = %task.job, %error, "progress writer broke");
    }
    let result =
        result.unwrap_or_else(|panic| Err(WorkError::Broken(panic_message(panic.as_ref()))));
    result.map(|()| summary.into_inner())
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

pub(super) fn panic_message(panic: &(dyn Any + Send)) -> String {
    let text = panic
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    format!("the work panicked: {}", text.unwrap_or("no message"))
}

/// Writes the ending and deletes what the attempt stored unless it is published.
fn end(shared: &Shared, bytes: &ByteStore, (id, attempt): (JobId, u32), ending: Ending) {
    let publishes = matches!(ending, Ending::Succeeded(..));
    let crashed = matches!(ending, Ending::Crashed(_));
    if !publishes && !crashed {
        // First, for on a full disk it makes room for the ending itself.
        delete_bytes(shared, bytes, id, attempt);
    }
    let begun = Instant::now();
    let mut written = shared.runtime.block_on(write_ending(shared, id, attempt, ending));
    super::metrics::database("end", begun);
    if publishes && let Err(StoreError::Full) = written {
        delete_bytes(shared, bytes, id, attempt);
        let ending = Ending::Troubled(StoreError::Full.to_string());
        written = shared.runtime.block_on(write_ending(shared, id, attempt, ending));
    }
    match written {
        Ok(state) => {
            tracing::info!(job = %id, attempt, ?state, "ended");
            // What the last of its crashes left behind may tell why.
            if state == JobState::Succeeded || (crashed && state == JobState::Failed) {
                return;
            }
        }
        Err(StoreError::LeaseLost { .. } | StoreError::NotFound(_)) => {
            // It was written, and only the answer lost, or nobody knows.
            if publishes && !shared.runtime.block_on(is_surely_unpublished(shared, id, attempt)) {
                return;
            }
            metrics::counter!("turnaround_leases_lost_total").increment(1);
            tracing::warn!(job = %id, attempt, "lost its lease, result thrown away");
        }
        // It may have been written all the same: the bytes stay until the
        // collector knows.
        Err(error) => {
            tracing::error!(job = %id, attempt, %error, "could not write how it ended");
            return;
        }
    }
    if publishes || crashed {
        delete_bytes(shared, bytes, id, attempt);
    }
}

fn delete_bytes(shared: &Shared, bytes: &ByteStore, id: JobId, attempt: u32) {
    if let Err(error) = shared.runtime.block_on(bytes.delete_attempt(id, attempt)) {
        tracing::warn!(job = %id, attempt, %error, "could not delete the attempt's bytes");
    }
}

/// Whether the bytes of an attempt that lost its lease are surely no result.
async fn is_surely_unpublished(shared: &Shared, id: JobId, attempt: u32) -> bool {
    match shared.store.get(id).await {
        Ok(job) => (job.state, job.attempt) != (JobState::Succeeded, attempt),
        Err(error) => matches!(error, StoreError::NotFound(_)),
    }
}

async fn write_ending(
    shared: &Shared,
    id: JobId,
    attempt: u32,
    ending: Ending,
) -> Result<JobState, StoreError> {
    let (begun, mut pause) = (Instant::now(), Duration::from_millis(100));
    let mut full = 0;
    loop {
        let error = match try_ending(shared, id, attempt, ending.clone()).await {
            Err(error @ (StoreError::Backend(_) | StoreError::Full)) => error,
            written => return written,
        };
        // A full disk is left to the ending that makes room.
        full += u32::from(matches!(error, StoreError::Full));
        if full == FULL_TRIES || begun.elapsed() + pause > ENDING_PATIENCE {
            return Err(error);
        }
        tracing::warn!(job = %id, attempt, %error, "trying again to write how it ended");
        tokio::time::sleep(pause).await;
        pause = (pause * 2).min(ENDING_PAUSE);
    }
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
        Ending::Crashed(detail) => {
            let failure = crash(store.as_ref(), id, &detail).await?;
            store.retry(id, attempt, failure, shared.config.retry_pause).await
        }
        Ending::Troubled(cause) => {
            tracing::warn!(job = %id, attempt, cause, "the machine is in trouble; the job waits");
            let code = FailureCode::EnvironmentTrouble;
            let detail = format!("{} ({})", code.meaning(), code.remedy());
            store.postpone(id, attempt, Failure { code: code.name().to_owned(), detail }).await
        }
        Ending::Stopped(Some(StopReason::TimeLimit)) => {
            let code = FailureCode::TimeLimit;
            let seconds = shared.config.max_job_time.as_secs();
            let detail = format!("stopped after {seconds} s; {}", code.remedy());
            store.fail(id, attempt, Failure { code: code.name().to_owned(), detail }).await
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

/// What is told of a job that crashed once more.
async fn crash(store: &dyn JobStore, id: JobId, detail: &str) -> Result<Failure, StoreError> {
    let is_crash = |event: &&Event| event.data["reason"] == jobs::CRASHED;
    let crashes = store.events(id, 0).await?.iter().filter(is_crash).count() + 1;
    let times = if crashes == 1 { "once".to_owned() } else { format!("{crashes} times") };
    let remedy = FailureCode::Crashed.remedy();
    let detail = format!("crashed {times}; the last time its process {detail}; {remedy}");
    Ok(Failure { code: FailureCode::Crashed.name().to_owned(), detail })
}
