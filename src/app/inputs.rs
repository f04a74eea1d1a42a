//! What several commands read from the command line and from folders.

use std::fs;
use std::path::Path;
use std::thread::available_parallelism;

use anyhow::{Context, Result};
use serde_json::Value;

use sheet::SheetDocument;

/// How many threads `--threads` means: 0 is all processors.
pub(super) fn threads(asked: usize) -> usize {
    match asked {
        0 => available_parallelism().map_or(1, usize::from),
        threads => threads,
    }
}

/// Lays the values of `--set`, each `OPTION=VALUE`, over options.
pub(super) fn lay_over(options: &mut Value, settings: &[String]) -> Result<()> {
    for setting in settings {
        let (option, value) = setting
            .split_once('=')
            .with_context(|| format!("--set {setting}: not OPTION=VALUE"))?;
        options::merge(options, options::nested(option.trim(), value.trim()));
    }
    Ok(())
}

/// Reads a sheet document.
pub(super) fn sheet_document(path: &Path) -> Result<SheetDocument> {
    let text = fs::read_to_string(path).with_context(|| path.display().to_string())?;
    let mut json = serde_json::Deserializer::from_str(&text);
    serde_path_to_error::deserialize(&mut json)
        .with_context(|| format!("{} is no sheet document", path.display()))
}
