//! What a job is: its states, claims, events and listings.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use uuid::Uuid;

use super::TenantName;
use super::bytes::Home;

/// A job's name; version 7, so that names sort by age.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(transparent)]
pub struct JobId(pub Uuid);

impl JobId {
    /// A new name, later than all earlier ones of this process.
    pub fn new() -> Self {
        Self(Uuid::now_v7())
    }

    /// As [`Self::new`], of a job or page whose bytes lie below its tenant's prefix: such names
    /// are UUIDs of version 8 in place of 7, and the same otherwise. So nodes that know nothing
    /// of it need no other columns.
    pub fn new_by_tenant() -> Self {
        Self(
            uuid::Builder::from_bytes(Uuid::now_v7().into_bytes())
                .with_version(uuid::Version::Custom)
                .into_uuid(),
        )
    }

    /// Where the bytes of the job or page of this name lie, which is the tenant's.
    pub fn home(self, tenant: &TenantName) -> Home {
        match self.0.get_version() {
            Some(uuid::Version::Custom) => Home::Tenant(tenant.clone()),
            _ => Home::Shared,
        }
    }

    /// When the name was made; `None` if it is not of version 7.
    pub fn created_at(self) -> Option<Timestamp> {
        let (seconds, nanoseconds) = self.0.get_timestamp()?.to_unix();
        Timestamp::new(seconds.cast_signed(), nanoseconds.cast_signed()).ok()
    }
}

impl Default for JobId {
    fn default() -> Self {
        Self::new()
    }
}

impl fmt::Display for JobId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl FromStr for JobId {
    type Err = uuid::Error;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        text.parse().map(Self)
    }
}

/// Where a job is in its life.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// Waits for a worker, for the first time or again.
    Queued,
    /// A worker holds its lease.
    Running,
    /// Done; its artifacts are published. Final.
    Succeeded,
    /// Ended without a result; `failure` has why. Final.
    Failed,
    /// Stopped because somebody asked to. Final.
    Cancelled,
}

impl JobState {
    /// Whether the job will never change again.
    pub fn is_final(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Cancelled)
    }
}

/// What tells an upload that is sent again from another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Idempotency {
    /// The client's name for the upload, one of its tenant's.
    pub key: String,
    /// A hash of what was uploaded.
    pub fingerprint: String,
}

/// What people say of a job, and may change at any time.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tags {
    /// What they call it.
    pub name: Option<String>,
    /// What they find it by.
    pub labels: BTreeMap<String, String>,
    /// When it is deleted by itself.
    pub expires_at: Option<Timestamp>,
    /// Whether it stays all the same.
    pub pinned: bool,
}

/// What to enqueue.
#[derive(Clone, Debug)]
pub struct NewJob {
    /// The new job's name.
    pub id: JobId,
    /// Whose it is.
    pub tenant: TenantName,
    /// Which work it is, such as `reconstruction`.
    pub kind: String,
    /// Claimed before others of its tenant that have a lower one.
    pub priority: i32,
    /// What the work needs, apart from stored bytes.
    pub payload: Value,
    /// How often the job may be claimed, released claims apart; at least 1.
    pub max_attempts: u32,
    /// How many jobs of its tenant may wait, this one among them.
    pub max_queued: Option<u32>,
    /// Stored bytes that it takes until it succeeds.
    pub bytes: u64,
    /// How many bytes may be stored for its tenant, these among them.
    pub max_bytes: Option<u64>,
    /// What people say of it.
    pub tags: Tags,
    /// Where its end is told; `None` for its tenant's address.
    pub webhook: Option<String>,
    /// Given by a client that may send it again.
    pub idempotency: Option<Idempotency>,
    /// The request that it came with, to follow it through the logs of all nodes.
    pub request_id: Option<String>,
    /// A hash of all that its result depends on.
    pub result_key: Option<String>,
    /// Ends it at once with the result of another; the artifacts' bytes are its
    /// own already, as those of attempt 1.
    pub result: Option<EarlierResult>,
}

/// The result of an earlier job.
#[derive(Clone, Debug)]
pub struct EarlierResult {
    /// Whose it is.
    pub of: JobId,
    /// What it published.
    pub artifacts: Vec<ArtifactEntry>,
    /// What it came to.
    pub summary: Option<Value>,
}

impl NewJob {
    /// A job of the default tenant, as important as any.
    pub fn new(id: JobId, kind: impl Into<String>, payload: Value, max_attempts: u32) -> Self {
        let tenant = TenantName::default();
        Self {
            id,
            tenant,
            kind: kind.into(),
            priority: 0,
            payload,
            max_attempts,
            max_queued: None,
            bytes: 0,
            max_bytes: None,
            tags: Tags::default(),
            webhook: None,
            idempotency: None,
            request_id: None,
            result_key: None,
            result: None,
        }
    }
}

/// A job as stored.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// Its name.
    pub id: JobId,
    /// Whose it is.
    pub tenant: TenantName,
    /// Which work it is, such as `reconstruction`.
    pub kind: String,
    /// Claimed before others of its tenant that have a lower one.
    pub priority: i32,
    /// What people say of it.
    pub tags: Tags,
    /// Where its end is told; `None` for its tenant's address.
    pub webhook: Option<String>,
    /// The request that it came with.
    pub request_id: Option<String>,
    /// What the work needs, apart from stored bytes.
    pub payload: Value,
    /// Where it is in its life.
    pub state: JobState,
    /// Claims so far: the latest one's fencing token, never used by two claims.
    pub attempt: u32,
    /// Claims that count: a released one is given back, so that this may be
    /// less than `attempt`.
    pub attempts_used: u32,
    /// How often it may be claimed, released claims apart.
    pub max_attempts: u32,
    /// Whether somebody asked to cancel it.
    pub cancel_requested: bool,
    /// Last reported progress of the current attempt.
    pub progress: Option<Value>,
    /// Set when failed.
    pub failure: Option<Failure>,
    /// Set when succeeded, in publication order.
    pub artifacts: Vec<ArtifactEntry>,
    /// What it came to in a few values, if succeeded and its work says so.
    pub summary: Option<Value>,
    /// The job whose result it was answered with.
    pub reused_from: Option<JobId>,
    /// When it was enqueued.
    pub created_at: Timestamp,
    /// When the current attempt began.
    pub started_at: Option<Timestamp>,
    /// When it reached a final state; `None` until then.
    pub finished_at: Option<Timestamp>,
    /// Grows by one with every change: the source of ETags and the number of
    /// the latest event.
    pub version: u64,
}

impl Job {
    /// Where its bytes lie.
    pub fn home(&self) -> Home {
        self.id.home(&self.tenant)
    }

    /// The job as it was when it was enqueued.
    pub fn as_enqueued(&self) -> Self {
        // One with an earlier result has ended when it is enqueued.
        if self.reused_from.is_some() {
            return self.clone();
        }
        Self {
            state: JobState::Queued,
            attempt: 0,
            attempts_used: 0,
            cancel_requested: false,
            progress: None,
            failure: None,
            artifacts: Vec::new(),
            summary: None,
            started_at: None,
            finished_at: None,
            version: 1,
            ..self.clone()
        }
    }
}

/// The failure code of a job whose last worker was lost.
pub const LEASE_EXPIRED: &str = "lease_expired";
/// The failure code of a job whose every attempt broke off.
pub const ATTEMPTS_EXHAUSTED: &str = "attempts_exhausted";
/// The failure code of a job whose process died at its last attempt.
pub const CRASHED: &str = "crashed";
/// The failure code of a job whose stored row can't be read.
pub const UNREADABLE: &str = "unreadable";

/// Why a job failed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failure {
    /// Stable name, such as `no_usable_pair` or `attempts_exhausted`.
    pub code: String,
    /// What happened and how to mend it.
    pub detail: String,
}

/// A published artifact.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ArtifactEntry {
    /// Path below the job's artifacts, such as `views/45/disparity.png`.
    pub name: String,
    /// Such as `image/png`.
    pub media_type: String,
    /// Size of the content, bytes.
    pub bytes: u64,
    /// Lower-case hexadecimal SHA-256 of the content.
    pub sha256: String,
}

/// The right to run a job until the lease ends.
#[derive(Clone, Debug)]
pub struct Claim {
    /// The job as it was claimed.
    pub job: Job,
    /// This claim's attempt, from 1: the fencing token.
    pub attempt: u32,
}

/// What a renewed lease tells the worker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heartbeat {
    /// The lease was extended.
    Held {
        /// Whether somebody asked to cancel the job.
        cancel_requested: bool,
    },
    /// The (job, attempt) no longer runs: stop and throw the result away.
    Lost,
}

/// What happened to a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EventKind {
    /// Enqueued.
    Queued,
    /// Claimed; the data has the attempt.
    Started,
    /// The work said how far it is; the data has it.
    Progress,
    /// Somebody asked to cancel it while it runs.
    CancelRequested,
    /// Put back: its worker stopped or its lease ended.
    Requeued,
    /// What people say of it was changed.
    Tagged,
    /// Done, its artifacts published.
    Succeeded,
    /// Ended without a result; the data has why.
    Failed,
    /// Ended because it was cancelled.
    Cancelled,
}

impl EventKind {
    /// Whether it ends the job.
    pub fn is_final(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Cancelled)
    }
}

/// An entry of a job's log. Numbers start at 1 and have no gaps.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// The job's version after it, from 1.
    pub number: u64,
    /// When it happened.
    pub at: Timestamp,
    /// What happened.
    pub kind: EventKind,
    /// More about it; its keys depend on the kind.
    pub data: Value,
}

/// What is stored at some moment: equal to another one if nothing was committed between.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Revision(pub(crate) i64);

/// A hint that a job changed in this process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JobChange {
    /// The job that changed.
    pub id: JobId,
    /// What happened to it.
    pub kind: EventKind,
    /// The job's version after the change.
    pub version: u64,
}

/// The jobs of a tenant that wait for a worker.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Queue {
    /// Whose they are.
    pub tenant: TenantName,
    /// How many.
    pub jobs: u64,
    /// When the oldest of them was enqueued.
    pub oldest: Timestamp,
}

/// How many jobs are stored in each state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JobCounts {
    /// Jobs that wait for a worker.
    pub queued: u64,
    /// Jobs that a worker holds.
    pub running: u64,
    /// Jobs that are done.
    pub succeeded: u64,
    /// Jobs that ended without a result.
    pub failed: u64,
    /// Jobs that were cancelled.
    pub cancelled: u64,
}

/// Which jobs to list, newest first.
#[derive(Clone, Debug, Default)]
pub struct ListQuery {
    /// Only jobs of this tenant; `None` for all.
    pub tenant: Option<TenantName>,
    /// Only jobs of this kind; `None` for all.
    pub kind: Option<String>,
    /// Only jobs in this state; `None` for all.
    pub state: Option<JobState>,
    /// Only jobs that have all of these labels.
    pub labels: BTreeMap<String, String>,
    /// Only jobs enqueued at this time or later.
    pub created_from: Option<Timestamp>,
    /// Only jobs enqueued before this time.
    pub created_before: Option<Timestamp>,
    /// Only jobs older than this one.
    pub before: Option<JobId>,
    /// At most this many; at least 1.
    pub limit: u32,
}

/// Part of a listing.
#[derive(Clone, Debug)]
pub struct Page {
    /// Newest first.
    pub jobs: Vec<Job>,
    /// Give as `before` for the next part; `None` at the end.
    pub next: Option<JobId>,
}
