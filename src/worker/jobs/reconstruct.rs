use serde::Deserialize;

use super::sink::AttemptSink;
use crate::draft::{self, DraftError};
use crate::jobs::Failure;
use crate::pipeline::{Observer, Progress};
use crate::sheet::{ImageLimits, RECONSTRUCTION, ReconstructionPayload};
use crate::worker::{Attempt, Work, WorkError};

/// Reconstructs a sheet from the job's inputs.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reconstruct {
    /// What one drawing may cost.
    pub limits: ImageLimits,
}

impl Work for Reconstruct {
    fn kind(&self) -> &'static str {
        RECONSTRUCTION
    }

    fn run(&self, attempt: &Attempt<'_>) -> Result<(), WorkError> {
        let payload = ReconstructionPayload::deserialize(&attempt.job().payload)
            .map_err(|error| WorkError::Broken(format!("unreadable payload: {error}")))?;
        draft::produce(
            &payload.document,
            &|name| attempt.read(name),
            &self.limits,
            attempt.threads(),
            &Watch(attempt),
            &mut AttemptSink(attempt),
        )?;
        Ok(())
    }
}

/// Lets the pool watch and stop the reconstruction.
struct Watch<'a>(&'a Attempt<'a>);

impl Observer for Watch<'_> {
    fn progress(&self, progress: Progress) {
        let fraction = progress.fraction;
        match serde_json::to_value(progress) {
            Ok(progress) => self.0.report(fraction, progress),
            Err(error) => tracing::warn!(%error, "progress can't be written as JSON"),
        }
    }

    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }
}

impl From<DraftError> for WorkError {
    fn from(error: DraftError) -> Self {
        match error {
            DraftError::Input { code, detail } => {
                Self::Input(Failure { code: code.to_owned(), detail })
            }
            DraftError::Cancelled(_) => Self::Cancelled,
            DraftError::Io(error) => Self::Broken(error.to_string()),
            DraftError::Internal(detail) => Self::Broken(detail),
        }
    }
}
