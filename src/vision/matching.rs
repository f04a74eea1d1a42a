use opencv::boxed_ref::BoxedRef;
use opencv::core::{DMatch, Mat, NORM_HAMMING, NORM_L2, ToInputArray, Vector};
use opencv::features2d::{BFMatcher, DescriptorMatcherTraitConst};

use super::cv::{self, OpenCvError};
use super::features::Descriptors;
use crate::options::MatchingOptions;

/// Keypoints of two views whose descriptors are alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// Index of the left view's keypoint.
    pub left: usize,
    /// Index of the right view's keypoint.
    pub right: usize,
    /// Descriptor distance: bits for binary descriptors, Euclidean otherwise.
    pub distance: f32,
}

/// Matches descriptors by brute force, sorted by the left keypoint.
///
/// The cross-check is OpenCV's: a right keypoint proposes itself to its nearest
/// left one, which keeps the nearest of its proposals. Descriptors of different
/// kinds have no matches.
///
/// # Source
/// Arys 2020, §2.2.3, §3.3; Lowe 2004, §7.1 (the ratio test).
pub fn match_descriptors(
    left: &Descriptors,
    right: &Descriptors,
    options: &MatchingOptions,
) -> Result<Vec<Match>, OpenCvError> {
    if left.count() == 0 || right.count() == 0 {
        return Ok(Vec::new());
    }
    let norm = match (left, right) {
        (Descriptors::Binary { length: l, .. }, Descriptors::Binary { length: r, .. })
            if l == r =>
        {
            NORM_HAMMING
        }
        (Descriptors::Float { length: l, .. }, Descriptors::Float { length: r, .. }) if l == r => {
            NORM_L2
        }
        _ => return Ok(Vec::new()),
    };
    cv::single_threaded();
    let (left, right) = (rows(left)?, rows(right)?);
    let mut matches = nearest(&left, &right, norm, options.cross_check)?;
    if let Some(ratio) = options.ratio {
        let distinct = distinct_nearest(&left, &right, norm, ratio)?;
        matches.retain(|found| distinct.contains(&(found.left, found.right)));
    }
    if let Some(limit) = options.max_distance {
        matches.retain(|found| found.distance <= limit);
    }
    matches.sort_by_key(|found| (found.left, found.right));
    Ok(matches)
}

fn rows(descriptors: &Descriptors) -> Result<BoxedRef<'_, Mat>, OpenCvError> {
    let count = descriptors.count() as i32;
    Ok(match descriptors {
        Descriptors::Binary { length, bytes } => {
            Mat::new_rows_cols_with_data(count, *length as i32, bytes.as_slice())?
        }
        Descriptors::Float { length, values } => {
            Mat::new_rows_cols_with_data(count, *length as i32, values.as_slice())?
        }
    })
}

fn nearest(
    left: &impl ToInputArray,
    right: &impl ToInputArray,
    norm: i32,
    cross_check: bool,
) -> Result<Vec<Match>, OpenCvError> {
    let mut found = Vector::<DMatch>::new();
    BFMatcher::create(norm, cross_check)?.train_match_def(left, right, &mut found)?;
    Ok(found.iter().map(to_match).collect())
}

/// The nearest neighbours that are clearly nearer than the second nearest, as
/// (left, right), sorted. One candidate alone has no rival.
fn distinct_nearest(
    left: &impl ToInputArray,
    right: &impl ToInputArray,
    norm: i32,
    ratio: f32,
) -> Result<std::collections::BTreeSet<(usize, usize)>, OpenCvError> {
    let mut found = Vector::<Vector<DMatch>>::new();
    BFMatcher::create(norm, false)?.knn_train_match_def(left, right, &mut found, 2)?;
    let distinct = found.iter().filter_map(|candidates| {
        let best = candidates.get(0).ok()?;
        let rival = candidates.get(1).ok();
        rival
            .is_none_or(|second| best.distance < ratio * second.distance)
            .then_some((best.query_idx as usize, best.train_idx as usize))
    });
    Ok(distinct.collect())
}

fn to_match(found: DMatch) -> Match {
    Match {
        left: found.query_idx as usize,
        right: found.train_idx as usize,
        distance: found.distance,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn binary(rows: &[u8]) -> Descriptors {
        Descriptors::Binary { length: 1, bytes: rows.to_vec() }
    }

    fn pairs(left: &[u8], right: &[u8], options: &MatchingOptions) -> Vec<(usize, usize, f32)> {
        match_descriptors(&binary(left), &binary(right), options)
            .unwrap()
            .iter()
            .map(|found| (found.left, found.right, found.distance))
            .collect()
    }

    #[test]
    fn cross_check_drops_the_worse_suitor() {
        let options = MatchingOptions::default();
        let (left, right) = ([0b0000_0000, 0b0000_0011], [0b0000_0000, 0b1111_1100]);
        assert_eq!(pairs(&left, &right, &options), [(0, 0, 0.0)]);
        let options = MatchingOptions { cross_check: false, ..options };
        assert_eq!(pairs(&left, &right, &options), [(0, 0, 0.0), (1, 0, 2.0)]);
    }

    #[test]
    fn ratio_drops_ambiguous_and_limit_drops_distant_matches() {
        let options = MatchingOptions { cross_check: false, ratio: Some(0.6), max_distance: None };
        let (left, right) = ([0b0000_1111], [0b0000_0111, 0b0000_1100]);
        assert_eq!(pairs(&left, &right, &options), [(0, 0, 1.0)]);
        let options = MatchingOptions { ratio: Some(0.5), ..options };
        assert_eq!(pairs(&left, &right, &options), []);
        let options = MatchingOptions { ratio: None, max_distance: Some(0.5), ..options };
        assert_eq!(pairs(&left, &right, &options), []);
    }

    #[test]
    fn nothing_matches_nothing_or_another_kind() {
        let options = MatchingOptions::default();
        assert_eq!(pairs(&[], &[1, 2], &options), []);
        let float = Descriptors::Float { length: 1, values: vec![1.0] };
        assert_eq!(match_descriptors(&binary(&[1]), &float, &options).unwrap(), []);
    }

    #[test]
    fn euclidean_distance_for_values() {
        let left = Descriptors::Float { length: 2, values: vec![0.0, 0.0] };
        let right = Descriptors::Float { length: 2, values: vec![9.0, 9.0, 3.0, 4.0] };
        let found = match_descriptors(&left, &right, &MatchingOptions::default()).unwrap();
        assert_eq!(found, [Match { left: 0, right: 1, distance: 5.0 }]);
    }
}
