//! What every job store can do, and why it may refuse.

use std::time::Duration;

use async_trait::async_trait;
use serde_json::Value;
use tokio::sync::broadcast;

use super::pages::PageStore;
use super::storage::StorageStore;
use super::webhooks::WebhookStore;
use super::{
    ArtifactEntry, Claim, Event, Failure, Heartbeat, Idempotency, Job, JobChange, JobCounts, JobId,
    JobState, ListQuery, NewJob, Page, Queue, Revision, Tags, TenantName,
};

/// Changes a slow listener may lag behind before it misses some.
pub(crate) const REMEMBERED_CHANGES: usize = 1024;

/// Why a store could not do what was asked.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// No job or page has this name.
    #[error("nothing is named {0}")]
    NotFound(JobId),
    /// The job is finished, so it can't be cancelled.
    #[error("job {id} is finished already")]
    Finished {
        /// Name of the job.
        id: JobId,
    },
    /// The job runs, so it can't be deleted yet.
    #[error("job {id} is running")]
    Running {
        /// Name of the job.
        id: JobId,
    },
    /// The idempotency key came with another upload.
    #[error("the key {0:?} was given with another upload")]
    OtherUpload(String),
    /// As many jobs of the tenant wait as may.
    #[error("{most} jobs of tenant {tenant} wait already")]
    TooManyQueued {
        /// Whose they are.
        tenant: TenantName,
        /// How many may wait.
        most: u32,
    },
    /// As many bytes are stored for the tenant as may be.
    #[error("tenant {tenant} may store {most} bytes")]
    TooManyBytes {
        /// Whose they are.
        tenant: TenantName,
        /// How many may be stored.
        most: u64,
    },
    /// There is no such tenant.
    #[error("there is no tenant {0}")]
    NoTenant(TenantName),
    /// There is such a tenant already.
    #[error("there is a tenant {0} already")]
    TenantExists(TenantName),
    /// The tenant can't be deleted: a job of it runs, or it is the default one.
    #[error("tenant {0} is in use")]
    TenantInUse(TenantName),
    /// There is no such key.
    #[error("there is no key {0}")]
    NoKey(String),
    /// The page was changed meanwhile.
    #[error("page {id} is at version {version} by now")]
    Changed {
        /// Name of the page.
        id: JobId,
        /// The version that it is at.
        version: u64,
    },
    /// The (job, attempt) no longer holds the lease.
    #[error("attempt {attempt} of job {id} lost its lease")]
    LeaseLost {
        /// Name of the job.
        id: JobId,
        /// The claim's attempt, from 1.
        attempt: u32,
    },
    /// The disk is full.
    #[error("the disk of the job store is full")]
    Full,
    /// What is stored of a job makes no sense to this version.
    #[error("job store: {0}")]
    Unreadable(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// The database failed.
    #[error("job store: {0}")]
    Backend(#[source] Box<dyn std::error::Error + Send + Sync>),
}

/// A durable queue of jobs, the pages that they may take as sources, and the
/// messages that tell of their ends. Every method is one transaction; when it
/// returns, its effect survives a crash of process and machine.
///
/// `tests/it/suite` is the suite that every implementation passes.
#[async_trait]
pub trait JobStore: PageStore + WebhookStore + StorageStore {
    /// Adds a job in state queued. If its idempotency key came with the same
    /// upload in the last day, the job that this became is returned instead, and
    /// nothing is added. One that comes with an earlier job's result has succeeded
    /// on return.
    ///
    /// # Errors
    /// [`StoreError::NoTenant`] if its tenant is not there,
    /// [`StoreError::TooManyQueued`] if too many of its jobs wait,
    /// [`StoreError::TooManyBytes`] if it stores too much,
    /// [`StoreError::OtherUpload`] if the key came with another upload,
    /// [`StoreError::NotFound`] if the job that it became is deleted.
    async fn enqueue(&self, job: NewJob) -> Result<Job, StoreError>;

    /// The job that an upload with this key became in the last day, if it did.
    ///
    /// # Errors
    /// As [`Self::enqueue`].
    async fn enqueued(
        &self,
        tenant: &TenantName,
        given: &Idempotency,
    ) -> Result<Option<Job>, StoreError>;

    /// The latest job of a tenant and kind that has succeeded with this key of its
    /// result, and whose time is not over.
    async fn with_result(
        &self,
        tenant: &TenantName,
        kind: &str,
        result_key: &str,
    ) -> Result<Option<Job>, StoreError>;

    /// The job as it is now.
    async fn get(&self, id: JobId) -> Result<Job, StoreError>;

    /// Part of the jobs that `query` is about, newest first.
    async fn list(&self, query: &ListQuery) -> Result<Page, StoreError>;

    /// The events of a job numbered above `after`, in order.
    async fn events(&self, id: JobId, after: u64) -> Result<Vec<Event>, StoreError>;

    /// Claims a queued job for `lease` and counts the attempt: of the tenant that
    /// has the fewest jobs running and was served longest ago, the most important
    /// job and of those the oldest. `worker` names the claimant for people who
    /// read the log.
    async fn claim(&self, worker: &str, lease: Duration) -> Result<Option<Claim>, StoreError>;

    /// Extends the lease of (job, attempt).
    async fn heartbeat(
        &self,
        id: JobId,
        attempt: u32,
        lease: Duration,
    ) -> Result<Heartbeat, StoreError>;

    /// Records progress of (job, attempt).
    async fn progress(&self, id: JobId, attempt: u32, progress: Value) -> Result<(), StoreError>;

    /// Publishes artifacts and summary and ends the job as succeeded, in one
    /// transaction.
    ///
    /// This and the other endings return the state the job is in afterwards:
    /// one whose cancellation was accepted always ends as cancelled, whatever
    /// its attempt came to, and then publishes nothing.
    async fn succeed(
        &self,
        id: JobId,
        attempt: u32,
        artifacts: Vec<ArtifactEntry>,
        summary: Option<Value>,
    ) -> Result<JobState, StoreError>;

    /// Ends the job as failed: trying again would not help.
    async fn fail(&self, id: JobId, attempt: u32, failure: Failure)
    -> Result<JobState, StoreError>;

    /// Ends the job as cancelled, after its work saw the request.
    async fn cancelled(&self, id: JobId, attempt: u32) -> Result<JobState, StoreError>;

    /// Puts the job back because this attempt broke (`failure`, internal causes),
    /// to be claimed after `pause` at the earliest; fails it as
    /// `attempts_exhausted` if no attempt is left, but with [`crate::CRASHED`] as
    /// it is.
    async fn retry(
        &self,
        id: JobId,
        attempt: u32,
        failure: Failure,
        pause: Duration,
    ) -> Result<JobState, StoreError>;

    /// Puts the job back because of trouble that is not its own, such as a full
    /// disk. The attempt is not counted; the pause before the next one grows
    /// from a second to a minute. After an hour of it the job fails with `failure`.
    async fn postpone(
        &self,
        id: JobId,
        attempt: u32,
        failure: Failure,
    ) -> Result<JobState, StoreError>;

    /// Puts the job back because its worker stops; the attempt is not counted.
    /// The next claim gets a new attempt number all the same.
    async fn release(&self, id: JobId, attempt: u32) -> Result<JobState, StoreError>;

    /// Puts back every running job whose lease has ended, or fails it as
    /// `attempts_exhausted`, or ends it as cancelled if that was asked for.
    /// Returns how many jobs changed.
    async fn reap(&self) -> Result<u64, StoreError>;

    /// Asks for cancellation: a queued job is cancelled at once, a running one
    /// when its worker sees the request. Asking again changes nothing.
    ///
    /// # Errors
    /// [`StoreError::Finished`] if the job ended already.
    async fn request_cancel(&self, id: JobId) -> Result<Job, StoreError>;

    /// Sets what people say of a job.
    async fn tag(&self, id: JobId, tags: &Tags) -> Result<Job, StoreError>;

    /// Cancels a job that runs, and has it deleted when it has ended. `false` if
    /// it does not run.
    async fn delete_when_ended(&self, id: JobId) -> Result<bool, StoreError>;

    /// Forgets a job and its events.
    ///
    /// # Errors
    /// [`StoreError::Running`] while it runs.
    async fn delete(&self, id: JobId) -> Result<(), StoreError>;

    /// Says that bytes will be stored for a job that is enqueued later, so that
    /// they can be told from those of other databases if it never is.
    async fn expect_bytes(&self, id: JobId) -> Result<(), StoreError>;

    /// Whether the job was expected or deleted at least `for_at_least` ago and
    /// has not been enqueued since: its bytes may go.
    async fn is_ownerless(&self, id: JobId, for_at_least: Duration) -> Result<bool, StoreError>;

    /// The bytes of a job without a row are deleted.
    async fn forget_bytes(&self, id: JobId) -> Result<(), StoreError>;

    /// Every job's name, for collecting bytes that belong to none.
    async fn ids(&self) -> Result<Vec<JobId>, StoreError>;

    /// Stored jobs by state.
    async fn counts(&self) -> Result<JobCounts, StoreError>;

    /// The jobs that wait, by tenant.
    async fn queues(&self) -> Result<Vec<Queue>, StoreError>;

    /// Jobs queued and running now.
    async fn depth(&self) -> Result<(u64, u64), StoreError>;

    /// Answers if the store can read and write.
    async fn ping(&self) -> Result<(), StoreError>;

    /// What is stored, by a number that every commit changes, whoever makes it: what is
    /// read after asking for it is as stored for as long as it is the same. Asking waits
    /// for nothing and is cheaper than reading. `None` where it can't be told like that.
    fn revision(&self) -> Option<Revision>;

    /// Tells of changes as they are committed through this store, to save
    /// waiting for the next poll. Only a hint: changes of other processes, and
    /// those a slow receiver lags behind, are missing.
    fn changes(&self) -> broadcast::Receiver<JobChange>;
}
