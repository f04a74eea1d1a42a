//! Single pairs and single maps, for studying stages apart.

use std::convert::Infallible;

use image::GrayImage;

use super::correspond::{Correspondences, PairInput, correspond};
use super::pair::{PairFailure, PairOutcome, PairResult, agreeing, rectified_pair};
use super::pairs::PairName;
use crate::Options;
use crate::options::DisparityOptions;
use crate::vision::{self, Rectification, RectificationError, detect_and_describe};
use picture::FloatImage;
use sheet::View;

/// A view's place in a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The view that the pair turns from.
    Left,
    /// The view ahead of it.
    Right,
}

/// Takes one pair, left and right, as far as its rectification.
///
/// A failure is a result; [`PairOutcome::Usable`] says nothing of disparity.
pub fn probe_pair(views: [&View; 2], options: &Options) -> PairResult {
    let name = PairName { left: views[0].azimuth, right: views[1].azimuth };
    let features = views.map(|view| detect_and_describe(&view.image, &options.detection));
    let input = PairInput {
        name,
        drawings: views.map(|view| &view.image),
        features: [&features[0], &features[1]],
        edit: None,
    };
    let Ok(found) = correspond(&input, options, || Ok::<(), Infallible>(()));
    let Correspondences { keypoints, matches, edit, geometry, tries, chosen_try } = found;
    let (width_px, height_px) = views[0].image.dimensions();
    let outcome = match geometry {
        Err(failure) => PairOutcome::Failed { failure, geometry: None },
        Ok(geometry) => {
            let inliers = agreeing(&matches, &geometry);
            match vision::rectify(&inliers, &geometry.fundamental, width_px, height_px) {
                Ok(rectification) => PairOutcome::Usable { geometry, rectification },
                Err(error) => {
                    PairOutcome::Failed { failure: error.into(), geometry: Some(geometry) }
                }
            }
        }
    };
    PairResult {
        name,
        angle_deg: name.left.degrees_to(name.right),
        keypoints_left: keypoints[0],
        keypoints_right: keypoints[1],
        matches,
        edit,
        outcome,
        tries,
        chosen_try,
    }
}

/// A pair's disparity map at the pixels of one of its views, px, nearer being
/// larger; NaN where missing.
///
/// * `drawings`: left and right, as they were rectified by `rectification`.
///
/// # Errors
/// [`PairFailure`] if the drawings cannot be rectified or matched.
pub fn probe_map(
    drawings: [&GrayImage; 2],
    rectification: &Rectification,
    side: Side,
    options: &DisparityOptions,
) -> Result<FloatImage, PairFailure> {
    let [left, right] =
        rectified_pair(drawings, rectification).map_err(RectificationError::from)?;
    let map = match side {
        // Fusing takes both directions.
        _ if !options.block_sizes.is_empty() => {
            let [of_left, of_right] = vision::disparity_maps(&left, &right, options)?;
            if side == Side::Left { of_left } else { of_right }
        }
        Side::Left => vision::left_disparity(&left, &right, options)?,
        Side::Right => vision::right_disparity(&left, &right, options)?,
    };
    let rectified_from_view = match side {
        Side::Left => &rectification.rectified_from_left,
        Side::Right => &rectification.rectified_from_right,
    };
    Ok(vision::derectify(&map, rectified_from_view)?)
}
