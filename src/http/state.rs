//! What the handlers share.

use std::sync::Arc;

use metrics_exporter_prometheus::PrometheusHandle;
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;

use super::files::Files;
use super::statuses::Statuses;
use super::streams::Streams;
use super::upload::{Budget, Decoders};
use super::{Access, Guard, HttpLimits, LinkKey, Redirects};
use crate::outbound::Outbound;
use jobs::bytes::ByteStore;
use jobs::{JobId, JobStore, TenantName};

/// What the handlers work with.
#[derive(Clone)]
pub struct ApiState {
    /// The job queue.
    pub store: Arc<dyn JobStore>,
    /// Where inputs and artifacts are stored.
    pub bytes: ByteStore,
    /// Whether those of new jobs and pages lie below their tenant's prefix.
    pub bytes_by_tenant: bool,
    /// Lets the bucket send large artifacts itself.
    pub redirects: Option<Redirects>,
    /// Renders `/metrics`.
    pub metrics: PrometheusHandle,
    /// How often each job may be tried.
    pub max_attempts: u32,
    /// Who may use the service.
    pub access: Access,
    /// Whom the service may call.
    pub outbound: Arc<Outbound>,
    /// What links to artifacts are signed with.
    pub link_key: LinkKey,
    /// Which requests are meant for the service.
    pub guard: Guard,
    /// Uploads are refused and readiness denied: the service is about to stop.
    pub draining: CancellationToken,
    /// Ends event streams and long polls.
    pub shutdown: CancellationToken,
}

impl ApiState {
    /// A name for a new job or page of `tenant`, and the store of its bytes.
    pub(super) fn new_name(&self, tenant: &TenantName) -> (JobId, ByteStore) {
        let id = if self.bytes_by_tenant { JobId::new_by_tenant() } else { JobId::new() };
        (id, self.bytes.of(&id.home(tenant)))
    }
}

/// State and limits, as the handlers share them.
pub(super) struct Api {
    pub state: ApiState,
    pub limits: HttpLimits,
    pub budget: Budget,
    pub decoders: Decoders,
    /// Uploads whose parts are being held against each other.
    pub checks: Semaphore,
    pub streams: Streams,
    pub statuses: Statuses,
    pub files: Files,
}

impl Api {
    pub(super) fn new(state: ApiState, limits: HttpLimits) -> Arc<Self> {
        // One upload of the largest size must always fit.
        let budget = Budget::new(limits.max_upload_memory_bytes.max(limits.max_body_bytes));
        let decoders = Decoders::new(limits.concurrent_decodes);
        let checks = Semaphore::new(2 * limits.concurrent_decodes.max(1));
        let streams = Streams::new(limits.max_streams);
        let (statuses, files) = (Statuses::default(), Files::default());
        Arc::new(Self { state, limits, budget, decoders, checks, streams, statuses, files })
    }
}
