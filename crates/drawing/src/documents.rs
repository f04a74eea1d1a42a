//! The documents of a drawn sheet.

use serde::Serialize;

use super::files::ArtifactKind;
use super::{Degradation, DrawOptions, ViewError};
use frames::{Elevation, Viewpoint};
use sheet::{SheetDocument, TruthDocument, ViewDocument};

/// `sheet.json`: what a reconstruction takes, with the truth for its evaluation.
pub(super) fn sheet_document(
    viewpoints: &[Viewpoint],
    options: &DrawOptions,
    depth_counts_per_unit: f64,
) -> SheetDocument {
    let own = |view: &Viewpoint| (view.elevation != options.elevation()).then_some(view.elevation);
    let view = |&view: &Viewpoint| ViewDocument {
        azimuth_deg: view.azimuth.degrees(),
        elevation_deg: own(&view).map(Elevation::degrees),
        image: ArtifactKind::View(view).name(),
        depth: Some(ArtifactKind::Depth(view).name()),
        ..ViewDocument::default()
    };
    SheetDocument {
        width: Some(options.width_px),
        height: Some(options.height_px),
        pixels_per_unit: Some(options.pixels_per_unit()),
        elevation_deg: options.elevation_deg,
        views: viewpoints.iter().map(view).collect(),
        truth: Some(TruthDocument {
            model: Some(ArtifactKind::Model.name()),
            depth_counts_per_unit: Some(depth_counts_per_unit),
            // The depth of the origin.
            camera_distance: Some(options.camera_distance()),
            ..TruthDocument::default()
        }),
        ..SheetDocument::default()
    }
}

/// `degradation.json`: kept apart from the sheet, which states what an artist would.
#[derive(Serialize)]
pub(super) struct DegradationDocument {
    seed: u64,
    limits: Degradation,
    views: Vec<ViewErrorEntry>,
}

#[derive(Serialize)]
struct ViewErrorEntry {
    azimuth_deg: f64,
    elevation_deg: f64,
    #[serde(flatten)]
    error: ViewError,
}

impl DegradationDocument {
    /// `None` if nothing is degraded.
    pub(crate) fn new(
        errors: impl Iterator<Item = (Viewpoint, ViewError)>,
        options: &DrawOptions,
    ) -> Option<Self> {
        let entries = errors.map(|(view, error)| ViewErrorEntry {
            azimuth_deg: view.azimuth.degrees(),
            elevation_deg: view.elevation.degrees(),
            error,
        });
        Some(Self {
            seed: options.degrade.seed,
            limits: options.degrade.resolved(options.line_width_px)?,
            views: entries.collect(),
        })
    }
}
