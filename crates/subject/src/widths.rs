//! How wide the dark lines of painted figures are: of those everything is ink, so ink does not tell.

use rayon::prelude::*;

use crate::raster::{Bits, Raster};
use crate::strokes;

/// Lines are so much more inked than what they lie on, share of full ink.
const STANDS_OUT: f32 = 0.15;
/// Outlines are drawn where so much of the border is a line,
const OUTLINED: f64 = 0.4;
/// and as deep as this share of the border's still is.
const STILL_LINE: f64 = 0.25;
/// Lines that cover less of the figure are chance.
const LEAST_LINES: f64 = 0.002;

/// Widths in pixels; 0 where there are none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Widths {
    /// Of the line that draws the border.
    pub(crate) outline: f64,
    /// Of most lines.
    pub(crate) line: f64,
}

/// Of the lines in `inside` that are at most `widest` pixels wide.
///
/// * `ink`: shares of full ink.
pub(crate) fn of_painted(ink: &Raster<f32>, inside: &Bits, widest: f64) -> Widths {
    let own = inside.data.iter().zip(&ink.data).map(|(is, ink)| if *is { *ink } else { 0.0 });
    let own = Raster { width: ink.width, height: ink.height, data: own.collect() };
    let areas = opened(&own, (widest / 2.0).ceil() as usize);
    let stand_out = own.data.iter().zip(&areas.data).map(|(own, area)| own - area > STANDS_OUT);
    let lines = Bits { width: ink.width, height: ink.height, data: stand_out.collect() };
    let enough = lines.count() as f64 > LEAST_LINES * inside.count() as f64;
    let line = if enough { strokes::width_of(&lines, 0.5) } else { 0.0 };
    Widths { outline: outline(&lines, inside, widest), line }
}

/// How deep below the border lines go.
fn outline(lines: &Bits, inside: &Bits, widest: f64) -> f64 {
    let depth = inside.not().distance();
    let mut counts = vec![[0_usize; 2]; widest.ceil() as usize + 1];
    for ((&depth, &inside), &line) in depth.data.iter().zip(&inside.data).zip(&lines.data) {
        let bin = (depth - 0.5).max(0.0) as usize;
        if inside && bin < counts.len() {
            counts[bin][0] += usize::from(line);
            counts[bin][1] += 1;
        }
    }
    let shares = counts.iter().map(|[lines, all]| *lines as f64 / (*all).max(1) as f64);
    let shares: Vec<f64> = shares.collect();
    // The first pixel may be half paper.
    let most = shares.iter().take(2).copied().fold(0.0, f64::max);
    if most < OUTLINED {
        return 0.0;
    }
    let own = shares.iter().map(|share| (share / most).min(1.0));
    own.take_while(|share| *share > STILL_LINE).sum::<f64>().max(1.0)
}

/// The grey-level opening by a square of `2 * reach + 1` pixels.
fn opened(values: &Raster<f32>, reach: usize) -> Raster<f32> {
    let least = filtered(values, reach, f32::min, f32::INFINITY);
    filtered(&least, reach, f32::max, f32::NEG_INFINITY)
}

/// The best value of each pixel's square.
///
/// * `none`: what is worse than every value.
fn filtered(
    values: &Raster<f32>,
    reach: usize,
    best: fn(f32, f32) -> f32,
    none: f32,
) -> Raster<f32> {
    let along_rows = |values: &Raster<f32>| {
        let mut all = values.clone();
        all.data.par_chunks_mut(values.width.max(1)).for_each(|row| slid(row, reach, best, none));
        all
    };
    along_rows(&along_rows(values).transposed()).transposed()
}

/// Replaces each value by the best of those at most `reach` from it, in windows that double.
fn slid(row: &mut [f32], reach: usize, best: fn(f32, f32) -> f32, none: f32) {
    let window = 2 * reach + 1;
    let mut padded = vec![none; row.len() + 2 * reach];
    padded[reach..reach + row.len()].copy_from_slice(row);
    let mut covered = 1;
    while 2 * covered <= window {
        for at in 0..padded.len() - covered {
            padded[at] = best(padded[at], padded[at + covered]);
        }
        covered *= 2;
    }
    for (at, value) in row.iter_mut().enumerate() {
        *value = best(padded[at], padded[at + window - covered]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disc of the radius 40, filled with ink of `fill`, its border `outline` wide.
    fn disc(fill: f32, outline: f64) -> (Raster<f32>, Bits) {
        let (mut ink, mut inside) = (Raster::filled(100, 100, 0.0), Bits::filled(100, 100, false));
        for i in 0..10_000 {
            let from = (i as f64 % 100.0 - 50.0).hypot((i / 100) as f64 - 50.0);
            inside.data[i] = from < 40.0;
            ink.data[i] = if from >= 40.0 {
                0.0
            } else if from > 40.0 - outline {
                1.0
            } else {
                fill
            };
        }
        (ink, inside)
    }

    #[test]
    fn outlines_of_painted_figures_are_as_wide_as_drawn() {
        for outline in [2.0, 4.0, 7.0] {
            let (ink, inside) = disc(0.5, outline);
            let found = of_painted(&ink, &inside, 10.0);
            assert!((found.outline - outline).abs() < 1.0, "{found:?} for {outline}");
            assert!((found.line - outline).abs() < 2.0, "{found:?} for {outline}");
        }
    }

    #[test]
    fn windows_that_double_have_the_best_of_each_square() {
        let values = |i: usize| ((i * 7919) % 101) as f32;
        let raster = Raster { width: 13, height: 9, data: (0..13 * 9).map(values).collect() };
        for reach in 0..6_usize {
            let found = filtered(&raster, reach, f32::max, f32::NEG_INFINITY);
            for (x, y) in (0..13).flat_map(|x| (0..9).map(move |y| (x, y))) {
                let near =
                    |at: usize, end: usize| at.saturating_sub(reach)..(at + reach + 1).min(end);
                let square = near(y, 9).flat_map(|y| near(x, 13).map(move |x| (x, y)));
                let most = square.map(|(x, y)| raster.data[y * 13 + x]).fold(0.0, f32::max);
                assert_eq!(found.data[y * 13 + x], most, "{reach} at {x}, {y}");
            }
        }
    }

    #[test]
    fn a_figure_without_lines_has_none() {
        let (ink, inside) = disc(0.5, 0.0);
        assert_eq!(of_painted(&ink, &inside, 10.0), Widths { outline: 0.0, line: 0.0 });
    }
}
