//! Depth, mask and normals of a view, pixel by pixel.

use image::{GrayImage, Luma, Rgb, RgbImage};
use nalgebra::Vector3;

use super::camera::Camera;
use super::features::ViewedModel;
use super::{DrawError, DrawOptions, PreparedModel};
use mesh::raster::SampleBuffer;
use picture::FloatImage;

/// What is known about one view of the model, pixel by pixel.
///
/// A pixel is covered if at least half of its samples hit the model, and holds the mean of as many
/// of its nearest ones: at silhouettes it tells of the surface in front.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundTruth {
    /// Distance from the camera plane in scene units; NaN is background.
    pub depth: FloatImage,
    /// 255 where the model is.
    pub mask: GrayImage,
    /// Unit normal in the view frame with y up and z towards the viewer, each component's
    /// [-1, 1] as 0..255; black is background.
    pub normals: RgbImage,
}

/// Renders the ground truth of a view.
///
/// # Errors
/// [`DrawError::TooComplex`] if the triangles cover each other too many times.
pub(super) fn ground_truth(
    model: &PreparedModel,
    camera: &Camera,
    options: &DrawOptions,
) -> Result<GroundTruth, DrawError> {
    let factor = options.supersampling;
    let fine = camera.refined(f64::from(factor));
    let viewed = ViewedModel::new(model, &fine);
    let mut samples = SampleBuffer::new(
        (options.width_px * factor) as usize,
        (options.height_px * factor) as usize,
    );
    samples.draw((0..model.mesh.triangles.len()).map(|face| viewed.corners(face)))?;
    Ok(gather(&samples, &viewed, &fine, options))
}

fn gather(
    samples: &SampleBuffer,
    viewed: &ViewedModel<'_>,
    camera: &Camera,
    options: &DrawOptions,
) -> GroundTruth {
    let (width, height) = (options.width_px, options.height_px);
    let mut truth = GroundTruth {
        depth: FloatImage::from_pixel(width, height, Luma([f32::NAN])),
        mask: GrayImage::new(width, height),
        normals: RgbImage::new(width, height),
    };
    let factor = options.supersampling as usize;
    let needed = (factor * factor).div_ceil(2);
    let mut hits: Vec<usize> = Vec::with_capacity(factor * factor);
    for (x, y, depth) in truth.depth.enumerate_pixels_mut() {
        let first = y as usize * factor * samples.width + x as usize * factor;
        samples.hits(first, factor, &mut hits);
        if hits.len() < needed {
            continue;
        }
        hits.sort_unstable_by(|&a, &b| samples.samples[a].z.total_cmp(&samples.samples[b].z));
        let nearest = hits[..needed].iter().map(|&hit| f64::from(samples.samples[hit].z));
        let z = nearest.sum::<f64>() / needed as f64;
        depth.0[0] = camera.depth_from_view(z) as f32;
        truth.mask.put_pixel(x, y, Luma([255]));
        let normals = hits[..needed].iter().map(|&hit| normal_at(samples, viewed, camera, hit));
        truth.normals.put_pixel(x, y, encoded(normals.sum()));
    }
    truth
}

/// The normal seen at a sample, turned towards the viewer.
fn normal_at(
    samples: &SampleBuffer,
    viewed: &ViewedModel<'_>,
    camera: &Camera,
    index: usize,
) -> Vector3<f64> {
    let face = samples.samples[index].face as usize;
    let mut normal = viewed.model.face_normals[face];
    if let Some(corner_normals) = &viewed.model.corner_normals {
        let [a, b, c] = viewed.corners(face);
        let x = (index % samples.width) as f64 + 0.5 - a.x;
        let y = (index / samples.width) as f64 + 0.5 - a.y;
        let (ab, ac) = ((b - a).xy(), (c - a).xy());
        let area = ab.perp(&ac);
        let v = (x * ac.y - y * ac.x) / area;
        let w = (y * ab.x - x * ab.y) / area;
        let [n0, n1, n2] = corner_normals[face];
        let interpolated = n0 * (1.0 - v - w) + n1 * v + n2 * w;
        normal = interpolated.try_normalize(1e-9).unwrap_or(normal);
    }
    let in_view = camera.rotate(normal);
    let sign = if in_view.z > 0.0 { -1.0 } else { 1.0 };
    Vector3::new(in_view.x, -in_view.y, -in_view.z) * sign
}

fn encoded(sum: Vector3<f64>) -> Rgb<u8> {
    let unit = sum.try_normalize(1e-12).unwrap_or(Vector3::z());
    let byte = |component: f64| ((component + 1.0) / 2.0 * 255.0).round() as u8;
    Rgb([byte(unit.x), byte(unit.y), byte(unit.z)])
}

/// The dissertation's ground truth: depth inverted and normalised to a linear 8-bit ramp, the
/// nearest white (255), the farthest 1, the background 0.
pub fn normalised_inverse_depth(depth: &FloatImage) -> GrayImage {
    let known = || depth.as_raw().iter().copied().filter(|d| d.is_finite());
    let nearest = known().fold(f32::INFINITY, f32::min);
    let farthest = known().fold(f32::NEG_INFINITY, f32::max);
    let range = (farthest - nearest).max(f32::MIN_POSITIVE);
    let levels = depth.as_raw().iter().map(|&d| {
        let nearness = (farthest - d) / range;
        if d.is_finite() { (1.0 + 254.0 * nearness).round() as u8 } else { 0 }
    });
    GrayImage::from_raw(depth.width(), depth.height(), levels.collect()).unwrap_or_default()
}

/// The disparity of a view towards another one, pixels: how far to the left each point moves.
///
/// With x from the turntable axis' column and d the depth behind the axis plane, both in pixels,
/// and t the angle from this view to the other: x (1 - cos t) - d sin t. Nearer is larger for the
/// next view counter-clockwise. In views from above or below it is the horizontal part.
pub fn disparity_towards(
    depth: &FloatImage,
    camera: &Camera,
    options: &DrawOptions,
    angle_deg: f64,
) -> FloatImage {
    let (sin_t, cos_t) = angle_deg.to_radians().sin_cos();
    let (sin_e, cos_e) = options.elevation_deg.to_radians().sin_cos();
    let mut disparity = depth.clone();
    for (column, row, value) in disparity.enumerate_pixels_mut() {
        if !value.0[0].is_finite() {
            continue;
        }
        let x = f64::from(column) + 0.5 - f64::from(options.width_px) / 2.0;
        let y = f64::from(row) + 0.5 - f64::from(options.height_px) / 2.0;
        let along = f64::from(value.0[0]) - camera.distance_units;
        // y = -(Z cos e + d sin e) and along = d cos e - Z sin e, solved for d.
        let d = along * camera.pixels_per_unit * cos_e - y * sin_e;
        value.0[0] = (x * (1.0 - cos_t) - d * sin_t) as f32;
    }
    disparity
}
