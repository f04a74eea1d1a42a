//! The reconstruction of views and pairs as files.

use artifacts::{Artifact, ArtifactName, Files, PairArtifact, ViewArtifact};
use frames::Azimuth;
use image::GrayImage;
use picture::{EncodeError, png};
use sheet::{Sheet, View};

use crate::pair_files::{matches_json, matches_png, rectified_png};
use crate::{PairResult, ViewResult, rectified_pair};

/// The maps of a view and its drawing.
///
/// # Errors
/// [`EncodeError`] for a picture that cannot be written.
pub fn view_files(view: &ViewResult, sheet: &Sheet) -> Result<Files, EncodeError> {
    let mut files = maps(view)?;
    let drawing = png(drawing(sheet, view.azimuth)?)?;
    let name = ArtifactName::View(view.azimuth.into(), ViewArtifact::DrawingPng);
    files.artifacts.push(Artifact::new(name, drawing));
    Ok(files)
}

fn maps(view: &ViewResult) -> Result<Files, EncodeError> {
    match (&view.disparity, &view.depth) {
        (Some(disparity), Some(depth)) => Files::of_maps(view.azimuth.into(), disparity, depth),
        _ => {
            use ViewArtifact::{DepthPfm, DepthPng, DisparityPfm, DisparityPng};
            let mut files = Files::default();
            for artifact in [DisparityPng, DisparityPfm, DepthPng, DepthPfm] {
                let name = ArtifactName::View(view.azimuth.into(), artifact);
                files
                    .absent
                    .extend(Files::none(name, "none of the view's pairs was usable").absent);
            }
            Ok(files)
        }
    }
}

/// A pair's matches and its rectified drawings.
///
/// # Errors
/// [`EncodeError`] for a picture that cannot be written.
pub fn pair_files(pair: &PairResult, sheet: &Sheet) -> Result<Files, EncodeError> {
    let name = |artifact| ArtifactName::Pair(pair.name.left, pair.name.right, artifact);
    let drawings = [drawing(sheet, pair.name.left)?, drawing(sheet, pair.name.right)?];
    let mut files = Files {
        artifacts: vec![
            Artifact::new(name(PairArtifact::MatchesPng), matches_png(pair, drawings)?),
            Artifact::new(name(PairArtifact::MatchesJson), matches_json(pair)?),
        ],
        ..Files::default()
    };
    match pair.rectification() {
        Some(rectification) => {
            let rectified = rectified_pair(drawings, rectification)
                .map_err(|error| EncodeError::new("a rectified pair", error))?;
            let picture = rectified_png(pair, rectification, [&rectified[0], &rectified[1]])?;
            files.artifacts.push(Artifact::new(name(PairArtifact::RectifiedPng), picture));
        }
        None => {
            let none = Files::none(name(PairArtifact::RectifiedPng), "the pair was not usable");
            files.absent.extend(none.absent);
        }
    }
    Ok(files)
}

fn drawing(sheet: &Sheet, azimuth: Azimuth) -> Result<&GrayImage, EncodeError> {
    let found = sheet.views().iter().find(|view: &&View| view.azimuth == azimuth);
    let none = || EncodeError::new("a drawing", format!("there is no view {azimuth}"));
    found.map(|view| &view.image).ok_or_else(none)
}
