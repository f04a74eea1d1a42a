//! Drawn sheets as clients see them.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;
use uuid::Uuid;

use super::openapi::sheet_options_reference;
use super::representation::{JobStatus, Paths};
use super::sheets::Sheets;
use crate::kinds::{DrawPayload, ModelSource};
use jobs::Job;

/// A model on its way to a drawn sheet.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({
    "id": "01936a5e-9f63-7d41-8f0c-2b1f5f0a7c55",
    "model": {"file": "bunny.obj", "format": "obj"},
    "azimuths_deg": [0.0, 45.0, 90.0],
    "elevations_deg": [0.0, 0.0, 0.0],
    "options": {"width_px": 960, "height_px": 540, "scale": 7.3, "line_width_px": 2.0},
    "state": "running",
    "attempt": 1,
    "max_attempts": 3,
    "priority": 0,
    "labels": {"show": "7"},
    "expires_at": null,
    "pinned": false,
    "cancel_requested": false,
    "progress": {"stage": "views", "done": 1, "total": 3, "fraction": 0.25},
    "failure": null,
    "created_at": "2026-11-22T08:00:00Z",
    "started_at": "2026-11-22T08:00:00.120Z",
    "finished_at": null,
    "links": {
        "self": "/v1/sheets/01936a5e-9f63-7d41-8f0c-2b1f5f0a7c55",
        "events": "/v1/sheets/01936a5e-9f63-7d41-8f0c-2b1f5f0a7c55/events",
        "cancel": "/v1/sheets/01936a5e-9f63-7d41-8f0c-2b1f5f0a7c55/cancel",
        "artifacts": null,
        "sheet": null,
        "page": null,
        "bundle": null
    }
}))]
pub(super) struct Sheet {
    pub id: Uuid,
    /// What people call it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    pub model: SheetModel,
    /// The views' azimuths, degrees in [0, 360), rising.
    pub azimuths_deg: Vec<f64>,
    /// Their elevations, in the same order, degrees from -90 to 90.
    pub elevations_deg: Vec<f64>,
    /// Every option with the value used.
    #[schema(schema_with = sheet_options_reference)]
    pub options: Value,
    #[serde(flatten)]
    pub status: JobStatus,
    pub links: SheetLinks,
}

/// What is drawn: a built-in model or a file.
#[derive(Debug, Default, Serialize, ToSchema)]
pub(super) struct SheetModel {
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(example = "teapot")]
    pub builtin: Option<String>,
    /// The file's name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// The file's format: glb, gltf, obj, ply or stl.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<String>)]
    pub format: Option<Value>,
    /// Which axis of the file points up, y or z, if it is not the format's usual one.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<String>)]
    pub up_axis: Option<Value>,
}

/// Where to go on, as relative URIs.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct SheetLinks {
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
    pub artifacts: Option<String>,
    /// The sheet document, `sheet.json`; null until it has succeeded.
    #[schema(format = "uri-reference")]
    pub sheet: Option<String>,
    /// All views on one page; null until it has succeeded.
    #[schema(format = "uri-reference")]
    pub page: Option<String>,
    /// All files in a zip; null until it has succeeded.
    #[schema(format = "uri-reference")]
    pub bundle: Option<String>,
}

/// Part of the listing, newest first.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct SheetList {
    pub sheets: Vec<Sheet>,
    /// The next part; null at the end. Also as the header `Link`.
    #[schema(format = "uri-reference")]
    pub next: Option<String>,
}

impl From<&Job> for Sheet {
    fn from(job: &Job) -> Self {
        // A payload that an older version stored may not read; its job is
        // still listed.
        let payload = DrawPayload::deserialize(&job.payload).ok();
        let viewpoints = payload.as_ref().and_then(DrawPayload::viewpoints).unwrap_or_default();
        let options = payload.as_ref().and_then(|p| serde_json::to_value(&p.options).ok());
        Self {
            id: job.id.0,
            name: job.tags.name.clone(),
            model: payload.as_ref().map(|p| SheetModel::from(&p.model)).unwrap_or_default(),
            azimuths_deg: viewpoints.iter().map(|view| view.azimuth.degrees()).collect(),
            elevations_deg: viewpoints.iter().map(|view| view.elevation.degrees()).collect(),
            options: options.unwrap_or_default(),
            status: JobStatus::from(job),
            links: SheetLinks::of(job),
        }
    }
}

impl From<&ModelSource> for SheetModel {
    fn from(model: &ModelSource) -> Self {
        match model {
            ModelSource::Builtin(model) => {
                Self { builtin: Some(model.name().to_owned()), ..Self::default() }
            }
            ModelSource::File(file) => Self {
                builtin: None,
                file: Some(file.name.clone()),
                format: serde_json::to_value(file.format).ok(),
                up_axis: file.up_axis.and_then(|axis| serde_json::to_value(axis).ok()),
            },
        }
    }
}

impl SheetLinks {
    fn of(job: &Job) -> Self {
        let paths = Paths::of::<Sheets>(job);
        Self {
            this: paths.this.clone(),
            events: paths.events(),
            cancel: paths.cancel(),
            artifacts: paths.result("artifacts"),
            sheet: paths.result("artifacts/sheet.json"),
            page: paths.result("artifacts/page.png"),
            bundle: paths.result("artifacts/bundle.zip"),
        }
    }
}
