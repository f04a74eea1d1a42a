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
    pub rectified_from_left: Matrix3<f64>,
    pub rectified_from_right: Matrix3<f64>,
}

/// Why a pair could not be rectified.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, thiserror::Error)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum RectificationError {
    #[error("no rectifying homographies fit the {found} inliers")]
    NoHomographies { found: usize },
    #[error("a rectifying homography is singular or not finite")]
    Singular,
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
    let (mut left_h, mut right_h) = (Mat::default(), Mat::default());
    let found = calib3d::stereo_rectify_uncalibrated(
        &left,
        &right,
        &cv::matrix_mat(fundamental)?,
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
