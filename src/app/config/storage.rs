//! Settings of where jobs and bytes are kept.

use std::path::PathBuf;

use clap::Args;
use serde::{Deserialize, Serialize};

/// Where jobs and bytes are kept.
#[derive(Args, Clone, Debug, PartialEq, Serialize, Deserialize)]
#[command(next_help_heading = "Storage")]
pub(crate) struct StorageConfig {
    /// Folder of the database and of all bytes; made if missing
    #[arg(long, env = "TURNAROUND_DATA_DIR", value_name = "DIR", default_value = "data")]
    pub data_dir: PathBuf,
    /// Uploads are taken only while this much is left on the disk, MiB
    #[arg(long, env = "TURNAROUND_MIN_FREE_MIB", value_name = "MIB", default_value_t = 64)]
    pub min_free_mib: u64,
    /// Start with a new database beside bytes of jobs that it does not know
    #[arg(long, env = "TURNAROUND_ADOPT_BYTES")]
    pub adopt_bytes: bool,
    /// Delete bytes of jobs that the database never knew once they are this old,
    /// hours; unset keeps them
    #[arg(long, env = "TURNAROUND_COLLECT_UNKNOWN_AFTER", value_name = "HOURS")]
    pub collect_unknown_after: Option<u64>,
}
