//! The work of jobs that reconstruct a sheet.

use std::fmt::Display;

use serde::Deserialize;

use super::failure;
use super::sink::AttemptSink;
use super::watch::Watch;
use crate::draft::{self, DraftError, DraftLimits};
use crate::kinds::{MATCHES_INPUT, RECONSTRUCTION, ReconstructionPayload, ReconstructionSummary};
use crate::worker::{Attempt, Work, WorkError};

/// Reconstructs a sheet from the job's inputs.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reconstruct {
    /// What the drawings and the whole may cost.
    pub limits: DraftLimits,
}

impl Work for Reconstruct {
    fn kind(&self) -> &'static str {
        RECONSTRUCTION
    }

    fn run(&self, attempt: &dyn Attempt) -> Result<(), WorkError> {
        let unreadable = |error: &dyn Display| WorkError::Broken(format!("payload: {error}"));
        let mut payload = ReconstructionPayload::deserialize(&attempt.task().payload)
            .map_err(|error| unreadable(&error))?;
        if payload.has_matches {
            payload.document.matches = serde_json::from_slice(&attempt.read(MATCHES_INPUT)?)
                .map_err(|error| unreadable(&error))?;
        }
        let found = draft::produce(
            &payload.document,
            &|name| attempt.read(name),
            &self.limits,
            attempt.task().threads,
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
            DraftError::Io(error) => error.into(),
            DraftError::Internal(error) => Self::Broken(error.to_string()),
        }
    }
}
