//! What the handlers share.

use std::sync::Arc;

use metrics_exporter_prometheus::PrometheusHandle;
use tokio_util::sync::CancellationToken;

use super::HttpLimits;
use super::upload::{Budget, Decoders};
use jobs::JobStore;
use jobs::bytes::ByteStore;

/// What the handlers work with.
#[derive(Clone)]
pub struct ApiState {
    /// The job queue.
    pub store: Arc<dyn JobStore>,
    /// Where inputs and artifacts are stored.
    pub bytes: ByteStore,
    /// Renders `/metrics`.
    pub metrics: PrometheusHandle,
    /// How often each job may be tried.
    pub max_attempts: u32,
    /// Origins whose pages may use the service; `*` for all.
    pub cors_origins: Vec<String>,
    /// Ends event streams and long polls.
    pub shutdown: CancellationToken,
}

/// State and limits, as the handlers share them.
pub(super) struct Api {
    pub state: ApiState,
    pub limits: HttpLimits,
    pub budget: Budget,
    pub decoders: Decoders,
}

impl Api {
    pub(super) fn new(state: ApiState, limits: HttpLimits) -> Arc<Self> {
        // One upload of the largest size must always fit.
        let budget = Budget::new(limits.max_upload_memory_bytes.max(limits.max_body_bytes));
        let decoders = Decoders::new(limits.concurrent_decodes);
        Arc::new(Self { state, limits, budget, decoders })
    }
}
