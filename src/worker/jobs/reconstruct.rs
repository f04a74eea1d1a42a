//! The work of jobs that reconstruct a sheet.

use serde::Deserialize;

use super::failure;
use super::sink::AttemptSink;
use super::watch::Watch;
use crate::draft::{self, DraftError};
use crate::kinds::{RECONSTRUCTION, ReconstructionPayload, ReconstructionSummary};
use crate::worker::{Attempt, Work, WorkError};
use picture::ImageLimits;

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
        let found = draft::produce(
            &payload.document,
            &|name| attempt.read(name),
            &self.limits,
            attempt.threads(),
            &Watch(attempt),
            &mut AttemptSink(attempt),
        )?;
        let summary = ReconstructionSummary { fit: found.fit, warnings: found.warnings };
        let summary = serde_json::to_value(summary);
        attempt.summarise(summary.map_err(|error| WorkError::Broken(error.to_string()))?);
        Ok(())
    }
}

impl From<DraftError> for WorkError {
    fn from(error: DraftError) -> Self {
        match error {
            DraftError::Input { code, detail } => Self::Input(failure(code, detail)),
            DraftError::Cancelled(_) => Self::Cancelled,
            DraftError::Io(error) => Self::Broken(error.to_string()),
            DraftError::Internal(error) => Self::Broken(error.to_string()),
        }
    }
}
