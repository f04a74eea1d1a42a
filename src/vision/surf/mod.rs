//! SURF keypoints and descriptors.
//!
//! Blobs are maxima of the determinant of the Hessian over position and scale,
//! with second derivatives of Gaussians approximated by boxes on an integral
//! image. Filter sizes, sampling and the response's scaling are OpenCV's, so
//! that its thresholds carry over. Pixel coordinates are OpenCV's too: the
//! centre of the top left pixel is (0, 0).
//!
//! Source: Bay, Ess, Tuytelaars & Van Gool, Speeded-Up Robust Features, CVIU
//! 110(3), 2008.

mod descriptor;
mod haar;
mod hessian;
mod integral;
mod orientation;

use image::GrayImage;
use rayon::prelude::*;

use integral::IntegralImage;

/// Values of a descriptor: four sums over each of 4×4 fields.
pub const DESCRIPTOR_LENGTH: usize = 64;

/// What is detected (Arys 2020, table 4.3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfOptions {
    /// The least determinant of the Hessian, of 8-bit grey levels and filters
    /// normalised by their boxes' areas, as OpenCV counts.
    pub hessian_threshold: f64,
    /// Octaves: how often sampling step and filter size double, and one.
    pub octaves: u32,
    /// Scales an octave in which blobs are found.
    pub octave_layers: u32,
    /// Leave out the orientation: faster, for pictures that are not rotated.
    pub upright: bool,
}

impl Default for SurfOptions {
    fn default() -> Self {
        Self {
            hessian_threshold: 1000.0,
            octaves: 2,
            octave_layers: 4,
            upright: false,
        }
    }
}

/// A blob, or another detector's point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfKeypoint {
    /// Right, px.
    pub x: f32,
    /// Down, px.
    pub y: f32,
    /// Side of the box filter, px: 7.5 times the scale σ. A descriptor covers
    /// 20 σ, 2.7 times this.
    pub size: f32,
    /// From the x axis towards the y axis, degrees in [0, 360); `None` if not
    /// known yet.
    pub angle_deg: Option<f32>,
    /// The determinant of the Hessian.
    pub response: f32,
    /// 1 for a dark blob on light ground, -1 for a light one.
    pub laplacian_sign: i8,
}

/// Finds blobs, strongest first.
///
/// Points nearer to the border than half a filter are not found.
pub fn detect(image: &GrayImage, options: &SurfOptions) -> Vec<SurfKeypoint> {
    let integral = IntegralImage::new(image);
    let mut keypoints = hessian::blobs(&integral, options);
    keypoints.par_iter_mut().for_each(|keypoint| {
        let angle = if options.upright {
            0.0
        } else {
            orientation::angle_deg(&integral, keypoint)
        };
        keypoint.angle_deg = Some(angle);
    });
    keypoints
}

/// Describes the surroundings of each keypoint by a vector of unit length, or
/// of zeros where the picture is flat.
///
/// Keypoints without an angle get the one [`detect`] would give; clear the
/// angles of another detector's points to do as OpenCV does. Only position,
/// size and angle are used. What lies beyond the picture does not count.
pub fn describe(image: &GrayImage, keypoints: &[SurfKeypoint]) -> Vec<[f32; DESCRIPTOR_LENGTH]> {
    let integral = IntegralImage::new(image);
    keypoints
        .par_iter()
        .map(|keypoint| {
            let angle_deg = keypoint
                .angle_deg
                .unwrap_or_else(|| orientation::angle_deg(&integral, keypoint));
            descriptor::describe(&integral, keypoint, angle_deg)
        })
        .collect()
}

/// The scale σ of a keypoint, px, at least that of one pixel wide wavelets.
fn scale_px(keypoint: &SurfKeypoint) -> f64 {
    // The smallest filter, 9 px, approximates σ = 1.2 (Bay et al., §3.2).
    (f64::from(keypoint.size) * 1.2 / 9.0).max(0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Dark and light Gaussian blobs `(x, y, σ, depth)` on grey, each with a
    /// wider one beside it that gives its surroundings a direction.
    fn blobs() -> Vec<(f64, f64, f64, f64)> {
        let main = [
            (70.0, 80.0, 3.0, 110.0),
            (180.0, 75.5, 4.0, -100.0),
            (120.25, 170.0, 5.0, 105.0),
            (200.0, 190.0, 3.5, -110.0),
            (60.0, 200.0, 4.5, 100.0),
        ];
        let beside = |&(x, y, sigma, depth): &(f64, f64, f64, f64), index: usize| {
            let turn = index as f64 * 1.3;
            let away = 5.0 * sigma;
            (
                x + away * turn.cos(),
                y + away * turn.sin(),
                2.0 * sigma,
                0.7 * depth,
            )
        };
        main.iter()
            .enumerate()
            .flat_map(|(i, blob)| [*blob, beside(blob, i)])
            .collect()
    }

    /// Renders the blobs turned by `angle_deg` and magnified about the middle.
    fn picture(angle_deg: f64, magnification: f64) -> GrayImage {
        let blobs: Vec<_> = blobs()
            .into_iter()
            .map(|(x, y, sigma, depth)| {
                let (x, y) = moved((x, y), angle_deg, magnification);
                (x, y, sigma * magnification, depth)
            })
            .collect();
        GrayImage::from_fn(256, 256, |x, y| {
            let darkness: f64 = blobs
                .iter()
                .map(|(bx, by, sigma, depth)| {
                    let square = (f64::from(x) - bx).powi(2) + (f64::from(y) - by).powi(2);
                    depth * (-square / (2.0 * sigma * sigma)).exp()
                })
                .sum();
            image::Luma([(128.0 - darkness).round().clamp(0.0, 255.0) as u8])
        })
    }

    fn moved((x, y): (f64, f64), angle_deg: f64, magnification: f64) -> (f64, f64) {
        let (sin, cos) = angle_deg.to_radians().sin_cos();
        let (dx, dy) = (x - 127.5, y - 127.5);
        (
            127.5 + magnification * (dx * cos - dy * sin),
            127.5 + magnification * (dx * sin + dy * cos),
        )
    }

    fn options() -> SurfOptions {
        SurfOptions {
            octaves: 3,
            ..SurfOptions::default()
        }
    }

    fn nearest(keypoints: &[SurfKeypoint], (x, y): (f64, f64)) -> (usize, f64) {
        keypoints
            .iter()
            .map(|k| (f64::from(k.x) - x).hypot(f64::from(k.y) - y))
            .enumerate()
            .min_by(|one, other| one.1.total_cmp(&other.1))
            .unwrap()
    }

    #[test]
    fn a_lone_blob_is_found_to_sub_pixel_with_its_scale_and_sign() {
        for (sigma, sign) in [(2.5, 1), (4.0, -1), (6.0, 1)] {
            let (bx, by) = (64.3, 60.7);
            let image = GrayImage::from_fn(128, 128, |x, y| {
                let square = (f64::from(x) - bx).powi(2) + (f64::from(y) - by).powi(2);
                let bump = 110.0 * (-square / (2.0 * sigma * sigma)).exp();
                image::Luma([(128.0 - f64::from(sign) * bump).round() as u8])
            });
            let found = detect(&image, &options())[0];
            let off = (f64::from(found.x) - bx).hypot(f64::from(found.y) - by);
            assert!(off < 0.35, "σ {sigma}: {off} px off");
            assert_eq!(i32::from(found.laplacian_sign), sign);
            // Box filters blur less than the Gaussians that they stand for:
            // they respond best somewhat below the blob's own scale.
            let scale = f64::from(found.size) * 1.2 / 9.0 / sigma;
            assert!((0.65..0.85).contains(&scale), "σ {sigma}: scale {scale}");
        }
    }

    /// Bay's response for one dark pixel, by hand: with the 9×9 filter over it,
    /// Dxx and Dyy are -2/15 (their middle box of weight -2 holds it) and Dxy is
    /// 0, times the difference of -255.
    #[test]
    fn the_response_is_scaled_as_opencv_does() {
        let mut image = GrayImage::from_pixel(64, 64, image::Luma([255]));
        image.put_pixel(31, 33, image::Luma([0]));
        let integral = IntegralImage::new(&image);
        let (determinant, trace) = hessian::response_at(&integral, 31 - 4, 33 - 4, 9);
        let derivative = 255.0 * 2.0 / 15.0;
        assert!((f64::from(determinant) - derivative * derivative).abs() < 1e-3);
        assert!((f64::from(trace) - 2.0 * derivative).abs() < 1e-4);
    }

    #[test]
    fn detection_repeats_under_rotation_and_scale() {
        let first = detect(&picture(0.0, 1.0), &options());
        assert!(first.len() >= 5, "{}", first.len());
        for (angle_deg, magnification) in [
            (17.0, 1.0),
            (90.0, 1.0),
            (200.0, 1.0),
            (0.0, 1.3),
            (40.0, 0.8),
        ] {
            let second = detect(&picture(angle_deg, magnification), &options());
            let repeated = first
                .iter()
                .filter(|k| {
                    let at = moved((f64::from(k.x), f64::from(k.y)), angle_deg, magnification);
                    let (index, distance) = nearest(&second, at);
                    let ratio = f64::from(second[index].size / k.size) / magnification;
                    distance < 1.5 && (0.75..1.35).contains(&ratio)
                })
                .count();
            let share = repeated as f64 / first.len() as f64;
            assert!(
                share >= 0.8,
                "{angle_deg}° ×{magnification}: {repeated} of {}",
                first.len()
            );
        }
    }

    #[test]
    fn orientation_turns_with_the_picture_and_descriptors_match() {
        let first_image = picture(0.0, 1.0);
        let first = detect(&first_image, &options());
        let descriptors = describe(&first_image, &first);
        for (angle_deg, magnification) in [(30.0, 1.0), (90.0, 1.0), (145.0, 1.2)] {
            let second_image = picture(angle_deg, magnification);
            let second = detect(&second_image, &options());
            let others = describe(&second_image, &second);
            for (x, y, ..) in blobs().into_iter().step_by(2) {
                let (one, _) = nearest(&first, (x, y));
                let (expected, _) = nearest(&second, moved((x, y), angle_deg, magnification));
                let turned = second[expected].angle_deg.unwrap() - first[one].angle_deg.unwrap();
                let off = (f64::from(turned) - angle_deg + 540.0).rem_euclid(360.0) - 180.0;
                assert!(off.abs() < 12.0, "{angle_deg}°: off by {off}°");
                let square = |other: &[f32; 64]| -> f32 {
                    other
                        .iter()
                        .zip(&descriptors[one])
                        .map(|(a, b)| (a - b).powi(2))
                        .sum()
                };
                let best = (0..others.len())
                    .filter(|&i| second[i].laplacian_sign == first[one].laplacian_sign)
                    .min_by(|&a, &b| square(&others[a]).total_cmp(&square(&others[b])))
                    .unwrap();
                assert_eq!(best, expected, "{angle_deg}° ×{magnification} at {x},{y}");
                assert!(
                    square(&others[best]) < 0.09,
                    "{}",
                    square(&others[best]).sqrt()
                );
            }
        }
    }

    #[test]
    fn descriptors_are_of_unit_length_or_zero() {
        let image = picture(0.0, 1.0);
        let keypoints = detect(&image, &options());
        for descriptor in describe(&image, &keypoints) {
            let length: f32 = descriptor.iter().map(|value| value * value).sum();
            assert!((length - 1.0).abs() < 1e-5);
        }
        let flat = GrayImage::from_pixel(64, 64, image::Luma([200]));
        assert!(detect(&flat, &options()).is_empty());
        assert_eq!(describe(&flat, &keypoints[..1]), vec![[0.0; 64]]);
    }

    /// A corner detector's points carry no angle; those of a border lie partly
    /// outside; sizes may be anything.
    #[test]
    fn points_of_other_detectors_are_described() {
        let image = picture(0.0, 1.0);
        let at = |x: f32, y: f32, size: f32| SurfKeypoint {
            x,
            y,
            size,
            angle_deg: None,
            response: 0.0,
            laplacian_sign: 1,
        };
        let odd = [
            at(0.0, 0.0, 11.0),
            at(255.0, 255.0, 1.0),
            at(-50.0, 1e9, 7.0),
            at(70.0, 80.0, 1e6),
        ];
        assert_eq!(describe(&image, &odd).len(), 4);
        let nan = [
            at(f32::NAN, 3.0, 5.0),
            at(3.0, 3.0, f32::NAN),
            at(3.0, 3.0, f32::INFINITY),
        ];
        assert!(
            describe(&image, &nan)
                .iter()
                .flatten()
                .all(|value| value.is_finite())
        );
        let found = detect(&image, &options())[0];
        let cleared = SurfKeypoint {
            angle_deg: None,
            ..found
        };
        assert_eq!(describe(&image, &[found]), describe(&image, &[cleared]));
    }

    #[test]
    fn upright_points_point_right() {
        let upright = SurfOptions {
            upright: true,
            ..options()
        };
        assert!(
            detect(&picture(0.0, 1.0), &upright)
                .iter()
                .all(|k| k.angle_deg == Some(0.0))
        );
    }

    #[test]
    fn tiny_pictures_and_extreme_options_give_nothing() {
        for (width, height) in [(0, 0), (1, 1), (8, 100), (9, 9), (300, 3)] {
            assert!(detect(&GrayImage::new(width, height), &options()).is_empty());
        }
        let extreme = SurfOptions {
            octaves: u32::MAX,
            octave_layers: u32::MAX,
            ..options()
        };
        detect(&GrayImage::new(32, 32), &extreme);
        let none = SurfOptions {
            octaves: 0,
            octave_layers: 0,
            ..options()
        };
        assert!(detect(&picture(0.0, 1.0), &none).is_empty());
    }

    #[test]
    fn strongest_first_and_the_same_every_time() {
        let image = picture(10.0, 1.0);
        let found = detect(&image, &options());
        assert!(found.is_sorted_by(|one, other| one.response >= other.response));
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(3)
            .build()
            .unwrap();
        assert_eq!(pool.install(|| detect(&image, &options())), found);
    }
}
