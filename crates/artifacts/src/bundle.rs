//! All artifacts of a job as one zip archive.

use std::io::{self, Write};

use zip::write::{SimpleFileOptions, StreamWriter};
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::artifact::Artifact;

/// A zip archive that grows artifact by artifact, written as it grows. It holds
/// no clock time, so the same artifacts in the same order are the same bytes.
pub struct Bundle<W: Write> {
    writer: ZipWriter<StreamWriter<W>>,
}

impl<W: Write> Bundle<W> {
    /// An empty archive that is written to `inner`.
    pub fn new(inner: W) -> Self {
        Self { writer: ZipWriter::new_stream(inner) }
    }

    /// Adds a file; pictures, which are compressed already, are stored.
    pub fn add(&mut self, artifact: &Artifact) -> io::Result<()> {
        let options = SimpleFileOptions::default()
            .last_modified_time(DateTime::default())
            .large_file(artifact.bytes.len() > u32::MAX as usize)
            .unix_permissions(0o644);
        let options = if artifact.media_type == "image/png" {
            options.compression_method(CompressionMethod::Stored)
        } else {
            // The fastest level: float maps and clouds hardly shrink more.
            options.compression_method(CompressionMethod::Deflated).compression_level(Some(1))
        };
        self.writer.start_file(artifact.name.as_str(), options)?;
        self.writer.write_all(&artifact.bytes)
    }

    /// Writes the directory; returns what was written to.
    pub fn finish(self) -> io::Result<W> {
        Ok(self.writer.finish()?.into_inner())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ArtifactName;
    use std::io::{Cursor, Read};

    fn bundle() -> Vec<u8> {
        let mut bundle = Bundle::new(Vec::new());
        bundle.add(&Artifact::new(ArtifactName::Metrics, b"{}".to_vec())).unwrap();
        bundle.add(&Artifact::new(ArtifactName::Thumbnail, vec![7; 1000])).unwrap();
        bundle.finish().unwrap()
    }

    #[test]
    fn files_come_back_and_bytes_repeat() {
        let bytes = bundle();
        assert_eq!(bytes, bundle());
        let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
        assert_eq!(archive.len(), 2);
        let mut file = archive.by_name("thumbnail.png").unwrap();
        let mut content = Vec::new();
        file.read_to_end(&mut content).unwrap();
        assert_eq!(content, vec![7; 1000]);
    }
}
