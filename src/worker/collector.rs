//! Housekeeping beside the workers: jobs of silent workers are put back, bytes
//! that belong to nothing are deleted.

use std::sync::Arc;
use std::time::Duration;

use jiff::{SignedDuration, Timestamp};
use tokio::time::{Instant, MissedTickBehavior, interval};

use super::WorkerConfig;
use jobs::bytes::{ByteError, ByteStore, BytesOf};
use jobs::{CRASHED, Job, JobId, JobState, JobStore, StoreError};

/// Why bytes could not be collected.
#[derive(Debug, thiserror::Error)]
pub enum CollectError {
    /// The job store failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The byte store failed.
    #[error(transparent)]
    Bytes(#[from] ByteError),
}

/// What was deleted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Collected {
    /// Jobs whose bytes belonged to no stored job.
    pub jobs: u64,
    /// Attempts that lost their lease or broke.
    pub attempts: u64,
    /// Jobs whose bytes are kept, though the store never heard of them.
    pub unknown: u64,
}

/// Reaps and collects for ever, at once first.
pub(super) async fn keep(config: WorkerConfig, store: Arc<dyn JobStore>, bytes: ByteStore) {
    let mut ticks = interval(config.reap_interval.max(Duration::from_millis(1)));
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut collect_at = Instant::now();
    loop {
        ticks.tick().await;
        match store.reap().await {
            Ok(0) => {}
            Ok(jobs) => tracing::warn!(jobs, "leases had ended"),
            Err(error) => tracing::error!(%error, "could not look for ended leases"),
        }
        if let Err(error) = retain(store.as_ref(), &bytes, config.make_room).await {
            tracing::error!(%error, "could not delete what is not to be kept");
        }
        if Instant::now() >= collect_at {
            collect_at = Instant::now() + config.collect_interval;
            match collect(store.as_ref(), &bytes, &config).await {
                Ok(done) if done == Collected::default() => {}
                Ok(Collected { jobs, attempts, unknown }) => {
                    tracing::info!(jobs, attempts, "bytes collected");
                    if unknown > 0 {
                        tracing::warn!(
                            unknown,
                            "bytes of jobs that this database never knew are kept; put its latest \
                             copy back, or have them deleted with --collect-unknown-after"
                        );
                    }
                }
                Err(error) => tracing::error!(%error, "could not collect bytes"),
            }
        }
    }
}

/// Deletes jobs and pages whose time is over, and what ended longest ago if more
/// than `make_room` bytes are stored; with their bytes.
async fn retain(
    store: &dyn JobStore,
    bytes: &ByteStore,
    make_room: Option<u64>,
) -> Result<(), CollectError> {
    for BytesOf { id, home } in store.unmeasured().await? {
        store.measured(id, bytes.of(&home).stored(id).await?).await?;
    }
    for BytesOf { id, home } in store.expire().await? {
        tracing::info!(target: "audit", %id, "its time was over");
        bytes.of(&home).delete_job(id).await?;
    }
    if let Some(most) = make_room
        && store.stored_bytes(None).await? > most
    {
        for BytesOf { id, home } in store.make_room(most).await? {
            tracing::info!(target: "audit", %id, "deleted to make room");
            bytes.of(&home).delete_job(id).await?;
        }
    }
    Ok(())
}

/// Deletes the bytes of attempts that are over without being published, of jobs
/// and pages that were deleted, and of uploads that came to nothing.
///
/// Only what the store once knew is deleted: it is told of jobs before their
/// bytes are stored, and remembers those that were deleted. Whatever else there
/// is belongs to another database or to a later state of this one, and goes
/// after [`WorkerConfig::collect_unknown_after`] alone.
pub async fn collect(
    store: &dyn JobStore,
    bytes: &ByteStore,
    config: &WorkerConfig,
) -> Result<Collected, CollectError> {
    let mut collected = Collected::default();
    for BytesOf { id, home } in bytes.all().await? {
        let bytes = &bytes.of(&home);
        // Listed before the job is read: an attempt that begins in between is
        // not in the list.
        let attempts = bytes.attempts(id).await?;
        match store.get(id).await {
            Ok(job) => {
                for attempt in attempts.into_iter().filter(|it| is_over(&job, *it)) {
                    bytes.delete_attempt(id, attempt).await?;
                    collected.attempts += 1;
                }
            }
            // Of the readiness probe, which writes it again and again.
            Err(StoreError::NotFound(_)) if id.0.is_nil() => {}
            Err(StoreError::NotFound(_)) => {
                if is_page(store, id).await? {
                    continue;
                }
                let is_ours = store.is_ownerless(id, config.collect_after).await?;
                if is_ours || is_abandoned(bytes, id, config.collect_unknown_after).await? {
                    bytes.delete_job(id).await?;
                    store.forget_bytes(id).await?;
                    collected.jobs += 1;
                } else if !store.is_ownerless(id, Duration::ZERO).await? {
                    collected.unknown += 1;
                }
            }
            // Whatever it was, its bytes may be all that is left of it.
            Err(StoreError::Unreadable(_)) => {}
            Err(error) => return Err(error.into()),
        }
    }
    Ok(collected)
}

async fn is_page(store: &dyn JobStore, id: JobId) -> Result<bool, StoreError> {
    match store.page(id).await {
        Ok(_) => Ok(true),
        Err(StoreError::NotFound(_)) => Ok(false),
        Err(error) => Err(error),
    }
}

/// Whether the bytes of `attempt` will never be published. A later attempt than
/// the store knows of is one of a later state of it. What the last crash of a job
/// left behind stays with the job, for those who look for its cause.
fn is_over(job: &Job, attempt: u32) -> bool {
    let crashed = job.failure.as_ref().is_some_and(|failure| failure.code == CRASHED);
    match job.state {
        JobState::Failed if crashed => attempt < job.attempt,
        JobState::Running | JobState::Succeeded => attempt < job.attempt,
        JobState::Queued | JobState::Failed | JobState::Cancelled => attempt <= job.attempt,
    }
}

/// Whether unknown bytes are as old as they may get.
async fn is_abandoned(
    bytes: &ByteStore,
    id: JobId,
    min_age: Option<Duration>,
) -> Result<bool, ByteError> {
    let oldest = min_age
        .and_then(|age| SignedDuration::try_from(age).ok())
        .and_then(|age| Timestamp::now().checked_sub(age).ok());
    let Some(oldest) = oldest else { return Ok(false) };
    Ok(bytes.last_written(id).await?.is_none_or(|written| written <= oldest))
}
