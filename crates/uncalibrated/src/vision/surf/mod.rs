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

pub use crate::options::SurfOptions;

/// Values of a descriptor: four sums over each of 4×4 fields.
pub const DESCRIPTOR_LENGTH: usize = 64;

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
    /// The octave it was found in, from 0.
    pub octave: u8,
}

/// Finds blobs, strongest first.
///
/// Points nearer to the border than half a filter are not found.
pub fn detect(image: &GrayImage, options: &SurfOptions) -> Vec<SurfKeypoint> {
    let integral = IntegralImage::new(image);
    let mut keypoints = hessian::blobs(&integral, options);
    keypoints.par_iter_mut().for_each(|keypoint| {
        let angle = if options.upright { 0.0 } else { orientation::angle_deg(&integral, keypoint) };
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
            let angle_deg =
                keypoint.angle_deg.unwrap_or_else(|| orientation::angle_deg(&integral, keypoint));
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

    /// A disc with one side cut off, which gives it a direction, and a dot
    /// beside it that tells it from the others.
    struct Shape {
        x: f64,
        y: f64,
        radius: f64,
        direction_deg: f64,
        dot_deg: f64,
        darkness: f64,
    }

    fn shapes() -> [Shape; 5] {
        let shape = |(x, y), radius, direction_deg, dot_deg, darkness| Shape {
            x,
            y,
            radius,
            direction_deg,
            dot_deg,
            darkness,
        };
        [
            shape((82.0, 85.5), 7.0, 10.0, 90.0, 100.0),
            shape((170.0, 80.0), 9.0, 100.0, 200.0, -100.0),
            shape((127.5, 126.0), 8.0, 220.0, 300.0, 100.0),
            shape((84.0, 172.0), 10.0, 300.0, 150.0, -100.0),
            shape((173.0, 168.0), 7.5, 60.0, 240.0, 100.0),
        ]
    }

    /// Grey at a place of the picture as it is before turning.
    fn grey(x: f64, y: f64) -> f64 {
        let soft = |inside: f64| 1.0 / (1.0 + (-inside / 0.7).exp());
        let darkness = |shape: &Shape| {
            let (dx, dy) = (x - shape.x, y - shape.y);
            let (sin, cos) = shape.direction_deg.to_radians().sin_cos();
            let cut = soft(0.2 * shape.radius - (dx * cos + dy * sin));
            let disc = soft(shape.radius - dx.hypot(dy)) * cut;
            let (sin, cos) = (shape.direction_deg + shape.dot_deg).to_radians().sin_cos();
            let away = 1.9 * shape.radius;
            let dot = soft(0.35 * shape.radius - (dx - away * cos).hypot(dy - away * sin));
            shape.darkness * (disc + dot)
        };
        128.0 - shapes().iter().map(darkness).sum::<f64>()
    }

    /// The shapes turned by `angle_deg` and magnified about the middle.
    fn picture(angle_deg: f64, magnification: f64) -> GrayImage {
        let (sin, cos) = (-angle_deg).to_radians().sin_cos();
        GrayImage::from_fn(256, 256, |x, y| {
            let (dx, dy) = (f64::from(x) - 127.5, f64::from(y) - 127.5);
            let (dx, dy) = (dx * cos - dy * sin, dx * sin + dy * cos);
            let value = grey(127.5 + dx / magnification, 127.5 + dy / magnification);
            image::Luma([value.round().clamp(0.0, 255.0) as u8])
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
        SurfOptions { octaves: 3, ..SurfOptions::default() }
    }

    fn place(keypoint: &SurfKeypoint) -> (f64, f64) {
        (f64::from(keypoint.x), f64::from(keypoint.y))
    }

    fn distance(keypoint: &SurfKeypoint, (x, y): (f64, f64)) -> f64 {
        (f64::from(keypoint.x) - x).hypot(f64::from(keypoint.y) - y)
    }

    fn nearest(keypoints: &[SurfKeypoint], at: (f64, f64)) -> usize {
        let by_distance = |&one: &usize, &other: &usize| {
            distance(&keypoints[one], at).total_cmp(&distance(&keypoints[other], at))
        };
        (0..keypoints.len()).min_by(by_distance).unwrap()
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
        for (angle_deg, magnification) in
            [(17.0, 1.0), (90.0, 1.0), (200.0, 1.0), (0.0, 1.3), (40.0, 0.8)]
        {
            let second = detect(&picture(angle_deg, magnification), &options());
            // What shrinks below the smallest filters cannot be found again.
            let findable: Vec<_> =
                first.iter().filter(|k| f64::from(k.size) * magnification >= 12.0).collect();
            let repeated = findable
                .iter()
                .filter(|k| {
                    let at = moved(place(k), angle_deg, magnification);
                    second.iter().any(|other| {
                        let ratio = f64::from(other.size / k.size) / magnification;
                        distance(other, at) < 1.5 && (0.75..1.35).contains(&ratio)
                    })
                })
                .count();
            let share = repeated as f64 / findable.len() as f64;
            let of = findable.len();
            assert!(of >= 5 && share >= 0.8, "{angle_deg}° ×{magnification}: {repeated} of {of}");
        }
    }

    #[test]
    fn orientation_turns_with_the_picture_and_descriptors_match() {
        let first_image = picture(0.0, 1.0);
        let first = detect(&first_image, &options());
        let descriptors = describe(&first_image, &first);
        let mut matched = 0;
        for (angle_deg, magnification) in [(30.0, 1.0), (90.0, 1.0), (145.0, 1.2)] {
            let second_image = picture(angle_deg, magnification);
            let second = detect(&second_image, &options());
            let others = describe(&second_image, &second);
            for Shape { x, y, .. } in shapes() {
                let one = nearest(&first, (x, y));
                let square = |other: &[f32; 64]| -> f32 {
                    other.iter().zip(&descriptors[one]).map(|(a, b)| (a - b).powi(2)).sum()
                };
                let best = (0..others.len())
                    .filter(|&i| second[i].laplacian_sign == first[one].laplacian_sign)
                    .min_by(|&a, &b| square(&others[a]).total_cmp(&square(&others[b])))
                    .unwrap();
                let at = moved(place(&first[one]), angle_deg, magnification);
                let turned = second[best].angle_deg.unwrap() - first[one].angle_deg.unwrap();
                let off_deg = (f64::from(turned) - angle_deg + 540.0).rem_euclid(360.0) - 180.0;
                let off_px = distance(&second[best], at);
                if off_px < 2.0 && off_deg.abs() < 12.0 && square(&others[best]) < 0.09 {
                    matched += 1;
                }
            }
        }
        assert!(matched >= 13, "{matched} of 15");
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
            octave: 0,
        };
        let odd =
            [at(0.0, 0.0, 11.0), at(255.0, 255.0, 1.0), at(-50.0, 1e9, 7.0), at(70.0, 80.0, 1e6)];
        assert_eq!(describe(&image, &odd).len(), 4);
        let nan = [at(f32::NAN, 3.0, 5.0), at(3.0, 3.0, f32::NAN), at(3.0, 3.0, f32::INFINITY)];
        assert!(describe(&image, &nan).iter().flatten().all(|value| value.is_finite()));
        let found = detect(&image, &options())[0];
        let cleared = SurfKeypoint { angle_deg: None, ..found };
        assert_eq!(describe(&image, &[found]), describe(&image, &[cleared]));
    }

    #[test]
    fn upright_points_point_right() {
        let upright = SurfOptions { upright: true, ..options() };
        assert!(detect(&picture(0.0, 1.0), &upright).iter().all(|k| k.angle_deg == Some(0.0)));
    }

    #[test]
    fn tiny_pictures_and_extreme_options_give_nothing() {
        for (width, height) in [(0, 0), (1, 1), (8, 100), (9, 9), (300, 3)] {
            assert!(detect(&GrayImage::new(width, height), &options()).is_empty());
        }
        let extreme = SurfOptions { octaves: u32::MAX, octave_layers: u32::MAX, ..options() };
        detect(&GrayImage::new(32, 32), &extreme);
        let none = SurfOptions { octaves: 0, octave_layers: 0, ..options() };
        assert!(detect(&picture(0.0, 1.0), &none).is_empty());
    }

    #[test]
    fn strongest_first_and_the_same_every_time() {
        let image = picture(10.0, 1.0);
        let found = detect(&image, &options());
        assert!(found.is_sorted_by(|one, other| one.response >= other.response));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        assert_eq!(pool.install(|| detect(&image, &options())), found);
    }
}
