//! How good a pair's try is, in one number.

use serde::Serialize;

use crate::options::MetricWeights;
use crate::vision::{
    Correspondence, EpipolarGeometry, PairDistortion, mean_distance, rectify, sampson_distance_px2,
    smallest_absolute_eigenvalue,
};

/// Values at which a metric counts half; see the options' `MetricWeights`.
const MEAN_SAMPSON_SCALE_PX2: f64 = 1.0;
const EIGENVALUE_SCALE: f64 = 1e-4;
const OUTLIER_SCALE: f64 = 0.5;
const DISTORTION_SCALE: f64 = 0.1;

/// The five metrics of Arys 2020, §3.4, §3.5, of one try.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FiveMetrics {
    /// Over the inliers.
    pub mean_sampson_px2: f64,
    /// Of the fundamental matrix scaled to `F₃₃ = 1`; ideally 0.
    pub smallest_absolute_eigenvalue: f64,
    /// Matches that the estimator rejected over all matches.
    pub outlier_ratio: f64,
    /// Mean over both homographies of Eo's relative deviation from 90 degrees.
    pub orthogonality_deviation: f64,
    /// Mean over both homographies of Ea's deviation from 1.
    pub aspect_ratio_deviation: f64,
}

impl FiveMetrics {
    /// Rectifies the pair, views of `size_px`, and measures; `None` if one of
    /// the five does not exist.
    pub(super) fn of(
        geometry: &EpipolarGeometry,
        matches: &[Correspondence],
        (width_px, height_px): (u32, u32),
    ) -> Option<Self> {
        let inliers: Vec<_> = geometry.agreeing(matches).collect();
        let rectification = rectify(&inliers, &geometry.fundamental, width_px, height_px).ok()?;
        let distortion = PairDistortion::of(
            &rectification.rectified_from_left,
            &rectification.rectified_from_right,
            f64::from(width_px),
            f64::from(height_px),
        )?;
        Some(Self {
            mean_sampson_px2: inlier_sampson(geometry, matches)?,
            smallest_absolute_eigenvalue: smallest_absolute_eigenvalue(&geometry.fundamental)?,
            outlier_ratio: 1.0 - inliers.len() as f64 / matches.len() as f64,
            orthogonality_deviation: distortion.mean_orthogonality_deviation,
            aspect_ratio_deviation: distortion.mean_aspect_ratio_deviation,
        })
    }

    /// The weighed sum, from 0, perfect, to 1.
    pub(super) fn cost(&self, weights: &MetricWeights) -> f64 {
        let counted = [
            (weights.mean_sampson, self.mean_sampson_px2, MEAN_SAMPSON_SCALE_PX2),
            (weights.smallest_eigenvalue, self.smallest_absolute_eigenvalue, EIGENVALUE_SCALE),
            (weights.outlier_ratio, self.outlier_ratio, OUTLIER_SCALE),
            (weights.orthogonality, self.orthogonality_deviation, DISTORTION_SCALE),
            (weights.aspect_ratio, self.aspect_ratio_deviation, DISTORTION_SCALE),
        ];
        let (sum, all) = counted.iter().fold((0.0, 0.0), |(sum, all), (weight, value, scale)| {
            (sum + weight * value / (value + scale), all + weight)
        });
        sum / all
    }
}

/// Mean Sampson distance of the matches that agree, px².
pub(super) fn inlier_sampson(
    geometry: &EpipolarGeometry,
    matches: &[Correspondence],
) -> Option<f64> {
    let inliers = geometry.agreeing(matches).map(|c| (c.left, c.right));
    mean_distance(&geometry.fundamental, inliers, sampson_distance_px2)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERFECT: FiveMetrics = FiveMetrics {
        mean_sampson_px2: 0.0,
        smallest_absolute_eigenvalue: 0.0,
        outlier_ratio: 0.0,
        orthogonality_deviation: 0.0,
        aspect_ratio_deviation: 0.0,
    };

    #[test]
    fn costs_by_hand() {
        let weights = MetricWeights::default();
        assert_eq!(PERFECT.cost(&weights), 0.0);
        // One of five at its scale counts half, far beyond it nearly whole.
        let half = FiveMetrics { mean_sampson_px2: 1.0, ..PERFECT };
        assert!((half.cost(&weights) - 0.1).abs() < 1e-12);
        let whole = FiveMetrics { orthogonality_deviation: 1e9, ..PERFECT };
        assert!((whole.cost(&weights) - 0.2).abs() < 1e-6);
        let only = MetricWeights {
            mean_sampson: 3.0,
            smallest_eigenvalue: 0.0,
            outlier_ratio: 0.0,
            orthogonality: 0.0,
            aspect_ratio: 0.0,
        };
        assert_eq!((whole.cost(&only), half.cost(&only)), (0.0, 0.5));
    }
}
