//! Messages that tell other services how jobs ended.
//!
//! A message is written in the transaction that ends its job, and sent at least
//! once: whoever sends it claims it for a lease, as workers do with jobs.

use std::collections::BTreeMap;
use std::time::Duration;

use async_trait::async_trait;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use jiff::Timestamp;
use rand::RngCore;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::{Failure, JobId, JobState, StoreError, TenantName};

/// A new secret to sign messages with: `whsec_` and base64 of 256 random bits.
pub fn new_webhook_secret() -> String {
    let mut bytes = [0; 32];
    rand::rng().fill_bytes(&mut bytes);
    format!("whsec_{}", STANDARD.encode(bytes))
}

/// Where a message is in its life.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DeliveryState {
    /// To be sent, for the first time or again.
    Pending,
    /// The receiver took it.
    Delivered,
    /// Tried for long enough.
    GivenUp,
}

/// How a job ended, as it is told.
#[derive(Clone, Debug, PartialEq)]
pub struct Ended {
    /// The job.
    pub job: JobId,
    /// Which work it was.
    pub kind: String,
    /// A final state.
    pub state: JobState,
    /// What people called it.
    pub name: Option<String>,
    /// What they found it by.
    pub labels: BTreeMap<String, String>,
    /// Why it failed, if it did.
    pub failure: Option<Failure>,
    /// When it ended.
    pub finished_at: Timestamp,
}

/// A message about the end of a job.
#[derive(Clone, Debug, PartialEq)]
pub struct Delivery {
    /// Its name, the same however often it is sent.
    pub id: Uuid,
    /// Whose job it was.
    pub tenant: TenantName,
    /// Where it goes.
    pub url: String,
    /// What it says.
    pub ended: Ended,
    /// Where it is in its life.
    pub state: DeliveryState,
    /// How often it was claimed since it was last asked for.
    pub tries: u32,
}

/// What came of sending a message once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeliveryAttempt {
    /// When it was sent.
    pub at: Timestamp,
    /// From then to the end of the answer.
    pub duration: Duration,
    /// What the receiver answered, if it did.
    pub status: Option<u16>,
    /// Why it was no success, if it was none.
    pub error: Option<String>,
}

/// Addresses, secrets and the outbox. Every method is one transaction.
#[async_trait]
pub trait WebhookStore: Send + Sync {
    /// Where the ends of the tenant's jobs are told unless they say otherwise.
    async fn webhook(&self, tenant: &TenantName) -> Result<Option<String>, StoreError>;

    /// Sets that.
    async fn set_webhook(&self, tenant: &TenantName, url: Option<&str>) -> Result<(), StoreError>;

    /// What the tenant's messages are signed with now, newest first.
    async fn webhook_secrets(&self, tenant: &TenantName) -> Result<Vec<String>, StoreError>;

    /// Signs with `secret` from now on, and with the one before for `overlap`
    /// besides. Older ones are forgotten.
    async fn add_webhook_secret(
        &self,
        tenant: &TenantName,
        secret: &str,
        overlap: Duration,
    ) -> Result<(), StoreError>;

    /// Claims the message that is due first for `lease` and counts the try:
    /// those that were not tried yet before those that were refused.
    ///
    /// * `busy`: tenants whose messages are left out.
    async fn claim_delivery(
        &self,
        lease: Duration,
        busy: &[TenantName],
    ) -> Result<Option<Delivery>, StoreError>;

    /// Writes down what came of a try. It was a success if it has no error;
    /// otherwise the message is sent again after `pause`, or given up.
    async fn attempted(
        &self,
        id: Uuid,
        attempt: &DeliveryAttempt,
        pause: Option<Duration>,
    ) -> Result<(), StoreError>;

    /// The messages about a job, oldest first, each with its tries.
    async fn deliveries(
        &self,
        job: JobId,
    ) -> Result<Vec<(Delivery, Vec<DeliveryAttempt>)>, StoreError>;

    /// Has a message about the job sent anew. `false` if there is none of this name.
    async fn redeliver(&self, job: JobId, id: Uuid) -> Result<bool, StoreError>;
}
