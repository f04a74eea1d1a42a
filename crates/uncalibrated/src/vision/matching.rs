//! Matches descriptors of two views.

use opencv::boxed_ref::BoxedRef;
use opencv::core::{self, DMatch, Mat, MatTraitConst, NORM_HAMMING, NORM_L2, Ptr, Vector};
use opencv::features2d::{BFMatcher, DescriptorMatcherTraitConst, FlannBasedMatcher};
use opencv::flann::{IndexParams, KDTreeIndexParams, LshIndexParams, SearchParams};

use super::cv::{self, OpenCvError};
use super::features::Descriptors;
use crate::options::{FlannOptions, Matcher, MatchingOptions};

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

/// Matches descriptors, sorted by the left keypoint.
///
/// * `seed`: of the approximate search's trees and hash tables.
///
/// By brute force the cross-check is OpenCV's: a right keypoint proposes itself
/// to its nearest left one, which keeps the nearest of its proposals. By FLANN
/// each must have found the other. Descriptors of different kinds have no
/// matches; hashing may find none for some.
///
/// # Source
/// Arys 2020, §2.2.3, §3.3; Lowe 2004, §7.1 (the ratio test); Muja & Lowe 2009;
/// Lv et al. 2007 (multi-probe hashing).
pub fn match_descriptors(
    left: &Descriptors,
    right: &Descriptors,
    options: &MatchingOptions,
    seed: u32,
) -> Result<Vec<Match>, OpenCvError> {
    if left.count() == 0 || right.count() == 0 || !comparable(left, right) {
        return Ok(Vec::new());
    }
    cv::single_threaded();
    let search = Search { left: rows(left)?, right: rows(right)?, kind: kind(left), options, seed };
    let mut matches = search.nearest()?;
    if let Some(ratio) = options.ratio {
        let distinct = search.distinct(ratio)?;
        matches.retain(|found| distinct.contains(&(found.left, found.right)));
    }
    if let Some(limit) = options.max_distance {
        matches.retain(|found| found.distance <= limit);
    }
    matches.sort_by_key(|found| (found.left, found.right));
    Ok(matches)
}

fn comparable(left: &Descriptors, right: &Descriptors) -> bool {
    match (left, right) {
        (Descriptors::Binary { length: l, .. }, Descriptors::Binary { length: r, .. })
        | (Descriptors::Float { length: l, .. }, Descriptors::Float { length: r, .. }) => l == r,
        _ => false,
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Bits,
    Values,
}

fn kind(descriptors: &Descriptors) -> Kind {
    match descriptors {
        Descriptors::Binary { .. } => Kind::Bits,
        Descriptors::Float { .. } => Kind::Values,
    }
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

/// Two views' descriptors, a row each, and how they are compared.
struct Search<'a> {
    left: BoxedRef<'a, Mat>,
    right: BoxedRef<'a, Mat>,
    kind: Kind,
    options: &'a MatchingOptions,
    seed: u32,
}

impl Search<'_> {
    /// The nearest right row of each left one, cross-checked if asked for.
    fn nearest(&self) -> Result<Vec<Match>, OpenCvError> {
        if self.options.matcher == Matcher::BruteForce {
            let mut found = Vector::<DMatch>::new();
            self.brute_force(self.options.cross_check)?.train_match_def(
                &self.left,
                &self.right,
                &mut found,
            )?;
            return Ok(found.iter().map(to_match).collect());
        }
        let forward = self.flann_neighbours(&self.left, &self.right, 1)?;
        let mut matches: Vec<_> = forward.iter().filter_map(|row| row.first().copied()).collect();
        if self.options.cross_check {
            let backward = self.flann_neighbours(&self.right, &self.left, 1)?;
            matches.retain(|found| {
                let answer = backward.get(found.right).and_then(|row| row.first());
                answer.is_some_and(|back| back.right == found.left)
            });
        }
        Ok(matches)
    }

    /// The nearest neighbours that are clearly nearer than the second nearest,
    /// as (left, right). One candidate alone has no rival.
    fn distinct(
        &self,
        ratio: f32,
    ) -> Result<std::collections::BTreeSet<(usize, usize)>, OpenCvError> {
        let candidates = match self.options.matcher {
            Matcher::Flann => self.flann_neighbours(&self.left, &self.right, 2)?,
            Matcher::BruteForce => {
                let mut found = Vector::<Vector<DMatch>>::new();
                self.brute_force(false)?.knn_train_match_def(
                    &self.left,
                    &self.right,
                    &mut found,
                    2,
                )?;
                to_matches(&found)
            }
        };
        let distinct = candidates.iter().filter_map(|row| {
            let (best, rival) = (row.first()?, row.get(1));
            rival
                .is_none_or(|second| best.distance < ratio * second.distance)
                .then_some((best.left, best.right))
        });
        Ok(distinct.collect())
    }

    fn brute_force(&self, cross_check: bool) -> Result<BFMatcher, OpenCvError> {
        let norm = match self.kind {
            Kind::Bits => NORM_HAMMING,
            Kind::Values => NORM_L2,
        };
        Ok(BFMatcher::new(norm, cross_check)?)
    }

    /// About the `count` nearest rows of `train` of each row of `query`, the
    /// nearest first; query rows are `left` of the matches.
    fn flann_neighbours(
        &self,
        query: &BoxedRef<'_, Mat>,
        train: &BoxedRef<'_, Mat>,
        count: i32,
    ) -> Result<Vec<Vec<Match>>, OpenCvError> {
        // FLANN draws from the thread's generator, whose seed has 32 bits: the
        // lower ones of ours.
        core::set_rng_seed(self.seed as i32)?;
        let FlannOptions { trees, checks, tables, key_bits, multi_probe_level } =
            self.options.flann;
        let index: Ptr<IndexParams> = match self.kind {
            Kind::Values => Ptr::new(KDTreeIndexParams::new(trees)?).into(),
            Kind::Bits => {
                Ptr::new(LshIndexParams::new(tables, key_bits, multi_probe_level)?).into()
            }
        };
        let search = Ptr::new(SearchParams::new_1(checks, 0.0, true)?);
        let mut found = Vector::<Vector<DMatch>>::new();
        FlannBasedMatcher::new(&index, &search)?.knn_train_match_def(
            query,
            train,
            &mut found,
            count.min(train.rows()),
        )?;
        Ok(to_matches(&found))
    }
}

fn to_matches(found: &Vector<Vector<DMatch>>) -> Vec<Vec<Match>> {
    found.iter().map(|row| row.iter().map(to_match).collect()).collect()
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
    use rand::seq::SliceRandom;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn binary(rows: &[u8]) -> Descriptors {
        Descriptors::Binary { length: 1, bytes: rows.to_vec() }
    }

    fn pairs(left: &[u8], right: &[u8], options: &MatchingOptions) -> Vec<(usize, usize, f32)> {
        match_descriptors(&binary(left), &binary(right), options, 0)
            .unwrap()
            .iter()
            .map(|found| (found.left, found.right, found.distance))
            .collect()
    }

    fn all_nearest() -> MatchingOptions {
        MatchingOptions { cross_check: false, ..MatchingOptions::default() }
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
        let options = MatchingOptions { ratio: Some(0.6), ..all_nearest() };
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
        assert_eq!(match_descriptors(&binary(&[1]), &float, &options, 0).unwrap(), []);
    }

    #[test]
    fn euclidean_distance_for_values() {
        let left = Descriptors::Float { length: 2, values: vec![0.0, 0.0] };
        let right = Descriptors::Float { length: 2, values: vec![9.0, 9.0, 3.0, 4.0] };
        let found = match_descriptors(&left, &right, &MatchingOptions::default(), 0).unwrap();
        assert_eq!(found, [Match { left: 0, right: 1, distance: 5.0 }]);
    }

    /// Random descriptors, and the same ones slightly changed in another order.
    fn shuffled(kind: Kind, count: usize) -> (Descriptors, Descriptors, Vec<usize>) {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut order: Vec<usize> = (0..count).collect();
        order.shuffle(&mut rng);
        match kind {
            Kind::Bits => {
                let left: Vec<[u8; 32]> = (0..count).map(|_| rng.random()).collect();
                let changed = |index: &usize| {
                    let mut row = left[*index];
                    row[index % 32] ^= 1 << (index % 8);
                    row
                };
                let right: Vec<u8> = order.iter().flat_map(changed).collect();
                let of = |bytes| Descriptors::Binary { length: 32, bytes };
                (of(left.concat()), of(right), order)
            }
            Kind::Values => {
                let left: Vec<[f32; 8]> = (0..count).map(|_| rng.random()).collect();
                let right = order.iter().flat_map(|&index| left[index].map(|v| v + 0.001));
                let right = right.collect();
                let of = |values| Descriptors::Float { length: 8, values };
                (of(left.concat()), of(right), order)
            }
        }
    }

    #[test]
    fn flann_finds_nearly_all_that_brute_force_finds_and_nothing_else() {
        for kind in [Kind::Bits, Kind::Values] {
            let (left, right, order) = shuffled(kind, 300);
            let flann = MatchingOptions { matcher: Matcher::Flann, ..MatchingOptions::default() };
            for options in [
                flann.clone(),
                MatchingOptions { cross_check: false, ratio: Some(0.8), ..flann.clone() },
            ] {
                let found = match_descriptors(&left, &right, &options, 7).unwrap();
                assert!(found.len() >= 285, "{} of 300", found.len());
                assert!(found.iter().all(|m| order[m.right] == m.left));
                assert_eq!(match_descriptors(&left, &right, &options, 7).unwrap(), found);
            }
            let exact = match_descriptors(&left, &right, &all_nearest(), 0).unwrap();
            let found = match_descriptors(&left, &right, &flann, 7).unwrap();
            let of = |left: usize| exact.iter().find(|m| m.left == left).unwrap();
            assert!(found.iter().all(|m| (m.distance - of(m.left).distance).abs() < 1e-5));
        }
    }

    #[test]
    fn flann_takes_few_and_equal_descriptors() {
        let options = MatchingOptions {
            matcher: Matcher::Flann,
            ratio: Some(0.9),
            ..MatchingOptions::default()
        };
        for count in [1, 2, 5] {
            let bits = Descriptors::Binary { length: 32, bytes: vec![7; 32 * count] };
            let values = Descriptors::Float { length: 64, values: vec![0.5; 64 * count] };
            for descriptors in [bits, values] {
                let found = match_descriptors(&descriptors, &descriptors, &options, 0).unwrap();
                assert!(found.len() <= count);
                assert!(found.iter().all(|m| m.left < count && m.right < count));
            }
        }
    }
}
