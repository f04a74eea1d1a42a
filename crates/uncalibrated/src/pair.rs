//! One pair of views, from matches to both disparity maps.

use image::GrayImage;
use serde::Serialize;

use super::correspond::{
    Correspondences, MatchedPoints, PairInput, TryReport, ViewFeatures, correspond,
};
use super::edit::EditReport;
use super::pairs::{PairName, PlannedPair};
use super::tracker::Tracker;
use crate::Options;
use crate::options::CloudSource;
use crate::vision::{
    self, Correspondence, DisparityError, EpipolarError, EpipolarGeometry, FeatureError,
    OpenCvError, Rectification, RectificationError,
};
use picture::FloatImage;
use progress::Cancelled;
use sheet::{Sheet, View};

/// Steps a pair reports: correspondences, rectification, both maps, the way back of
/// one, of the other.
pub(super) const STEPS: usize = 5;

/// The stage a pair failed at, and how.
#[derive(Clone, Debug, PartialEq, Serialize, thiserror::Error)]
#[serde(tag = "stage", rename_all = "snake_case")]
pub enum PairFailure {
    /// A view has no features.
    #[error("features: {0}")]
    Features(FeatureError),
    /// OpenCV refused to match the descriptors.
    #[error("matching: {0}")]
    Matching(OpenCvError),
    /// The matches give no fundamental matrix to rely on.
    #[error("epipolar geometry: {0}")]
    EpipolarGeometry(EpipolarError),
    /// No homographies make the epipolar lines level.
    #[error("rectification: {0}")]
    Rectification(#[from] RectificationError),
    /// The rectified views could not be matched densely.
    #[error("disparity: {0}")]
    Disparity(#[from] DisparityError),
}

/// What became of a pair.
#[derive(Clone, Debug, PartialEq)]
pub enum PairOutcome {
    /// Both disparity maps were made.
    Usable {
        /// The fundamental matrix and the matches that agree with it.
        geometry: EpipolarGeometry,
        /// The homographies under which disparity was searched.
        rectification: Rectification,
    },
    /// It has none; the geometry if the pair came that far.
    Failed {
        /// What went wrong.
        failure: PairFailure,
        /// The fundamental matrix; `None` if there is no estimate.
        geometry: Option<EpipolarGeometry>,
    },
}

/// A pair's result, in OpenCV's pixel coordinates.
#[derive(Clone, Debug)]
pub struct PairResult {
    /// Azimuths of its two views.
    pub name: PairName,
    /// From left to right, degrees.
    pub angle_deg: f64,
    /// Keypoints found in the left view.
    pub keypoints_left: usize,
    /// Keypoints found in the right view.
    pub keypoints_right: usize,
    /// All matches, agreeing or not.
    pub matches: Vec<MatchedPoints>,
    /// What a person did to the automatic matches.
    pub edit: Option<EditReport>,
    /// Whether it went through, and with what.
    pub outcome: PairOutcome,
    /// Every try at its geometry, in order.
    pub tries: Vec<TryReport>,
    /// The number of the try that went on.
    pub chosen_try: u32,
}

impl PairResult {
    /// The estimated geometry; `None` if there is none.
    pub fn geometry(&self) -> Option<&EpipolarGeometry> {
        match &self.outcome {
            PairOutcome::Usable { geometry, .. } => Some(geometry),
            PairOutcome::Failed { geometry, .. } => geometry.as_ref(),
        }
    }

    /// The homographies of a usable pair; `None` if it failed.
    pub fn rectification(&self) -> Option<&Rectification> {
        match &self.outcome {
            PairOutcome::Usable { rectification, .. } => Some(rectification),
            PairOutcome::Failed { .. } => None,
        }
    }

    /// What went wrong; `None` if the pair is usable.
    pub fn failure(&self) -> Option<&PairFailure> {
        match &self.outcome {
            PairOutcome::Usable { .. } => None,
            PairOutcome::Failed { failure, .. } => Some(failure),
        }
    }

    /// The matches that agree with the geometry; none without one.
    pub fn inliers(&self) -> Vec<Correspondence> {
        self.geometry().map_or_else(Vec::new, |geometry| agreeing(&self.matches, geometry))
    }
}

pub(super) fn agreeing(
    matches: &[MatchedPoints],
    geometry: &EpipolarGeometry,
) -> Vec<Correspondence> {
    let points: Vec<_> = matches.iter().map(|found| found.points).collect();
    geometry.agreeing(&points).collect()
}

/// Disparity at the pixels of the left and of the right view.
pub(super) struct PairMaps {
    pub left: FloatImage,
    pub right: FloatImage,
    /// The same at the matched corners alone, if clouds are made of them.
    pub corners: Option<[FloatImage; 2]>,
}

/// Why a pair's stages ended early.
enum Stop {
    Cancelled(Cancelled),
    Failed(PairFailure),
}

impl From<Cancelled> for Stop {
    fn from(cancelled: Cancelled) -> Self {
        Self::Cancelled(cancelled)
    }
}

impl From<RectificationError> for Stop {
    fn from(error: RectificationError) -> Self {
        Self::Failed(error.into())
    }
}

impl From<DisparityError> for Stop {
    fn from(error: DisparityError) -> Self {
        Self::Failed(error.into())
    }
}

/// Takes one pair through all its stages. A failure is a result.
pub(super) fn process_pair(
    plan: &PlannedPair,
    sheet: &Sheet,
    features: &[ViewFeatures],
    options: &Options,
    tracker: &Tracker<'_>,
) -> Result<(PairResult, Option<PairMaps>), Cancelled> {
    let pair_views = [&sheet.views()[plan.left], &sheet.views()[plan.right]];
    let input = PairInput {
        name: plan.name,
        drawings: pair_views.map(|view| &view.image),
        features: [&features[plan.left], &features[plan.right]],
        edit: sheet.match_edit(plan.name.left, plan.name.right),
    };
    let mut progress = PairProgress { tracker, taken: 0 };
    let found = correspond(&input, options, || tracker.check())?;
    progress.step()?;
    let Correspondences { keypoints, matches, edit, geometry, tries, chosen_try } = found;
    let (outcome, maps) = match geometry {
        Err(failure) => (PairOutcome::Failed { failure, geometry: None }, None),
        Ok(geometry) => {
            let inliers = agreeing(&matches, &geometry);
            match dense(pair_views, &inliers, &geometry, options, &mut progress) {
                Ok((rectification, maps)) => {
                    (PairOutcome::Usable { geometry, rectification }, Some(maps))
                }
                Err(Stop::Failed(failure)) => {
                    (PairOutcome::Failed { failure, geometry: Some(geometry) }, None)
                }
                Err(Stop::Cancelled(cancelled)) => return Err(cancelled),
            }
        }
    };
    tracker.finish(plan.name.to_string(), STEPS - progress.taken)?;
    let result = PairResult {
        name: plan.name,
        angle_deg: plan.angle_deg,
        keypoints_left: keypoints[0],
        keypoints_right: keypoints[1],
        matches,
        edit,
        outcome,
        tries,
        chosen_try,
    };
    Ok((result, maps))
}

/// Rectification and disparity, both ways.
fn dense(
    views: [&View; 2],
    inliers: &[Correspondence],
    geometry: &EpipolarGeometry,
    options: &Options,
    progress: &mut PairProgress<'_>,
) -> Result<(Rectification, PairMaps), Stop> {
    let (width_px, height_px) = views[0].image.dimensions();
    let rectification = vision::rectify(inliers, &geometry.fundamental, width_px, height_px)?;
    let [left, right] = rectified_pair([&views[0].image, &views[1].image], &rectification)
        .map_err(RectificationError::from)?;
    progress.step()?;
    let corners = (options.cloud.source == CloudSource::Corners)
        .then(|| vision::corner_disparity(inliers, &rectification, (width_px, height_px)));
    let options = &options.disparity;
    let [left_map, right_map] = vision::disparity_maps(&left, &right, options)?;
    progress.step()?;
    let left_map = vision::derectify(&left_map, &rectification.rectified_from_left)?;
    progress.step()?;
    let right_map = vision::derectify(&right_map, &rectification.rectified_from_right)?;
    let maps = PairMaps { left: left_map, right: right_map, corners };
    Ok((rectification, maps))
}

/// Both drawings of a pair, rectified.
pub fn rectified_pair(
    drawings: [&GrayImage; 2],
    rectification: &Rectification,
) -> Result<[GrayImage; 2], OpenCvError> {
    Ok([
        vision::warp(drawings[0], &rectification.rectified_from_left)?,
        vision::warp(drawings[1], &rectification.rectified_from_right)?,
    ])
}

/// Counts a pair's steps, so that one that fails early is still whole.
struct PairProgress<'a> {
    tracker: &'a Tracker<'a>,
    taken: usize,
}

impl PairProgress<'_> {
    fn step(&mut self) -> Result<(), Cancelled> {
        self.taken += 1;
        self.tracker.step()
    }
}
