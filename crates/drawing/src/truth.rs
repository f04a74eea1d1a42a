//! Depth, mask, normals and colours of a view, pixel by pixel.

use image::{GrayImage, Luma, Rgb, RgbImage};
use nalgebra::Vector3;

use super::camera::Camera;
use super::features::ViewedModel;
use super::options::Ink;
use super::paint::{Paint, painted};
use super::{DrawError, DrawOptions, DrawnView, PreparedModel};
use mesh::raster::SampleBuffer;
use mesh::read::LinearRgb;
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

/// A view of a model, sampled: the nearest surface at each of a pixel's samples.
pub(super) struct SampledView<'a> {
    samples: SampleBuffer,
    viewed: ViewedModel<'a>,
    /// Of the samples.
    camera: Camera,
    size: [u32; 2],
    /// Samples of a pixel on each axis.
    factor: usize,
}

impl<'a> SampledView<'a> {
    /// # Errors
    /// [`DrawError::TooComplex`] if the triangles cover each other too many times.
    pub(crate) fn new(
        model: &'a PreparedModel,
        camera: &Camera,
        options: &DrawOptions,
    ) -> Result<Self, DrawError> {
        let factor = options.supersampling;
        let fine = camera.refined(f64::from(factor));
        let viewed = ViewedModel::new(model, &fine);
        let size = [options.width_px, options.height_px];
        let [width, height] = size.map(|side| (side * factor) as usize);
        let mut samples = SampleBuffer::new(width, height);
        samples.draw((0..model.mesh.triangles.len()).map(|face| viewed.corners(face)))?;
        Ok(Self { samples, viewed, camera: fine, size, factor: factor as usize })
    }

    /// What is true of the view.
    pub(crate) fn truth(&self) -> GroundTruth {
        let [width, height] = self.size;
        let mut truth = GroundTruth {
            depth: FloatImage::from_pixel(width, height, Luma([f32::NAN])),
            mask: GrayImage::new(width, height),
            normals: RgbImage::new(width, height),
        };
        let samples = &self.samples.samples;
        let needed = (self.factor * self.factor).div_ceil(2);
        let mut hits = Vec::with_capacity(self.factor * self.factor);
        for (x, y, depth) in truth.depth.enumerate_pixels_mut() {
            self.hits(x, y, &mut hits);
            if hits.len() < needed {
                continue;
            }
            hits.sort_unstable_by(|&a, &b| samples[a].z.total_cmp(&samples[b].z));
            let nearest = hits[..needed].iter().map(|&hit| f64::from(samples[hit].z));
            let z = nearest.sum::<f64>() / needed as f64;
            depth.0[0] = self.camera.depth_from_view(z) as f32;
            truth.mask.put_pixel(x, y, Luma([255]));
            let normals = hits[..needed].iter().map(|&hit| self.normal_at(hit));
            truth.normals.put_pixel(x, y, encoded(normals.sum()));
        }
        truth
    }

    /// The surface in its own colours: each pixel the mean of its samples that hit it.
    pub(crate) fn painted(&self, ink: Ink) -> Paint {
        let [width, height] = self.size;
        let mut paint =
            Paint { colours: RgbImage::new(width, height), cover: GrayImage::new(width, height) };
        let all = self.factor * self.factor;
        let mut hits = Vec::with_capacity(all);
        for (x, y, pixel) in paint.colours.enumerate_pixels_mut() {
            self.hits(x, y, &mut hits);
            if hits.is_empty() {
                continue;
            }
            let mut sums = [0_usize; 3];
            for &hit in &hits {
                let colour = painted(self.colour_at(hit), self.normal_at(hit), ink);
                sums.iter_mut().zip(colour).for_each(|(sum, level)| *sum += usize::from(level));
            }
            // Means of bytes are bytes.
            pixel.0 = sums.map(|sum| ((sum + hits.len() / 2) / hits.len()) as u8);
            paint.cover.put_pixel(x, y, Luma([(255 * hits.len() / all) as u8]));
        }
        paint
    }

    fn hits(&self, x: u32, y: u32, hits: &mut Vec<usize>) {
        let first = y as usize * self.factor * self.samples.width + x as usize * self.factor;
        self.samples.hits(first, self.factor, hits);
    }

    /// How near a sample is to its triangle's corners: weights that add up to one.
    fn weights(&self, index: usize) -> [f64; 3] {
        let [a, b, c] = self.viewed.corners(self.samples.samples[index].face as usize);
        let x = (index % self.samples.width) as f64 + 0.5 - a.x;
        let y = (index / self.samples.width) as f64 + 0.5 - a.y;
        let (ab, ac) = ((b - a).xy(), (c - a).xy());
        let area = ab.perp(&ac);
        let v = (x * ac.y - y * ac.x) / area;
        let w = (y * ab.x - x * ab.y) / area;
        [1.0 - v - w, v, w]
    }

    fn colour_at(&self, index: usize) -> LinearRgb {
        let face = self.samples.samples[index].face as usize;
        let corners = self.viewed.model.corner_colours[face];
        if corners[0] == corners[1] && corners[1] == corners[2] {
            return corners[0];
        }
        let weights = self.weights(index).map(|weight| weight.clamp(0.0, 1.0) as f32);
        let total = weights.iter().sum::<f32>().max(f32::MIN_POSITIVE);
        std::array::from_fn(|channel| {
            let terms = corners.iter().zip(weights).map(|(colour, w)| colour[channel] * w);
            terms.sum::<f32>() / total
        })
    }

    /// The normal seen at a sample, turned towards the viewer.
    fn normal_at(&self, index: usize) -> Vector3<f64> {
        let face = self.samples.samples[index].face as usize;
        let mut normal = self.viewed.model.face_normals[face];
        if let Some(corner_normals) = &self.viewed.model.corner_normals {
            let [u, v, w] = self.weights(index);
            let [n0, n1, n2] = corner_normals[face];
            let interpolated = n0 * u + n1 * v + n2 * w;
            normal = interpolated.try_normalize(1e-9).unwrap_or(normal);
        }
        let in_view = self.camera.rotate(normal);
        let sign = if in_view.z > 0.0 { -1.0 } else { 1.0 };
        Vector3::new(in_view.x, -in_view.y, -in_view.z) * sign
    }
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
///
/// * `view`: whose depth it is.
pub fn disparity_towards(
    depth: &FloatImage,
    view: &DrawnView,
    options: &DrawOptions,
    angle_deg: f64,
) -> FloatImage {
    let (sin_t, cos_t) = angle_deg.to_radians().sin_cos();
    let (sin_e, cos_e) = view.viewpoint.elevation.sin_cos();
    let camera = &view.camera;
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
