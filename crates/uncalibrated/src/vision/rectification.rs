//! Rectifies a pair without calibration.

use image::GrayImage;
use nalgebra::Matrix3;
use opencv::calib3d;
use opencv::core::{BORDER_CONSTANT, Mat, Scalar, Size};
use opencv::imgproc;
use serde::Serialize;

use super::Correspondence;
use super::cv::{self, OpenCvError};

/// Correspondences farther from their epipolar lines are not used, px.
const MAX_ERROR_PX: f64 = 5.0;
/// What lies outside the drawing: paper.
const PAPER: f64 = 255.0;

/// Homographies that make a pair's epipolar lines horizontal and level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectification {
    /// From pixels of the left view to those of its rectified picture.
    pub rectified_from_left: Matrix3<f64>,
    /// From pixels of the right view to those of its rectified picture.
    pub rectified_from_right: Matrix3<f64>,
}

/// Why a pair could not be rectified.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, thiserror::Error)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum RectificationError {
    /// OpenCV found none.
    #[error("no rectifying homographies fit the {found} inliers")]
    NoHomographies {
        /// How many inliers it was given.
        found: usize,
    },
    /// A homography cannot be inverted.
    #[error("a rectifying homography is singular or not finite")]
    Singular,
    /// OpenCV refused a call.
    #[error(transparent)]
    OpenCv(#[from] OpenCvError),
}

/// Finds rectifying homographies without calibration.
///
/// * `inliers`: correspondences that agree with `fundamental`, pixels.
/// * `width_px`, `height_px`: of both views.
///
/// # Errors
/// [`RectificationError::NoHomographies`] if OpenCV finds none,
/// [`RectificationError::Singular`] if they cannot be inverted.
///
/// # Source
/// Hartley, Theory and practice of projective rectification, 1999; Arys 2020, §3.5.
pub fn rectify(
    inliers: &[Correspondence],
    fundamental: &Matrix3<f64>,
    width_px: u32,
    height_px: u32,
) -> Result<Rectification, RectificationError> {
    cv::single_threaded();
    let left = cv::points(inliers.iter().map(|c| c.left));
    let right = cv::points(inliers.iter().map(|c| c.right));
    // OpenCV adds a matrix of its own, of unit size, to a product with F. With
    // F₃₃ = 1 the F of level epipolar lines has entries of 1e12 that swallow it,
    // and the left homography collapses to a column; with ‖F‖ = 1 it does not.
    let unit = fundamental / fundamental.norm();
    let (mut left_h, mut right_h) = (Mat::default(), Mat::default());
    let found = calib3d::stereo_rectify_uncalibrated(
        &left,
        &right,
        &cv::matrix_mat(&unit)?,
        Size::new(width_px as i32, height_px as i32),
        &mut left_h,
        &mut right_h,
        MAX_ERROR_PX,
    )
    .map_err(OpenCvError::from)?;
    let homographies =
        if found { (cv::matrix(&left_h)?, cv::matrix(&right_h)?) } else { (None, None) };
    let (Some(rectified_from_left), Some(rectified_from_right)) = homographies else {
        return Err(RectificationError::NoHomographies { found: inliers.len() });
    };
    if !invertible(&rectified_from_left) || !invertible(&rectified_from_right) {
        return Err(RectificationError::Singular);
    }
    Ok(Rectification { rectified_from_left, rectified_from_right })
}

fn invertible(homography: &Matrix3<f64>) -> bool {
    homography.iter().all(|value| value.is_finite())
        && homography.try_inverse().is_some_and(|inverse| inverse.iter().all(|v| v.is_finite()))
}

/// Warps a drawing by `rectified_from_view`, keeping its size; what comes from
/// outside is paper white.
pub fn warp(
    image: &GrayImage,
    rectified_from_view: &Matrix3<f64>,
) -> Result<GrayImage, OpenCvError> {
    cv::single_threaded();
    let mut warped = Mat::default();
    imgproc::warp_perspective(
        &cv::gray_mat(image)?,
        &mut warped,
        &cv::matrix_mat(rectified_from_view)?,
        Size::new(image.width() as i32, image.height() as i32),
        imgproc::INTER_LINEAR,
        BORDER_CONSTANT,
        Scalar::all(PAPER),
    )?;
    cv::gray_image(&warped)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{EpipolarOptions, Estimator};
    use crate::vision::estimate_fundamental;
    use nalgebra::Point2;

    /// A turntable's points at 0 and 5 degrees, every row its own problem, the
    /// right view turned and shifted in the picture plane.
    fn turntable_pair() -> Vec<Correspondence> {
        let (sin, cos) = 5.0_f64.to_radians().sin_cos();
        (0..60)
            .map(|i| {
                let value = |step: usize, size: f64| ((i * step) % 61) as f64 / 61.0 * size;
                let (x, depth, y) = (value(17, 300.0) - 150.0, value(29, 300.0), value(43, 400.0));
                let right = Point2::new(480.0 + x * cos + depth * sin, 70.0 + y);
                Correspondence {
                    left: Point2::new(480.0 + x, 70.0 + y),
                    right: Point2::new(right.x - 0.05 * right.y, right.y + 0.05 * right.x + 9.0),
                }
            })
            .collect()
    }

    #[test]
    fn matches_end_up_in_the_same_row() {
        let points = turntable_pair();
        let options = EpipolarOptions { estimator: Estimator::EightPoint, ..Default::default() };
        let geometry = estimate_fundamental(&points, &options, 0).unwrap();
        let r = rectify(&points, &geometry.fundamental, 960, 540).unwrap();
        for c in &points {
            let left = r.rectified_from_left.transform_point(&c.left);
            let right = r.rectified_from_right.transform_point(&c.right);
            assert!((left.y - right.y).abs() < 0.05, "{left} and {right}");
        }
    }

    /// Level epipolar lines: F₃₃ is 0, and scaling it to 1 blows the rest up.
    #[test]
    fn level_lines_do_not_collapse_the_drawing() {
        let points: Vec<_> = turntable_pair()
            .iter()
            .map(|c| Correspondence { right: Point2::new(c.left.x + 9.0, c.left.y), ..*c })
            .collect();
        let f = Matrix3::new(0.0, 1e-4, 0.0, -1e-4, 0.0, -1e12, 0.0, 1e12, 1.0);
        let r = rectify(&points, &f, 960, 540).unwrap();
        let width = |x: f64| r.rectified_from_left.transform_point(&Point2::new(x, 270.0)).x;
        assert!(((width(800.0) - width(100.0)) / 700.0 - 1.0).abs() < 0.05);
    }

    #[test]
    fn warping_by_a_shift_moves_the_drawing_and_fills_with_paper() {
        let image = GrayImage::from_fn(6, 4, |x, y| image::Luma([(10 * x + y) as u8]));
        let shift = Matrix3::new_translation(&nalgebra::Vector2::new(2.0, 1.0));
        let warped = warp(&image, &shift).unwrap();
        assert_eq!(warped.get_pixel(2, 1), image.get_pixel(0, 0));
        assert_eq!(warped.get_pixel(5, 3), image.get_pixel(3, 2));
        assert_eq!(warped.get_pixel(1, 1).0, [255]);
    }

    #[test]
    fn nothing_to_rectify_is_named() {
        let error = rectify(&[], &Matrix3::zeros(), 960, 540).unwrap_err();
        assert!(!error.to_string().is_empty());
    }
}
