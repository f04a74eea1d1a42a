use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A part of the pipeline, in the order of the work.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
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
