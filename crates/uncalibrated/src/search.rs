//! The disparity stage searched for parameters that suit a known truth.

use image::GrayImage;
use rayon::prelude::*;
use serde::Serialize;

use super::pair::{PairFailure, rectified_pair};
use crate::options::DisparityOptions;
use crate::vision::{self, Rectification, RectificationError};
use picture::FloatImage;

/// Values tried, each with each.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct DisparityGrid {
    /// The smallest disparity searched, px.
    pub min_disparities_px: Vec<i32>,
    /// Side of the matched window, px, odd.
    pub block_sizes: Vec<i32>,
}

impl DisparityGrid {
    /// The least disparities `0, step, -step, …` up to `reach_px` either way,
    /// and block sizes `blocks` by `block_step`.
    pub fn symmetric(
        reach_px: u16,
        step_px: u16,
        blocks: std::ops::RangeInclusive<u16>,
        block_step: u16,
    ) -> Self {
        let (reach, step) = (i32::from(reach_px), i32::from(step_px.max(1)));
        let both = (step..=reach).step_by(step as usize).flat_map(|value| [value, -value]);
        let (low, high) = (i32::from(*blocks.start()), i32::from(*blocks.end()));
        Self {
            min_disparities_px: std::iter::once(0).chain(both).collect(),
            block_sizes: (low..=high).step_by(usize::from(block_step.max(1))).collect(),
        }
    }

    /// Block size and least disparity of every point: by block size, then by
    /// least disparity.
    pub fn points(&self) -> impl Iterator<Item = (i32, i32)> {
        let with_each = |&block| self.min_disparities_px.iter().map(move |&least| (block, least));
        self.block_sizes.iter().flat_map(with_each)
    }
}

impl Default for DisparityGrid {
    /// -32 to 32 px by 2, blocks of 5 to 51 px by 4 (these stay odd).
    fn default() -> Self {
        Self::symmetric(32, 2, 5..=51, 4)
    }
}

/// One point of the grid.
#[derive(Clone, Debug, PartialEq)]
pub struct DisparityTry<M> {
    /// The smallest disparity searched, px.
    pub min_disparity_px: i32,
    /// Side of the matched window, px.
    pub block_size: i32,
    /// What `measure` said.
    pub measured: M,
}

/// Tries every point of `grid` on one pair and measures the left view's map.
///
/// * `drawings`: left and right, of one size, as they were rectified by
///   `rectification`.
/// * `options`: of the stage; the two searched ones are replaced.
/// * `measure`: takes the disparity map of the left view, px (`x_left -
///   x_right` of the rectified pair), NaN where missing; or why there is none.
///
/// Returns a try for each point, in the order of [`DisparityGrid::points`]. Runs
/// on the current thread pool; the result does not depend on it.
///
/// # Source
/// Arys 2020, §3.6, §4.4 (min disparity searched about zero for the best bad2.0).
pub fn search_disparity<M: Send>(
    drawings: [&GrayImage; 2],
    rectification: &Rectification,
    options: &DisparityOptions,
    grid: &DisparityGrid,
    measure: impl Fn(Result<FloatImage, PairFailure>) -> M + Sync,
) -> Vec<DisparityTry<M>> {
    // Once for all points: they differ after it.
    let rectified = rectified_pair(drawings, rectification)
        .map_err(|error| PairFailure::from(RectificationError::from(error)));
    let map = |options: &DisparityOptions| {
        let [left, right] = rectified.as_ref().map_err(PairFailure::clone)?;
        let map = vision::left_disparity(left, right, options)?;
        Ok(vision::derectify(&map, &rectification.rectified_from_left)?)
    };
    let points: Vec<_> = grid.points().collect();
    let tried = points.par_iter().with_max_len(1).map(|&(block_size, min_disparity_px)| {
        let options = DisparityOptions { block_size, min_disparity_px, ..options.clone() };
        DisparityTry { min_disparity_px, block_size, measured: measure(map(&options)) }
    });
    tried.collect()
}

/// The try with the least of what `bad2` reads from its measure; among equals
/// the first. Those that it reads nothing from are left out.
pub fn best_try<M>(
    tries: &[DisparityTry<M>],
    bad2: impl Fn(&M) -> Option<f64>,
) -> Option<&DisparityTry<M>> {
    let measured = tries.iter().filter_map(|found| Some((bad2(&found.measured)?, found)));
    measured
        .filter(|(bad2, _)| !bad2.is_nan())
        .min_by(|(one, _), (other, _)| one.total_cmp(other))
        .map(|(_, found)| found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;
    use nalgebra::Matrix3;

    use crate::vision::DisparityError;

    /// Repeatable texture without structure.
    fn texture(x: i64, y: i64) -> u8 {
        let mut hash = (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (y as u64) << 32;
        hash = (hash ^ hash >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (hash >> 40) as u8
    }

    /// A plane at this disparity.
    fn plane(disparity: i64) -> [GrayImage; 2] {
        [0, disparity].map(|shift| {
            GrayImage::from_fn(160, 60, |x, y| Luma([texture(i64::from(x) + shift, i64::from(y))]))
        })
    }

    fn level() -> Rectification {
        Rectification {
            rectified_from_left: Matrix3::identity(),
            rectified_from_right: Matrix3::identity(),
        }
    }

    /// Share of the middle that is off by more than two from `truth`.
    fn off_from(truth: f32) -> impl Fn(Result<FloatImage, PairFailure>) -> Option<f64> + Sync {
        move |map| {
            let map = map.ok()?;
            let middle: Vec<_> =
                map.enumerate_pixels().filter(|(x, ..)| (60..100).contains(x)).collect();
            let bad = middle
                .iter()
                .filter(|(.., v)| v.0[0].is_nan() || (v.0[0] - truth).abs() > 2.0)
                .count();
            Some(bad as f64 / middle.len() as f64)
        }
    }

    #[test]
    fn the_grid_is_the_dissertations() {
        let grid = DisparityGrid::default();
        assert_eq!(grid.min_disparities_px.len(), 33);
        assert_eq!(grid.min_disparities_px[..5], [0, 2, -2, 4, -4]);
        assert_eq!(grid.min_disparities_px[32], -32);
        assert_eq!(grid.block_sizes, [5, 9, 13, 17, 21, 25, 29, 33, 37, 41, 45, 49]);
    }

    #[test]
    fn the_best_try_searches_where_the_truth_is() {
        let [left, right] = plane(-20);
        let options = DisparityOptions {
            num_disparities: 16,
            p1: 200,
            p2: 800,
            ..DisparityOptions::default()
        };
        let grid = DisparityGrid { min_disparities_px: vec![0, 24, -24], block_sizes: vec![5, 9] };
        let level = level();
        let drawings = [&left, &right];
        let tries = search_disparity(drawings, &level, &options, &grid, off_from(-20.0));
        assert_eq!(tries.len(), 6);
        let best = best_try(&tries, |bad2| *bad2).unwrap();
        assert_eq!(best.min_disparity_px, -24);
        assert!(best.measured.unwrap() < 0.05, "{best:?}");
        assert!(tries.iter().filter(|t| t.min_disparity_px != -24).all(|t| t.measured > Some(0.9)));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        let again =
            pool.install(|| search_disparity(drawings, &level, &options, &grid, off_from(-20.0)));
        assert_eq!(again, tries);
    }

    #[test]
    fn points_that_cannot_be_tried_say_why() {
        let [left, right] = plane(3);
        let grid = DisparityGrid { min_disparities_px: vec![0], block_sizes: vec![155] };
        let options = DisparityOptions::default();
        let tries =
            search_disparity([&left, &right], &level(), &options, &grid, |map| map.map(|_| 0.0));
        assert!(matches!(
            tries[0].measured,
            Err(PairFailure::Disparity(DisparityError::TooNarrow { .. }))
        ));
        assert_eq!(best_try(&tries, |measured| measured.as_ref().ok().copied()), None);
    }
}
