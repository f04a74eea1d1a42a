//! Reconstruction: a sheet in, depth, clouds and a mesh out.
//!
//! Stages are pure functions; only this module calls several of them.

mod correspond;
mod edit;
mod merge;
mod observer;
mod pair;
mod pairs;
mod probe;
mod quality;
mod reconstruct;
mod report;
mod search;
mod tracker;
mod variation;

pub use correspond::{MatchedPoints, TryReport};
pub use edit::EditReport;
pub use merge::{LinkOutcome, MergeLink, Merged};
pub use observer::{Cancelled, Observer, Progress, Silent, Stage};
pub use pair::{PairFailure, PairOutcome, PairResult, rectified_pair};
pub use pairs::{PairName, SkippedPair};
pub use probe::{Side, probe_map, probe_pair};
pub use quality::FiveMetrics;
pub use reconstruct::{PipelineError, Reconstruction, ViewResult, check_size, reconstruct};
pub use report::{
    HullReport, MeanMetrics, Metrics, PairMetrics, ValueRange, ViewMetrics, measure, pair_metrics,
};
pub use search::{DisparityGrid, DisparityTry, best_try, search_disparity};

#[cfg(test)]
mod tests;
