//! Housekeeping beside the workers: jobs of silent workers are put back, bytes
//! that belong to nothing are deleted.

use std::sync::Arc;
use std::time::Duration;

use jiff::{SignedDuration, Timestamp};
use tokio::time::{Instant, MissedTickBehavior, interval};

use super::WorkerConfig;
use jobs::bytes::{ByteError, ByteStore};
use jobs::{Job, JobId, JobState, JobStore, StoreError};

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
        if Instant::now() >= collect_at {
            collect_at = Instant::now() + config.collect_interval;
            match collect(store.as_ref(), &bytes, Timestamp::now(), config.collect_after).await {
                Ok(done) if done == Collected::default() => {}
                Ok(Collected { jobs, attempts }) => {
                    tracing::info!(jobs, attempts, "bytes collected");
                }
                Err(error) => tracing::error!(%error, "could not collect bytes"),
            }
        }
    }
}

/// Deletes the bytes of attempts that are over without being published, and of
/// neither jobs nor pages that are in the store.
///
/// A job that is uploading is not in the store yet. It is told from one that
/// never got there by age, for the upload may go through another process: all
/// is left alone until both the job's name and its latest bytes are `min_age`
/// old, so that an upload must not be silent or last longer than that.
pub async fn collect(
    store: &dyn JobStore,
    bytes: &ByteStore,
    now: Timestamp,
    min_age: Duration,
) -> Result<Collected, CollectError> {
    let mut collected = Collected::default();
    for id in bytes.jobs().await? {
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
            Err(StoreError::NotFound(_)) => {
                if is_abandoned(bytes, id, now, min_age).await? && !is_page(store, id).await? {
                    bytes.delete_job(id).await?;
                    collected.jobs += 1;
                }
            }
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

/// Whether the bytes of `attempt` will never be published.
fn is_over(job: &Job, attempt: u32) -> bool {
    match job.state {
        JobState::Running | JobState::Succeeded => attempt != job.attempt,
        JobState::Queued | JobState::Failed | JobState::Cancelled => true,
    }
}

async fn is_abandoned(
    bytes: &ByteStore,
    id: JobId,
    now: Timestamp,
    min_age: Duration,
) -> Result<bool, ByteError> {
    let Some(oldest) =
        SignedDuration::try_from(min_age).ok().and_then(|age| now.checked_sub(age).ok())
    else {
        return Ok(false);
    };
    if id.created_at().is_some_and(|created| created > oldest) {
        return Ok(false);
    }
    Ok(bytes.last_written(id).await?.is_none_or(|written| written <= oldest))
}
