//! How much each pixel differs from the paper: ink and colour, at full size
//! and reduced for finding structure.

use image::RgbaImage;
use rayon::prelude::*;

use crate::alpha::luma;
use crate::paper::{Paper, PaperRow, luma_of};
use crate::raster::Raster;
use crate::report::Polarity;

/// Ink above this share counts as part of a line.
const INK_THRESHOLD: f32 = 0.2;
/// The share of pixels that reach full ink.
const FULL_INK_SHARE: f64 = 0.0005;
/// Full ink differs at least so much from paper, levels.
const LEAST_CONTRAST: f32 = 32.0;
/// Colour differs from paper from here on, levels, at least.
const LEAST_TOLERANCE: f32 = 9.0;
/// What differs by less than so many standard deviations is grain.
const GRAINS: f32 = 4.5;
/// Paper darker than this may bear light lines, levels.
const DARK_PAPER: f32 = 128.0;

/// How a pixel's colour becomes ink.
pub(crate) struct Tone<'a> {
    image: &'a RgbaImage,
    paper: &'a Paper,
    pub(crate) polarity: Polarity,
    /// Levels from paper to full ink.
    pub(crate) contrast: f32,
    /// The share of full ink from which a pixel is ink.
    pub(crate) threshold: f32,
    /// Levels from which a pixel's colour is not paper's.
    pub(crate) tolerance: f32,
}

impl<'a> Tone<'a> {
    pub(crate) fn new(image: &'a RgbaImage, paper: &'a Paper) -> Self {
        let histogram = differences(image, paper);
        let total: u64 = histogram.iter().sum();
        let grain = (GRAINS * paper.noise).max(12.0) as usize;
        let darker: u64 = histogram[256 + grain.min(255)..].iter().sum();
        let lighter: u64 = histogram[..257 - grain.min(255)].iter().sum();
        let mean = luma_of(&paper.summary().colour.map(f32::from));
        let inverted = mean < DARK_PAPER && lighter > darker;
        let polarity = if inverted { Polarity::LightOnDark } else { Polarity::DarkOnLight };
        let wanted = ((total as f64 * FULL_INK_SHARE).ceil() as u64).max(1);
        let mut sum = 0;
        let full = (0..=255_usize).rev().find(|&level| {
            sum += histogram[if inverted { 256 - level } else { 256 + level }];
            sum >= wanted
        });
        let contrast = (full.unwrap_or(0) as f32).max(LEAST_CONTRAST);
        Self {
            image,
            paper,
            polarity,
            contrast,
            threshold: INK_THRESHOLD.max(GRAINS * paper.noise / contrast).min(0.6),
            tolerance: LEAST_TOLERANCE.max(GRAINS * paper.noise),
        }
    }

    /// The share of ink at column `x` of a row; at most 1.
    pub(crate) fn share(&self, pixel: &[u8], row: &PaperRow, x: usize) -> f32 {
        let paper = luma_of(&row.at(x)).round();
        let darker = match self.polarity {
            Polarity::DarkOnLight => paper - luma(pixel),
            Polarity::LightOnDark => luma(pixel) - paper,
        };
        (darker / self.contrast).clamp(0.0, 1.0)
    }

    /// How far a pixel's colour is from the paper's, levels.
    pub(crate) fn difference(&self, pixel: &[u8], row: &PaperRow, x: usize) -> f32 {
        let paper = row.at(x);
        let off: [f32; 3] = std::array::from_fn(|c| (f32::from(pixel[c]) - paper[c]).abs());
        let luma = luma_of(&[0, 1, 2].map(|c: usize| f32::from(pixel[c]) - paper[c])).abs();
        luma.max(0.6 * off[0].max(off[1]).max(off[2]))
    }

    /// The row's pixels and paper.
    pub(crate) fn row(&self, y: usize) -> (&'a [u8], PaperRow) {
        let bytes = self.image.width() as usize * 4;
        (&self.image.as_raw()[y * bytes..(y + 1) * bytes], self.paper.row(y))
    }

    /// Ink and colour difference in blocks of `factor` pixels a side. Of a
    /// block's ink the most in any 2x2 pixels counts, so that thin lines stay;
    /// of its colour the mean.
    pub(crate) fn reduced(&self, factor: usize) -> (Raster<f32>, Raster<f32>) {
        let (w, h) = (self.image.width() as usize, self.image.height() as usize);
        let (rw, rh) = (w.div_ceil(factor), h.div_ceil(factor));
        let mut ink = Raster::filled(rw, rh, 0.0_f32);
        let mut colour = Raster::filled(rw, rh, 0.0_f32);
        let rows = ink.data.par_chunks_mut(rw.max(1)).zip(colour.data.par_chunks_mut(rw.max(1)));
        rows.enumerate().for_each(|(y, (ink, colour))| {
            let mut counts = vec![0.0_f32; rw];
            let mut before: Vec<f32> = Vec::new();
            for v in y * factor..((y + 1) * factor).min(h) {
                let (pixels, paper) = self.row(v);
                let shares: Vec<f32> =
                    (0..w).map(|u| self.share(&pixels[u * 4..], &paper, u)).collect();
                for u in 0..w {
                    let x = u / factor;
                    colour[x] += self.difference(&pixels[u * 4..], &paper, u);
                    counts[x] += 1.0;
                    let pooled = if factor == 1 {
                        shares[u]
                    } else if u % factor > 0 && !before.is_empty() {
                        (shares[u] + shares[u - 1] + before[u] + before[u - 1]) / 4.0
                    } else {
                        shares[u] / 4.0
                    };
                    ink[x] = ink[x].max(pooled);
                }
                before = shares;
            }
            colour.iter_mut().zip(&counts).for_each(|(sum, count)| *sum /= count.max(1.0));
        });
        (ink, colour)
    }
}

/// How many pixels are how much darker (after 256) or lighter (before) than
/// paper; of large images every few rows.
fn differences(image: &RgbaImage, paper: &Paper) -> Vec<u64> {
    let (w, h) = (image.width() as usize, image.height() as usize);
    let step = (w * h / 4_000_000).max(1);
    let rows: Vec<usize> = (0..h).step_by(step).collect();
    let of_row = |mut histogram: Vec<u64>, y: &usize| {
        let row = paper.row(*y);
        for (x, pixel) in image.as_raw()[y * w * 4..(y + 1) * w * 4].chunks_exact(4).enumerate() {
            let darker = (luma_of(&row.at(x)).round() - luma(pixel)).clamp(-255.0, 255.0);
            histogram[(256.0 + darker) as usize] += 1;
        }
        histogram
    };
    let empty = || vec![0_u64; 512];
    let add = |mut a: Vec<u64>, b: Vec<u64>| {
        a.iter_mut().zip(&b).for_each(|(a, b)| *a += b);
        a
    };
    rows.par_iter().fold(empty, of_row).reduce(empty, add)
}

impl Tone<'_> {
    pub(crate) fn noise(&self) -> f32 {
        self.paper.noise
    }

    pub(crate) fn foreign_border(&self) -> f64 {
        self.paper.foreign_border
    }

    /// Whether the colours in `areas`, at working size, are many.
    pub(crate) fn is_shaded(&self, areas: &crate::raster::Bits, factor: usize) -> bool {
        const CLASSES: usize = 12;
        const COVERED: f64 = 0.85;
        let inner = areas.eroded(2.0);
        let mut counts: std::collections::BTreeMap<[u8; 3], usize> = Default::default();
        let mut total = 0_usize;
        let set = inner.data.iter().enumerate().filter(|(_, is)| **is);
        let step = (inner.count() / 20_000).max(1);
        for (index, _) in set.step_by(step) {
            let (x, y) = (index % inner.width * factor, index / inner.width * factor);
            let (pixels, _) = self.row(y.min(self.image.height() as usize - 1));
            let x = x.min(self.image.width() as usize - 1);
            let class = [0, 1, 2].map(|c| pixels[x * 4 + c] / 12);
            *counts.entry(class).or_default() += 1;
            total += 1;
        }
        let mut sizes: Vec<usize> = counts.into_values().collect();
        sizes.sort_unstable_by(|a, b| b.cmp(a));
        let most: usize = sizes.iter().take(CLASSES).sum();
        total > 0 && (most as f64) < COVERED * total as f64
    }
}

impl Tone<'_> {
    /// Columns and rows of the drawing.
    pub(crate) fn size(&self) -> (usize, usize) {
        (self.image.width() as usize, self.image.height() as usize)
    }
}
