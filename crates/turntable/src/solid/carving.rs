//! Depth maps as the fusion sees them: how deep, how steep, how far believed.

use std::sync::Arc;

use nalgebra::Point2;
use picture::FloatImage;

use super::ViewDepthMap;
use super::solid_views::{SolidSheet, SolidView};
use crate::depth_map::Confidence;

/// Surfaces steeper than this are told by other views, the cosine to the view direction.
const MIN_COSINE: f32 = 0.15;
/// How far depth at the visual hull's bound is believed.
const HULL_TRUST: f32 = 0.5;
/// How far depth that is carried on from lines farther off is believed, of
/// views up to `NEAR_DEG` apart; of wider ones less in proportion.
const GUESS_TRUST: f32 = 0.3;
const NEAR_DEG: f64 = 5.0;
/// What a map that contradicts counts against one that agrees.
const CONFLICT_WEIGHT: f32 = 4.0;
/// Maps are compared at every so many columns and rows.
const CELL_PX: usize = 2;

/// What a depth map says of a pixel.
#[derive(Clone, Copy)]
struct Sample {
    /// px; NaN outside.
    depth: f32,
    /// The surface's cosine to the view direction.
    facing: f32,
    /// How far the depth is believed, 0 to 1.
    trust: f32,
}

/// A depth map made ready for looking up.
#[derive(Clone)]
pub(super) struct CarvingView {
    /// Sine and cosine of the azimuth.
    direction: (f64, f64),
    axis_px: f64,
    mirror_sum_px: Option<f64>,
    depth_gain_px: f64,
    width: usize,
    height: usize,
    /// Index of the depth map.
    map: usize,
    samples: Arc<Vec<Sample>>,
}

impl CarvingView {
    /// One for each view, drawn or mirrored, whose drawing has a depth map.
    ///
    /// Where maps contradict each other, those that more maps agree with are
    /// believed. `reach_px` is how far apart surfaces still agree.
    pub(super) fn of_sheet(
        sheet: &SolidSheet,
        depth_maps: &[ViewDepthMap<'_>],
        reach_px: f64,
    ) -> Vec<Self> {
        use rayon::prelude::*;
        let samples: Vec<_> = depth_maps
            .par_iter()
            .map(|map| Arc::new(samples_of(map, guess_trust(map, depth_maps))))
            .collect();
        let views = sheet.views.iter();
        let mut carving: Vec<Self> =
            views.filter_map(|view| Self::new(sheet, view, depth_maps, &samples)).collect();
        let points: Vec<_> = carving.par_iter().map(Self::points).collect();
        let believed: Vec<_> = (0..depth_maps.len())
            .into_par_iter()
            .map(|map| {
                let own = carving.iter().position(|view| view.map == map)?;
                Some(Arc::new(believed(&carving, &points, own, reach_px)))
            })
            .collect();
        for view in &mut carving {
            if let Some(samples) = &believed[view.map] {
                view.samples = samples.clone();
            }
        }
        carving
    }

    fn new(
        sheet: &SolidSheet,
        view: &SolidView,
        depth_maps: &[ViewDepthMap<'_>],
        samples: &[Arc<Vec<Sample>>],
    ) -> Option<Self> {
        let azimuth = sheet.azimuths[view.drawing];
        let map = depth_maps.iter().position(|map| map.azimuth == azimuth)?;
        Some(Self {
            direction: view.outline.azimuth_rad.sin_cos(),
            axis_px: sheet.axis_px,
            mirror_sum_px: view.mirror_sum_px,
            depth_gain_px: view.depth_gain_px?,
            width: depth_maps[map].map.depth_px.width() as usize,
            height: depth_maps[map].map.depth_px.height() as usize,
            map,
            samples: samples[map].clone(),
        })
    }

    /// The pixel that shows a point; `None` outside and where the surface is
    /// too steep.
    fn pixel(&self, point: &Point2<f64>, row: usize) -> Option<usize> {
        let (sine, cosine) = self.direction;
        let column = point.x * cosine + point.y * sine;
        let column = self.mirror_sum_px.map_or(column, |sum| sum - column) + self.axis_px;
        if row >= self.height || column < 0.0 || column >= self.width as f64 {
            return None;
        }
        let pixel = row * self.width + column as usize;
        (self.samples[pixel].facing > MIN_COSINE).then_some(pixel)
    }

    /// How far a point is behind the view's surface along the surface's normal, px.
    fn behind(&self, point: &Point2<f64>, sample: &Sample) -> f64 {
        let (sine, cosine) = self.direction;
        let own = point.y * cosine - point.x * sine;
        (own - f64::from(sample.depth) - self.depth_gain_px) * f64::from(sample.facing)
    }

    /// Signed distance behind the view's surface, px, and its weight; `None`
    /// where the view says nothing.
    pub(super) fn vote(
        &self,
        point: &Point2<f64>,
        row: usize,
        reach_px: f64,
    ) -> Option<(f64, f64)> {
        let sample = self.samples[self.pixel(point, row)?];
        let behind = self.behind(point, &sample);
        // Far behind the surface nothing is known.
        let fade = (2.0 - behind / reach_px).clamp(0.0, 1.0);
        let weight = f64::from(sample.facing * sample.trust) * fade;
        (weight > 0.0).then(|| (behind.clamp(-reach_px, reach_px), weight))
    }

    /// Points of the surface, one a cell: (pixel, row, point).
    fn points(&self) -> Vec<(usize, usize, Point2<f64>)> {
        let (sine, cosine) = self.direction;
        let cells = (0..self.height)
            .step_by(CELL_PX)
            .flat_map(|y| (0..self.width).step_by(CELL_PX).map(move |x| (x, y)));
        cells
            .filter(|&(x, y)| self.samples[y * self.width + x].facing > MIN_COSINE)
            .map(|(x, y)| {
                let pixel = y * self.width + x;
                let column = x as f64 + 0.5 - self.axis_px;
                let column = self.mirror_sum_px.map_or(column, |sum| sum - column);
                let depth = f64::from(self.samples[pixel].depth) + self.depth_gain_px;
                let point =
                    Point2::new(column * cosine - depth * sine, column * sine + depth * cosine);
                (pixel, y, point)
            })
            .collect()
    }

    fn cell(&self, pixel: usize) -> usize {
        let columns = self.width.div_ceil(CELL_PX);
        (pixel / self.width / CELL_PX) * columns + pixel % self.width / CELL_PX
    }
}

/// The samples of one view, trusted less where other views contradict it.
///
/// Two surfaces contradict each other where one lies in what the other sees as
/// empty. Either may be wrong: the one that more views agree with is believed.
fn believed(
    views: &[CarvingView],
    points: &[Vec<(usize, usize, Point2<f64>)>],
    own: usize,
    reach_px: f64,
) -> Vec<Sample> {
    let view = &views[own];
    // Per cell: trust of those that agree, and of those that contradict.
    let cells = view.width.div_ceil(CELL_PX) * view.height.div_ceil(CELL_PX);
    let mut tally = vec![(0.0_f32, 0.0_f32); cells];
    let mut count = |pixel: usize, behind: f64, trust: f32| {
        let (agreeing, against) = &mut tally[view.cell(pixel)];
        if behind < -reach_px {
            *against += trust;
        } else if behind < reach_px {
            *agreeing += trust;
        }
    };
    for index in (0..views.len()).filter(|&index| index != own) {
        let (other, other_points) = (&views[index], &points[index]);
        for (pixel, row, point) in &points[own] {
            if let Some(there) = other.pixel(point, *row) {
                let sample = other.samples[there];
                count(*pixel, other.behind(point, &sample), sample.trust);
            }
        }
        for (there, row, point) in other_points {
            if let Some(pixel) = view.pixel(point, *row) {
                let behind = view.behind(point, &view.samples[pixel]);
                count(pixel, behind, other.samples[*there].trust);
            }
        }
    }
    let mut samples = view.samples.to_vec();
    for (pixel, sample) in samples.iter_mut().enumerate() {
        let (agreeing, against) = tally[view.cell(pixel)];
        sample.trust *= (1.0 + agreeing) / (1.0 + agreeing + CONFLICT_WEIGHT * against);
    }
    samples
}

/// The wider the angle to the next view, the less its lines tell of what is
/// between them.
fn guess_trust(map: &ViewDepthMap<'_>, all: &[ViewDepthMap<'_>]) -> f32 {
    let angle = |other: &ViewDepthMap<'_>| {
        let ahead = map.azimuth.degrees_to(other.azimuth);
        ahead.min(360.0 - ahead)
    };
    let others = all.iter().filter(|other| other.azimuth != map.azimuth);
    let nearest_deg = others.map(angle).fold(180.0, f64::min);
    GUESS_TRUST * (NEAR_DEG / nearest_deg).min(1.0) as f32
}

fn samples_of(found: &ViewDepthMap<'_>, guess_trust: f32) -> Vec<Sample> {
    let (depth, confidence) = (&found.map.depth_px, &found.map.confidence);
    let pixels = depth.as_raw().iter().zip(cosines(depth)).zip(confidence.as_raw());
    let sample = |((&depth, facing), &level): ((&f32, f32), &u8)| Sample {
        depth,
        facing,
        trust: trust_of(level, guess_trust),
    };
    pixels.map(sample).collect()
}

fn trust_of(level: u8, guess_trust: f32) -> f32 {
    if level >= Confidence::Lines as u8 {
        1.0
    } else if level == Confidence::Hull as u8 {
        HULL_TRUST
    } else {
        guess_trust
    }
}

/// Per pixel, the surface's cosine to the view direction; NaN outside.
fn cosines(depth: &FloatImage) -> Vec<f32> {
    let (width, height) = (depth.width() as usize, depth.height() as usize);
    let values = depth.as_raw();
    let mut cosines = vec![f32::NAN; values.len()];
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
                cosines[index] = 1.0 / (1.0 + across * across + down * down).sqrt();
            }
        }
    }
    cosines
}

/// The gentler of the slopes to two neighbours: a jump beside a surface is not
/// its slope.
fn slope(here: f32, before: Option<&f32>, after: Option<&f32>) -> f32 {
    let step = |value: Option<&f32>, sign: f32| {
        value.filter(|value| value.is_finite()).map(|value| sign * (value - here))
    };
    match (step(before, -1.0), step(after, 1.0)) {
        (Some(a), Some(b)) if a.abs() < b.abs() => a,
        (_, Some(b)) => b,
        (Some(a), None) => a,
        (None, None) => 0.0,
    }
}
