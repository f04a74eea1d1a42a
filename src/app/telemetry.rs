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
    let filter = filter(&config.log)?;
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

/// Sends log lines to the service that started this process, which adds the time.
///
/// # Errors
/// If `level` is no tracing directive.
pub(super) fn init_child(level: &str) -> Result<()> {
    let lines = tracing_subscriber::fmt().with_env_filter(filter(level)?);
    lines.with_writer(io::stderr).with_ansi(false).without_time().init();
    Ok(())
}

fn filter(level: &str) -> Result<EnvFilter> {
    EnvFilter::try_new(level).with_context(|| format!("--log {level}: not a level or directive"))
}
