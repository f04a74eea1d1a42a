//! Why there is no draft, as data.

use std::error::Error;
use std::io;

use picture::EncodeError;
use progress::Cancelled;
use turntable::export::ExportError;
use turntable::silhouette::SilhouetteError;
use turntable::solid::SolidError;
use uncalibrated::PipelineError;

use crate::failure_code::FailureCode;

/// Why there is no draft.
#[derive(Debug, thiserror::Error)]
pub enum DraftError {
    /// The input is to blame: trying again cannot help.
    #[error("{detail}")]
    Input {
        /// The kind of failure.
        code: FailureCode,
        /// What happened and how to mend it.
        detail: String,
    },
    /// Somebody asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Inputs could not be read or artifacts not be written.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// Our own fault.
    #[error(transparent)]
    Internal(Box<dyn Error + Send + Sync>),
}

impl DraftError {
    pub(super) fn input(code: FailureCode, detail: impl ToString) -> Self {
        Self::Input { code, detail: detail.to_string() }
    }

    pub(super) fn internal(source: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::Internal(source.into())
    }

    /// The condition and its kind's remedy in one sentence.
    fn with_remedy(code: FailureCode, condition: &dyn Error) -> Self {
        Self::input(code, format!("{condition}; {}", code.remedy()))
    }
}

impl From<EncodeError> for DraftError {
    fn from(error: EncodeError) -> Self {
        Self::internal(error)
    }
}

impl From<ExportError> for DraftError {
    fn from(error: ExportError) -> Self {
        match error {
            ExportError::Encode(error) => error.into(),
            ExportError::Cancelled(cancelled) => cancelled.into(),
        }
    }
}

impl From<PipelineError> for DraftError {
    fn from(error: PipelineError) -> Self {
        let code = match &error {
            PipelineError::Cancelled(cancelled) => return Self::Cancelled(*cancelled),
            PipelineError::NoThreads { .. } => return Self::internal(error),
            PipelineError::TooFewViews { .. } => FailureCode::TooFewViews,
            PipelineError::SizesDiffer { .. } => FailureCode::SizesDiffer,
            PipelineError::NoUsablePair { .. } => FailureCode::NoUsablePair,
        };
        Self::input(code, error)
    }
}

impl From<turntable::DraftError> for DraftError {
    fn from(error: turntable::DraftError) -> Self {
        use turntable::DraftError as Found;
        match error {
            Found::Cancelled(cancelled) => Self::Cancelled(cancelled),
            Found::Depth(error) => Self::internal(error),
            Found::TooFewLevelViews { .. } => Self::input(FailureCode::TooFewViews, error),
            Found::Views(error) => Self::input(FailureCode::InvalidViews, error),
            Found::Hole(error) => Self::input(FailureCode::InvalidAzimuth, error),
            Found::HoleElevation(error) => Self::input(FailureCode::InvalidAzimuth, error),
            Found::Silhouette(error) => {
                let code = match error {
                    SilhouetteError::TooSmall { .. } => FailureCode::BlankView,
                    SilhouetteError::CoversImage { .. } => FailureCode::NoPaper,
                };
                Self::with_remedy(code, &error)
            }
            Found::Solid(error) => {
                let code = match error {
                    SolidError::Cancelled(cancelled) => return Self::Cancelled(cancelled),
                    SolidError::Prior(_) => return Self::internal(error),
                    SolidError::NoCommonRow => FailureCode::NoCommonRow,
                    SolidError::Empty => FailureCode::ContradictingViews,
                };
                Self::with_remedy(code, &error)
            }
        }
    }
}
