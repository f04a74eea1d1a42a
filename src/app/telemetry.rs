//! Where log lines go.

use std::io::{self, IsTerminal};

use anyhow::{Context, Result};
use tracing_subscriber::EnvFilter;

use super::config::{LogConfig, LogFormat};

/// Sends log lines to standard error as `config` says.
///
/// # Errors
/// If the level is no tracing directive.
pub(super) fn init(config: &LogConfig) -> Result<()> {
    let filter = EnvFilter::try_new(&config.log)
        .with_context(|| format!("--log {}: not a level or directive", config.log))?;
    let lines = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(io::stderr)
        .with_ansi(io::stderr().is_terminal());
    match config.log_format {
        LogFormat::Text => lines.init(),
        LogFormat::Json => lines.json().init(),
    }
    Ok(())
}
