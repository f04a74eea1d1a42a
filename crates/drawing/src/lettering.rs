//! Digits and signs as pen strokes, for the angles on the page.

use nalgebra::{Point2, Vector2};

use super::{LineKind, Stroke};

/// A glyph's pen strokes on a grid 4 wide and 6 high, y down.
type Glyph = &'static [&'static [[u8; 2]]];

const ADVANCE: f64 = 6.0;
const HEIGHT: f64 = 6.0;

const DIGITS: [Glyph; 10] = [
    &[&[[1, 0], [3, 0], [4, 2], [4, 4], [3, 6], [1, 6], [0, 4], [0, 2], [1, 0]]],
    &[&[[1, 1], [2, 0], [2, 6]], &[[1, 6], [3, 6]]],
    &[&[[0, 1], [1, 0], [3, 0], [4, 1], [4, 2], [0, 6], [4, 6]]],
    &[&[[0, 0], [4, 0], [2, 2], [4, 4], [4, 5], [3, 6], [1, 6], [0, 5]]],
    &[&[[3, 6], [3, 0], [0, 4], [4, 4]]],
    &[&[[4, 0], [0, 0], [0, 3], [3, 2], [4, 4], [3, 6], [0, 6]]],
    &[&[[3, 0], [1, 2], [0, 4], [1, 6], [3, 6], [4, 4], [3, 3], [1, 3], [0, 4]]],
    &[&[[0, 0], [4, 0], [1, 6]]],
    &[
        &[[1, 3], [0, 2], [1, 0], [3, 0], [4, 2], [3, 3], [1, 3]],
        &[[1, 3], [0, 5], [1, 6], [3, 6], [4, 5], [3, 3]],
    ],
    &[&[[1, 6], [3, 4], [4, 2], [3, 0], [1, 0], [0, 2], [1, 3], [3, 3], [4, 2]]],
];
const POINT: Glyph = &[&[[2, 6], [2, 5]]];
const MINUS: Glyph = &[&[[1, 3], [3, 3]]];
const SLASH: Glyph = &[&[[0, 6], [3, 0]]];
const DEGREE: Glyph = &[&[[1, 0], [2, 0], [2, 1], [1, 1], [1, 0]]];

/// Digits, decimal point, minus, slash and degree sign as strokes, centred below `top_px`; other characters
/// are blank.
pub(super) fn lettering(text: &str, top_px: Point2<f64>, height_px: f64) -> Vec<Stroke> {
    let scale = height_px / HEIGHT;
    let width = ADVANCE * text.chars().count() as f64 - (ADVANCE - 4.0);
    let start = top_px - Vector2::new(width * scale / 2.0, 0.0);
    let glyphs = text.chars().enumerate().flat_map(|(column, character)| {
        let origin = start + Vector2::new(ADVANCE * scale * column as f64, 0.0);
        glyph(character).iter().map(move |pen| (origin, *pen))
    });
    glyphs
        .map(|(origin, pen)| Stroke {
            kind: LineKind::Crease,
            points: pen
                .iter()
                .map(|&[x, y]| origin + Vector2::new(f64::from(x), f64::from(y)) * scale)
                .collect(),
            widths_px: Vec::new(),
        })
        .collect()
}

fn glyph(character: char) -> Glyph {
    match character {
        '.' => POINT,
        '°' => DEGREE,
        '-' => MINUS,
        '/' => SLASH,
        _ => character.to_digit(10).map_or(&[], |digit| DIGITS[digit as usize]),
    }
}
