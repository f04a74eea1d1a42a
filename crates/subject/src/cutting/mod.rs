//! Lines taken out of a drawing: their pixels go, and what of them the figure
//! needs is drawn again.

mod closing;
mod crossing;
mod drawn;

pub(crate) use closing::close;
pub(crate) use drawn::Drawn;

use crate::raster::Bits;
use crate::straight::Line;

/// What of a removed line is drawn again.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Restore {
    /// Where strokes go on across it or meet in it, and what closes the figure on it best.
    Best,
    /// Only where strokes go on across it or meet in it, which leaves several figures apart.
    Crossings,
}

/// Removes `lines` from `ink`, then draws again what `restored` says.
///
/// * `earlier`: lines that were removed before; what was drawn again of them may have gone now.
pub(crate) fn cut_all(
    ink: &mut Bits,
    lines: &[Line],
    earlier: &[Line],
    stroke_px: f64,
    restored: Restore,
) {
    let before = ink.clone();
    lines.iter().for_each(|line| cut(ink, line));
    let drawn = Drawn { ink: &before, corner: (0, 0) };
    crossing::restore(ink, &drawn, lines, earlier, stroke_px);
    if restored == Restore::Best {
        close(ink, &before, &drawn, lines, stroke_px);
    }
}

/// A view of the raster along a line: `(along, across)`.
struct Along<'a> {
    ink: &'a mut Bits,
    upright: bool,
}

impl Along<'_> {
    fn at(&self, along: i64, across: i64) -> bool {
        if self.upright { self.ink.at(across, along) } else { self.ink.at(along, across) }
    }

    fn set(&mut self, along: i64, across: i64, value: bool) {
        let (x, y) = if self.upright { (across, along) } else { (along, across) };
        self.ink.set(x, y, value);
    }

    /// Draws a segment one pixel wide between two pixels, `(along, across)`.
    fn draw(&mut self, from: (i64, i64), to: (i64, i64)) {
        let steps = (to.0 - from.0).abs().max((to.1 - from.1).abs()).max(1);
        for step in 0..=steps {
            let between = |a: i64, b: i64| {
                (a as f64 + (b - a) as f64 * step as f64 / steps as f64).round() as i64
            };
            self.set(between(from.0, to.0), between(from.1, to.1), true);
        }
    }
}

/// Removes a line's pixels but those of strokes that cross it.
fn cut(ink: &mut Bits, line: &Line) {
    let mut view = Along { ink, upright: line.upright };
    let half = line.thickness / 2.0;
    let reach = half.ceil() as i64 + 1;
    let slack = 1 + line.thickness.ceil() as usize;
    for along in line.from.saturating_sub(slack)..line.to + slack {
        let middle = line.across(along);
        let centre = middle.floor() as i64;
        let along = along as i64;
        let Some(start) =
            (0..=reach).flat_map(|d| [centre - d, centre + d]).find(|&y| view.at(along, y))
        else {
            continue;
        };
        let low = (0..).map(|d| start - d).find(|&y| !view.at(along, y)).unwrap_or(start) + 1;
        let high = (0..).map(|d| start + d).find(|&y| !view.at(along, y)).unwrap_or(start);
        let band = ((middle - half - 0.3).floor() as i64, (middle + half + 0.3).ceil() as i64);
        let above = band.0 - low > 1;
        let below = high - band.1 > 1;
        match (above, below) {
            (true, true) => {}
            (false, false) => (low..high).for_each(|y| view.set(along, y, false)),
            _ => (band.0.max(low)..band.1.min(high)).for_each(|y| view.set(along, y, false)),
        }
    }
}

/// The runs of those places along a line that hold.
fn runs(along: std::ops::Range<usize>, is: impl Fn(usize) -> bool) -> Vec<(usize, usize)> {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for along in along.filter(|&along| is(along)) {
        match runs.last_mut() {
            Some(run) if run.1 + 1 >= along => run.1 = along,
            _ => runs.push((along, along)),
        }
    }
    runs
}
