//! Settings of where jobs and bytes are kept, and how many.

use std::path::PathBuf;

use clap::Args;
use serde::{Deserialize, Serialize};

/// Where jobs and bytes are kept.
#[derive(Args, Clone, Debug, PartialEq, Serialize, Deserialize)]
#[command(next_help_heading = "Storage")]
pub(crate) struct StoresConfig {
    /// Folder of the database and of all bytes, unless they are elsewhere; made if
    /// missing
    #[arg(long, env = "TURNAROUND_DATA_DIR", value_name = "DIR", default_value = "data")]
    pub data_dir: PathBuf,
    /// PostgreSQL database in place of a file, shared by all nodes of a farm, such as
    /// postgres://user:password@host/name?sslmode=verify-full
    #[arg(long, env = "TURNAROUND_DATABASE_URL", value_name = "URL", hide_env_values = true)]
    pub database_url: Option<String>,
    /// Connections to the PostgreSQL database at most, one more for listening besides
    #[arg(long, env = "TURNAROUND_DATABASE_CONNECTIONS", value_name = "N", default_value_t = 10)]
    pub database_connections: u32,
    /// Bucket for all bytes in place of a folder: s3://BUCKET or s3://BUCKET/PREFIX;
    /// endpoint and credentials by AWS_ENDPOINT_URL, AWS_REGION, AWS_ACCESS_KEY_ID ...
    #[arg(long, env = "TURNAROUND_STORE", value_name = "ADDRESS")]
    pub store: Option<String>,
}

/// How much is kept, and what is deleted.
#[derive(Args, Clone, Debug, PartialEq, Serialize, Deserialize)]
#[command(next_help_heading = "Storage")]
pub(crate) struct StorageConfig {
    /// Uploads are taken only while this much is left on the disk, MiB
    #[arg(long, env = "TURNAROUND_MIN_FREE_MIB", value_name = "MIB", default_value_t = 64)]
    pub min_free_mib: u64,
    /// What may be stored for all jobs and pages together, MiB; uploads are refused
    /// above; unset for what the disk holds
    #[arg(long, env = "TURNAROUND_DISK_BUDGET_MIB", value_name = "MIB")]
    pub disk_budget_mib: Option<u64>,
    /// When nine tenths of the budget are used, delete what ended longest ago and
    /// is not pinned, in place of refusing uploads
    #[arg(long, env = "TURNAROUND_MAKE_ROOM", requires = "disk_budget_mib")]
    pub make_room: bool,
    /// Store the bytes of new jobs and pages below a prefix of their tenant: once all nodes are
    /// of a version that knows it
    #[arg(long, env = "TURNAROUND_BYTES_BY_TENANT")]
    pub bytes_by_tenant: bool,
    /// Answer downloads of large artifacts with a redirect to a signed URL of the bucket that
    /// works for this long, seconds; unset to send all bytes through the nodes
    #[arg(long, env = "TURNAROUND_DOWNLOAD_REDIRECTS", value_name = "SECONDS")]
    pub download_redirects: Option<u32>,
    /// Endpoint of the bucket for those who download, if they reach it by another name than
    /// the nodes; otherwise that of AWS_ENDPOINT_URL
    #[arg(
        long,
        env = "TURNAROUND_DOWNLOAD_ENDPOINT",
        value_name = "URL",
        requires = "download_redirects"
    )]
    pub download_endpoint: Option<String>,
    /// Start with a new database beside bytes of jobs that it does not know
    #[arg(long, env = "TURNAROUND_ADOPT_BYTES")]
    pub adopt_bytes: bool,
    /// Delete bytes of jobs that the database never knew once they are this old,
    /// hours; unset keeps them
    #[arg(long, env = "TURNAROUND_COLLECT_UNKNOWN_AFTER", value_name = "HOURS")]
    pub collect_unknown_after: Option<u64>,
}
