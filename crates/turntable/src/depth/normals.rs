//! Surface normals from a depth map.

use image::{ImageBuffer, Luma, Rgb};

/// Surface normals from a depth map in the view's own frame.
///
/// * `depth_px`: depth along the view direction, px, growing away from the
///   camera; NaN where there is no surface.
/// * `max_step_px`: depths of neighbouring pixels that differ by more belong
///   to different surfaces; the difference is then taken on the other side.
///
/// Returns unit normals, x right, y up, z towards the camera; NaN where the
/// depth is missing. A pixel alone on its surface faces the camera.
///
/// # Source
/// The gradient of a graph surface: `(d_x, -d_y, 1)` normalised, `y` down in
/// the image; Arys 2020, ch. 6 (normals from disparity).
pub fn normals_from_depth(
    depth_px: &ImageBuffer<Luma<f32>, Vec<f32>>,
    max_step_px: f32,
) -> ImageBuffer<Rgb<f32>, Vec<f32>> {
    let (width, height) = depth_px.dimensions();
    let at = |x: i64, y: i64| -> Option<f32> {
        let (x, y) = (u32::try_from(x).ok()?, u32::try_from(y).ok()?);
        let inside = x < width && y < height;
        inside.then(|| depth_px.get_pixel(x, y).0[0]).filter(|depth| !depth.is_nan())
    };
    let slope = |before: Option<f32>, here: f32, after: Option<f32>| {
        let near = |value: &f32| (value - here).abs() <= max_step_px;
        match (before.filter(near), after.filter(near)) {
            (Some(before), Some(after)) => (after - before) / 2.0,
            (Some(before), None) => here - before,
            (None, Some(after)) => after - here,
            (None, None) => 0.0,
        }
    };
    ImageBuffer::from_fn(width, height, |x, y| {
        let (x, y) = (i64::from(x), i64::from(y));
        let Some(here) = at(x, y) else {
            return Rgb([f32::NAN; 3]);
        };
        let right = slope(at(x - 1, y), here, at(x + 1, y));
        let down = slope(at(x, y - 1), here, at(x, y + 1));
        let length = (right * right + down * down + 1.0).sqrt();
        Rgb([right / length, -down / length, 1.0 / length])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(depth: impl Fn(f32, f32) -> f32) -> ImageBuffer<Luma<f32>, Vec<f32>> {
        ImageBuffer::from_fn(40, 40, |x, y| Luma([depth(x as f32 + 0.5, y as f32 + 0.5)]))
    }

    #[test]
    fn a_sphere_has_radial_normals() {
        let depth =
            map(|x, y| -(18.0_f32.powi(2) - (x - 20.0).powi(2) - (y - 20.0).powi(2)).sqrt());
        let normals = normals_from_depth(&depth, 20.0);
        for (x, y) in [(20, 20), (26, 15), (14, 29)] {
            let (u, v) = (x as f32 + 0.5 - 20.0, y as f32 + 0.5 - 20.0);
            let toward = (18.0_f32.powi(2) - u * u - v * v).sqrt();
            let expected = [u / 18.0, -v / 18.0, toward / 18.0];
            for (found, expected) in normals.get_pixel(x, y).0.iter().zip(expected) {
                assert!((found - expected).abs() < 0.01, "{found} {expected}");
            }
        }
        assert!(normals.get_pixel(0, 0).0[0].is_nan());
    }

    #[test]
    fn a_step_between_surfaces_does_not_tilt_them() {
        let normals = normals_from_depth(&map(|x, _| if x < 20.0 { 0.0 } else { 90.0 }), 10.0);
        assert_eq!(normals.get_pixel(19, 7).0, [0.0, 0.0, 1.0]);
        assert_eq!(normals.get_pixel(20, 7).0, [0.0, 0.0, 1.0]);
    }
}
