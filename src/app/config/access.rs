//! Settings of who may use the service, and how much of it.

use std::path::PathBuf;

use clap::Args;
use serde::{Deserialize, Serialize};

/// Who may use the service, and how much of it.
#[derive(Args, Clone, Debug, PartialEq, Serialize, Deserialize)]
#[command(next_help_heading = "Access")]
pub(crate) struct AccessConfig {
    /// Let everybody who reaches the service do everything, keys or not
    #[arg(long, env = "TURNAROUND_INSECURE_NO_AUTH")]
    pub insecure_no_auth: bool,
    /// File with a key of the scope admin that is stored at the start, so that a
    /// new service comes up closed; `turnaround keys generate` prints one
    #[arg(long, env = "TURNAROUND_FIRST_KEY_FILE", value_name = "FILE")]
    pub first_key_file: Option<PathBuf>,
    /// File with the secret that links to artifacts are signed with, at least 32
    /// bytes; unset for one that is made and kept in the database
    #[arg(long, env = "TURNAROUND_LINK_SECRET_FILE", value_name = "FILE")]
    pub link_secret_file: Option<PathBuf>,
    /// Serve `/metrics` without a key; otherwise it needs one of the scope admin,
    /// for it counts the jobs of all tenants
    #[arg(long, env = "TURNAROUND_OPEN_METRICS")]
    pub open_metrics: bool,
    /// Serve no `/docs`
    #[arg(long, env = "TURNAROUND_NO_DOCS")]
    pub no_docs: bool,
    /// Requests a second of each tenant for which nothing else is said; unset for any
    #[arg(long, env = "TURNAROUND_REQUESTS_PER_SECOND", value_name = "N")]
    pub requests_per_second: Option<u32>,
    /// Jobs of each tenant that may wait; unset for any
    #[arg(long, env = "TURNAROUND_MAX_QUEUED", value_name = "N")]
    pub max_queued: Option<u32>,
    /// Event streams of each tenant; unset for any
    #[arg(long, env = "TURNAROUND_MAX_TENANT_STREAMS", value_name = "N")]
    pub max_tenant_streams: Option<u32>,
    /// MiB stored for each tenant; its uploads are refused above; unset for any
    #[arg(long, env = "TURNAROUND_MAX_TENANT_MIB", value_name = "MIB")]
    pub max_tenant_mib: Option<u64>,
    /// Seconds after which jobs that have ended and pages are deleted, unless they
    /// say otherwise; unset keeps them
    #[arg(long, env = "TURNAROUND_EXPIRES_IN", value_name = "SECONDS")]
    pub expires_in: Option<u32>,
}
