//! Views' clouds brought together along the chain of neighbours.

use nalgebra::{Point3, Rotation3, Similarity3, Translation3, UnitQuaternion, Vector3};
use serde::Serialize;

use super::pair::PairResult;
use super::pairs::{PairName, PlannedPair};
use super::reconstruct::ViewResult;
use super::variation::pair_seed;
use crate::Options;
use crate::vision::{SimilarityError, SimilarityFit, ViewCloud, robust_similarity};
use frames::Azimuth;
use picture::FloatImage;

/// Sets the merge's random stream apart from those of detection tries.
const SEED_PURPOSE: u64 = 1 << 32;

/// How two neighbouring clouds were joined.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MergeLink {
    /// The pair whose two clouds it joins.
    pub pair: PairName,
    /// Inlier matches with depth in both views.
    pub shared_points: usize,
    /// Whether it holds.
    #[serde(flatten)]
    pub outcome: LinkOutcome,
}

/// Whether two clouds could be joined, and by what.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "status", rename_all = "snake_case")]
pub enum LinkOutcome {
    /// A similarity brings them together.
    Joined {
        /// Shared points within the merge's error limit.
        agreeing_points: usize,
        /// Over the agreeing points, px.
        rms_error_px: f64,
        /// Of the right view's cloud to the left's.
        scale: f64,
        /// Of the right view's cloud to the left's, degrees; the azimuths differ
        /// by `angle_deg` of the pair.
        rotation_deg: f64,
    },
    /// No similarity does.
    Failed {
        /// Why.
        failure: SimilarityError,
    },
}

/// The joined views and where their clouds go.
#[derive(Clone, Debug)]
pub struct Merged {
    /// View index and the transform to the turntable frame, in chain order.
    pub views: Vec<(usize, Similarity3<f64>)>,
    /// One a pair of neighbours that was tried, joined or not.
    pub links: Vec<MergeLink>,
}

/// Joins the longest chain of neighbouring clouds.
///
/// Each usable pair gives the similarity that best maps the right view's cloud
/// to the left's by their shared matches. The chain's middle view keeps its own
/// scale and is turned to its azimuth; the others follow. Views beyond a broken
/// link are left out.
///
/// # Source
/// Arys 2020, §3.7.
pub(super) fn merge(
    views: &[ViewResult],
    plans: &[PlannedPair],
    pairs: &[PairResult],
    options: &Options,
) -> Merged {
    let mut forward: Vec<Option<Similarity3<f64>>> = vec![None; views.len()];
    let mut links = Vec::new();
    for (plan, pair) in plans.iter().zip(pairs) {
        let depths = (views[plan.left].cloud_depth(), views[plan.right].cloud_depth());
        let (Some(left), Some(right)) = depths else {
            continue;
        };
        if pair.rectification().is_none() {
            continue;
        }
        let (shared_points, fit) = join(pair, left, right, options);
        if let Ok(fit) = &fit {
            forward[plan.left] = Some(fit.target_from_source);
        }
        links.push(MergeLink { pair: pair.name, shared_points, outcome: outcome(fit) });
    }
    let points: Vec<_> = views.iter().map(|view| count_points(view.cloud_depth())).collect();
    let azimuths: Vec<_> = views.iter().map(|view| view.azimuth).collect();
    let chain = longest_chain(&forward, &points);
    Merged { views: place(&chain, &forward, &azimuths), links }
}

fn join(
    pair: &PairResult,
    left: &FloatImage,
    right: &FloatImage,
    options: &Options,
) -> (usize, Result<SimilarityFit, SimilarityError>) {
    let (left, right) = (ViewCloud::new(left), ViewCloud::new(right));
    let shared = pair.inliers().into_iter().filter_map(|points| {
        Some((
            right.point_at(points.right.x, points.right.y)?,
            left.point_at(points.left.x, points.left.y)?,
        ))
    });
    let (source, target): (Vec<Point3<f64>>, Vec<Point3<f64>>) = shared.unzip();
    let seed = pair_seed(options.seed, pair.name, SEED_PURPOSE);
    let fit = robust_similarity(
        &source,
        &target,
        options.merge.max_error_px,
        options.merge.iterations,
        seed,
    );
    (source.len(), fit)
}

fn outcome(fit: Result<SimilarityFit, SimilarityError>) -> LinkOutcome {
    match fit {
        Ok(fit) => LinkOutcome::Joined {
            agreeing_points: fit.inliers.iter().filter(|&&inlier| inlier).count(),
            rms_error_px: fit.rms_error,
            scale: fit.target_from_source.scaling(),
            rotation_deg: fit.target_from_source.isometry.rotation.angle().to_degrees(),
        },
        Err(failure) => LinkOutcome::Failed { failure },
    }
}

fn count_points(depth: Option<&FloatImage>) -> usize {
    depth.map_or(0, |depth| depth.iter().filter(|value| value.is_finite()).count())
}

/// The longest run of views joined by `forward[i]`, from view i + 1 (around the
/// turn) to view i; among equals the one with most `points`, then the first.
/// Views without points do not count.
fn longest_chain(forward: &[Option<Similarity3<f64>>], points: &[usize]) -> Vec<usize> {
    let count = forward.len();
    let mut best = Vec::new();
    let size =
        |chain: &[usize]| (chain.len(), chain.iter().map(|&view| points[view]).sum::<usize>());
    for start in (0..count).filter(|&start| points[start] > 0) {
        let mut chain = vec![start];
        while chain.len() < count && forward[chain[chain.len() - 1]].is_some() {
            chain.push((start + chain.len()) % count);
        }
        if size(&chain) > size(&best) {
            best = chain;
        }
    }
    best
}

fn place(
    chain: &[usize],
    forward: &[Option<Similarity3<f64>>],
    azimuths: &[Azimuth],
) -> Vec<(usize, Similarity3<f64>)> {
    let Some(&middle) = chain.get(chain.len() / 2) else { return Vec::new() };
    let azimuth = Rotation3::from_axis_angle(&Vector3::z_axis(), azimuths[middle].radians());
    let upright = Similarity3::from_parts(
        Translation3::identity(),
        UnitQuaternion::from_rotation_matrix(&azimuth),
        1.0,
    );
    let mut placed = vec![(middle, upright)];
    for pair in chain[chain.len() / 2..].windows(2) {
        let turntable_from_left = placed[placed.len() - 1].1;
        let Some(left_from_right) = forward[pair[0]] else { break };
        placed.push((pair[1], turntable_from_left * left_from_right));
    }
    let mut before = Vec::new();
    let mut turntable_from_right = upright;
    for pair in chain[..=chain.len() / 2].windows(2).rev() {
        let Some(left_from_right) = forward[pair[0]] else { break };
        turntable_from_right *= left_from_right.inverse();
        before.push((pair[0], turntable_from_right));
    }
    before.reverse();
    before.extend(placed);
    before
        .retain(|(_, placement)| placement.to_homogeneous().iter().all(|value| value.is_finite()));
    before
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turn(degrees: f64) -> Similarity3<f64> {
        Similarity3::new(Vector3::zeros(), Vector3::z() * degrees.to_radians(), 1.0)
    }

    fn azimuths(degrees: &[f64]) -> Vec<Azimuth> {
        degrees.iter().map(|&degrees| Azimuth::from_degrees(degrees).unwrap()).collect()
    }

    #[test]
    fn the_longest_chain_may_cross_zero() {
        let link = Some(turn(1.0));
        let points = [9; 5];
        assert_eq!(longest_chain(&[link, None, None, link, link], &points), [3, 4, 0, 1]);
        assert_eq!(longest_chain(&[link; 5], &points), [0, 1, 2, 3, 4]);
        assert_eq!(longest_chain(&[None; 3], &[0, 5, 5]), [1]);
        assert_eq!(longest_chain(&[None; 3], &[4, 5, 6]), [2]);
        assert_eq!(longest_chain(&[None; 3], &[0; 3]), [0_usize; 0]);
    }

    #[test]
    fn every_view_is_turned_to_its_azimuth() {
        let azimuths = azimuths(&[10.0, 30.0, 70.0, 75.0]);
        let forward = [Some(turn(20.0)), Some(turn(40.0)), Some(turn(5.0)), None];
        let placed = place(&[0, 1, 2, 3], &forward, &azimuths);
        assert_eq!(placed.iter().map(|(view, _)| *view).collect::<Vec<_>>(), [0, 1, 2, 3]);
        for (view, placement) in placed {
            let expected = turn(azimuths[view].degrees());
            let off = (placement.to_homogeneous() - expected.to_homogeneous()).norm();
            assert!(off < 1e-12, "view {view} is off by {off}");
        }
    }
}
