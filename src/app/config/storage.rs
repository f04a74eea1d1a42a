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
    /// What may be stored for all jobs and pages together, MiB; uploads are refused
    /// above; unset for what the disk holds
    #[arg(long, env = "TURNAROUND_DISK_BUDGET_MIB", value_name = "MIB")]
    pub disk_budget_mib: Option<u64>,
    /// When nine tenths of the budget are used, delete what ended longest ago and
    /// is not pinned, in place of refusing uploads
    #[arg(long, env = "TURNAROUND_MAKE_ROOM", requires = "disk_budget_mib")]
    pub make_room: bool,
    /// Start with a new database beside bytes of jobs that it does not know
    #[arg(long, env = "TURNAROUND_ADOPT_BYTES")]
    pub adopt_bytes: bool,
    /// Delete bytes of jobs that the database never knew once they are this old,
    /// hours; unset keeps them
    #[arg(long, env = "TURNAROUND_COLLECT_UNKNOWN_AFTER", value_name = "HOURS")]
    pub collect_unknown_after: Option<u64>,
}
