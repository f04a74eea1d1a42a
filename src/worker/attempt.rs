//! An attempt whose work runs in this process.

use std::io;
use std::sync::{Mutex, OnceLock};
use std::time::Instant;

use bytes::Bytes;
use serde_json::Value;
use tokio::runtime::Handle;
use tokio::sync::watch;

use super::metrics::{self, Stages};
use super::signal::Signal;
use super::uploads::Uploads;
use super::{Attempt, Task};
use artifacts::ArtifactWriter;
use jobs::bytes::{ByteStore, Key};

/// An attempt that reads and writes the pool's stores.
pub(super) struct PoolAttempt<'a> {
    pub task: Task,
    pub bytes: &'a ByteStore,
    pub runtime: &'a Handle,
    pub signal: &'a Signal,
    pub uploads: &'a Uploads,
    pub progress: ProgressSender,
    pub summary: OnceLock<Value>,
    pub stages: Stages,
}

impl Attempt for PoolAttempt<'_> {
    fn task(&self) -> &Task {
        &self.task
    }

    fn is_cancelled(&self) -> bool {
        self.signal.reason().is_some()
    }

    fn summarise(&self, summary: Value) {
        let _ = self.summary.set(summary);
    }

    fn read(&self, name: &str) -> io::Result<Vec<u8>> {
        let key = Key::Input { job: self.task.job, name };
        let begun = Instant::now();
        let bytes = self.runtime.block_on(self.bytes.get(&key)).map_err(io::Error::from)?;
        metrics::store("get", begun, bytes.len() as u64);
        Ok(bytes.into())
    }

    fn emit(&self, name: &str, media_type: &str, bytes: Bytes) -> io::Result<()> {
        self.uploads.add(name, media_type, bytes)
    }

    fn create(&self, name: &str, media_type: &str) -> io::Result<Box<dyn ArtifactWriter>> {
        Ok(Box::new(self.uploads.create(name, media_type)?))
    }

    fn report(&self, fraction: f64, progress: Value) {
        self.stages.see(&progress);
        self.progress.report(fraction, progress);
    }
}

/// The end of the progress channel that the work holds.
pub(super) struct ProgressSender {
    furthest: Mutex<f64>,
    latest: watch::Sender<Option<Value>>,
}

impl ProgressSender {
    pub(super) fn new() -> (Self, watch::Receiver<Option<Value>>) {
        let (latest, receiver) = watch::channel(None);
        (Self { furthest: Mutex::new(0.0), latest }, receiver)
    }

    fn report(&self, fraction: f64, progress: Value) {
        let mut furthest = self.furthest.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if fraction >= *furthest {
            *furthest = fraction;
            // Sent under the lock, so that reports of two threads keep order.
            self.latest.send_replace(Some(progress));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_never_goes_back() {
        let (sender, receiver) = ProgressSender::new();
        for (fraction, latest) in [(0.25, 1), (0.5, 2), (0.4, 2), (0.5, 4), (f64::NAN, 4)] {
            sender.report(
                fraction,
                if fraction == 0.5 && latest == 4 { 4.into() } else { latest.into() },
            );
            assert_eq!(*receiver.borrow(), Some(latest.into()));
        }
    }
}
