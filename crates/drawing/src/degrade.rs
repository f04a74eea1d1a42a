//! Makes drawings imperfect as by hand: wobble, gaps, pencil, paper, misplaced views.

use image::GrayImage;
use rand::Rng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::Serialize;

use super::wobble::Noise;
use super::{LineKind, Stroke};
use frames::Viewpoint;

/// All imperfections of a sheet; see [`DegradeOptions`](super::DegradeOptions) for their units.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Degradation {
    /// Root mean square deviation of lines, px.
    pub wobble_rms_px: f64,
    /// Length of a wave of the lines' wobble, px.
    pub wobble_wavelength_px: f64,
    /// Share of the lines' length that is missing in gaps, 0 to 1.
    pub gap_share: f64,
    /// Smallest line width, px.
    pub width_min_px: f64,
    /// Largest line width, px.
    pub width_max_px: f64,
    /// Lightness of the lines: 0 is black ink, 0.6 a hard pencil.
    pub pencil_lightness: f64,
    /// Standard deviation of the paper's texture, share of the grey range.
    pub paper_texture: f64,
    /// Largest error of a view's scale, as a share of it.
    pub scale_error: f64,
    /// Largest shift of a view along either axis, px.
    pub shift_px: f64,
    /// Largest error of a view's azimuth, degrees.
    pub azimuth_error_deg: f64,
    /// Share of the strokes inside the outline that are left out, 0 to 1.
    pub missing_interior: f64,
    /// Quality of the JPEG compression that the drawing goes through, 1 to 100; 0 for none.
    pub jpeg_quality: u8,
}

/// How one view was misdrawn as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ViewError {
    /// Factor on the view's scale.
    pub scale: f64,
    /// How far the drawing is moved right and down, px.
    pub shift_px: [f64; 2],
    /// Degrees that the camera stood ahead of the azimuth that the sheet states.
    pub azimuth_error_deg: f64,
}

/// Randomness of one view: it depends on the seed and the viewpoint, not on the other views.
pub(super) fn view_random(seed: u64, viewpoint: Viewpoint) -> ChaCha8Rng {
    /// Azimuths are below this, millionths of a degree.
    const TURN: u64 = 360_000_000;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let azimuth = (viewpoint.azimuth.degrees() * 1e6).round() as u64;
    let elevation = (viewpoint.elevation.degrees() * 1e6).round() as i64;
    random.set_stream(azimuth.wrapping_add(TURN.wrapping_mul(elevation as u64)));
    random
}

impl Degradation {
    pub(super) fn none(line_width_px: f64) -> Self {
        Self {
            wobble_rms_px: 0.0,
            wobble_wavelength_px: 40.0,
            gap_share: 0.0,
            width_min_px: line_width_px,
            width_max_px: line_width_px,
            pencil_lightness: 0.0,
            paper_texture: 0.0,
            scale_error: 0.0,
            shift_px: 0.0,
            azimuth_error_deg: 0.0,
            missing_interior: 0.0,
            jpeg_quality: 0,
        }
    }

    pub(super) fn view_error(&self, random: &mut ChaCha8Rng) -> ViewError {
        let mut within = |limit: f64| random.random_range(-1.0..=1.0) * limit;
        ViewError {
            scale: 1.0 + within(self.scale_error),
            shift_px: [within(self.shift_px), within(self.shift_px)],
            azimuth_error_deg: within(self.azimuth_error_deg),
        }
    }

    /// Leaves out interior strokes, then redraws the others by a less steady hand.
    pub(super) fn redraw(&self, strokes: &[Stroke], random: &mut ChaCha8Rng) -> Vec<Stroke> {
        let kept = self.without_missing(strokes, random);
        kept.into_iter()
            .flat_map(|stroke| {
                let unsteady = self.wobbled(stroke, random);
                self.with_gaps(unsteady, random)
            })
            .collect()
    }

    fn without_missing<'a>(
        &self,
        strokes: &'a [Stroke],
        random: &mut ChaCha8Rng,
    ) -> Vec<&'a Stroke> {
        let is_interior = |stroke: &Stroke| stroke.kind != LineKind::Silhouette;
        let interior: Vec<_> = (0..strokes.len()).filter(|&i| is_interior(&strokes[i])).collect();
        let count = (self.missing_interior * interior.len() as f64).round() as usize;
        let mut missing = vec![false; strokes.len()];
        for chosen in index::sample(random, interior.len(), count.min(interior.len())) {
            missing[interior[chosen]] = true;
        }
        let strokes = strokes.iter().zip(missing);
        strokes.filter_map(|(stroke, missing)| (!missing).then_some(stroke)).collect()
    }

    fn wobbled(&self, stroke: &Stroke, random: &mut ChaCha8Rng) -> Stroke {
        let spacing_px = (self.wobble_wavelength_px / 10.0).clamp(1.0, 4.0);
        let [x, y, pressure] = [(); 3].map(|()| Noise::new(self.wobble_wavelength_px, random));
        let mut redrawn = Stroke { kind: stroke.kind, points: Vec::new(), widths_px: Vec::new() };
        let middle = (self.width_min_px + self.width_max_px) / 2.0;
        let half = (self.width_max_px - self.width_min_px) / 2.0;
        for (distance, point) in resampled(stroke, spacing_px) {
            let offset = nalgebra::Vector2::new(x.at(distance), y.at(distance));
            redrawn.points.push(point + offset * self.wobble_rms_px);
            // Noise of unit variance mostly stays within two.
            let width = middle + half * (pressure.at(distance) / 2.0).clamp(-1.0, 1.0);
            redrawn.widths_px.push(width);
        }
        redrawn
    }

    fn with_gaps(&self, stroke: Stroke, random: &mut ChaCha8Rng) -> Vec<Stroke> {
        const GAP_PX: f64 = 6.0;
        let length = stroke.length_px();
        let expected = self.gap_share * length / GAP_PX;
        let extra = random.random::<f64>() < expected.fract();
        let count = expected as usize + usize::from(extra);
        let gaps: Vec<[f64; 2]> = (0..count)
            .map(|_| {
                let gap = GAP_PX * random.random_range(0.5..1.5);
                let from = random.random_range(0.0..=1.0) * (length - gap).max(0.0);
                [from, from + gap]
            })
            .collect();
        split_at_gaps(&stroke, &gaps)
    }

    /// Pencil on paper: grey lines that skip the grain, on a sheet that is not quite white.
    ///
    /// * `ink`: coverage, 0..255. Returns grey, 255 is white.
    pub(super) fn on_paper(&self, ink: &GrayImage, random: &mut ChaCha8Rng) -> GrayImage {
        GrayImage::from_fn(ink.width(), ink.height(), |x, y| {
            // The sum of uniform numbers has a variance of a twelfth each.
            let grain = (0..3).map(|_| random.random::<f64>() - 0.5).sum::<f64>() * 2.0;
            let paper = 1.0 - (self.paper_texture * grain).abs();
            let skipped = (self.paper_texture * 8.0 * grain).clamp(0.0, 0.8);
            let coverage = f64::from(ink.get_pixel(x, y).0[0]) / 255.0 * (1.0 - skipped);
            let grey = paper * (1.0 - coverage) + self.pencil_lightness * coverage;
            image::Luma([(grey.clamp(0.0, 1.0) * 255.0).round() as u8])
        })
    }
}

/// Points along a stroke no farther apart than `spacing_px`, each with its distance from the
/// start; the stroke's own points are kept.
fn resampled(stroke: &Stroke, spacing_px: f64) -> Vec<(f64, nalgebra::Point2<f64>)> {
    let mut points = Vec::new();
    let mut walked = 0.0;
    for pair in stroke.points.windows(2) {
        let step = pair[1] - pair[0];
        let length = step.norm();
        let parts = (length / spacing_px).ceil().max(1.0);
        for part in 0..parts as usize {
            let t = part as f64 / parts;
            points.push((walked + t * length, pair[0] + step * t));
        }
        walked += length;
    }
    points.extend(stroke.points.last().map(|&last| (walked, last)));
    points
}

/// The stroke without the points in gaps, given as distances from its start.
fn split_at_gaps(stroke: &Stroke, gaps: &[[f64; 2]]) -> Vec<Stroke> {
    let mut parts: Vec<Stroke> = Vec::new();
    let mut drawing = false;
    for (distance, point) in resampled(stroke, 1.0) {
        let in_gap = gaps.iter().any(|&[from, to]| (from..=to).contains(&distance));
        if !in_gap {
            if !drawing {
                parts.push(Stroke { kind: stroke.kind, points: Vec::new(), widths_px: Vec::new() });
            }
            let width = width_at(stroke, distance);
            if let Some(part) = parts.last_mut() {
                part.points.push(point);
                part.widths_px.push(width);
            }
        }
        drawing = !in_gap;
    }
    parts.retain(|part| part.points.len() > 1);
    parts
}

fn width_at(stroke: &Stroke, distance: f64) -> f64 {
    let mut walked = 0.0;
    for (index, pair) in stroke.points.windows(2).enumerate() {
        walked += (pair[1] - pair[0]).norm();
        if walked >= distance {
            return stroke.widths_px[index];
        }
    }
    stroke.widths_px.last().copied().unwrap_or(0.0)
}

#[cfg(test)]
#[path = "degrade_tests.rs"]
mod tests;
