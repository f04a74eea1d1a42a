//! How far long work is, and whether it should stop.
//!
//! Every loop that can take more than a moment is given an [`Observer`]: it
//! reports units of work and asks between them whether to go on.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A part of the pipeline, in the order of the work.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "the schema describes it")]
pub enum Stage {
    /// The views of a sheet that is drawn.
    Views,
    Decode,
    Features,
    /// Matching, epipolar geometry, rectification and disparity of each pair.
    Pairs,
    Combine,
    Cloud,
    Merge,
    Hull,
    /// The area of the subject in each view, and how well the views agree.
    Silhouettes,
    /// Depth from the lines of neighbouring views.
    Depth,
    /// The closed surface from silhouettes, lines and depth.
    Solid,
    Export,
}

/// How far an attempt is. Never goes back within an attempt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[expect(missing_docs, reason = "the schema describes it")]
pub struct Progress {
    pub stage: Stage,
    /// Units of the stage that are done, of `total`.
    pub done: usize,
    pub total: usize,
    /// The unit done last, such as the pair `40-45`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Share of the whole work done, 0 to 1.
    pub fraction: f64,
}

/// Somebody asked to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

/// Who watches a reconstruction and may stop it. Called from several threads.
pub trait Observer: Sync {
    /// A unit of work is done.
    fn progress(&self, progress: Progress);

    /// Asked between units of work.
    fn is_cancelled(&self) -> bool;

    /// `Err` if the work should stop.
    fn check(&self) -> Result<(), Cancelled> {
        if self.is_cancelled() { Err(Cancelled) } else { Ok(()) }
    }
}

/// Nobody watches.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Observer for Silent {
    fn progress(&self, _: Progress) {}

    fn is_cancelled(&self) -> bool {
        false
    }
}

/// Asks another observer whether to stop, and tells it nothing: for work that
/// is done again.
pub struct Unreported<'a>(pub &'a dyn Observer);

impl Observer for Unreported<'_> {
    fn progress(&self, _: Progress) {}

    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }
}

/// Passes a part's progress on as its share of the whole work.
pub struct Share<'a> {
    whole: &'a dyn Observer,
    start: f64,
    end: f64,
}

impl<'a> Share<'a> {
    /// The part lies between the fractions `start` and `end` of `whole`.
    pub fn new(whole: &'a dyn Observer, start: f64, end: f64) -> Self {
        Self { whole, start, end }
    }
}

impl Observer for Share<'_> {
    fn progress(&self, mut progress: Progress) {
        progress.fraction = self.start + (self.end - self.start) * progress.fraction;
        self.whole.progress(progress);
    }

    fn is_cancelled(&self) -> bool {
        self.whole.is_cancelled()
    }
}

/// A stage of a known number of steps that follow one another.
pub struct Steps<'a> {
    observer: &'a dyn Observer,
    stage: Stage,
    total: usize,
}

impl<'a> Steps<'a> {
    /// A stage of `total` steps.
    pub fn new(observer: &'a dyn Observer, stage: Stage, total: usize) -> Self {
        Self { observer, stage, total }
    }

    /// `done` steps are done, `unit` the last of them.
    ///
    /// # Errors
    /// [`Cancelled`] if the work should stop.
    pub fn done(&self, done: usize, unit: &str) -> Result<(), Cancelled> {
        self.observer.progress(Progress {
            stage: self.stage,
            done,
            total: self.total,
            unit: (done > 0).then(|| unit.to_owned()),
            fraction: done as f64 / self.total.max(1) as f64,
        });
        self.observer.check()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    struct Log(Mutex<Vec<Progress>>);

    impl Observer for Log {
        fn progress(&self, progress: Progress) {
            self.0.lock().unwrap().push(progress);
        }

        fn is_cancelled(&self) -> bool {
            self.0.lock().unwrap().len() >= 2
        }
    }

    #[test]
    fn a_share_lies_within_the_whole_and_passes_cancelling_back() {
        let log = Log(Mutex::default());
        let share = Share::new(&log, 0.5, 0.75);
        let steps = Steps::new(&share, Stage::Depth, 4);
        assert_eq!(steps.done(0, "nothing"), Ok(()));
        assert_eq!(steps.done(2, "lines"), Err(Cancelled));
        let seen = log.0.into_inner().unwrap();
        let told: Vec<_> = seen.iter().map(|p| (p.unit.as_deref(), p.fraction)).collect();
        assert_eq!(told, [(None, 0.5), (Some("lines"), 0.625)]);
    }
}
