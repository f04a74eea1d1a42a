//! What a kind of job must do, and what an attempt can read and write.

use std::io;
use std::sync::{Mutex, OnceLock};

use bytes::Bytes;
use serde_json::Value;
use tokio::runtime::Handle;
use tokio::sync::watch;

use super::signal::Signal;
use super::uploads::{Upload, Uploads};
use jobs::bytes::{ByteStore, Key};
use jobs::{Failure, Job};

/// A kind of job. The pool knows nothing else about the work.
pub trait Work: Send + Sync {
    /// The kind of the jobs this work is for.
    fn kind(&self) -> &'static str;

    /// Does the job, on a thread that may block. It should look at
    /// [`Attempt::is_cancelled`] several times a second.
    ///
    /// A panic counts as [`WorkError::Broken`].
    fn run(&self, attempt: &Attempt<'_>) -> Result<(), WorkError>;
}

/// Why work did not come to its end.
#[derive(Debug, thiserror::Error)]
pub enum WorkError {
    /// The input is to blame: trying again would not help.
    #[error("{}: {}", .0.code, .0.detail)]
    Input(Failure),
    /// [`Attempt::is_cancelled`] was seen.
    #[error("cancelled")]
    Cancelled,
    /// Something broke that may hold next time.
    #[error("{0}")]
    Broken(String),
    /// The machine is in trouble, such as a full disk or no more files to open:
    /// the job waits until that is over. The cause is for the log alone.
    #[error("{0}")]
    Troubled(String),
}

/// Of reading inputs and storing artifacts: what is not asked wrongly is
/// trouble of the machine.
impl From<io::Error> for WorkError {
    fn from(error: io::Error) -> Self {
        use io::ErrorKind::{AlreadyExists, InvalidData, InvalidInput, NotFound, UnexpectedEof};
        match error.kind() {
            AlreadyExists | InvalidData | InvalidInput | NotFound | UnexpectedEof => {
                Self::Broken(error.to_string())
            }
            _ => Self::Troubled(error.to_string()),
        }
    }
}

/// One attempt at a job: what its work can read and write.
pub struct Attempt<'a> {
    pub(super) job: &'a Job,
    pub(super) threads: usize,
    pub(super) bytes: &'a ByteStore,
    pub(super) runtime: &'a Handle,
    pub(super) signal: &'a Signal,
    pub(super) uploads: &'a Uploads,
    pub(super) progress: ProgressSender,
    pub(super) summary: OnceLock<Value>,
}

impl Attempt<'_> {
    /// The job as it was claimed.
    pub fn job(&self) -> &Job {
        self.job
    }

    /// Threads the work may compute with.
    pub fn threads(&self) -> usize {
        self.threads
    }

    /// Whether the work should stop now: cancelled, shut down or lease lost.
    pub fn is_cancelled(&self) -> bool {
        self.signal.reason().is_some()
    }

    /// Says what the work came to, in a few values; the first word counts.
    pub fn summarise(&self, summary: Value) {
        let _ = self.summary.set(summary);
    }

    /// What the work said it came to.
    pub(super) fn into_summary(self) -> Option<Value> {
        self.summary.into_inner()
    }

    /// An input of the job.
    ///
    /// # Errors
    /// `NotFound` if the job has no such input; what the byte store says.
    pub fn read(&self, name: &str) -> io::Result<Vec<u8>> {
        let key = Key::Input { job: self.job.id, name };
        let bytes = self.runtime.block_on(self.bytes.get(&key)).map_err(io::Error::from)?;
        Ok(bytes.into())
    }

    /// Hands over an artifact. It is hashed and stored while the work goes on;
    /// an error of that ends the attempt later.
    ///
    /// # Errors
    /// `AlreadyExists` if the attempt has emitted this name; `InvalidInput` if
    /// it can't be stored under it.
    pub fn emit(&self, name: &str, media_type: &str, bytes: impl Into<Bytes>) -> io::Result<()> {
        self.uploads.add(name, media_type, bytes.into())
    }

    /// Begins an artifact that is written piece by piece: hashed and stored as
    /// it grows.
    ///
    /// # Errors
    /// As [`Self::emit`].
    pub fn create(&self, name: &str, media_type: &str) -> io::Result<Upload> {
        self.uploads.create(name, media_type)
    }

    /// Reports progress, quickly: it is written when there is time, the latest
    /// first. `fraction` is the share of the whole work done; a report that
    /// falls behind an earlier one is dropped.
    pub fn report(&self, fraction: f64, progress: Value) {
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
