//! What was found, drawn on the page.

use image::{Rgb, RgbImage, RgbaImage};
use subject::{Box2, Point};

use crate::proposal::PageProposal;
use crate::small;

/// The preview's longest side, px.
const SIDE_PX: u32 = 1600;
const FIGURE: Rgb<u8> = Rgb([0, 120, 220]);
const OUTLINE: Rgb<u8> = Rgb([20, 160, 60]);
const AXIS: Rgb<u8> = Rgb([160, 0, 200]);
const LEFT_OUT: Rgb<u8> = Rgb([220, 90, 0]);

/// Glyphs 3 wide and 5 high, a row of three bits each from the top, for digits
/// and small letters.
const DIGITS: [u16; 10] = [
    0b111_101_101_101_111,
    0b010_110_010_010_111,
    0b111_001_111_100_111,
    0b111_001_011_001_111,
    0b101_101_111_001_001,
    0b111_100_111_001_111,
    0b111_100_111_101_111,
    0b111_001_010_010_010,
    0b111_101_111_101_111,
    0b111_101_111_001_111,
];
const LETTERS: [u16; 26] = [
    0b010_101_111_101_101,
    0b110_101_110_101_110,
    0b011_100_100_100_011,
    0b110_101_101_101_110,
    0b111_100_110_100_111,
    0b111_100_110_100_100,
    0b011_100_101_101_011,
    0b101_101_111_101_101,
    0b111_010_010_010_111,
    0b001_001_001_101_010,
    0b101_101_110_101_101,
    0b100_100_100_100_111,
    0b101_111_111_101_101,
    0b110_101_101_101_101,
    0b010_101_101_101_010,
    0b110_101_110_100_100,
    0b010_101_101_111_011,
    0b110_101_110_101_101,
    0b011_100_010_001_110,
    0b111_010_010_010_010,
    0b101_101_101_101_111,
    0b101_101_101_101_010,
    0b101_101_111_111_101,
    0b101_101_010_101_101,
    0b101_101_010_010_010,
    0b111_001_010_100_111,
];

/// `page` as it is, on its paper, reduced to at most 1600 px a side.
pub fn reduced(page: &RgbaImage, proposal: &PageProposal) -> RgbImage {
    let small = small::colours(page, reduction(page) as usize, proposal.paper.colour);
    let mut canvas = RgbImage::new(small.width as u32, small.height as u32);
    for (pixel, colour) in canvas.pixels_mut().zip(&small.data) {
        *pixel = Rgb(*colour);
    }
    canvas
}

/// So many pixels of the page become one, each way.
fn reduction(page: &RgbaImage) -> u32 {
    page.width().max(page.height()).div_ceil(SIDE_PX).max(1)
}

/// Draws the proposal on `page`, reduced to at most 1600 px a side: boxes,
/// outlines, baselines, axes, azimuths with their confidence, and in another
/// colour what was left out.
pub fn preview(page: &RgbaImage, proposal: &PageProposal) -> RgbImage {
    let mut canvas = reduced(page, proposal);
    // Paler, so that what is drawn over it stands out.
    for pixel in canvas.pixels_mut() {
        *pixel = Rgb(pixel.0.map(|level| 255 - (255 - level) / 4 * 3));
    }
    let mut pen = Pen { canvas, factor: f64::from(reduction(page)) };
    for left in &proposal.left_out {
        pen.rectangle(&left.place, LEFT_OUT);
        pen.text(&left.kind.to_string(), left.place.left, left.place.top, 2, LEFT_OUT);
    }
    for (index, figure) in proposal.figures.iter().enumerate() {
        let place = &figure.place;
        pen.rectangle(place, FIGURE);
        pen.polygon(&figure.outline, OUTLINE);
        let (x, bottom) = (figure.axis_column, f64::from(figure.baseline_row));
        pen.line(x, f64::from(place.top), x, bottom, AXIS);
        let beyond = 0.04 * f64::from(place.height());
        pen.line(
            f64::from(place.left) - beyond,
            bottom,
            f64::from(place.right) + beyond,
            bottom,
            AXIS,
        );
        let percent = (figure.confidence * 100.0).round();
        let text = format!("{} AZ {} {percent}%", index + 1, figure.azimuth);
        pen.text(&text, place.left, place.top, 3, FIGURE);
    }
    pen.canvas
}

struct Pen {
    canvas: RgbImage,
    factor: f64,
}

impl Pen {
    fn dot(&mut self, x: i64, y: i64, colour: Rgb<u8>) {
        let (w, h) = self.canvas.dimensions();
        if x >= 0 && y >= 0 && x < i64::from(w) && y < i64::from(h) {
            self.canvas.put_pixel(x as u32, y as u32, colour);
        }
    }

    /// A line between places on the page.
    fn line(&mut self, x0: f64, y0: f64, x1: f64, y1: f64, colour: Rgb<u8>) {
        let [x0, y0, x1, y1] = [x0, y0, x1, y1].map(|v| v / self.factor);
        let steps = (x1 - x0).abs().max((y1 - y0).abs()).ceil().clamp(1.0, 40_000.0);
        for k in 0..=steps as u32 {
            let t = f64::from(k) / steps;
            self.dot((x0 + (x1 - x0) * t) as i64, (y0 + (y1 - y0) * t) as i64, colour);
        }
    }

    fn rectangle(&mut self, place: &Box2, colour: Rgb<u8>) {
        let [l, t, r, b] = [place.left, place.top, place.right, place.bottom].map(f64::from);
        for (x0, y0, x1, y1) in [(l, t, r, t), (r, t, r, b), (r, b, l, b), (l, b, l, t)] {
            self.line(x0, y0, x1, y1, colour);
        }
    }

    fn polygon(&mut self, corners: &[Point], colour: Rgb<u8>) {
        for (k, a) in corners.iter().enumerate() {
            let b = corners[(k + 1) % corners.len()];
            self.line(a.x, a.y, b.x, b.y, colour);
        }
    }

    /// Text that ends above a place on the page, in pixels of `size`.
    fn text(&mut self, text: &str, left: u32, top: u32, size: i64, colour: Rgb<u8>) {
        let left = (f64::from(left) / self.factor) as i64;
        let top = ((f64::from(top) / self.factor) as i64 - 6 * size).max(0);
        for (column, character) in text.chars().enumerate() {
            let rows = glyph(character);
            for bit in 0..15_i64 {
                if rows >> (14 - bit) & 1 == 1 {
                    let (x, y) =
                        (left + (column as i64 * 4 + bit % 3) * size, top + bit / 3 * size);
                    (0..size * size).for_each(|k| self.dot(x + k % size, y + k / size, colour));
                }
            }
        }
    }
}

fn glyph(character: char) -> u16 {
    match character.to_ascii_lowercase() {
        '.' => 0b010,
        '-' => 0b111_000_000,
        '%' => 0b101_001_010_100_101,
        c @ '0'..='9' => DIGITS[c as usize - '0' as usize],
        c @ 'a'..='z' => LETTERS[c as usize - 'a' as usize],
        _ => 0,
    }
}
