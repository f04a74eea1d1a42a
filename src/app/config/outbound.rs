//! Settings of whom the service may call.

use std::path::PathBuf;

use clap::Args;
use serde::{Deserialize, Serialize};

/// Whom the service may call: receivers of webhooks, hosts of drawings.
#[derive(Args, Clone, Debug, PartialEq, Serialize, Deserialize)]
#[command(next_help_heading = "Calls to others")]
pub(crate) struct OutboundConfig {
    /// Host (a name or an address, without a port) that may be called whatever
    /// its address is, and without TLS; others must have public addresses. May
    /// be repeated
    #[arg(long, env = "TURNAROUND_TRUSTED_HOST", value_name = "HOST", value_delimiter = ',')]
    pub trusted_host: Vec<String>,
    /// Let all hosts be called without TLS
    #[arg(long, env = "TURNAROUND_ALLOW_HTTP")]
    pub allow_http: bool,
    /// File with certificates (PEM) of authorities that are believed besides those
    /// of the machine, such as a studio's own
    #[arg(long, env = "TURNAROUND_CA_FILE", value_name = "FILE")]
    pub ca_file: Option<PathBuf>,
    /// Fetch drawings and masks that sheet documents name by URL
    #[arg(long, env = "TURNAROUND_INPUTS_BY_URL")]
    pub inputs_by_url: bool,
}
