//! Settings of the log.

use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};

/// How log lines are written.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum LogFormat {
    Text,
    Json,
}

/// What is logged, to standard error.
#[derive(Args, Clone, Debug, PartialEq, Serialize, Deserialize)]
#[command(next_help_heading = "Log")]
pub(crate) struct LogConfig {
    /// Least level, or directives such as `info,turnaround=debug`
    #[arg(long, env = "TURNAROUND_LOG", value_name = "LEVEL", default_value = "info")]
    pub log: String,
    /// Layout of log lines
    #[arg(long, env = "TURNAROUND_LOG_FORMAT", value_name = "FORMAT", default_value = "text")]
    pub log_format: LogFormat,
}
