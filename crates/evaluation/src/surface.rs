//! Distance between two surfaces: Hausdorff, Chamfer, F-score, normals.

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use serde::Serialize;

use super::boundary::SurfacePoint;
use super::statistics::share;

/// Two surfaces compared by points on both. Lengths are shares of the truth's
/// longest side.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SurfaceReport {
    /// Half of the mean nearest distances there and back, not squared.
    pub chamfer_l1: f64,
    /// The largest nearest distance either way.
    pub hausdorff: f64,
    /// The larger of both ways' 95th percentiles.
    pub hausdorff_95: f64,
    /// The share of our points within the tolerance of the truth.
    pub precision: f64,
    /// The share of the truth's points within the tolerance of ours.
    pub recall: f64,
    /// The harmonic mean of precision and recall.
    pub f_score: f64,
    /// Mean of |cos| between normals of nearest points, both ways' mean.
    pub normal_consistency: f64,
    /// The share of our points on level surfaces, where the truth's nearest is not level: shelves
    /// and steps that views from the side cannot rule out.
    pub shelf_share: f64,
}

/// Level surfaces look straight up or down within this, degrees.
const LEVEL_DEG: f64 = 10.0;
/// A true surface that looks up or down within this excuses a level one, degrees.
const NEARLY_LEVEL_DEG: f64 = 30.0;

/// Nearest distances and |cos| of normals from each point of one surface.
struct Directed {
    /// Sorted.
    distances: Vec<f64>,
    mean_cosine: f64,
    /// Points whose own normal is level and the nearest one's is not.
    shelves: usize,
}

/// Compares `ours` with `truth`, lengths divided by `longest_side`.
///
/// `None` if either is empty or the points cannot be indexed.
///
/// # Source
/// Tatarchenko et al., What do single-view 3D reconstruction networks learn?,
/// 2019 (F-score); Mescheder et al., Occupancy networks, 2019 (Chamfer-L1,
/// normal consistency).
pub(super) fn compare_surfaces(
    ours: &[SurfacePoint],
    truth: &[SurfacePoint],
    longest_side: f64,
    tolerance: f64,
) -> Option<SurfaceReport> {
    let there = directed(ours, truth, longest_side)?;
    let back = directed(truth, ours, longest_side)?;
    let (precision, recall) = (there.within(tolerance), back.within(tolerance));
    let both = precision + recall;
    Some(SurfaceReport {
        chamfer_l1: (there.mean() + back.mean()) / 2.0,
        hausdorff: there.percentile(1.0).max(back.percentile(1.0)),
        hausdorff_95: there.percentile(0.95).max(back.percentile(0.95)),
        precision,
        recall,
        f_score: if both > 0.0 { 2.0 * precision * recall / both } else { 0.0 },
        normal_consistency: (there.mean_cosine + back.mean_cosine) / 2.0,
        shelf_share: share(there.shelves, there.distances.len()),
    })
}

fn directed(from: &[SurfacePoint], to: &[SurfacePoint], longest_side: f64) -> Option<Directed> {
    if from.is_empty() || to.is_empty() {
        return None;
    }
    let positions: Vec<[f64; 3]> = to.iter().map(|point| point.position.into()).collect();
    let tree = ImmutableKdTree::<f64, 3>::new_from_slice(&positions).ok()?;
    let rise = |degrees: f64| degrees.to_radians().cos();
    let (level, nearly) = (rise(LEVEL_DEG), rise(NEARLY_LEVEL_DEG));
    let nearest: Vec<(f64, f64, bool)> = from
        .par_iter()
        .map(|point| {
            let query: [f64; 3] = point.position.into();
            let found = tree.query(&query).nearest_one::<SquaredEuclidean<f64>>().execute();
            let normal = to[found.item as usize].normal;
            let is_shelf = point.normal.z.abs() > level && normal.z.abs() < nearly;
            (found.distance.sqrt() / longest_side, point.normal.dot(&normal).abs(), is_shelf)
        })
        .collect();
    let mean_cosine = nearest.iter().map(|pair| pair.1).sum::<f64>() / nearest.len() as f64;
    let shelves = nearest.iter().filter(|found| found.2).count();
    let mut distances: Vec<f64> = nearest.into_iter().map(|pair| pair.0).collect();
    distances.sort_by(f64::total_cmp);
    Some(Directed { distances, mean_cosine, shelves })
}

impl Directed {
    fn mean(&self) -> f64 {
        self.distances.iter().sum::<f64>() / self.distances.len() as f64
    }

    fn within(&self, tolerance: f64) -> f64 {
        share(self.distances.partition_point(|&d| d <= tolerance), self.distances.len())
    }

    /// The smallest distance that at least this share of points keeps.
    fn percentile(&self, share: f64) -> f64 {
        let rank = (share * self.distances.len() as f64).ceil() as usize;
        self.distances[rank.clamp(1, self.distances.len()) - 1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector3};

    fn at(x: f64, normal: Vector3<f64>) -> SurfacePoint {
        SurfacePoint { position: Point3::new(x, 0.0, 0.0), normal }
    }

    #[test]
    fn three_points_against_two_by_hand() {
        let (up, slanted) = (Vector3::z(), Vector3::new(0.6, 0.0, -0.8));
        let ours = [at(0.0, up), at(3.0, up), at(10.0, slanted)];
        let truth = [at(0.5, up), at(4.0, up)];
        // There .5 1 6, back .5 1; all over a side of 10.
        let found = compare_surfaces(&ours, &truth, 10.0, 0.1).unwrap();
        assert!((found.chamfer_l1 - (0.25 + 0.075) / 2.0).abs() < 1e-12);
        assert!((found.hausdorff - 0.6).abs() < 1e-12);
        assert!((found.precision - 2.0 / 3.0).abs() < 1e-12);
        assert!((found.recall - 1.0).abs() < 1e-12);
        assert!((found.f_score - 0.8).abs() < 1e-12);
        assert!((found.normal_consistency - (2.8 / 3.0 + 1.0) / 2.0).abs() < 1e-12);
        assert_eq!(found.shelf_share, 0.0);
    }

    #[test]
    fn level_points_on_a_slope_are_shelves() {
        let (up, slope) = (Vector3::z(), Vector3::new(0.8, 0.0, 0.6));
        let ours = [at(0.0, up), at(1.0, -up), at(2.0, slope), at(9.0, up)];
        let truth = [at(0.0, slope), at(1.0, slope), at(2.0, slope), at(9.0, up)];
        let found = compare_surfaces(&ours, &truth, 10.0, 0.1).unwrap();
        assert_eq!(found.shelf_share, 0.5);
    }

    #[test]
    fn the_percentile_leaves_out_the_outliers() {
        let mut ours: Vec<_> = (0..100).map(|i| at(f64::from(i), Vector3::z())).collect();
        let truth = ours.clone();
        ours[99] = at(199.0, Vector3::z());
        let found = compare_surfaces(&ours, &truth, 1.0, 0.0).unwrap();
        assert_eq!((found.hausdorff, found.hausdorff_95), (100.0, 0.0));
    }

    #[test]
    fn many_points_with_an_equal_coordinate_are_indexed() {
        let points: Vec<_> = (0..5000).map(|i| at(f64::from(i % 5), Vector3::z())).collect();
        let found = compare_surfaces(&points, &points, 1.0, 0.0).unwrap();
        assert_eq!((found.hausdorff, found.f_score), (0.0, 1.0));
    }

    #[test]
    fn nothing_cannot_be_compared() {
        assert!(compare_surfaces(&[], &[at(0.0, Vector3::z())], 1.0, 0.1).is_none());
    }
}
