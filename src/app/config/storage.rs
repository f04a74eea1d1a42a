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
}
