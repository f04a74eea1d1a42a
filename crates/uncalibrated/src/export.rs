//! The reconstruction of views and pairs as files.

use artifacts::{Artifact, ArtifactName, Files, PairArtifact, ViewArtifact};
use picture::EncodeError;
use sheet::{Sheet, View};

use crate::pair_files::{matches_json, matches_png, rectified_png};
use crate::{PairResult, ViewResult, rectified_pair};

/// The maps of a view.
///
/// # Errors
/// [`EncodeError`] for a picture that cannot be written.
pub fn view_files(view: &ViewResult) -> Result<Files, EncodeError> {
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
    let drawing = |azimuth| {
        let found = sheet.views().iter().find(|view: &&View| view.azimuth == azimuth);
        found
            .map(|view| &view.image)
            .ok_or_else(|| EncodeError::new("a pair", format!("{} has no view", pair.name)))
    };
    let drawings = [drawing(pair.name.left)?, drawing(pair.name.right)?];
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
