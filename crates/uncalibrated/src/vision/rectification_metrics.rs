//! How much a rectifying homography distorts a picture.

use nalgebra::{Matrix3, Point2, Vector2};

/// Distortion of a `width_px` × `height_px` picture by a rectifying homography.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct RectificationDistortion {
    /// Eo: the angle between the lines that join the midpoints of opposite
    /// sides, degrees; ideally 90.
    pub orthogonality_deg: f64,
    /// Ea: the ratio of the two diagonals' lengths; ideally 1.
    pub aspect_ratio: f64,
}

impl RectificationDistortion {
    /// Measures `homography`, which maps the original picture's pixels to the
    /// rectified picture's.
    ///
    /// `None` when one of the eight points goes to infinity or two that
    /// belong together coincide: no angle or ratio exists then.
    ///
    /// # Source
    /// Mallon & Whelan, Projective rectification from the fundamental matrix, 2005;
    /// Arys 2020, §2.2.5.
    pub fn of(homography: &Matrix3<f64>, width_px: f64, height_px: f64) -> Option<Self> {
        let (w, h) = (width_px, height_px);
        let across = |from: [f64; 2], to: [f64; 2]| -> Option<Vector2<f64>> {
            let difference = transform(homography, to)? - transform(homography, from)?;
            difference.iter().all(|value| value.is_finite()).then_some(difference)
        };
        let x = across([0.0, h / 2.0], [w, h / 2.0])?;
        let y = across([w / 2.0, 0.0], [w / 2.0, h])?;
        let falling_diagonal = across([0.0, 0.0], [w, h])?;
        let rising_diagonal = across([0.0, h], [w, 0.0])?;
        let lengths = [x, y, falling_diagonal, rising_diagonal].map(|v| v.norm());
        lengths.iter().all(|&length| length > 0.0).then(|| Self {
            orthogonality_deg: x.perp(&y).abs().atan2(x.dot(&y)).to_degrees(),
            aspect_ratio: rising_diagonal.norm() / falling_diagonal.norm(),
        })
    }

    /// Eo's deviation from 90 degrees, relative to it; 0 is ideal.
    pub fn orthogonality_deviation(&self) -> f64 {
        (self.orthogonality_deg - 90.0).abs() / 90.0
    }

    /// Ea's deviation from 1; 0 is ideal.
    pub fn aspect_ratio_deviation(&self) -> f64 {
        (self.aspect_ratio - 1.0).abs()
    }
}

/// Both homographies of a rectified pair, as the dissertation's tables count.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PairDistortion {
    /// Of the left view's homography.
    pub left: RectificationDistortion,
    /// Of the right view's homography.
    pub right: RectificationDistortion,
    /// Mean over left and right of Eo's relative deviation from 90 degrees.
    pub mean_orthogonality_deviation: f64,
    /// Mean over left and right of Ea's deviation from 1.
    pub mean_aspect_ratio_deviation: f64,
}

impl PairDistortion {
    /// `None` when [`RectificationDistortion::of`] has none for either.
    pub fn of(
        left_homography: &Matrix3<f64>,
        right_homography: &Matrix3<f64>,
        width_px: f64,
        height_px: f64,
    ) -> Option<Self> {
        let left = RectificationDistortion::of(left_homography, width_px, height_px)?;
        let right = RectificationDistortion::of(right_homography, width_px, height_px)?;
        let mean = |of: fn(&RectificationDistortion) -> f64| 0.5 * (of(&left) + of(&right));
        Some(Self {
            left,
            right,
            mean_orthogonality_deviation: mean(RectificationDistortion::orthogonality_deviation),
            mean_aspect_ratio_deviation: mean(RectificationDistortion::aspect_ratio_deviation),
        })
    }
}

fn transform(homography: &Matrix3<f64>, [x, y]: [f64; 2]) -> Option<Point2<f64>> {
    Point2::from_homogeneous(homography * Point2::new(x, y).to_homogeneous())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(value: f64, expected: f64) -> bool {
        (value - expected).abs() < 1e-12
    }

    #[test]
    fn similarities_distort_nothing() {
        let turned = Matrix3::new_translation(&Vector2::new(300.0, -20.0))
            * Matrix3::new_rotation(0.7)
            * Matrix3::new_scaling(3.0);
        for homography in [Matrix3::identity(), turned, turned * -2.0] {
            let found = RectificationDistortion::of(&homography, 960.0, 540.0).unwrap();
            assert!(near(found.orthogonality_deg, 90.0));
            assert!(near(found.aspect_ratio, 1.0));
            assert!(near(found.orthogonality_deviation(), 0.0));
        }
    }

    /// `x' = x + y` on a 2×2 square: the vertical midline becomes (2, 2), at
    /// 45 degrees; the diagonals become (4, 2) and (0, -2), a ratio of 1/√5.
    #[test]
    fn a_shear_by_hand() {
        let shear = Matrix3::new(1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
        let found = RectificationDistortion::of(&shear, 2.0, 2.0).unwrap();
        assert!(near(found.orthogonality_deg, 45.0));
        assert!(near(found.orthogonality_deviation(), 0.5));
        assert!(near(found.aspect_ratio, 0.2_f64.sqrt()));
        assert!(near(found.aspect_ratio_deviation(), 1.0 - 0.2_f64.sqrt()));
    }

    /// `w' = 1 + x` on a 2×2 square: corners to (0,0) (2/3,0) (2/3,2/3) (0,2),
    /// midpoints to (1/2,0) (2/3,1/3) (1/2,1) (0,1).
    #[test]
    fn a_perspective_map_by_hand() {
        let perspective = Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0);
        let found = RectificationDistortion::of(&perspective, 2.0, 2.0).unwrap();
        // x = (2/3, -2/3), y = (0, 1): 135 degrees.
        assert!(near(found.orthogonality_deg, 135.0));
        assert!(near(found.orthogonality_deviation(), 0.5));
        // Diagonals (2/3, -2) and (2/3, 2/3): √(40/9) over √(8/9).
        assert!(near(found.aspect_ratio, 5.0_f64.sqrt()));
    }

    #[test]
    fn a_pair_reports_the_mean_of_both_deviations() {
        let shear = Matrix3::new(1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
        let pair = PairDistortion::of(&Matrix3::identity(), &shear, 2.0, 2.0).unwrap();
        assert!(near(pair.mean_orthogonality_deviation, 0.25));
        assert!(near(pair.mean_aspect_ratio_deviation, 0.5 * (1.0 - 0.2_f64.sqrt())));
    }

    #[test]
    fn what_goes_to_infinity_or_collapses_has_no_figures() {
        let to_infinity = Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0);
        let collapsed = Matrix3::new(0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
        let unusable = Matrix3::repeat(f64::NAN);
        for homography in [to_infinity, collapsed, unusable] {
            assert_eq!(RectificationDistortion::of(&homography, 2.0, 2.0), None);
        }
    }
}
