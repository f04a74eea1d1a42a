//! What several commands read from the command line and from folders.

use std::fs;
use std::io::{self, Read};
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

/// The largest file that a sheet names.
pub(super) const MAX_FILE_BYTES: u64 = 512 << 20;

/// Reads a file that a document names: a regular one of at most
/// [`MAX_FILE_BYTES`]. Devices and pipes never end, or never begin.
pub(super) fn read_file(path: &Path) -> io::Result<Vec<u8>> {
    let refuse = |what: String| Err(io::Error::new(io::ErrorKind::InvalidInput, what));
    let found = fs::metadata(path)?;
    if found.is_dir() {
        return refuse("is a folder; name a file in it".to_owned());
    } else if !found.is_file() {
        return refuse("is no regular file; name one with the picture in it".to_owned());
    } else if found.len() > MAX_FILE_BYTES {
        return refuse(format!("has {} bytes, over the limit of {MAX_FILE_BYTES}", found.len()));
    }
    let mut bytes = Vec::with_capacity(usize::try_from(found.len()).unwrap_or(0));
    // A file may grow while it is read.
    fs::File::open(path)?.take(MAX_FILE_BYTES).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Reads a sheet document.
pub(super) fn sheet_document(path: &Path) -> Result<SheetDocument> {
    let text = fs::read_to_string(path).with_context(|| path.display().to_string())?;
    let mut json = serde_json::Deserializer::from_str(&text);
    serde_path_to_error::deserialize(&mut json)
        .with_context(|| format!("{} is no sheet document", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_files_that_end_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
        assert!(made.success());
        for (path, told) in [
            (Path::new("/dev/zero"), "no regular file"),
            (&pipe, "no regular file"),
            (folder.path(), "is a folder"),
        ] {
            let error = read_file(path).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::InvalidInput);
            assert!(error.to_string().contains(told), "{error}");
        }
        let large = folder.path().join("large");
        fs::File::create(&large).unwrap().set_len(MAX_FILE_BYTES + 1).unwrap();
        assert!(read_file(&large).unwrap_err().to_string().contains("over the limit"));
        fs::write(&large, b"drawing").unwrap();
        assert_eq!(read_file(&large).unwrap(), b"drawing");
    }
}
