//! From two views' features to their epipolar geometry, tried again with other
//! parameters while it is not good enough.

use image::GrayImage;
use serde::Serialize;

use super::edit::{EditReport, edited};
use super::pair::PairFailure;
use super::pairs::PairName;
use super::quality::{FiveMetrics, inlier_sampson};
use super::variation::{Parameters, pair_seed, vary};
use crate::Options;
use crate::options::{DetectionOptions, EpipolarOptions, Feedback};
use crate::vision::{
    Correspondence, EpipolarGeometry, FeatureError, Features, Match, detect_and_describe,
    estimate_fundamental, match_descriptors,
};
use sheet::MatchEdit;

/// Sets the estimate's random stream apart from those of detection tries.
const SEED_PURPOSE: u64 = 2 << 32;
/// Tries with fewer inliers go behind those with as many, however good: few
/// matches are easily explained.
const MANY_INLIERS: usize = 15;

/// A match as coordinates, OpenCV's pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatchedPoints {
    /// Where it is in the left and in the right view.
    pub points: Correspondence,
    /// Descriptor distance; `None` for matches that were given.
    pub distance: Option<f32>,
}

/// One try's outcome.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TryReport {
    /// From 1.
    pub number: u32,
    /// Keypoints found in the left view.
    pub keypoints_left: usize,
    /// Keypoints found in the right view.
    pub keypoints_right: usize,
    /// Matches that the geometry was estimated from.
    pub matches: usize,
    /// How many of them agree with it; 0 if there is no estimate.
    pub inliers: usize,
    /// Over the inliers; null if there is no estimate.
    pub mean_sampson_px2: Option<f64>,
    /// All five, if they are what is optimised and exist.
    pub five_metrics: Option<FiveMetrics>,
    /// Their weighed sum.
    pub cost: Option<f64>,
    /// Whether the mean Sampson distance was at most its threshold.
    pub passed: bool,
    /// Why there is no estimate, for people; `None` if there is one.
    pub failure: Option<String>,
    /// Inlier threshold that it ran with, px.
    pub max_error_px: f64,
    /// What the detection ran with.
    pub detection: DetectionOptions,
}

/// What two views have in common.
#[derive(Clone, Debug)]
pub(super) struct Correspondences {
    pub keypoints: [usize; 2],
    pub matches: Vec<MatchedPoints>,
    /// What was done to the automatic matches.
    pub edit: Option<EditReport>,
    pub geometry: Result<EpipolarGeometry, PairFailure>,
    pub tries: Vec<TryReport>,
    /// Of the try that these are from; from 1.
    pub chosen_try: u32,
}

/// One view's features, or why it has none.
pub(super) type ViewFeatures = Result<Features, FeatureError>;

/// Two views to be matched.
#[derive(Clone, Copy)]
pub(super) struct PairInput<'a> {
    pub name: PairName,
    pub drawings: [&'a GrayImage; 2],
    /// By the options as given.
    pub features: [&'a ViewFeatures; 2],
    pub edit: Option<&'a MatchEdit>,
}

/// Matches two views and estimates their geometry; the best of at most
/// `options.epipolar.tries`.
///
/// `check` is asked between tries.
///
/// # Source
/// Arys 2020, §3.4 (the feedback of the mean Sampson distance), §3.5 (of all
/// five metrics).
pub(super) fn correspond<E>(
    pair: &PairInput<'_>,
    options: &Options,
    check: impl Fn() -> Result<(), E>,
) -> Result<Correspondences, E> {
    let given = Parameters::of(options);
    let mut used = given.clone();
    let mut best = attempt(pair, pair.features, &used, options, 1);
    // Where no match is automatic, detection has no say.
    let tries = match pair.edit {
        Some(MatchEdit::Replace(_)) => 1,
        _ => options.epipolar.tries,
    };
    for number in 2..=tries {
        if is_settled(&best, &options.epipolar) {
            break;
        }
        check()?;
        let from = match options.epipolar.feedback {
            Feedback::MeanSampson => &given,
            Feedback::FiveMetrics => &used,
        };
        let varied = vary(from, options, pair.name, number - 1);
        let found = pair.drawings.map(|drawing| detect_and_describe(drawing, &varied.detection));
        let next = attempt(pair, [&found[0], &found[1]], &varied, options, number);
        best = better(best, next, options.epipolar.feedback);
        if best.chosen_try == number {
            used = varied;
        }
    }
    Ok(best)
}

/// Whether further tries are spared.
fn is_settled(best: &Correspondences, options: &EpipolarOptions) -> bool {
    options.feedback == Feedback::MeanSampson && best.tries.last().is_some_and(|last| last.passed)
}

/// The better of two outcomes, with the tries of both.
fn better(old: Correspondences, new: Correspondences, feedback: Feedback) -> Correspondences {
    let quality = |outcome: &Correspondences| {
        let report = outcome.tries.last();
        let value = report.and_then(|report| match feedback {
            Feedback::MeanSampson => report.mean_sampson_px2,
            Feedback::FiveMetrics => report.cost,
        });
        let few = report.is_some_and(|report| report.inliers < MANY_INLIERS);
        let behind = feedback == Feedback::FiveMetrics && few;
        (value.is_none(), behind, value.unwrap_or(f64::INFINITY))
    };
    // The older's own report is not its last.
    let chosen = old.tries.iter().find(|report| report.number == old.chosen_try).cloned();
    let of_old = Correspondences { tries: chosen.into_iter().collect(), ..old.clone() };
    let wins = quality(&new) < quality(&of_old);
    let tries = [old.tries.clone(), new.tries.clone()].concat();
    Correspondences { tries, ..if wins { new } else { old } }
}

fn attempt(
    pair: &PairInput<'_>,
    features: [&ViewFeatures; 2],
    parameters: &Parameters,
    options: &Options,
    number: u32,
) -> Correspondences {
    let keypoints =
        features.map(|found| found.as_ref().map_or(0, |features| features.keypoints.len()));
    let automatic = match pair.edit {
        Some(MatchEdit::Replace(_)) => Ok(Vec::new()),
        _ => match_features(features, options),
    };
    let epipolar =
        EpipolarOptions { max_error_px: parameters.max_error_px, ..options.epipolar.clone() };
    let (matches, edit, geometry) = match automatic {
        Ok(automatic) => {
            let (matches, edit) = edited(automatic, pair.edit);
            let points: Vec<_> = matches.iter().map(|m| m.points).collect();
            let seed = pair_seed(options.seed, pair.name, SEED_PURPOSE);
            let geometry = estimate_fundamental(&points, &epipolar, seed)
                .map_err(PairFailure::EpipolarGeometry);
            (matches, edit, geometry)
        }
        Err(failure) => (Vec::new(), None, Err(failure)),
    };
    let outcome = Correspondences {
        keypoints,
        matches,
        edit,
        geometry,
        tries: Vec::new(),
        chosen_try: number,
    };
    let report = report(&outcome, pair, parameters, &epipolar);
    Correspondences { tries: vec![report], ..outcome }
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
    MatchedPoints { points, distance: Some(found.distance) }
}

fn report(
    outcome: &Correspondences,
    pair: &PairInput<'_>,
    parameters: &Parameters,
    options: &EpipolarOptions,
) -> TryReport {
    let points: Vec<_> = outcome.matches.iter().map(|m| m.points).collect();
    let geometry = outcome.geometry.as_ref().ok();
    let mean_sampson_px2 = geometry.and_then(|geometry| inlier_sampson(geometry, &points));
    let five_metrics = geometry
        .filter(|_| options.feedback == Feedback::FiveMetrics)
        .and_then(|geometry| FiveMetrics::of(geometry, &points, pair.drawings[0].dimensions()));
    TryReport {
        number: outcome.chosen_try,
        keypoints_left: outcome.keypoints[0],
        keypoints_right: outcome.keypoints[1],
        matches: outcome.matches.len(),
        inliers: geometry.map_or(0, EpipolarGeometry::inlier_count),
        mean_sampson_px2,
        five_metrics,
        cost: five_metrics.map(|five| five.cost(&options.weights)),
        passed: mean_sampson_px2.is_some_and(|msd| msd <= options.max_mean_sampson_px2),
        failure: outcome.geometry.as_ref().err().map(ToString::to_string),
        max_error_px: parameters.max_error_px,
        detection: parameters.detection.clone(),
    }
}
