//! How long each stage of a job takes.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde::Serialize;

use progress::{Observer, Progress, Share, Stage};

/// Where decoding ends and exporting begins within the whole work, as measured
/// on sheets of 19 views.
const DECODED: f64 = 0.02;
const COMPUTED: f64 = 0.7;

/// Wall time a stage took, seconds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct StageTime {
    pub stage: Stage,
    pub seconds: f64,
}

/// The timings artifact: the only one that differs between runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Timings {
    pub threads: usize,
    /// Decoding to the hull; no encoding of artifacts, no pictures of matches.
    pub compute_seconds: f64,
    /// Making, encoding and handing over artifacts.
    pub export_seconds: f64,
    pub stages: Vec<StageTime>,
}

/// Passes progress on, as part of the whole work, and notes when stages end.
pub(super) struct Timed<'a> {
    observer: &'a dyn Observer,
    started: Instant,
    ends: Mutex<Ends>,
}

#[derive(Default)]
struct Ends {
    /// When the last unit of each stage was done, in order.
    stages: Vec<(Stage, Duration)>,
    computed: Duration,
}

impl<'a> Timed<'a> {
    pub(super) fn new(observer: &'a dyn Observer) -> Self {
        Self { observer, started: Instant::now(), ends: Mutex::default() }
    }

    pub(super) fn decoding(&self) -> Share<'_> {
        Share::new(self, 0.0, DECODED)
    }

    pub(super) fn reconstructing(&self) -> Share<'_> {
        Share::new(self, DECODED, COMPUTED)
    }

    pub(super) fn exporting(&self) -> Share<'_> {
        Share::new(self, COMPUTED, 1.0)
    }

    /// Computing is over; what follows is export.
    pub(super) fn computed(&self) {
        self.ends().computed = self.started.elapsed();
    }

    pub(super) fn timings(&self, threads: usize) -> Timings {
        let total = self.started.elapsed();
        let ends = self.ends();
        let begins = [Duration::ZERO].into_iter().chain(ends.stages.iter().map(|(_, end)| *end));
        let stages = ends.stages.iter().zip(begins).map(|((stage, end), begin)| StageTime {
            stage: *stage,
            seconds: end.saturating_sub(begin).as_secs_f64(),
        });
        Timings {
            threads,
            compute_seconds: ends.computed.as_secs_f64(),
            export_seconds: total.saturating_sub(ends.computed).as_secs_f64(),
            stages: stages.collect(),
        }
    }

    fn ends(&self) -> std::sync::MutexGuard<'_, Ends> {
        self.ends.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Observer for Timed<'_> {
    fn progress(&self, progress: Progress) {
        let now = self.started.elapsed();
        {
            let mut ends = self.ends();
            match ends.stages.last_mut().filter(|(stage, _)| *stage == progress.stage) {
                Some((_, end)) => *end = now,
                None => ends.stages.push((progress.stage, now)),
            }
        }
        self.observer.progress(progress);
    }

    fn is_cancelled(&self) -> bool {
        self.observer.is_cancelled()
    }
}
