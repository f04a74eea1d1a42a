use image::GrayImage;
use nalgebra::Matrix3;
use opencv::calib3d::{
    StereoBM, StereoBMTrait, StereoMatcherTrait, StereoSGBM, StereoSGBM_MODE_HH,
    StereoSGBM_MODE_HH4, StereoSGBM_MODE_SGBM, StereoSGBM_MODE_SGBM_3WAY,
};
use opencv::core::{
    self, BORDER_CONSTANT, Mat, MatTraitConst, MatTraitConstManual, Scalar, Size, ToInputArray,
};
use opencv::imgproc;
use serde::Serialize;

use super::FloatImage;
use super::cv::{self, OpenCvError};
use crate::options::{DisparityAlgorithm, DisparityOptions, SgbmMode};

/// OpenCV's disparities are in sixteenths of a pixel.
const STEPS_PER_PX: f32 = 16.0;
/// Block matching takes no smaller window.
const BLOCK_MATCHING_MIN: i32 = 5;

/// Why there is no disparity map.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, thiserror::Error)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum DisparityError {
    #[error("the rectified views are {left:?} and {right:?} px; they must be alike")]
    SizesDiffer { left: (u32, u32), right: (u32, u32) },
    #[error(
        "views of {width_px} px are too narrow for disparities of {min_px} to {max_px} px and blocks of {block_size} px"
    )]
    TooNarrow { width_px: u32, min_px: i32, max_px: i32, block_size: i32 },
    #[error(transparent)]
    OpenCv(#[from] OpenCvError),
}

/// Disparity of each pixel of the left rectified view: `x_left - x_right`, px;
/// NaN where nothing matched.
///
/// # Errors
/// [`DisparityError`]; also what OpenCV itself refuses.
///
/// # Source
/// Hirschmüller, Stereo processing by semiglobal matching, 2008; Arys 2020,
/// §2.2.6, §3.6.
pub fn left_disparity(
    left: &GrayImage,
    right: &GrayImage,
    options: &DisparityOptions,
) -> Result<FloatImage, DisparityError> {
    check(left, right, options)?;
    cv::single_threaded();
    let steps = compute(&cv::gray_mat(left)?, &cv::gray_mat(right)?, options)?;
    Ok(in_pixels(&steps, options)?)
}

/// Disparity of each pixel of the right rectified view, of the same sign as
/// [`left_disparity`]; NaN where nothing matched.
///
/// Mirroring turns right-to-left matching into left-to-right.
pub fn right_disparity(
    left: &GrayImage,
    right: &GrayImage,
    options: &DisparityOptions,
) -> Result<FloatImage, DisparityError> {
    check(left, right, options)?;
    cv::single_threaded();
    let steps =
        compute(&mirrored(&cv::gray_mat(right)?)?, &mirrored(&cv::gray_mat(left)?)?, options)?;
    Ok(in_pixels(&mirrored(&steps)?, options)?)
}

/// Warps a rectified view's disparity map back to the view; the values stay
/// those of the rectified pair, the nearest is taken.
pub fn derectify(
    disparity: &FloatImage,
    rectified_from_view: &Matrix3<f64>,
) -> Result<FloatImage, DisparityError> {
    cv::single_threaded();
    let mut warped = Mat::default();
    imgproc::warp_perspective(
        &cv::float_mat(disparity)?,
        &mut warped,
        &cv::matrix_mat(rectified_from_view)?,
        Size::new(disparity.width() as i32, disparity.height() as i32),
        imgproc::INTER_NEAREST | imgproc::WARP_INVERSE_MAP,
        BORDER_CONSTANT,
        Scalar::all(f64::NAN),
    )
    .map_err(OpenCvError::from)?;
    Ok(cv::float_image(&warped)?)
}

/// About how much memory matching one pair takes, bytes.
pub fn working_bytes(width_px: u32, height_px: u32, options: &DisparityOptions) -> u64 {
    let cost_row = 2 * u64::from(width_px) * options.num_disparities.max(0) as u64;
    let pictures = 16 * u64::from(width_px) * u64::from(height_px);
    let rows = options.block_size.max(0) as u64 + 16;
    let volumes = match (options.algorithm, options.mode) {
        (DisparityAlgorithm::Sgbm, SgbmMode::EightPath | SgbmMode::Hh4) => 2,
        _ => 0,
    };
    pictures + cost_row * (rows + volumes * u64::from(height_px))
}

fn check(
    left: &GrayImage,
    right: &GrayImage,
    options: &DisparityOptions,
) -> Result<(), DisparityError> {
    if left.dimensions() != right.dimensions() {
        return Err(DisparityError::SizesDiffer {
            left: left.dimensions(),
            right: right.dimensions(),
        });
    }
    let (min_px, block_size) = (options.min_disparity_px, options.block_size);
    let max_px = min_px + options.num_disparities - 1;
    let reach = max_px.max(0) - min_px.min(0) + block_size;
    if (left.width() as i32) <= reach || (left.height() as i32) < block_size {
        let width_px = left.width();
        return Err(DisparityError::TooNarrow { width_px, min_px, max_px, block_size });
    }
    Ok(())
}

fn compute(
    left: &impl ToInputArray,
    right: &impl ToInputArray,
    options: &DisparityOptions,
) -> Result<Mat, OpenCvError> {
    let mut steps = Mat::default();
    match options.algorithm {
        DisparityAlgorithm::Sgbm => semi_global(options)?.compute(left, right, &mut steps)?,
        DisparityAlgorithm::BlockMatching => {
            block_matching(options)?.compute(left, right, &mut steps)?;
        }
    }
    Ok(steps)
}

fn semi_global(options: &DisparityOptions) -> Result<core::Ptr<StereoSGBM>, OpenCvError> {
    let mode = match options.mode {
        SgbmMode::FivePath => StereoSGBM_MODE_SGBM,
        SgbmMode::EightPath => StereoSGBM_MODE_HH,
        SgbmMode::ThreeWay => StereoSGBM_MODE_SGBM_3WAY,
        SgbmMode::Hh4 => StereoSGBM_MODE_HH4,
    };
    Ok(StereoSGBM::create(
        options.min_disparity_px,
        options.num_disparities,
        options.block_size,
        options.p1,
        options.p2,
        options.max_left_right_difference_px,
        options.pre_filter_cap,
        options.uniqueness_percent,
        options.speckle_window_px,
        options.speckle_range_px,
        mode,
    )?)
}

fn block_matching(options: &DisparityOptions) -> Result<core::Ptr<StereoBM>, OpenCvError> {
    let block_size = options.block_size.max(BLOCK_MATCHING_MIN);
    let mut matcher = StereoBM::create(options.num_disparities, block_size)?;
    matcher.set_min_disparity(options.min_disparity_px)?;
    matcher.set_disp12_max_diff(options.max_left_right_difference_px)?;
    matcher.set_pre_filter_cap(options.pre_filter_cap)?;
    matcher.set_uniqueness_ratio(options.uniqueness_percent)?;
    matcher.set_speckle_window_size(options.speckle_window_px)?;
    matcher.set_speckle_range(options.speckle_range_px)?;
    matcher.set_texture_threshold(options.texture_threshold)?;
    Ok(matcher)
}

fn mirrored(mat: &impl ToInputArray) -> Result<Mat, OpenCvError> {
    let mut flipped = Mat::default();
    core::flip(mat, &mut flipped, 1)?;
    Ok(flipped)
}

fn in_pixels(steps: &Mat, options: &DisparityOptions) -> Result<FloatImage, OpenCvError> {
    let missing = ((options.min_disparity_px - 1) * STEPS_PER_PX as i32) as i16;
    let pixels = steps
        .data_typed::<i16>()?
        .iter()
        .map(|&step| if step <= missing { f32::NAN } else { f32::from(step) / STEPS_PER_PX })
        .collect();
    FloatImage::from_raw(steps.cols() as u32, steps.rows() as u32, pixels)
        .ok_or_else(cv::size_mismatch)
}
