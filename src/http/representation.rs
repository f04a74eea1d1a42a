//! Jobs as clients see them.

use std::collections::BTreeMap;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;
use uuid::Uuid;

use super::openapi::options_reference;
use super::reconstructions::Reconstructions;
use super::resource::Resource;
use crate::kinds::{ReconstructionPayload, ReconstructionSummary};
use frames::Azimuth;
use jobs::{ArtifactEntry, Failure, Job, JobId, JobState};
use sheet::{SheetDocument, ViewDocument};

/// A sheet on its way to a 3D draft.
#[derive(Debug, Serialize, ToSchema)]
#[expect(missing_docs, reason = "the schema describes it")]
pub struct Reconstruction {
    pub id: Uuid,
    /// What people call it; at first the name that the sheet document has.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// The earlier reconstruction whose views it takes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<Uuid>,
    /// The page whose figures its views are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub page: Option<Uuid>,
    /// How the sheet becomes a 3D draft; also in `options`.
    #[schema(example = "turntable")]
    pub method: Option<String>,
    /// Every option with the value used.
    #[schema(schema_with = options_reference)]
    pub options: Value,
    /// By rising azimuth.
    pub views: Vec<ViewSummary>,
    /// Whether a true model came with it.
    pub truth_model: bool,
    /// How well the draft fits its drawings; null until it has succeeded.
    pub summary: Option<ReconstructionSummary>,
    #[serde(flatten)]
    pub status: JobStatus,
    pub links: Links,
}

/// How a job is doing, whatever its kind.
#[derive(Debug, Serialize, ToSchema)]
pub struct JobStatus {
    pub state: State,
    /// How often it was begun; it is begun again if its worker dies.
    pub attempt: u32,
    pub max_attempts: u32,
    /// Those with a higher one run before others of their tenant.
    pub priority: i32,
    /// What it is found by.
    pub labels: BTreeMap<String, String>,
    /// When it is deleted by itself, unless it is pinned; null keeps it.
    #[schema(value_type = Option<String>, format = DateTime)]
    pub expires_at: Option<Timestamp>,
    /// Whether it stays although its time is over.
    pub pinned: bool,
    /// Whether somebody asked to cancel it.
    pub cancel_requested: bool,
    /// The earlier job whose result it was answered with.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reused_from: Option<Uuid>,
    /// How far the current attempt is; never goes back within an attempt.
    pub progress: Option<Progress>,
    /// Why it failed.
    pub failure: Option<FailureReason>,
    #[schema(value_type = String, format = DateTime)]
    pub created_at: Timestamp,
    /// When the current attempt began.
    #[schema(value_type = Option<String>, format = DateTime)]
    pub started_at: Option<Timestamp>,
    #[schema(value_type = Option<String>, format = DateTime)]
    pub finished_at: Option<Timestamp>,
}

/// Where a job is in its life.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = JobState)]
pub enum State {
    Queued,
    Running,
    Succeeded,
    Failed,
    Cancelled,
}

/// One drawn view.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = View)]
pub struct ViewSummary {
    /// Degrees in [0, 360).
    #[schema(minimum = 0, exclusive_maximum = 360)]
    pub azimuth_deg: f64,
    /// Degrees, up positive.
    #[schema(minimum = -90, maximum = 90)]
    pub elevation_deg: f64,
    /// Whether a mask came as a picture of its own.
    pub mask: bool,
    /// Whether a picture of true values came with it.
    pub truth: bool,
}

/// How far an attempt is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Progress {
    /// Part of the work that is going on.
    #[schema(example = "pairs")]
    pub stage: String,
    /// Units of the stage that are done, of `total`.
    pub done: u64,
    pub total: u64,
    /// The unit done last.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = "40-45")]
    pub unit: Option<String>,
    /// Share of the whole work done.
    #[schema(minimum = 0, maximum = 1)]
    pub fraction: f64,
}

/// Why a job failed.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Failure)]
pub struct FailureReason {
    /// Stable name of the reason.
    #[schema(example = "no_usable_pair")]
    pub code: String,
    /// What happened and how to mend it.
    pub detail: String,
}

/// Where to go on, as relative URIs.
#[derive(Debug, Serialize, ToSchema)]
pub struct Links {
    #[serde(rename = "self")]
    #[schema(format = "uri-reference")]
    pub this: String,
    /// Server-sent events.
    #[schema(format = "uri-reference")]
    pub events: String,
    /// Post here to cancel; null once it is finished.
    #[schema(format = "uri-reference")]
    pub cancel: Option<String>,
    /// Null until it has succeeded.
    #[schema(format = "uri-reference")]
    pub metrics: Option<String>,
    /// Null until it has succeeded.
    #[schema(format = "uri-reference")]
    pub artifacts: Option<String>,
}

/// Part of the listing, newest first.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct ReconstructionList {
    pub reconstructions: Vec<Reconstruction>,
    /// The next part; null at the end. Also as the header `Link`.
    #[schema(format = "uri-reference")]
    pub next: Option<String>,
}

/// The results of a job; empty until it has succeeded.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct ArtifactList {
    pub artifacts: Vec<ArtifactSummary>,
}

/// One result.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Artifact)]
pub(super) struct ArtifactSummary {
    #[schema(example = "views/45/disparity.png")]
    pub name: String,
    #[schema(example = "image/png")]
    pub media_type: String,
    pub bytes: u64,
    /// Of the content, lower-case hexadecimal; also its ETag.
    #[schema(min_length = 64, max_length = 64)]
    pub sha256: String,
    /// Where the bytes are.
    #[schema(format = "uri-reference")]
    pub href: String,
}

impl From<&Job> for Reconstruction {
    fn from(job: &Job) -> Self {
        // A payload that an older version stored may not read; its job is
        // still listed.
        let payload = ReconstructionPayload::deserialize(&job.payload).ok();
        let (document, source, page) =
            payload.map(|p| (p.document, p.source, p.page)).unwrap_or_default();
        let options = document.options.clone().unwrap_or_default();
        Self {
            id: job.id.0,
            name: job.tags.name.clone().or(document.name.clone()),
            source,
            page,
            method: options["method"].as_str().map(str::to_owned),
            options,
            views: summaries(&document),
            summary: job.summary.clone().and_then(|value| serde_json::from_value(value).ok()),
            truth_model: document.truth.is_some_and(|truth| truth.model.is_some()),
            status: JobStatus::from(job),
            links: Links::of(job),
        }
    }
}

impl From<&Job> for JobStatus {
    fn from(job: &Job) -> Self {
        Self {
            state: job.state.into(),
            attempt: job.attempt,
            max_attempts: job.max_attempts,
            priority: job.priority,
            labels: job.tags.labels.clone(),
            expires_at: job.tags.expires_at,
            pinned: job.tags.pinned,
            cancel_requested: job.cancel_requested,
            reused_from: job.reused_from.map(|id| id.0),
            progress: job.progress.clone().and_then(|value| serde_json::from_value(value).ok()),
            failure: job.failure.clone().map(FailureReason::from),
            created_at: job.created_at,
            started_at: job.started_at,
            finished_at: job.finished_at,
        }
    }
}

fn summaries(document: &SheetDocument) -> Vec<ViewSummary> {
    let summary = |view: &ViewDocument| {
        Some(ViewSummary {
            azimuth_deg: Azimuth::from_degrees(view.azimuth_deg).ok()?.degrees(),
            elevation_deg: view.elevation_deg.unwrap_or(document.elevation_deg),
            mask: view.mask.is_some(),
            truth: view.truth().is_some(),
        })
    };
    document.views.iter().filter_map(summary).collect()
}

impl Links {
    fn of(job: &Job) -> Self {
        let paths = Paths::of::<Reconstructions>(job);
        Self {
            this: paths.this.clone(),
            events: paths.events(),
            cancel: paths.cancel(),
            metrics: paths.result("metrics"),
            artifacts: paths.result("artifacts"),
        }
    }
}

/// What lies below a job.
pub(super) struct Paths {
    pub this: String,
    state: JobState,
}

impl Paths {
    pub(super) fn of<R: Resource>(job: &Job) -> Self {
        Self { this: R::path(job.id), state: job.state }
    }

    pub(super) fn events(&self) -> String {
        format!("{}/events", self.this)
    }

    /// `None` once it is finished.
    pub(super) fn cancel(&self) -> Option<String> {
        (!self.state.is_final()).then(|| format!("{}/cancel", self.this))
    }

    /// `None` until it has succeeded.
    pub(super) fn result(&self, name: &str) -> Option<String> {
        (self.state == JobState::Succeeded).then(|| format!("{}/{name}", self.this))
    }
}

impl From<JobState> for State {
    fn from(state: JobState) -> Self {
        match state {
            JobState::Queued => Self::Queued,
            JobState::Running => Self::Running,
            JobState::Succeeded => Self::Succeeded,
            JobState::Failed => Self::Failed,
            JobState::Cancelled => Self::Cancelled,
        }
    }
}

impl From<State> for JobState {
    fn from(state: State) -> Self {
        match state {
            State::Queued => Self::Queued,
            State::Running => Self::Running,
            State::Succeeded => Self::Succeeded,
            State::Failed => Self::Failed,
            State::Cancelled => Self::Cancelled,
        }
    }
}

impl From<Failure> for FailureReason {
    fn from(failure: Failure) -> Self {
        Self { code: failure.code, detail: failure.detail }
    }
}

impl ArtifactSummary {
    pub(super) fn of<R: Resource>(job: JobId, entry: &ArtifactEntry) -> Self {
        Self {
            name: entry.name.clone(),
            media_type: entry.media_type.clone(),
            bytes: entry.bytes,
            sha256: entry.sha256.clone(),
            href: format!("{}/artifacts/{}", R::path(job), entry.name),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use progress::Stage;

    #[test]
    fn progress_of_the_pipeline_is_what_clients_see() {
        let progress = progress::Progress {
            stage: Stage::Pairs,
            done: 3,
            total: 18,
            unit: Some("40-45".to_owned()),
            fraction: 0.25,
        };
        let stored = serde_json::to_value(&progress).unwrap();
        let seen: Progress = serde_json::from_value(stored.clone()).unwrap();
        assert_eq!(serde_json::to_value(seen).unwrap(), stored);
    }
}
