//! Settings of where and how the service listens.

use std::net::SocketAddr;

use clap::Args;
use serde::{Deserialize, Serialize};

/// Where and how the service listens.
#[derive(Args, Clone, Debug, PartialEq, Serialize, Deserialize)]
#[command(next_help_heading = "HTTP")]
pub(crate) struct HttpConfig {
    /// Address and port to listen on
    #[arg(
        long,
        env = "TURNAROUND_LISTEN",
        value_name = "ADDR:PORT",
        default_value = "127.0.0.1:8080"
    )]
    pub listen: SocketAddr,
    /// Origin that web pages may call from, repeatable; `*` for any
    #[arg(long, env = "TURNAROUND_CORS_ORIGIN", value_name = "ORIGIN", value_delimiter = ',')]
    pub cors_origin: Vec<String>,
    /// Name by which the service may be called, repeatable; any if it listens on
    /// other than the loopback and none is given
    #[arg(long, env = "TURNAROUND_ALLOWED_HOST", value_name = "HOST", value_delimiter = ',')]
    pub allowed_host: Vec<String>,
    /// Connections open at a time; 0 for what the limit of open files leaves
    #[arg(long, env = "TURNAROUND_MAX_CONNECTIONS", value_name = "N", default_value_t = 0)]
    pub max_connections: usize,
    /// Event streams open at a time
    #[arg(long, env = "TURNAROUND_MAX_STREAMS", value_name = "N", default_value_t = 256)]
    pub max_streams: usize,
    /// Seconds a client has for sending a request's header
    #[arg(long, env = "TURNAROUND_HEADER_TIMEOUT", value_name = "SECONDS", default_value_t = 10)]
    pub header_timeout: u64,
    /// Seconds a request's body may pause
    #[arg(
        long,
        env = "TURNAROUND_BODY_IDLE_TIMEOUT",
        value_name = "SECONDS",
        default_value_t = 30
    )]
    pub body_idle_timeout: u64,
    /// Seconds a client may take no more of its answer
    #[arg(long, env = "TURNAROUND_WRITE_TIMEOUT", value_name = "SECONDS", default_value_t = 30)]
    pub write_timeout: u64,
}
