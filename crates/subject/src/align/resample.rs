//! Views laid on the common canvas.

use image::{GrayImage, RgbaImage};
use rayon::prelude::*;

use super::{Alignment, Canvas, Transform, View};

/// One view on the canvas. All images have the canvas' size.
#[derive(Clone, Debug)]
pub struct Aligned {
    /// 255 inside, 0 outside.
    pub mask: GrayImage,
    /// Dark lines on white paper.
    pub ink: GrayImage,
    /// The subject's colours, alpha is the mask.
    pub colour: RgbaImage,
}

/// Resamples every view onto the canvas; views that need nothing are copied.
///
/// A triangle filter as wide as a pixel of the coarser grid (bilinear when
/// enlarging, area-weighted when reducing), wider where the steps of single pixels
/// would be seen; colours are weighted by alpha.
///
/// * `views`: those that `alignment` was found for, in their order.
pub fn apply(alignment: &Alignment, views: &[View<'_>]) -> Vec<Aligned> {
    let pairs = alignment.views.par_iter().zip(views.par_iter());
    pairs
        .map(|(found, view)| {
            let subject = view.subject;
            let (width, height) = subject.mask.dimensions();
            let canvas = (alignment.canvas.width, alignment.canvas.height);
            // A canvas that grew below has its views where they were, and more rows.
            if found.transform == Transform::IDENTITY && canvas == (width, height) {
                return Aligned {
                    mask: subject.mask.clone(),
                    ink: subject.ink.clone(),
                    colour: subject.colour.clone(),
                };
            }
            let grid = Grid::new(&alignment.canvas, &found.transform, width, height);
            let mut mask = grid.resampled::<1>(subject.mask.as_raw(), [0.0]);
            mask.iter_mut().for_each(|level| *level = if *level >= 128 { 255 } else { 0 });
            let ink = grid.resampled::<1>(subject.ink.as_raw(), [255.0]);
            let mut colour = grid.resampled_colours(subject.colour.as_raw());
            for (pixel, mask) in colour.chunks_exact_mut(4).zip(&mask) {
                pixel[3] = *mask;
            }
            let (width, height) = canvas;
            Aligned {
                mask: GrayImage::from_raw(width, height, mask).unwrap_or_default(),
                ink: GrayImage::from_raw(width, height, ink).unwrap_or_default(),
                colour: RgbaImage::from_raw(width, height, colour).unwrap_or_default(),
            }
        })
        .collect()
}

/// A drawing with fewer pixels: `factor` times fewer columns and rows, rounded up. Each is the
/// mean of those under it, colours weighed by alpha.
pub fn reduced(drawing: &RgbaImage, factor: f64) -> RgbaImage {
    let (width, height) = reduced_size(drawing.dimensions(), factor);
    let grid = Grid::reducing(drawing.dimensions(), factor);
    let bytes = grid.resampled_colours(drawing.as_raw());
    RgbaImage::from_raw(width, height, bytes).unwrap_or_default()
}

/// [`reduced`] for a mask.
pub fn reduced_mask(mask: &GrayImage, factor: f64) -> GrayImage {
    let (width, height) = reduced_size(mask.dimensions(), factor);
    let bytes = Grid::reducing(mask.dimensions(), factor).resampled::<1>(mask.as_raw(), [0.0]);
    GrayImage::from_raw(width, height, bytes).unwrap_or_default()
}

fn reduced_size((width, height): (u32, u32), factor: f64) -> (u32, u32) {
    let side = |side: u32| ((f64::from(side) / factor.max(1.0)).ceil() as u32).max(1);
    (side(width), side(height))
}

/// From this scale on a pixel's steps are smoothed, by a triangle of so many source pixels to each
/// side: lines one pixel wide stay.
const SMOOTHED_SCALE: f64 = 2.0;
const SMOOTH_RADIUS: f64 = 1.5;

/// For each canvas column or row: the first source pixel and the weights.
struct Taps(Vec<(i64, Vec<f32>)>);

impl Taps {
    fn new(count: u32, scale: f64, shift: f64) -> Self {
        let radius = if scale < SMOOTHED_SCALE { (1.0 / scale).max(1.0) } else { SMOOTH_RADIUS };
        let tap = |k: u32| {
            // Pixel centres: canvas = scale * source + shift.
            let centre = (f64::from(k) + 0.5 - shift) / scale - 0.5;
            let first = (centre - radius).ceil() as i64;
            let last = (centre + radius).floor() as i64;
            let weight = |s: i64| (1.0 - (s as f64 - centre).abs() / radius).max(0.0) as f32;
            let mut weights: Vec<f32> = (first..=last).map(weight).collect();
            let sum: f32 = weights.iter().sum();
            weights.iter_mut().for_each(|w| *w /= sum.max(1e-6));
            (first, weights)
        };
        Self((0..count).map(tap).collect())
    }
}

impl Taps {
    /// Takes nothing from beyond `count` source pixels.
    fn keep_inside(&mut self, count: i64) {
        for (first, weights) in &mut self.0 {
            let before = (-*first).clamp(0, weights.len() as i64) as usize;
            weights.drain(..before);
            *first += before as i64;
            weights.truncate((count - *first).max(0) as usize);
            let sum: f32 = weights.iter().sum();
            weights.iter_mut().for_each(|weight| *weight /= sum.max(1e-6));
        }
    }
}

struct Grid {
    across: Taps,
    down: Taps,
    width: usize,
    height: usize,
}

impl Grid {
    fn new(canvas: &Canvas, transform: &Transform, width: u32, height: u32) -> Self {
        Self {
            across: Taps::new(canvas.width, transform.scale, transform.dx),
            down: Taps::new(canvas.height, transform.scale, transform.dy),
            width: width as usize,
            height: height as usize,
        }
    }

    fn reducing(size: (u32, u32), factor: f64) -> Self {
        let (width, height) = reduced_size(size, factor);
        let taps = |count: u32, source: u32| {
            let mut taps = Taps::new(count, 1.0 / factor.max(1.0), 0.0);
            taps.keep_inside(i64::from(source));
            taps
        };
        Self {
            across: taps(width, size.0),
            down: taps(height, size.1),
            width: size.0 as usize,
            height: size.1 as usize,
        }
    }

    /// Resamples `N` interleaved channels; `outside` beyond the source.
    fn resampled<const N: usize>(&self, source: &[u8], outside: [f32; N]) -> Vec<u8> {
        let read = |row: usize, x: usize| -> [f32; N] {
            std::array::from_fn(|c| f32::from(source[(row * self.width + x) * N + c]))
        };
        let rows = self.filtered(read, outside);
        rows.into_iter().flatten().map(|v| v.round().clamp(0.0, 255.0) as u8).collect()
    }

    fn resampled_colours(&self, source: &[u8]) -> Vec<u8> {
        let read = |row: usize, x: usize| -> [f32; 4] {
            let at = (row * self.width + x) * 4;
            let alpha = f32::from(source[at + 3]) / 255.0;
            [0, 1, 2, 3].map(|c| if c == 3 { alpha } else { f32::from(source[at + c]) * alpha })
        };
        let mut bytes = Vec::new();
        for [r, g, b, alpha] in self.filtered(read, [0.0; 4]) {
            let level = |v: f32| (v / alpha.max(1e-3)).round().clamp(0.0, 255.0) as u8;
            bytes.extend([level(r), level(g), level(b), (alpha * 255.0).round() as u8]);
        }
        bytes
    }

    fn filtered<const N: usize>(
        &self,
        read: impl Fn(usize, usize) -> [f32; N] + Sync,
        outside: [f32; N],
    ) -> Vec<[f32; N]> {
        let across = |y: usize| -> Vec<[f32; N]> {
            let column = |(first, weights): &(i64, Vec<f32>)| {
                let mut sum = [0.0; N];
                for (k, weight) in weights.iter().enumerate() {
                    let x = first + k as i64;
                    let inside = x >= 0 && (x as usize) < self.width;
                    let value = if inside { read(y, x as usize) } else { outside };
                    (0..N).for_each(|c| sum[c] += weight * value[c]);
                }
                sum
            };
            self.across.0.iter().map(column).collect()
        };
        let columns = self.across.0.len();
        let mut canvas = vec![outside; columns * self.down.0.len()];
        const BAND: usize = 32;
        let bands = canvas.par_chunks_mut(columns.max(1) * BAND).zip(self.down.0.par_chunks(BAND));
        bands.for_each(|(rows, taps)| {
            // Neighbouring rows share most of their source rows.
            let mut known: Vec<(i64, Vec<[f32; N]>)> = Vec::new();
            for (row, (first, weights)) in rows.chunks_mut(columns.max(1)).zip(taps) {
                row.fill([0.0; N]);
                known.retain(|(y, _)| y >= first);
                for (k, weight) in weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
                    let y = first + k as i64;
                    if y < 0 || y as usize >= self.height {
                        row.iter_mut()
                            .for_each(|v| (0..N).for_each(|c| v[c] += weight * outside[c]));
                        continue;
                    }
                    let at = known.iter().position(|(known, _)| *known == y).unwrap_or_else(|| {
                        known.push((y, across(y as usize)));
                        known.len() - 1
                    });
                    for (v, from) in row.iter_mut().zip(&known[at].1) {
                        (0..N).for_each(|c| v[c] += weight * from[c]);
                    }
                }
            }
        });
        canvas
    }
}
