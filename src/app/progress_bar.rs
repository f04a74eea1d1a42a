//! Progress on the terminal.

use indicatif::{ProgressBar, ProgressStyle};
use progress::{Observer, Progress};

/// A progress bar on the terminal; silent elsewhere.
pub(super) struct Bar(ProgressBar);

impl Bar {
    const STEPS: u64 = 1000;

    pub(super) fn new() -> Self {
        let style = ProgressStyle::with_template("{bar:40} {percent:>3} % {msg}")
            .expect("the template is valid");
        Self(ProgressBar::new(Self::STEPS).with_style(style))
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

impl Observer for Bar {
    fn progress(&self, progress: Progress) {
        let stage = serde_json::to_value(progress.stage).unwrap_or_default();
        let unit = progress.unit.as_deref().unwrap_or_default();
        self.0.set_message(format!("{} {unit}", stage.as_str().unwrap_or_default()));
        self.0.set_position((progress.fraction * Self::STEPS as f64) as u64);
    }

    fn is_cancelled(&self) -> bool {
        false
    }
}
