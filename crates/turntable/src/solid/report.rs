//! The solid, what was found and decided on the way to it, and why there is none.

use mesh::{Mesh, components};
use prior::PriorError;
use progress::Cancelled;

use super::cuts::CutReport;
use super::holes::Hole;
use super::redraw::Explained;
use super::symmetry::MirrorPlane;
use crate::surface::support::Support;

/// What the solid is made of.
#[derive(Clone, Debug)]
pub struct Solid {
    /// Closed and manifold, outward; turntable frame, px.
    pub mesh: Mesh,
    /// Edges of `mesh` that are creases, low vertex first.
    pub creases: Vec<[u32; 2]>,
    /// What each vertex of `mesh` rests on.
    pub support: Vec<Support>,
    /// How it was found.
    pub report: SolidReport,
}

/// What was found and decided on the way.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct SolidReport {
    /// Directions that bound the solid, after joining opposite views.
    pub directions: usize,
    /// Whether all views look along one line: how deep the subject is is a guess.
    pub depth_guessed: bool,
    /// The plane that the drawings are symmetric about; `None` if they are not.
    pub symmetric_about: Option<MirrorPlane>,
    /// The plane that views were mirrored at; `None` if none were.
    pub mirror_plane: Option<MirrorPlane>,
    /// Holes through the subject that were carved.
    pub holes: Vec<Hole>,
    /// Regions that may be holes, but would leave lines or outlines of other
    /// views without anything behind them.
    pub hole_candidates: Vec<Hole>,
    /// What came of views from above and below.
    pub cuts: Vec<CutReport>,
    /// Views, drawn or mirrored, whose depths carved the solid.
    pub carving_views: usize,
    /// Slices through the solid and the distance between them, px.
    pub slices: usize,
    /// From slice to slice.
    pub pitch_px: f64,
    /// How much of the views' outlines all views together leave, share: less
    /// than 1 where drawings of one subject disagree.
    pub agreement: f64,
    /// Parts that no outline needs and no line shows.
    pub ghosts: usize,
    /// Parts that were cut to the lines that bound them.
    pub parts: usize,
    /// The share of the outlines' length that runs straight up or across.
    pub straight_share: f64,
    /// Corners of slices that are sharp, and all.
    pub sharp_corners: usize,
    /// Corners of all slices.
    pub corners: usize,
    /// What the learned prior had to say; `None` if it was not asked.
    pub prior: Option<PriorReport>,
    /// Separate pieces of the surface, kept and dropped.
    pub pieces: components::Pieces,
    /// Triangles of the surface as it was found, and in the end.
    pub full_faces: usize,
    /// In the end, after decimation.
    pub faces: usize,
}

/// How the learned prior was used.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct PriorReport {
    /// Whether the solid is the one that it shaped.
    pub used: bool,
    /// How well the solid without the prior explains the drawings; `None` if it
    /// was not to choose.
    pub without: Option<Explained>,
    /// The same with the prior.
    pub with: Option<Explained>,
}

/// Why there is no solid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SolidError {
    /// No height is covered by every silhouette.
    #[error("the silhouettes have no row in common")]
    NoCommonRow,
    /// The visual hull is empty.
    #[error("the silhouettes contradict each other everywhere: nothing is inside all of them")]
    Empty,
    /// The learned prior failed; its own message.
    #[error("{0}")]
    Prior(String),
    /// Somebody asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl From<PriorError> for SolidError {
    fn from(error: PriorError) -> Self {
        match error {
            PriorError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            other => Self::Prior(other.to_string()),
        }
    }
}
