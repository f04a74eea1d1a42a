//! What a kind of job must do, and what an attempt can read and write.

use std::io;

use bytes::Bytes;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use artifacts::ArtifactWriter;
use jobs::{Claim, Failure, JobId, TenantName};

/// A kind of job. The pool knows nothing else about the work.
pub trait Work: Send + Sync {
    /// The kind of the jobs this work is for.
    fn kind(&self) -> &'static str;

    /// Does the job, on a thread that may block. It should look at
    /// [`Attempt::is_cancelled`] several times a second.
    ///
    /// A panic counts as [`WorkError::Broken`].
    fn run(&self, attempt: &dyn Attempt) -> Result<(), WorkError>;
}

/// Why work did not come to its end.
#[derive(Debug, thiserror::Error, Serialize, Deserialize)]
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
    /// The process that did the work died, with how it died and its last words.
    #[error("{0}")]
    Crashed(String),
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

/// What an attempt is about.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Task {
    /// Name of the job.
    pub job: JobId,
    /// The claim's attempt, from 1.
    pub attempt: u32,
    /// Whose the job is.
    pub tenant: TenantName,
    /// The request that it came with.
    pub request_id: Option<String>,
    /// Which work it is.
    pub kind: String,
    /// What the work needs, apart from stored bytes.
    pub payload: Value,
    /// Threads the work may compute with.
    pub threads: usize,
}

impl Task {
    pub(super) fn new(claim: Claim, threads: usize) -> Self {
        let (job, attempt) = (claim.job, claim.attempt);
        let (tenant, request_id) = (job.tenant, job.request_id);
        let (kind, payload) = (job.kind, job.payload);
        Self { job: job.id, attempt, tenant, request_id, kind, payload, threads }
    }
}

/// One attempt at a job: what its work can read and write. Used by several threads.
pub trait Attempt: Sync {
    /// What it is about.
    fn task(&self) -> &Task;

    /// Whether the work should stop now: cancelled, shut down or lease lost.
    fn is_cancelled(&self) -> bool;

    /// Says what the work came to, in a few values; the first word counts.
    fn summarise(&self, summary: Value);

    /// An input of the job.
    ///
    /// # Errors
    /// `NotFound` if the job has no such input; what the byte store says.
    fn read(&self, name: &str) -> io::Result<Vec<u8>>;

    /// Hands over an artifact. It is hashed and stored while the work goes on;
    /// an error of that ends the attempt later.
    ///
    /// # Errors
    /// `AlreadyExists` if the attempt has emitted this name; `InvalidInput` if
    /// it can't be stored under it.
    fn emit(&self, name: &str, media_type: &str, bytes: Bytes) -> io::Result<()>;

    /// Begins an artifact that is written piece by piece: hashed and stored as
    /// it grows. Unless it is finished, the attempt cannot succeed.
    ///
    /// # Errors
    /// As [`Self::emit`].
    fn create(&self, name: &str, media_type: &str) -> io::Result<Box<dyn ArtifactWriter>>;

    /// Reports progress, quickly: it is written when there is time, the latest
    /// first. `fraction` is the share of the whole work done; a report that
    /// falls behind an earlier one is dropped.
    fn report(&self, fraction: f64, progress: Value);
}
