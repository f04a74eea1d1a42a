//! Stores artifacts as those of a job's attempt.

use std::io;

use crate::worker::Attempt;
use artifacts::{Artifact, ArtifactName, ArtifactSink, ArtifactWriter};

/// Files become the attempt's artifacts.
pub(super) struct AttemptSink<'a>(pub &'a dyn Attempt);

impl ArtifactSink for AttemptSink<'_> {
    fn put(&mut self, artifact: Artifact) -> io::Result<()> {
        self.0.emit(&artifact.name, artifact.media_type, artifact.bytes)
    }

    fn create(&mut self, name: ArtifactName) -> io::Result<Box<dyn ArtifactWriter>> {
        self.0.create(&name.to_string(), name.media_type())
    }
}
