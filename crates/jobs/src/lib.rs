//! The job queue. It knows nothing about the work: what a job is to do, how far
//! it is and why it failed are JSON values to it.
//!
//! Execution is at least once; a published result exactly one. A worker claims
//! a job for a lease and counts an attempt; it must renew the lease, and every
//! later write names the (job, attempt) it was claimed with, so that a worker
//! that lost its lease can change nothing.

#![expect(
    clippy::duplicate_mod,
    reason = "both job stores compile the modules of `sql`, each with its own driver's types"
)]

mod access;
pub mod bytes;
mod clock;
mod pages;
mod postgres;
mod record;
mod sqlite;
mod storage;
mod store;
mod types;
mod webhooks;

pub use access::{
    AccessStore, ApiKey, InvalidKey, InvalidTenantName, KeyText, NewKey, Scope, Tenant,
    TenantLimits, TenantName,
};
pub use clock::{Clock, ManualClock, SystemClock, Uptime};
pub use pages::{NewPage, PageQuery, PageStore, StoredPage};
pub use postgres::{ImportError, Imported, PostgresOptions, PostgresStore};
pub use sqlite::SqliteStore;
pub use storage::StorageStore;
pub use store::{JobStore, StoreError};
pub use types::{
    ATTEMPTS_EXHAUSTED, ArtifactEntry, CRASHED, Claim, EarlierResult, Event, EventKind, Failure,
    Heartbeat, Idempotency, Job, JobChange, JobCounts, JobId, JobState, LEASE_EXPIRED, ListQuery,
    NewJob, Page, Queue, Revision, Tags, UNREADABLE,
};
pub use webhooks::{
    Delivery, DeliveryAttempt, DeliveryState, Ended, WebhookStore, new_webhook_secret,
};
