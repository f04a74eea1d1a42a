//! Files with names and media types, and where they go.

use std::{fmt, io};

use bytes::Bytes;

use frames::{Azimuth, Viewpoint};

/// The media type of float maps; none is registered, this is the usual one.
pub const PFM_MEDIA_TYPE: &str = "image/x-portable-floatmap";

/// Which file of a view.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ViewArtifact {
    /// 8-bit picture, near is white.
    DisparityPng,
    /// Disparity in px, 32-bit float.
    DisparityPfm,
    /// 16-bit picture; scale and offset are in the metrics.
    DepthPng,
    /// Depth in px, 32-bit float.
    DepthPfm,
    /// Unit normals in the view's frame: x right, y up, z to the camera.
    NormalsPng,
    /// The drawing as the method took it, in which places of matches are told.
    DrawingPng,
    /// The subject's area, white.
    SilhouettePng,
    /// The subject cut out of the drawing, in colour.
    SubjectPng,
    /// Black where the view shows paper and the others the subject; only of views that do.
    TrustPng,
    /// The drawing with the draft's outline, drawn again, over it.
    FitPng,
}

/// Which file of a pair of views.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PairArtifact {
    /// Both drawings side by side with their matches.
    MatchesPng,
    /// The same matches as JSON in the sheet frame, px; a sheet may bring it back, corrected.
    MatchesJson,
    /// The rectified drawings side by side with epipolar lines.
    RectifiedPng,
}

/// Which file of the cleaned sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CleanArtifact {
    /// All views side by side, on one ground line, with their angles.
    Page,
    /// The sheet document that gives the same draft again.
    Document,
    /// A view's lines.
    View(Viewpoint),
    /// A view's mask, if it has one.
    Mask(Viewpoint),
}

impl CleanArtifact {
    /// Its name within the cleaned sheet's folder, as the document has it.
    pub fn file_name(self) -> String {
        match self {
            Self::Page => "page.png".to_owned(),
            Self::Document => "sheet.json".to_owned(),
            Self::View(view) => format!("view_{}.png", view.padded()),
            Self::Mask(view) => format!("mask_{}.png", view.padded()),
        }
    }
}

/// The name of everything a reconstruction can leave behind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ArtifactName {
    /// A file of the view from here.
    View(Viewpoint, ViewArtifact),
    /// A file of the cleaned sheet.
    Clean(CleanArtifact),
    /// A file of two neighbouring views, the left one first.
    Pair(Azimuth, Azimuth, PairArtifact),
    /// The merged point cloud of the method `uncalibrated`, PLY.
    Cloud,
    /// The convex hull of that cloud, GLB.
    Hull,
    /// The turntable method's surface; vertex colours say what it rests on.
    Solid,
    /// The same as even quads, Wavefront OBJ.
    SolidObj,
    /// The material of those quads.
    SolidMtl,
    /// Their texture and that of the textured model.
    Texture,
    /// The turntable method's surface in about 2000 triangles.
    LowPoly2000,
    /// The same in about 500.
    LowPoly500,
    /// The turntable method's surface as triangles, binary STL, millimetres.
    SolidStl,
    /// The same as triangles, 3MF, millimetres.
    SolidThreeMf,
    /// The same with the drawings projected on it.
    Textured,
    /// The same as of clay, the drawings' inner lines as grooves.
    Relief,
    /// A shaded picture of the mesh from three sides.
    Thumbnail,
    /// How well each step went, JSON.
    Metrics,
    /// How long each step took, JSON; it differs from run to run.
    Timings,
    /// All other files but the timings, in one zip archive.
    Bundle,
}

impl ArtifactName {
    /// The media type of the bytes.
    pub fn media_type(self) -> &'static str {
        use ViewArtifact::{
            DepthPfm, DepthPng, DisparityPfm, DisparityPng, DrawingPng, FitPng, NormalsPng,
            SilhouettePng, SubjectPng, TrustPng,
        };
        match self {
            Self::View(
                _,
                DisparityPng | DepthPng | NormalsPng | DrawingPng | SilhouettePng | SubjectPng
                | TrustPng | FitPng,
            )
            | Self::Pair(_, _, PairArtifact::MatchesPng | PairArtifact::RectifiedPng)
            | Self::Clean(CleanArtifact::Page | CleanArtifact::View(_) | CleanArtifact::Mask(_))
            | Self::Texture
            | Self::Thumbnail => "image/png",
            Self::View(_, DisparityPfm | DepthPfm) => PFM_MEDIA_TYPE,
            Self::Pair(_, _, PairArtifact::MatchesJson)
            | Self::Clean(CleanArtifact::Document)
            | Self::Metrics
            | Self::Timings => "application/json",
            Self::Cloud => "model/ply",
            Self::Hull
            | Self::Solid
            | Self::LowPoly2000
            | Self::LowPoly500
            | Self::Textured
            | Self::Relief => "model/gltf-binary",
            Self::SolidObj => "model/obj",
            Self::SolidMtl => "model/mtl",
            Self::SolidStl => "model/stl",
            Self::SolidThreeMf => "model/3mf",
            Self::Bundle => "application/zip",
        }
    }
}

/// The path below the job's artifacts, such as `views/45/disparity.png` or
/// `views/0_e90/fit.png`.
impl fmt::Display for ArtifactName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::View(view, artifact) => {
                let file = match artifact {
                    ViewArtifact::DisparityPng => "disparity.png",
                    ViewArtifact::DisparityPfm => "disparity.pfm",
                    ViewArtifact::DepthPng => "depth.png",
                    ViewArtifact::DepthPfm => "depth.pfm",
                    ViewArtifact::NormalsPng => "normals.png",
                    ViewArtifact::DrawingPng => "drawing.png",
                    ViewArtifact::SilhouettePng => "silhouette.png",
                    ViewArtifact::SubjectPng => "subject.png",
                    ViewArtifact::TrustPng => "trust.png",
                    ViewArtifact::FitPng => "fit.png",
                };
                write!(f, "views/{view}/{file}")
            }
            Self::Pair(left, right, artifact) => {
                let file = match artifact {
                    PairArtifact::MatchesPng => "matches.png",
                    PairArtifact::MatchesJson => "matches.json",
                    PairArtifact::RectifiedPng => "rectified.png",
                };
                write!(f, "pairs/{left}-{right}/{file}")
            }
            Self::Clean(artifact) => write!(f, "sheet/{}", artifact.file_name()),
            Self::Cloud => f.write_str("cloud.ply"),
            Self::Hull => f.write_str("hull.glb"),
            Self::Solid => f.write_str("solid.glb"),
            Self::SolidObj => f.write_str("solid.obj"),
            Self::SolidMtl => f.write_str("solid.mtl"),
            Self::Texture => f.write_str("texture.png"),
            Self::LowPoly2000 => f.write_str("low_2000.glb"),
            Self::LowPoly500 => f.write_str("low_500.glb"),
            Self::SolidStl => f.write_str("solid.stl"),
            Self::SolidThreeMf => f.write_str("solid.3mf"),
            Self::Textured => f.write_str("textured.glb"),
            Self::Relief => f.write_str("relief.glb"),
            Self::Thumbnail => f.write_str("thumbnail.png"),
            Self::Metrics => f.write_str("metrics.json"),
            Self::Timings => f.write_str("timings.json"),
            Self::Bundle => f.write_str("bundle.zip"),
        }
    }
}

/// A finished file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Artifact {
    /// Path below the job's artifacts.
    pub name: String,
    /// Media type of the bytes, such as `image/png`.
    pub media_type: &'static str,
    /// Shared: a clone is cheap.
    pub bytes: Bytes,
}

impl Artifact {
    /// A finished file with the name and media type that `name` stands for.
    pub fn new(name: ArtifactName, bytes: impl Into<Bytes>) -> Self {
        Self { name: name.to_string(), media_type: name.media_type(), bytes: bytes.into() }
    }
}

/// Where files go.
pub trait ArtifactSink: Send {
    /// Takes a finished file.
    fn put(&mut self, artifact: Artifact) -> io::Result<()>;

    /// Begins a file that is written piece by piece.
    fn create(&mut self, name: ArtifactName) -> io::Result<Box<dyn ArtifactWriter>>;
}

/// A file on its way. Dropped before [`Self::finish`], it leaves nothing.
pub trait ArtifactWriter: io::Write + Send {
    /// All is written.
    fn finish(self: Box<Self>) -> io::Result<()>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_users_know() {
        let azimuth = |degrees| Azimuth::from_degrees(degrees).unwrap();
        let name = ArtifactName::View(azimuth(22.5).into(), ViewArtifact::DepthPfm);
        assert_eq!(name.to_string(), "views/22.5/depth.pfm");
        let elevation = frames::Elevation::from_degrees(90.0).unwrap();
        let top = Viewpoint { azimuth: azimuth(0.0), elevation };
        let name = ArtifactName::View(top, ViewArtifact::FitPng);
        assert_eq!(name.to_string(), "views/0_e90/fit.png");
        let name = ArtifactName::Clean(CleanArtifact::View(top));
        assert_eq!(name.to_string(), "sheet/view_000_e90.png");
        let name = ArtifactName::Pair(azimuth(315.0), azimuth(0.0), PairArtifact::MatchesJson);
        assert_eq!(name.to_string(), "pairs/315-0/matches.json");
        assert_eq!(name.media_type(), "application/json");
    }
}
