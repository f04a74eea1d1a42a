//! Stores artifacts as those of a job's attempt.

use std::io;

use crate::worker::{Attempt, Upload};
use artifacts::{Artifact, ArtifactName, ArtifactSink, ArtifactWriter};

/// Files become the attempt's artifacts.
pub(super) struct AttemptSink<'a, 'b>(pub &'a Attempt<'b>);

impl ArtifactSink for AttemptSink<'_, '_> {
    fn put(&mut self, artifact: Artifact) -> io::Result<()> {
        self.0.emit(&artifact.name, artifact.media_type, artifact.bytes)
    }

    fn create(&mut self, name: ArtifactName) -> io::Result<Box<dyn ArtifactWriter>> {
        Ok(Box::new(self.0.create(&name.to_string(), name.media_type())?))
    }
}

impl ArtifactWriter for Upload {
    fn finish(self: Box<Self>) -> io::Result<()> {
        Upload::finish(*self)
    }
}
