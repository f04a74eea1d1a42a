//! The method `uncalibrated`: a sheet in, depth, clouds and a hull out, by
//! epipolar geometry that is estimated from the drawings themselves
//! (Arys 2020, §3).
//!
//! [`reconstruct`] runs the stages in this order; each is a pure function in
//! [`vision`]:
//!
//! | stage | what it finds | source |
//! |---|---|---|
//! | features | keypoints and descriptors of each view | Arys 2020, §2.2.2, §2.2.3 |
//! | pairs | matches, F, rectification and disparity of neighbours | Hartley & Zisserman, 2nd ed., ch. 9-12; Hirschmüller 2008 |
//! | combine | one disparity and depth map a view | Arys 2020, §3.6 |
//! | cloud, merge | clouds joined by shared matches | Umeyama 1991; Arys 2020, §3.7 |
//! | hull | the convex hull of all points | Barber et al. 1996 |
//!
//! The only crate that needs OpenCV.

mod correspond;
mod edit;
mod export;
mod hull_glb;
mod merge;
pub mod options;
mod pair;
mod pair_files;
mod pairs;
mod probe;
mod quality;
mod reconstruct;
mod report;
mod search;
mod tracker;
mod variation;
pub mod vision;

pub use self::options::Options;
pub use correspond::{MatchedPoints, TryReport};
pub use edit::EditReport;
pub use export::{pair_files, view_files};
pub use hull_glb::{MeshExtras, hull_glb};
pub use merge::{LinkOutcome, MergeLink, Merged};
pub use pair::{PairFailure, PairOutcome, PairResult, rectified_pair};
pub use pairs::{PairName, SkippedPair};
pub use probe::{Side, probe_map, probe_pair};
pub use quality::FiveMetrics;
pub use reconstruct::{
    MINIMUM_VIEWS, PipelineError, Reconstruction, ViewResult, reconstruct, working_bytes,
};
pub use report::{
    HullReport, MeanMetrics, Metrics, PairMetrics, ViewMetrics, measure, pair_metrics,
};
pub use search::{DisparityGrid, DisparityTry, best_try, search_disparity};

#[cfg(test)]
mod tests;
