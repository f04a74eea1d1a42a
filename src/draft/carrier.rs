use std::panic::resume_unwind;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{Scope, ScopedJoinHandle};

use super::{DraftError, EmitArtifact};
use crate::export::{Artifact, Bundle};

/// Artifacts that may wait to be bundled and stored.
const WAITING: usize = 4;

/// What the thread gives back when all artifacts are out.
pub type Delivered<'a> = Result<(Bundle, EmitArtifact<'a>), DraftError>;

/// Bundles and emits artifacts in the order they come, on a thread of its own:
/// the next ones are made meanwhile.
pub struct Carrier<'scope> {
    post: SyncSender<Artifact>,
    thread: ScopedJoinHandle<'scope, Delivered<'scope>>,
}

impl<'scope> Carrier<'scope> {
    pub fn start(scope: &'scope Scope<'scope, '_>, emit: EmitArtifact<'scope>) -> Self {
        let (post, waiting) = sync_channel(WAITING);
        Self { post, thread: scope.spawn(move || carry(waiting, emit)) }
    }

    /// Takes an artifact, waiting while too many wait. `false` if the thread
    /// has given up: [`Self::finish`] says why.
    pub fn send(&self, artifact: Artifact) -> bool {
        self.post.send(artifact).is_ok()
    }

    /// Waits until everything is out.
    ///
    /// # Errors
    /// The first one of bundling and emitting.
    pub fn finish(self) -> Delivered<'scope> {
        drop(self.post);
        self.thread.join().unwrap_or_else(|panic| resume_unwind(panic))
    }
}

fn carry(waiting: Receiver<Artifact>, emit: EmitArtifact<'_>) -> Delivered<'_> {
    let mut bundle = Bundle::default();
    for artifact in waiting {
        bundle.add(&artifact)?;
        emit(artifact)?;
    }
    Ok((bundle, emit))
}
