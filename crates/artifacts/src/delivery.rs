//! Stores and bundles artifacts on a thread of its own while the next are made.

use std::io;
use std::panic::resume_unwind;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{Scope, ScopedJoinHandle};

use crate::{Artifact, ArtifactName, ArtifactSink, Bundle};

/// Artifacts that may wait to be bundled and stored.
const WAITING: usize = 4;

/// What the thread gives back when all artifacts and their bundle are out.
pub type Delivered<'a> = io::Result<&'a mut dyn ArtifactSink>;

/// Bundles artifacts and hands them over in the order they come, on a thread of
/// its own: the next ones are made meanwhile, and the bundle is written as it
/// grows.
pub struct Delivery<'scope> {
    /// `None` is the last.
    post: SyncSender<Option<Artifact>>,
    thread: ScopedJoinHandle<'scope, Delivered<'scope>>,
}

impl<'scope> Delivery<'scope> {
    /// Starts a thread in `scope` that stores what is sent in `sink`.
    pub fn start(scope: &'scope Scope<'scope, '_>, sink: &'scope mut dyn ArtifactSink) -> Self {
        let (post, waiting) = sync_channel(WAITING);
        Self { post, thread: scope.spawn(move || deliver(waiting, sink)) }
    }

    /// Takes an artifact, waiting while too many wait. `false` if the thread
    /// has given up: [`Self::finish`] says why.
    pub fn send(&self, artifact: Artifact) -> bool {
        self.post.send(Some(artifact)).is_ok()
    }

    /// Closes the bundle and waits until everything is out.
    ///
    /// # Errors
    /// The first one of bundling and handing over.
    pub fn finish(self) -> Delivered<'scope> {
        // If the thread has given up, it says so itself.
        let _ = self.post.send(None);
        self.thread.join().unwrap_or_else(|panic| resume_unwind(panic))
    }
}

fn deliver(waiting: Receiver<Option<Artifact>>, sink: &mut dyn ArtifactSink) -> Delivered<'_> {
    let mut bundle = Bundle::new(sink.create(ArtifactName::Bundle)?);
    while let Some(artifact) = waiting.recv().map_err(|_| abandoned())? {
        // Stored while it is compressed.
        sink.put(artifact.clone())?;
        bundle.add(&artifact)?;
    }
    bundle.finish()?.finish()?;
    Ok(sink)
}

fn abandoned() -> io::Error {
    io::Error::other("artifacts were abandoned before the last")
}
