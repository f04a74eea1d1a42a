use serde::Serialize;

use super::artifacts::ArtifactKind;
use super::{Degradation, DrawOptions, ViewError};
use crate::sheet::Azimuth;

/// `sheet.json`: what a reconstruction takes, with the truth for its evaluation.
#[derive(Serialize)]
pub(super) struct SheetDocument {
    width: u32,
    height: u32,
    pixels_per_unit: f64,
    elevation_deg: f64,
    views: Vec<ViewEntry>,
    truth: TruthEntry,
}

#[derive(Serialize)]
struct ViewEntry {
    azimuth_deg: f64,
    image: String,
    depth: String,
}

#[derive(Serialize)]
struct TruthEntry {
    model: String,
    depth_counts_per_unit: f64,
    /// Depth of the origin.
    camera_distance: f64,
}

impl SheetDocument {
    pub fn new(azimuths: &[Azimuth], options: &DrawOptions, depth_scale: f64) -> Self {
        let entry = |&azimuth: &Azimuth| ViewEntry {
            azimuth_deg: azimuth.degrees(),
            image: ArtifactKind::View(azimuth).name(),
            depth: ArtifactKind::Depth(azimuth).name(),
        };
        Self {
            width: options.width_px,
            height: options.height_px,
            pixels_per_unit: options.pixels_per_unit(),
            elevation_deg: options.elevation_deg,
            views: azimuths.iter().map(entry).collect(),
            truth: TruthEntry {
                model: ArtifactKind::Model.name(),
                depth_counts_per_unit: depth_scale,
                camera_distance: options.distance / options.elevation_deg.to_radians().cos(),
            },
        }
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
    #[serde(flatten)]
    error: ViewError,
}

impl DegradationDocument {
    /// `None` if nothing is degraded.
    pub fn new(
        errors: impl Iterator<Item = (Azimuth, ViewError)>,
        options: &DrawOptions,
    ) -> Option<Self> {
        let entries =
            errors.map(|(azimuth, error)| ViewErrorEntry { azimuth_deg: azimuth.degrees(), error });
        Some(Self {
            seed: options.degrade.seed,
            limits: options.degrade.resolved(options.line_width_px)?,
            views: entries.collect(),
        })
    }
}
