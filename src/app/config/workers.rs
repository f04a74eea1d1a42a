//! Settings of the worker pool.

use std::net::SocketAddr;

use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};

/// Where the work of a job is done.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Isolation {
    /// In a process beside, without files and network
    Process,
    /// In the process of the service
    None,
}

/// How jobs are run.
#[derive(Args, Clone, Debug, PartialEq, Serialize, Deserialize)]
#[command(next_help_heading = "Workers")]
pub(crate) struct WorkersConfig {
    /// Jobs run at once; 0 makes a node that answers requests alone
    #[arg(long, env = "TURNAROUND_WORKERS", value_name = "N", default_value_t = 1)]
    pub workers: usize,
    /// Threads of each running job; 0 shares the processors among the workers
    #[arg(long, env = "TURNAROUND_THREADS_PER_JOB", value_name = "N", default_value_t = 0)]
    pub threads_per_job: usize,
    /// Where jobs are worked on; a process of its own takes no neighbour along when it dies
    #[arg(
        long,
        env = "TURNAROUND_ISOLATION",
        value_name = "WHERE",
        value_enum,
        default_value = "process"
    )]
    pub isolation: Isolation,
    /// Where a node of workers alone answers /metrics and /health/live; nowhere if not given
    #[arg(long, env = "TURNAROUND_METRICS_LISTEN", value_name = "ADDR:PORT")]
    pub metrics_listen: Option<SocketAddr>,
    /// Times a job is begun at most before it counts as failed
    #[arg(long, env = "TURNAROUND_MAX_ATTEMPTS", value_name = "N", default_value_t = 3)]
    pub max_attempts: u32,
    /// Seconds that one attempt at a job may take
    #[arg(long, env = "TURNAROUND_MAX_JOB_SECONDS", value_name = "SECONDS", default_value_t = 600)]
    pub max_job_seconds: u64,
    /// Seconds until a silent worker's job is taken from it
    #[arg(long, env = "TURNAROUND_LEASE", value_name = "SECONDS", default_value_t = 30)]
    pub lease: u64,
    /// Seconds between a worker's signs of life; well below the lease
    #[arg(long, env = "TURNAROUND_HEARTBEAT", value_name = "SECONDS", default_value_t = 10)]
    pub heartbeat: u64,
    /// Seconds that running jobs have to finish when the service stops
    #[arg(long, env = "TURNAROUND_SHUTDOWN_GRACE", value_name = "SECONDS", default_value_t = 5)]
    pub shutdown_grace: u64,
}
