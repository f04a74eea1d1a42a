//! From two views' features to their epipolar geometry, tried again with other
//! detection parameters while it is not good enough.

use serde::Serialize;

use super::pair::PairFailure;
use super::pairs::PairName;
use super::variation::{pair_seed, vary_detection};
use crate::options::{DetectionOptions, Options};
use crate::sheet::View;
use crate::vision::{
    Correspondence, EpipolarGeometry, FeatureError, Features, Match, detect_and_describe,
    estimate_fundamental, match_descriptors, mean_distance, sampson_distance_px2,
};

/// Sets the estimate's random stream apart from those of detection tries.
const SEED_PURPOSE: u64 = 2 << 32;

/// A match as coordinates, OpenCV's pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatchedPoints {
    pub points: Correspondence,
    /// Descriptor distance.
    pub distance: f32,
}

/// One try's outcome.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TryReport {
    /// From 1.
    pub number: u32,
    pub keypoints_left: usize,
    pub keypoints_right: usize,
    pub matches: usize,
    pub inliers: usize,
    /// Over the inliers; null if there is no estimate.
    pub mean_sampson_px2: Option<f64>,
    /// Whether the mean Sampson distance was at most its threshold.
    pub passed: bool,
    pub failure: Option<String>,
    /// What the detection ran with.
    pub detection: DetectionOptions,
}

/// What two views have in common.
#[derive(Clone, Debug)]
pub(super) struct Correspondences {
    pub keypoints: [usize; 2],
    pub matches: Vec<MatchedPoints>,
    pub geometry: Result<EpipolarGeometry, PairFailure>,
    pub tries: Vec<TryReport>,
}

/// One view's features, or why it has none.
pub(super) type ViewFeatures = Result<Features, FeatureError>;

/// Matches two views and estimates their geometry; the best of at most
/// `options.epipolar.tries`.
///
/// `check` is asked between tries.
///
/// # Source
/// Arys 2020, §3.4 (the feedback of the mean Sampson distance).
pub(super) fn correspond<E>(
    pair: PairName,
    views: [&View; 2],
    features: [&ViewFeatures; 2],
    options: &Options,
    check: impl Fn() -> Result<(), E>,
) -> Result<Correspondences, E> {
    let mut best = attempt(pair, features, &options.detection, options, 1);
    for number in 2..=options.epipolar.tries {
        if best.tries.last().is_some_and(|last| last.passed) {
            break;
        }
        check()?;
        let detection = vary_detection(&options.detection, options.seed, pair, number - 1);
        let found = views.map(|view| detect_and_describe(&view.image, &detection));
        let next = attempt(pair, [&found[0], &found[1]], &detection, options, number);
        best = better(best, next);
    }
    Ok(best)
}

/// The better of two outcomes, with the tries of both.
fn better(old: Correspondences, new: Correspondences) -> Correspondences {
    let quality = |c: &Correspondences| inlier_sampson(c).unwrap_or(f64::INFINITY);
    let wins = quality(&new) < quality(&old);
    let tries = [old.tries.clone(), new.tries.clone()].concat();
    Correspondences { tries, ..if wins { new } else { old } }
}

fn attempt(
    pair: PairName,
    features: [&ViewFeatures; 2],
    detection: &DetectionOptions,
    options: &Options,
    number: u32,
) -> Correspondences {
    let keypoints =
        features.map(|found| found.as_ref().map_or(0, |features| features.keypoints.len()));
    let (matches, geometry) = match match_features(features, options) {
        Ok(matches) => {
            let points: Vec<_> = matches.iter().map(|m| m.points).collect();
            let seed = pair_seed(options.seed, pair, SEED_PURPOSE);
            let geometry = estimate_fundamental(&points, &options.epipolar, seed)
                .map_err(PairFailure::EpipolarGeometry);
            (matches, geometry)
        }
        Err(failure) => (Vec::new(), Err(failure)),
    };
    let mut outcome = Correspondences { keypoints, matches, geometry, tries: Vec::new() };
    outcome.tries.push(report(&outcome, detection, options, number));
    outcome
}

fn match_features(
    features: [&ViewFeatures; 2],
    options: &Options,
) -> Result<Vec<MatchedPoints>, PairFailure> {
    let [left, right] =
        features.map(|found| found.as_ref().map_err(|error| PairFailure::Features(error.clone())));
    let (left, right) = (left?, right?);
    let matches =
        match_descriptors(&left.descriptors, &right.descriptors, &options.matching, options.seed)
            .map_err(PairFailure::Matching)?;
    Ok(matches.iter().map(|found| located(found, left, right)).collect())
}

fn located(found: &Match, left: &Features, right: &Features) -> MatchedPoints {
    let points = Correspondence {
        left: left.keypoints[found.left].position.cast(),
        right: right.keypoints[found.right].position.cast(),
    };
    MatchedPoints { points, distance: found.distance }
}

fn report(
    outcome: &Correspondences,
    detection: &DetectionOptions,
    options: &Options,
    number: u32,
) -> TryReport {
    let mean_sampson_px2 = inlier_sampson(outcome);
    TryReport {
        number,
        keypoints_left: outcome.keypoints[0],
        keypoints_right: outcome.keypoints[1],
        matches: outcome.matches.len(),
        inliers: outcome.geometry.as_ref().map_or(0, EpipolarGeometry::inlier_count),
        mean_sampson_px2,
        passed: mean_sampson_px2.is_some_and(|msd| msd <= options.epipolar.max_mean_sampson_px2),
        failure: outcome.geometry.as_ref().err().map(ToString::to_string),
        detection: detection.clone(),
    }
}

fn inlier_sampson(outcome: &Correspondences) -> Option<f64> {
    let geometry = outcome.geometry.as_ref().ok()?;
    let inliers = outcome.matches.iter().zip(&geometry.inliers).filter(|(_, inlier)| **inlier);
    mean_distance(
        &geometry.fundamental,
        inliers.map(|(m, _)| (m.points.left, m.points.right)),
        sampson_distance_px2,
    )
}
