//! Reports progress of the pipeline's stages.

use std::sync::{Mutex, PoisonError};

use progress::{Cancelled, Observer, Progress, Stage};

/// Counts a stage's steps, from several threads, and tells the observer, in
/// order and never backwards.
pub(super) struct Tracker<'a> {
    observer: &'a dyn Observer,
    stage: Stage,
    units: usize,
    steps: usize,
    /// Steps and units done.
    done: Mutex<(usize, usize)>,
}

impl<'a> Tracker<'a> {
    /// A stage of `units` with `steps_per_unit` each.
    pub(crate) fn new(
        observer: &'a dyn Observer,
        stage: Stage,
        units: usize,
        steps_per_unit: usize,
    ) -> Self {
        let steps = units * steps_per_unit;
        Self { observer, stage, units, steps, done: Mutex::new((0, 0)) }
    }

    /// A step of a unit is done.
    pub(crate) fn step(&self) -> Result<(), Cancelled> {
        self.advance(1, None)
    }

    /// A unit is done, with its last `steps`.
    pub(crate) fn finish(&self, unit: String, steps: usize) -> Result<(), Cancelled> {
        self.advance(steps, Some(unit))
    }

    /// `Err` if somebody asked to stop.
    pub(crate) fn check(&self) -> Result<(), Cancelled> {
        self.observer.check()
    }

    fn advance(&self, steps: usize, finished: Option<String>) -> Result<(), Cancelled> {
        // Held while telling, so that reports leave in order.
        let mut done = self.done.lock().unwrap_or_else(PoisonError::into_inner);
        done.0 += steps;
        done.1 += usize::from(finished.is_some());
        let share = done.0 as f64 / self.steps.max(1) as f64;
        let (start, end) = share_of_work(self.stage);
        self.observer.progress(Progress {
            stage: self.stage,
            done: done.1,
            total: self.units,
            unit: finished,
            fraction: start + (end - start) * share.min(1.0),
        });
        self.observer.check()
    }
}

/// Where a stage begins and ends within the pipeline's work, as measured on
/// sheets of 19 views.
fn share_of_work(stage: Stage) -> (f64, f64) {
    match stage {
        Stage::Decode => (0.0, 0.0),
        Stage::Features => (0.0, 0.1),
        Stage::Pairs => (0.1, 0.9),
        Stage::Combine => (0.9, 0.93),
        Stage::Cloud => (0.93, 0.96),
        Stage::Merge => (0.96, 0.97),
        Stage::Hull => (0.97, 1.0),
        // Stages of another method, and what follows this one's.
        Stage::Views | Stage::Silhouettes | Stage::Depth | Stage::Solid | Stage::Export => {
            (1.0, 1.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Recorder(Mutex<Vec<Progress>>);

    impl Observer for Recorder {
        fn progress(&self, progress: Progress) {
            self.0.lock().unwrap().push(progress);
        }

        fn is_cancelled(&self) -> bool {
            false
        }
    }

    #[test]
    fn progress_from_many_threads_never_goes_back() {
        let recorder = Recorder(Mutex::default());
        let tracker = Tracker::new(&recorder, Stage::Pairs, 8, 3);
        std::thread::scope(|scope| {
            for unit in 0..8 {
                let tracker = &tracker;
                scope.spawn(move || {
                    tracker.step().unwrap();
                    tracker.finish(format!("{unit}"), 2).unwrap();
                });
            }
        });
        let seen = recorder.0.into_inner().unwrap();
        assert_eq!(seen.len(), 16);
        assert!(seen.windows(2).all(|w| w[0].fraction <= w[1].fraction && w[0].done <= w[1].done));
        assert_eq!((seen[15].done, seen[15].fraction), (8, 0.9));
    }
}
