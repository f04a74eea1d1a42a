//! The paper under a drawing as a smooth field of colour, with its noise.

use image::RgbaImage;

use crate::alpha::{Meaning, luma};
use crate::report::PaperSummary;

/// Cells along the longer side of the page.
const CELLS: usize = 160;
/// How far a cell may be off the first guess, levels.
const FIRST_TOLERANCE: f32 = 34.0;
/// And off the fitted field.
const LEAST_TOLERANCE: f32 = 7.0;
const ROUNDS: usize = 7;
/// Of a polynomial of order 4 in two variables.
const TERMS: usize = 15;
/// The reach of what a polynomial does not fit, share of the longer side.
const SMOOTH_SHARE: f64 = 0.06;
/// Fields that change by less count as flat, levels.
const FLAT: f32 = 1.5;

/// The paper's colour at every pixel, bilinear between cells.
#[derive(Clone, Debug)]
pub struct Paper {
    across: usize,
    down: usize,
    cell_px: f32,
    cells: Vec<[f32; 3]>,
    /// Set if the field is constant.
    flat: Option<[f32; 3]>,
    /// Standard deviation of paper pixels about the field, levels.
    pub(crate) noise: f32,
    /// The share of the page's border that does not fit the field.
    pub(crate) foreign_border: f64,
}

/// The paper's colours along one row.
#[derive(Clone, Debug)]
pub struct PaperRow {
    flat: Option<[f32; 3]>,
    cells: Vec<[f32; 3]>,
    per_px: f32,
}

impl PaperRow {
    /// The colour at the column `x`, sRGB levels.
    pub fn at(&self, x: usize) -> [f32; 3] {
        if let Some(flat) = self.flat {
            return flat;
        }
        let place = ((x as f32 + 0.5) * self.per_px - 0.5).max(0.0);
        let left = (place as usize).min(self.cells.len() - 1);
        let right = (left + 1).min(self.cells.len() - 1);
        let t = (place - left as f32).min(1.0);
        let (a, b) = (self.cells[left], self.cells[right]);
        std::array::from_fn(|c| a[c] + (b[c] - a[c]) * t)
    }
}

impl Paper {
    /// The paper under `drawing`, whose alpha means `meaning`.
    ///
    /// * `image`: the drawing laid on paper.
    pub(crate) fn under(drawing: &RgbaImage, image: &RgbaImage, meaning: &Meaning) -> Self {
        match meaning {
            Meaning::Nothing => Self::fit(image),
            Meaning::CutOut(_) => Self::plain([255.0; 3]),
            Meaning::InkLayer => {
                let clear = drawing.pixels().zip(image.pixels()).find(|(p, _)| p.0[3] == 0);
                Self::plain(clear.map_or([255.0; 3], |(_, p)| [0, 1, 2].map(|c| p.0[c].into())))
            }
        }
    }

    /// One colour everywhere, without noise.
    fn plain(colour: [f32; 3]) -> Self {
        Self {
            across: 1,
            down: 1,
            cell_px: 1.0,
            cells: vec![colour],
            flat: Some(colour),
            noise: 0.0,
            foreign_border: 0.0,
        }
    }

    /// Fits a field to what looks like the page's border and agrees with it
    /// farther in: a polynomial of order 4 by repeated least squares, and
    /// smoothed what it leaves of paper connected to the border.
    fn fit(image: &RgbaImage) -> Self {
        let (w, h) = (image.width() as usize, image.height() as usize);
        let cell_px = (w.max(h) as f32 / CELLS as f32).max(1.0);
        let across = ((w as f32 / cell_px).ceil() as usize).max(1);
        let down = ((h as f32 / cell_px).ceil() as usize).max(1);
        let sampled = samples(image, across, down, cell_px);
        let mut own = Self {
            across,
            down,
            cell_px,
            cells: Vec::new(),
            flat: None,
            noise: 0.0,
            foreign_border: 0.0,
        };
        let ring = own.ring();
        let first = dominant(&ring.iter().map(|&i| sampled[i]).collect::<Vec<_>>());
        let mut field = vec![first; across * down];
        let mut tolerance = FIRST_TOLERANCE;
        let mut paper = vec![false; field.len()];
        let terms: Vec<_> = (0..field.len()).map(|index| own.terms(index)).collect();
        for round in 0..ROUNDS {
            let fits = |i: usize| off(&sampled[i], &field[i]) <= tolerance;
            let fitting: Vec<bool> = (0..field.len()).map(fits).collect();
            paper = own.connected(&fitting, &ring);
            if paper.iter().filter(|is| **is).count() < 16 {
                break;
            }
            let mut residuals: Vec<f32> = (0..field.len())
                .filter(|&i| paper[i])
                .map(|i| off(&sampled[i], &field[i]))
                .collect();
            let middle = residuals.len() / 2;
            let spread = *residuals.select_nth_unstable_by(middle, f32::total_cmp).1;
            tolerance = (4.0 * spread).clamp(LEAST_TOLERANCE, FIRST_TOLERANCE);
            field = polynomial(&terms, &sampled, &paper, if round < 2 { 3 } else { TERMS });
        }
        own.cells = own.smoothed(&sampled, &paper, field);
        own.foreign_border =
            1.0 - ring.iter().filter(|&&i| paper[i]).count() as f64 / ring.len().max(1) as f64;
        own.settle_flatness(first, &paper);
        own.noise = own.measure_noise(image, &paper);
        own
    }

    /// Cells within a twentieth of the page's border.
    fn ring(&self) -> Vec<usize> {
        let width = (self.across.min(self.down) / 24).max(1);
        let near = |x: usize, y: usize| {
            x < width || y < width || x + width >= self.across || y + width >= self.down
        };
        (0..self.across * self.down).filter(|i| near(i % self.across, i / self.across)).collect()
    }

    /// The `fitting` cells connected to those of the ring.
    fn connected(&self, fitting: &[bool], ring: &[usize]) -> Vec<bool> {
        let bits =
            crate::raster::Bits { width: self.across, height: self.down, data: fitting.to_vec() };
        bits.flooded(ring.to_vec()).data
    }

    fn unit(&self, index: usize) -> (f64, f64) {
        let at = |k: usize, n: usize| (k as f64 + 0.5) / n as f64 * 2.0 - 1.0;
        (at(index % self.across, self.across), at(index / self.across, self.down))
    }

    /// Products of a cell's place up to order 4, lower orders first.
    fn terms(&self, index: usize) -> [f64; TERMS] {
        let (x, y) = self.unit(index);
        let orders = (0..=4).flat_map(|total| (0..=total).map(move |k| (total - k, k)));
        let mut terms = [0.0; TERMS];
        for (term, (of_x, of_y)) in terms.iter_mut().zip(orders) {
            *term = x.powi(of_x) * y.powi(of_y);
        }
        terms
    }

    /// Adds to `field` the mean of what paper nearby differs from it.
    fn smoothed(
        &self,
        sampled: &[[f32; 3]],
        paper: &[bool],
        field: Vec<[f32; 3]>,
    ) -> Vec<[f32; 3]> {
        let radius = ((self.across.max(self.down) as f64 * SMOOTH_SHARE / 2.0) as usize).max(1);
        let difference =
            |i: usize, c: usize| if paper[i] { sampled[i][c] - field[i][c] } else { 0.0 };
        let mut planes: Vec<Vec<f32>> =
            (0..3).map(|c| (0..field.len()).map(|i| difference(i, c)).collect()).collect();
        planes.push(paper.iter().map(|is| f32::from(u8::from(*is))).collect());
        for plane in &mut planes {
            for _ in 0..3 {
                box_blur(plane, self.across, self.down, radius);
            }
        }
        let value = |i: usize| {
            let correction = |c: usize| planes[c][i] / (planes[3][i] + 0.05);
            std::array::from_fn(|c| (field[i][c] + correction(c)).clamp(0.0, 255.0))
        };
        (0..field.len()).map(value).collect()
    }

    /// Takes a field that hardly changes for one colour.
    fn settle_flatness(&mut self, first: [f32; 3], paper: &[bool]) {
        let count = paper.iter().filter(|is| **is).count();
        let mean: [f32; 3] = std::array::from_fn(|c| {
            let levels =
                self.cells.iter().zip(paper).filter(|(_, is)| **is).map(|(cell, _)| cell[c]);
            if count == 0 { first[c] } else { levels.sum::<f32>() / count as f32 }
        });
        let mut offs: Vec<f32> = self.cells.iter().map(|cell| off(cell, &mean)).collect();
        let most = offs.len() * 98 / 100;
        let worst = offs.select_nth_unstable_by(most.min(self.cells.len() - 1), f32::total_cmp).1;
        if count < 16 || *worst < FLAT {
            let same = off(&first, &mean) < FLAT;
            self.flat = Some(if same || count < 16 { first } else { mean.map(f32::round) });
        }
    }

    fn measure_noise(&self, image: &RgbaImage, paper: &[bool]) -> f32 {
        let mut residuals = Vec::new();
        for (index, _) in paper.iter().enumerate().filter(|(_, is)| **is) {
            let x = ((index % self.across) as f32 + 0.37) * self.cell_px;
            let y = ((index / self.across) as f32 + 0.61) * self.cell_px;
            let (x, y) = ((x as u32).min(image.width() - 1), (y as u32).min(image.height() - 1));
            let p = image.get_pixel(x, y).0;
            let field = self.row(y as usize).at(x as usize);
            residuals.push((luma(&p) - luma_of(&field)).abs());
        }
        if residuals.is_empty() {
            return 0.0;
        }
        // The 68th percentile of normal noise is its standard deviation.
        let place = residuals.len() * 68 / 100;
        *residuals.select_nth_unstable_by(place, f32::total_cmp).1
    }

    /// The paper's colours along the pixel row `y`.
    pub fn row(&self, y: usize) -> PaperRow {
        if self.flat.is_some() {
            return PaperRow { flat: self.flat, cells: Vec::new(), per_px: 1.0 };
        }
        let place = ((y as f32 + 0.5) / self.cell_px - 0.5).max(0.0);
        let above = (place as usize).min(self.down - 1);
        let below = (above + 1).min(self.down - 1);
        let t = (place - above as f32).min(1.0);
        let cell = |x: usize| {
            let (a, b) = (self.cells[above * self.across + x], self.cells[below * self.across + x]);
            std::array::from_fn(|c| a[c] + (b[c] - a[c]) * t)
        };
        let cells = (0..self.across).map(cell).collect();
        PaperRow { flat: None, cells, per_px: 1.0 / self.cell_px }
    }

    pub(crate) fn summary(&self) -> PaperSummary {
        let count = self.cells.len().max(1) as f32;
        let mean: [f32; 3] = self.flat.unwrap_or_else(|| {
            std::array::from_fn(|c| self.cells.iter().map(|cell| cell[c]).sum::<f32>() / count)
        });
        let lumas = self.cells.iter().map(luma_of);
        let (low, high) = lumas.fold((f32::MAX, f32::MIN), |(a, b), l| (a.min(l), b.max(l)));
        let unevenness = if self.flat.is_some() { 0.0 } else { f64::from(high - low) };
        PaperSummary {
            colour: mean.map(|level| level.round() as u8),
            unevenness,
            noise: f64::from(self.noise),
        }
    }
}

/// The first `count` of each cell's `terms` fitted to what is sampled of paper, at every cell.
fn polynomial(
    terms: &[[f64; TERMS]],
    sampled: &[[f32; 3]],
    paper: &[bool],
    count: usize,
) -> Vec<[f32; 3]> {
    let mut normal = vec![vec![0.0; count + 3]; count];
    let mut weight = 0.0;
    for index in (0..paper.len()).filter(|&i| paper[i]) {
        let t = &terms[index][..count];
        weight += 1.0;
        for (a, row) in normal.iter_mut().enumerate() {
            let (products, levels) = row.split_at_mut(count);
            products.iter_mut().zip(t).for_each(|(sum, other)| *sum += t[a] * other);
            levels.iter_mut().zip(sampled[index]).for_each(|(sum, c)| *sum += t[a] * f64::from(c));
        }
    }
    for (a, row) in normal.iter_mut().enumerate().skip(1) {
        row[a] += 1e-4 * weight;
    }
    crate::linear::solve(&mut normal, 3);
    let value = |terms: &[f64; TERMS]| {
        let channel = |c: usize| {
            terms.iter().zip(&normal).map(|(t, row)| t * row[count + c]).sum::<f64>() as f32
        };
        std::array::from_fn(channel).map(|level: f32| level.clamp(0.0, 255.0))
    };
    terms.iter().map(value).collect()
}

/// Rec. 601 luma of a colour in floating point.
pub(crate) fn luma_of(c: &[f32; 3]) -> f32 {
    0.299 * c[0] + 0.587 * c[1] + 0.114 * c[2]
}

fn off(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max)
}

/// Per cell the median of a few pixels.
fn samples(image: &RgbaImage, across: usize, down: usize, cell_px: f32) -> Vec<[f32; 3]> {
    let (w, h) = image.dimensions();
    let sample = |index: usize| {
        let (cx, cy) = ((index % across) as f32, (index / across) as f32);
        let mut levels = [[0_u8; 9]; 3];
        for k in 0..9_usize {
            let (u, v) = ((k % 3) as f32 / 3.0 + 0.17, (k / 3) as f32 / 3.0 + 0.17);
            let x = (((cx + u) * cell_px) as u32).min(w - 1);
            let y = (((cy + v) * cell_px) as u32).min(h - 1);
            let p = image.get_pixel(x, y).0;
            levels.iter_mut().zip(p).for_each(|(levels, level)| levels[k] = level);
        }
        levels.map(|mut levels| {
            levels.sort_unstable();
            f32::from(levels[4])
        })
    };
    (0..across * down).map(sample).collect()
}

/// The mean of the fullest class of colours.
fn dominant(colours: &[[f32; 3]]) -> [f32; 3] {
    let mut counts = vec![0_u32; 4096];
    let class = |c: &[f32; 3]| {
        // Half a class off, so that near-white is one class.
        let level = |v: f32| (((v + 8.0) / 17.0) as usize).min(15);
        level(c[0]) * 256 + level(c[1]) * 16 + level(c[2])
    };
    colours.iter().for_each(|c| counts[class(c)] += 1);
    let fullest = (0..4096).max_by_key(|&k| (counts[k], k)).unwrap_or(0);
    let members: Vec<&[f32; 3]> = colours.iter().filter(|c| class(c) == fullest).collect();
    let count = members.len().max(1) as f32;
    std::array::from_fn(|c| {
        if members.is_empty() { 255.0 } else { members.iter().map(|m| m[c]).sum::<f32>() / count }
    })
}

fn box_blur(plane: &mut [f32], w: usize, h: usize, radius: usize) {
    let blur = |line: &mut Vec<f32>| {
        let from = line.clone();
        let mut sums = vec![0.0_f64; from.len() + 1];
        for (k, value) in from.iter().enumerate() {
            sums[k + 1] = sums[k] + f64::from(*value);
        }
        for (k, value) in line.iter_mut().enumerate() {
            let (a, b) = (k.saturating_sub(radius), (k + radius + 1).min(from.len()));
            *value = ((sums[b] - sums[a]) / (2 * radius + 1) as f64) as f32;
        }
    };
    for row in plane.chunks_exact_mut(w.max(1)) {
        let mut line = row.to_vec();
        blur(&mut line);
        row.copy_from_slice(&line);
    }
    for x in 0..w {
        let mut line: Vec<f32> = (0..h).map(|y| plane[y * w + x]).collect();
        blur(&mut line);
        (0..h).for_each(|y| plane[y * w + x] = line[y]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgba;

    #[test]
    fn a_gradient_under_a_figure_is_followed() {
        let paper = |x: u32, y: u32| 220.0 - f64::from(x) * 0.2 - f64::from(y) * 0.1;
        let image = RgbaImage::from_fn(300, 240, |x, y| {
            let inside = (80..220).contains(&x) && (40..200).contains(&y);
            let level = if inside { 40.0 } else { paper(x, y) } as u8;
            Rgba([level, level, level, 255])
        });
        let field = Paper::fit(&image);
        for (x, y) in [(5, 5), (290, 230), (40, 120), (150, 20)] {
            let found = f64::from(field.row(y as usize).at(x as usize)[0]);
            assert!((found - paper(x, y)).abs() < 3.0, "{x} {y}: {found}");
        }
        assert!(field.noise < 2.0);
    }

    #[test]
    fn plain_paper_is_exact() {
        let image = RgbaImage::from_fn(90, 70, |x, _| {
            Rgba(if x == 40 { [0, 0, 0, 255] } else { [255; 4] })
        });
        assert_eq!(Paper::fit(&image).row(3).at(5), [255.0; 3]);
        assert_eq!(Paper::fit(&image).summary().colour, [255; 3]);
    }

    #[test]
    fn one_pixel_is_paper() {
        assert_eq!(
            Paper::fit(&RgbaImage::from_pixel(1, 1, Rgba([9, 9, 9, 255]))).row(0).at(0),
            [9.0; 3]
        );
    }
}
