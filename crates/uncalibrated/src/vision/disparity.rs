//! Disparity maps of a rectified pair, by semi-global or block matching.

use image::GrayImage;
use nalgebra::Matrix3;
use opencv::calib3d::{
    StereoBM, StereoBM_PREFILTER_NORMALIZED_RESPONSE, StereoBM_PREFILTER_XSOBEL, StereoBMTrait,
    StereoMatcherTrait, StereoSGBM, StereoSGBM_MODE_HH, StereoSGBM_MODE_HH4, StereoSGBM_MODE_SGBM,
    StereoSGBM_MODE_SGBM_3WAY,
};
use opencv::core::{
    self, BORDER_CONSTANT, Mat, MatTraitConst, MatTraitConstManual, Scalar, Size, ToInputArray,
};
use opencv::imgproc;
use serde::Serialize;

use super::cv::{self, OpenCvError};
use crate::options::{DisparityAlgorithm, DisparityOptions, PreFilter, SgbmMode};
use picture::FloatImage;

/// OpenCV's disparities are in sixteenths of a pixel.
const STEPS_PER_PX: f32 = 16.0;
/// Block matching takes no smaller window.
const BLOCK_MATCHING_MIN: i32 = 5;

/// Why there is no disparity map.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, thiserror::Error)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum DisparityError {
    /// The two rectified views are not of one size.
    #[error("the rectified views are {left:?} and {right:?} px; they must be alike")]
    SizesDiffer {
        /// Width and height of the left one, px.
        left: (u32, u32),
        /// Width and height of the right one, px.
        right: (u32, u32),
    },
    /// No pixel has room for its block and all disparities.
    #[error(
        "views of {width_px} px are too narrow for disparities of {min_px} to {max_px} px and blocks of {block_size} px"
    )]
    TooNarrow {
        /// Width of both views, px.
        width_px: u32,
        /// The smallest disparity searched, px.
        min_px: i32,
        /// The largest disparity searched, px.
        max_px: i32,
        /// Side of the matched window, px.
        block_size: i32,
    },
    /// OpenCV refused a call.
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
    // Of each fused map, value and weight of both directions.
    let bytes_per_pixel = 16 + 16 * options.block_sizes.len() as u64;
    let pictures = bytes_per_pixel * u64::from(width_px) * u64::from(height_px);
    let largest = options.block_sizes.iter().copied().max().unwrap_or(options.block_size);
    let rows = largest.max(0) as u64 + 16;
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
    matcher.set_pre_filter_type(match options.pre_filter {
        PreFilter::XSobel => StereoBM_PREFILTER_XSOBEL,
        PreFilter::NormalizedResponse => StereoBM_PREFILTER_NORMALIZED_RESPONSE,
    })?;
    matcher.set_pre_filter_size(options.pre_filter_size_px)?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;
    use proptest::prelude::*;

    /// Repeatable texture without structure.
    fn texture(x: i64, y: i64) -> u8 {
        let mut hash = (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (y as u64) << 32;
        hash = (hash ^ hash >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (hash >> 40) as u8
    }

    /// A textured plane, shifted left by `disparity` in the right view; in the
    /// middle a nearer patch.
    fn pair(width: u32, height: u32, disparity: i64, patch: i64) -> (GrayImage, GrayImage) {
        let near =
            |x: i64, y: i64| (80..120).contains(&x) && (40..80).contains(&y) && patch != disparity;
        let left = GrayImage::from_fn(width, height, |x, y| {
            let (x, y) = (i64::from(x), i64::from(y));
            Luma([if near(x, y) { texture(x + 5000, y) } else { texture(x, y) }])
        });
        let right = GrayImage::from_fn(width, height, |x, y| {
            let (x, y) = (i64::from(x), i64::from(y));
            Luma([if near(x + patch, y) {
                texture(x + patch + 5000, y)
            } else {
                texture(x + disparity, y)
            }])
        });
        (left, right)
    }

    fn options() -> DisparityOptions {
        DisparityOptions {
            block_size: 5,
            p1: 200,
            p2: 800,
            speckle_window_px: 0,
            max_left_right_difference_px: 1,
            ..DisparityOptions::default()
        }
    }

    fn all_algorithms() -> Vec<DisparityOptions> {
        let mut all: Vec<_> =
            [SgbmMode::FivePath, SgbmMode::EightPath, SgbmMode::ThreeWay, SgbmMode::Hh4]
                .map(|mode| DisparityOptions { mode, ..options() })
                .into();
        let algorithm = DisparityAlgorithm::BlockMatching;
        all.push(DisparityOptions { algorithm, block_size: 9, ..options() });
        let pre_filter = PreFilter::NormalizedResponse;
        all.push(DisparityOptions { algorithm, pre_filter, block_size: 9, ..options() });
        all
    }

    fn share_within_half(map: &FloatImage, region: impl Fn(u32, u32) -> Option<f32>) -> f64 {
        let (mut good, mut all) = (0, 0);
        for (x, y, value) in map.enumerate_pixels() {
            let Some(expected) = region(x, y) else { continue };
            all += 1;
            good += i32::from((value.0[0] - expected).abs() <= 0.5);
        }
        f64::from(good) / f64::from(all)
    }

    #[test]
    fn a_plane_and_a_patch_have_their_disparities_both_ways() {
        let (left, right) = pair(200, 120, 7, 15);
        for options in all_algorithms() {
            let expected = |shift: u32, plane: std::ops::Range<u32>| {
                move |x: u32, y: u32| {
                    let inner = (86 - shift..114 - shift).contains(&x) && (46..74).contains(&y);
                    let outer = plane.contains(&x) && (20..100).contains(&y);
                    if inner { Some(15.0) } else { outer.then_some(7.0) }
                }
            };
            let map = left_disparity(&left, &right, &options).unwrap();
            let good = share_within_half(&map, expected(0, 45..70));
            assert!(good > 0.97, "{:?} {:?} left: {good}", options.algorithm, options.mode);
            let map = right_disparity(&left, &right, &options).unwrap();
            let good = share_within_half(&map, expected(15, 35..58));
            assert!(good > 0.97, "{:?} {:?} right: {good}", options.algorithm, options.mode);
        }
    }

    #[test]
    fn negative_disparities_are_found_when_searched() {
        let (left, right) = pair(200, 120, -6, -6);
        let options = DisparityOptions { min_disparity_px: -16, ..options() };
        let map = left_disparity(&left, &right, &options).unwrap();
        let inner = |x, y| ((40..150).contains(&x) && (10..110).contains(&y)).then_some(-6.0);
        assert!(share_within_half(&map, inner) > 0.97);
    }

    #[test]
    fn a_mirrored_pair_has_the_mirrored_disparity() {
        let (left, right) = pair(200, 120, 7, 15);
        let mirror = |image: &GrayImage| image::imageops::flip_horizontal(image);
        let map = left_disparity(&left, &right, &options()).unwrap();
        let mirrored = right_disparity(&mirror(&right), &mirror(&left), &options()).unwrap();
        let both = map.enumerate_pixels().filter(|(_, _, value)| !value.0[0].is_nan());
        let (good, all) = both.fold((0, 0), |(good, all), (x, y, value)| {
            let other = mirrored.get_pixel(199 - x, y).0[0];
            (good + i32::from((value.0[0] - other).abs() <= 0.5), all + 1)
        });
        assert!(f64::from(good) >= 0.99 * f64::from(all), "{good} of {all}");
    }

    #[test]
    fn derectifying_undoes_the_homography() {
        let map = FloatImage::from_fn(20, 10, |x, y| Luma([(x + 20 * y) as f32]));
        let shift = Matrix3::new_translation(&nalgebra::Vector2::new(3.0, -2.0));
        let back = derectify(&map, &shift).unwrap();
        assert_eq!(back.get_pixel(4, 5), map.get_pixel(7, 3));
        assert!(back.get_pixel(18, 5).0[0].is_nan());
        assert!(back.get_pixel(4, 1).0[0].is_nan());
    }

    #[test]
    fn small_pictures_and_extreme_options_never_crash() {
        for (width, height) in [(1, 1), (8, 8), (60, 3), (50, 50), (90, 70)] {
            let (left, right) = pair(width, height, 2, 2);
            for base in all_algorithms() {
                for (block_size, min_disparity_px, num_disparities) in
                    [(1, 0, 16), (5, -40, 32), (37, 0, 32), (255, -1024, 1024), (3, 1024, 16)]
                {
                    let options = DisparityOptions {
                        block_size,
                        min_disparity_px,
                        num_disparities,
                        speckle_window_px: 50,
                        ..base.clone()
                    };
                    if let Ok(map) = left_disparity(&left, &right, &options) {
                        assert_eq!(map.dimensions(), (width, height));
                    }
                }
            }
        }
    }

    #[test]
    fn too_narrow_and_unlike_views_are_refused() {
        let (left, right) = pair(60, 60, 0, 0);
        assert!(matches!(
            left_disparity(&left, &right, &DisparityOptions::default()),
            Err(DisparityError::TooNarrow { width_px: 60, min_px: 0, max_px: 31, block_size: 37 })
        ));
        assert!(matches!(
            right_disparity(&left, &GrayImage::new(60, 59), &options()),
            Err(DisparityError::SizesDiffer { .. })
        ));
    }

    /// Mirrored drawings have mirrored disparities of the other sign.
    fn mirrored_share(left: &GrayImage, right: &GrayImage, options: &DisparityOptions) -> f64 {
        let mirror = |image: &GrayImage| image::imageops::flip_horizontal(image);
        let least = -(options.min_disparity_px + options.num_disparities - 1);
        let mirrored_options = DisparityOptions { min_disparity_px: least, ..options.clone() };
        let map = left_disparity(left, right, options).unwrap();
        let mirrored = left_disparity(&mirror(left), &mirror(right), &mirrored_options).unwrap();
        let width = left.width();
        let both = map.enumerate_pixels().filter_map(|(x, y, value)| {
            let other = mirrored.get_pixel(width - 1 - x, y).0[0];
            (!value.0[0].is_nan() && !other.is_nan()).then_some((value.0[0] + other).abs())
        });
        let (good, all) = both
            .fold((0, 0), |(good, all), difference| (good + i32::from(difference <= 0.5), all + 1));
        assert!(all > (left.width() * left.height() / 3) as i32, "{all} pixels to compare");
        f64::from(good) / f64::from(all)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]

        #[test]
        fn a_pair_and_its_mirror_have_mirrored_disparities(
            disparity in -6_i64..7,
            step in 3_i64..8,
            mode in 0_usize..4,
            block in 1_i32..5,
        ) {
            let (left, right) = pair(200, 120, disparity, disparity + step);
            let modes =
                [SgbmMode::FivePath, SgbmMode::EightPath, SgbmMode::ThreeWay, SgbmMode::Hh4];
            let options = DisparityOptions {
                mode: modes[mode],
                block_size: 2 * block + 3,
                min_disparity_px: -16,
                // What is hidden in either view has no true disparity.
                uniqueness_percent: 10,
                ..options()
            };
            let share = mirrored_share(&left, &right, &options);
            prop_assert!(share >= 0.99, "{share} with {options:?}");
        }
    }
}
