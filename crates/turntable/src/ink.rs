//! How much of each pixel of a drawing is ink.

use image::GrayImage;

/// Ink above this share counts as part of a line.
pub const INK_THRESHOLD: f32 = 0.2;

/// How much of each pixel is covered by ink, 0 to 1, row by row.
#[derive(Clone, Debug)]
pub struct InkMap {
    width: usize,
    height: usize,
    ink: Vec<f32>,
}

impl InkMap {
    /// Reads `image` as dark lines on light paper.
    ///
    /// Paper is the median grey of the image's border, full ink the darkest
    /// grey that at least 0.05 % of the pixels reach, so that pencil on
    /// tinted paper reads as black on white does.
    pub fn from_image(image: &GrayImage) -> Self {
        let share_of_grey = shares_of_greys(image);
        let shares = image.as_raw().iter().map(|&grey| share_of_grey[usize::from(grey)]);
        Self {
            width: image.width() as usize,
            height: image.height() as usize,
            ink: shares.collect(),
        }
    }

    /// The part of the map from column and row `from` up to, without, `to`;
    /// both within the map.
    pub fn cropped(&self, from: [usize; 2], to: [usize; 2]) -> Self {
        let rows = (from[1]..to[1]).flat_map(|y| &self.row(y)[from[0]..to[0]]);
        Self { width: to[0] - from[0], height: to[1] - from[1], ink: rows.copied().collect() }
    }

    /// Columns, px.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows, px.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The ink of row `y`, left to right.
    ///
    /// # Panics
    /// If `y` is not a row of the image.
    pub fn row(&self, y: usize) -> &[f32] {
        &self.ink[y * self.width..(y + 1) * self.width]
    }

    /// The ink at column `x` of row `y`, 0 outside the image.
    pub fn at(&self, x: i64, y: i64) -> f32 {
        match (usize::try_from(x), usize::try_from(y)) {
            (Ok(x), Ok(y)) if x < self.width && y < self.height => self.ink[y * self.width + x],
            _ => 0.0,
        }
    }

    /// The ink of all pixels, row by row.
    pub fn as_slice(&self) -> &[f32] {
        &self.ink
    }
}

/// Per pixel of `image`, whether it is part of a line.
pub fn inked(image: &GrayImage) -> Vec<bool> {
    let is_ink = shares_of_greys(image).map(|share| share > INK_THRESHOLD);
    image.as_raw().iter().map(|&grey| is_ink[usize::from(grey)]).collect()
}

/// The ink that each grey of `image` stands for.
fn shares_of_greys(image: &GrayImage) -> [f32; 256] {
    let paper = f32::from(border_median(image));
    let darkest = f32::from(dark_level(image)).min(paper - 32.0);
    let scale = 1.0 / (paper - darkest).max(1.0);
    std::array::from_fn(|grey| ((paper - grey as f32) * scale).clamp(0.0, 1.0))
}

fn border_median(image: &GrayImage) -> u8 {
    let mut histogram = [0_u64; 256];
    let last = image.height().saturating_sub(1) as usize;
    for (y, row) in image.as_raw().chunks_exact(image.width().max(1) as usize).enumerate() {
        // Of rows between top and bottom the first and the last pixel.
        let step = if y == 0 || y == last { 1 } else { (row.len() - 1).max(1) };
        row.iter().step_by(step).for_each(|&grey| histogram[usize::from(grey)] += 1);
    }
    let half = histogram.iter().sum::<u64>().div_ceil(2);
    level_reaching(&histogram, half)
}

fn dark_level(image: &GrayImage) -> u8 {
    // Counters take turns: paper would have each wait for the one before.
    let mut turns = [[0_u32; 256]; 4];
    let (fours, rest) = image.as_raw().as_chunks::<4>();
    for greys in fours {
        for (turn, &grey) in turns.iter_mut().zip(greys) {
            turn[usize::from(grey)] += 1;
        }
    }
    rest.iter().for_each(|&grey| turns[0][usize::from(grey)] += 1);
    let histogram =
        std::array::from_fn(|grey| turns.iter().map(|turn| u64::from(turn[grey])).sum());
    level_reaching(&histogram, (image.as_raw().len() as u64).div_ceil(2000))
}

/// The lowest level at or below which `count` pixels lie.
fn level_reaching(histogram: &[u64; 256], count: u64) -> u8 {
    let mut sum = 0;
    (0..=u8::MAX)
        .find(|&level| {
            sum += histogram[usize::from(level)];
            sum >= count
        })
        .unwrap_or(u8::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;

    fn line_on_paper(paper: u8, line: u8) -> GrayImage {
        GrayImage::from_fn(40, 30, |x, _| Luma([if x == 20 { line } else { paper }]))
    }

    #[test]
    fn black_on_white_is_full_ink() {
        let ink = InkMap::from_image(&line_on_paper(255, 0));
        assert_eq!(ink.at(20, 7), 1.0);
        assert_eq!(ink.at(19, 7), 0.0);
        assert_eq!(ink.at(-1, 7), 0.0);
    }

    #[test]
    fn pencil_on_tinted_paper_reads_alike() {
        let ink = InkMap::from_image(&line_on_paper(210, 90));
        assert_eq!(ink.row(3)[20], 1.0);
        assert_eq!(ink.row(3)[21], 0.0);
    }

    #[test]
    fn an_empty_page_has_no_ink() {
        let ink = InkMap::from_image(&GrayImage::from_pixel(40, 30, Luma([250])));
        assert!(ink.as_slice().iter().all(|&share| share == 0.0));
    }

    #[test]
    fn faint_stains_are_not_stretched_to_full_ink() {
        let ink = InkMap::from_image(&line_on_paper(250, 246));
        assert!(ink.at(20, 3) < INK_THRESHOLD);
    }
}
