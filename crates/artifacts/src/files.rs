//! Files that are made together, and what could have been made and was not.

use frames::Viewpoint;
use picture::{DepthEncoding, EncodeError, FloatImage, depth_png, disparity_png, encode_pfm};
use serde::Serialize;

use super::{Artifact, ArtifactName, ViewArtifact};

/// A file that could have been and is not.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct AbsentArtifact {
    /// Its name.
    pub name: String,
    /// Why it is not made.
    pub reason: String,
}

/// How to read a view's 16-bit depth picture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DepthPicture {
    /// Name of the picture.
    pub name: String,
    /// Scale and offset.
    #[serde(flatten)]
    pub encoding: DepthEncoding,
}

/// Files that are made together.
#[derive(Default)]
pub struct Files {
    /// In the order they are handed over.
    pub artifacts: Vec<Artifact>,
    /// What is not among them, and why.
    pub absent: Vec<AbsentArtifact>,
    /// How the depth picture among them is read.
    pub depth_picture: Option<DepthPicture>,
}

impl Files {
    /// One file.
    pub fn one(artifact: Artifact) -> Self {
        Self { artifacts: vec![artifact], ..Self::default() }
    }

    /// No file, for a reason.
    pub fn none(name: ArtifactName, reason: &str) -> Self {
        let absent = AbsentArtifact { name: name.to_string(), reason: reason.to_owned() };
        Self { absent: vec![absent], ..Self::default() }
    }

    /// Disparity and depth of a view, as pictures and as values.
    ///
    /// # Errors
    /// [`EncodeError`] for a picture that cannot be written.
    pub fn of_maps(
        view: Viewpoint,
        disparity_px: &FloatImage,
        depth_px: &FloatImage,
    ) -> Result<Self, EncodeError> {
        let name = |artifact| ArtifactName::View(view, artifact);
        let (depth_picture, encoding) = depth_png(depth_px)?;
        let depth_name = name(ViewArtifact::DepthPng);
        Ok(Self {
            depth_picture: Some(DepthPicture { name: depth_name.to_string(), encoding }),
            artifacts: vec![
                Artifact::new(name(ViewArtifact::DisparityPng), disparity_png(disparity_px)?),
                Artifact::new(name(ViewArtifact::DisparityPfm), encode_pfm(disparity_px)),
                Artifact::new(depth_name, depth_picture),
                Artifact::new(name(ViewArtifact::DepthPfm), encode_pfm(depth_px)),
            ],
            absent: Vec::new(),
        })
    }
}
