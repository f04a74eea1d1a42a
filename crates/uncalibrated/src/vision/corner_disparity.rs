//! Disparity at matched keypoints alone.

use image::Luma;
use nalgebra::Point2;

use super::{Correspondence, Rectification};
use picture::FloatImage;

/// The disparity of each match in the rectified pair, at its pixels of the left
/// and of the right view, px; NaN everywhere else.
///
/// * `inliers`: matches of the views before rectification.
/// * `size_px`: width and height of both views.
///
/// Of several matches at one pixel the first counts; what lies outside does not.
///
/// # Source
/// Arys 2020, ch. 6 (disparities of corners alone).
pub fn corner_disparity(
    inliers: &[Correspondence],
    rectification: &Rectification,
    (width_px, height_px): (u32, u32),
) -> [FloatImage; 2] {
    let missing = || FloatImage::from_pixel(width_px, height_px, Luma([f32::NAN]));
    let mut maps = [missing(), missing()];
    for found in inliers {
        let left = rectification.rectified_from_left.transform_point(&found.left);
        let right = rectification.rectified_from_right.transform_point(&found.right);
        let disparity = (left.x - right.x) as f32;
        if disparity.is_finite() {
            let [left_map, right_map] = &mut maps;
            put_first(left_map, found.left, disparity);
            put_first(right_map, found.right, disparity);
        }
    }
    maps
}

fn put_first(map: &mut FloatImage, at: Point2<f64>, disparity: f32) {
    let (x, y) = (at.x.round(), at.y.round());
    if !(x >= 0.0 && y >= 0.0) {
        return;
    }
    if let Some(pixel) = map.get_pixel_mut_checked(x as u32, y as u32)
        && pixel.0[0].is_nan()
    {
        pixel.0[0] = disparity;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector2};

    #[test]
    fn every_match_has_its_disparity_at_both_its_pixels() {
        let at = |lx, ly, rx, ry| Correspondence {
            left: Point2::new(lx, ly),
            right: Point2::new(rx, ry),
        };
        let inliers = [
            at(5.0, 2.0, 3.0, 2.0),
            at(5.2, 2.1, 3.4, 2.0),
            at(-3.0, 1.0, 7.0, 1.0),
            at(2.0, f64::NAN, 1.0, 3.0),
        ];
        let rectification = Rectification {
            rectified_from_left: Matrix3::new_translation(&Vector2::new(10.0, 0.0)),
            rectified_from_right: Matrix3::identity(),
        };
        let [left, right] = corner_disparity(&inliers, &rectification, (10, 5));
        let found = |map: &FloatImage| -> Vec<_> {
            let all = map.enumerate_pixels().filter(|(.., value)| !value.0[0].is_nan());
            all.map(|(x, y, value)| (x, y, value.0[0])).collect()
        };
        assert_eq!(found(&left), [(5, 2, 12.0)]);
        assert_eq!(found(&right), [(7, 1, 0.0), (3, 2, 12.0)]);
    }
}
