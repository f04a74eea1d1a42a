//! Depth maps carve the solid slice by slice.

use image::{ImageBuffer, Luma};
use nalgebra::Point2;

use super::DepthMap;
use super::field::{Lattice, Plane};
use super::sheet::SolidSheet;

/// How far from a depth map's surface it has a say, as a share of the solid's
/// longest side: about the error of depth from lines.
const REACH: f64 = 0.02;
/// The silhouettes' own surface counts as much as this many depth maps seen face on.
const PRIOR_WEIGHT: f64 = 0.5;
/// Surfaces steeper than this are told by other views, the cosine to the view direction.
const MIN_COSINE: f32 = 0.15;

/// A depth map made ready for looking up.
pub struct CarvingView {
    azimuth_rad: f64,
    axis_px: f64,
    mirror_sum_px: Option<f64>,
    depth_gain_px: f64,
    width: usize,
    height: usize,
    /// Per pixel: depth, px, and the surface's cosine to the view direction;
    /// NaN outside.
    samples: std::sync::Arc<Vec<[f32; 2]>>,
}

impl CarvingView {
    /// One for each view, drawn or mirrored, whose drawing has a depth map.
    pub fn of_sheet(sheet: &SolidSheet, depth_maps: &[DepthMap]) -> Vec<Self> {
        use rayon::prelude::*;
        let samples: Vec<_> = depth_maps
            .par_iter()
            .map(|map| std::sync::Arc::new(with_cosines(&map.depth)))
            .collect();
        let mut carving = Vec::new();
        for view in &sheet.views {
            let azimuth = sheet.azimuths[view.drawing];
            let Some(depth_gain_px) = view.depth_gain_px else {
                continue;
            };
            let Some(index) = depth_maps.iter().position(|map| map.azimuth == azimuth) else {
                continue;
            };
            carving.push(Self {
                azimuth_rad: view.outline.azimuth_rad,
                axis_px: sheet.axis_px,
                mirror_sum_px: view.mirror_sum_px,
                depth_gain_px,
                width: depth_maps[index].depth.width() as usize,
                height: depth_maps[index].depth.height() as usize,
                samples: samples[index].clone(),
            });
        }
        carving
    }

    /// Signed distance behind the view's surface, px, and its weight; `None`
    /// where the view says nothing.
    fn vote(&self, point: &Point2<f64>, row: usize, reach_px: f64) -> Option<(f64, f64)> {
        let (sine, cosine) = self.azimuth_rad.sin_cos();
        let column = point.x * cosine + point.y * sine;
        let column = self.mirror_sum_px.map_or(column, |sum| sum - column) + self.axis_px;
        if row >= self.height || column < 0.0 || column >= self.width as f64 {
            return None;
        }
        let [depth, facing] = self.samples[row * self.width + column as usize];
        if facing.is_nan() || facing <= MIN_COSINE {
            return None;
        }
        let own = point.y * cosine - point.x * sine;
        let facing = f64::from(facing);
        let behind = (own - f64::from(depth) - self.depth_gain_px) * facing;
        // Far behind the surface nothing is known.
        let weight = facing * (2.0 - behind / reach_px).clamp(0.0, 1.0);
        (weight > 0.0).then(|| (behind.clamp(-reach_px, reach_px), weight))
    }
}

fn with_cosines(depth: &ImageBuffer<Luma<f32>, Vec<f32>>) -> Vec<[f32; 2]> {
    let (width, height) = (depth.width() as usize, depth.height() as usize);
    let values = depth.as_raw();
    let slope = |here: f32, before: Option<&f32>, after: Option<&f32>| -> f32 {
        let step = |value: Option<&f32>, sign: f32| {
            value.filter(|value| value.is_finite()).map(|value| sign * (value - here))
        };
        // The gentler side: a jump beside a surface is not its slope.
        match (step(before, -1.0), step(after, 1.0)) {
            (Some(a), Some(b)) => {
                if a.abs() < b.abs() {
                    a
                } else {
                    b
                }
            }
            (Some(a), None) | (None, Some(a)) => a,
            (None, None) => 0.0,
        }
    };
    let mut samples = vec![[f32::NAN; 2]; values.len()];
    for y in 0..height {
        for x in 0..width {
            let index = y * width + x;
            let here = values[index];
            if here.is_finite() {
                let before = (x > 0).then(|| &values[index - 1]);
                let above = index.checked_sub(width).map(|index| &values[index]);
                let after = (x + 1 < width).then(|| &values[index + 1]);
                let across = slope(here, before, after);
                let down = slope(here, above, values.get(index + width));
                samples[index] = [here, 1.0 / (1.0 + across * across + down * down).sqrt()];
            }
        }
    }
    samples
}

/// Moves the surface of `plane` to where the depth maps agree it is, nowhere
/// beyond `hull`.
///
/// Truncated signed distances are averaged, the silhouettes' own among them.
///
/// # Source
/// Curless & Levoy 1996, A volumetric method for building complex models from
/// range images.
pub fn carve(
    plane: &mut Plane,
    hull: &Plane,
    lattice: &Lattice,
    row: usize,
    views: &[CarvingView],
) {
    let longest = lattice.nodes.iter().copied().max().unwrap_or(1) as f64 * lattice.pitch_px;
    let reach_px = REACH * longest;
    let limit = lattice.truncation_px();
    let outside = -limit as f32;
    let mut carved = hull.clone();
    carved.creases = std::mem::take(&mut plane.creases);
    for j in 0..hull.size[1] {
        for i in 0..hull.size[0] {
            let index = j * hull.size[0] + i;
            let bound = f64::from(hull.values[index]);
            if bound <= 0.0 {
                continue;
            }
            let (i, j) = (hull.first[0] + i, hull.first[1] + j);
            let point = Point2::new(lattice.x(i), lattice.y(j));
            let prior = f64::from(plane.at(i, j, outside));
            let (mut sum, mut weights) = (prior * PRIOR_WEIGHT, PRIOR_WEIGHT);
            for (distance, weight) in
                views.iter().filter_map(|view| view.vote(&point, row, reach_px))
            {
                sum += distance * weight;
                weights += weight;
            }
            carved.values[index] = (sum / weights).min(bound).clamp(-limit, limit) as f32;
        }
    }
    *plane = carved;
}
