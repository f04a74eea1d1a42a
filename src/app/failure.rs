//! Why a command ended without its result.

use std::process::ExitCode;

/// Why a command ended without its result.
#[derive(Debug)]
pub(super) enum Failure {
    /// What the user gave can't be used.
    Input(anyhow::Error),
    /// The command line or the settings are wrong.
    Usage(anyhow::Error),
    /// Something of ours, or of the machine, broke.
    Internal(anyhow::Error),
}

impl Failure {
    /// Prints the reason and gives the exit status.
    pub(super) fn report(self) -> ExitCode {
        let (error, status) = match self {
            Self::Input(error) => (error, 1),
            Self::Usage(error) => (error, 2),
            Self::Internal(error) => (error, 3),
        };
        eprintln!("turnaround: {error:#}");
        ExitCode::from(status)
    }
}
