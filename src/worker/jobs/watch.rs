//! How the pool watches and stops work.

use progress::{Observer, Progress};

use crate::worker::Attempt;

/// Lets the pool watch and stop the work.
pub(super) struct Watch<'a>(pub &'a dyn Attempt);

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
