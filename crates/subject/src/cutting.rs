//! Lines taken out of a drawing: their pixels go, and what of them the figure
//! needs is drawn again.

use crate::raster::{Bits, filled};
use crate::straight::Line;

/// If drawing every second stretch again encloses less than this of what all
/// do, the count was wrong.
const ALTERNATING: f64 = 0.85;

/// What of a removed line is drawn again: what closes the figure on it best, or
/// only where strokes go on across it, which leaves several figures apart.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Restore {
    Best,
    Crossings,
}

/// Removes `lines` from `ink`, then draws again what `restored` says.
pub(crate) fn cut_all(ink: &mut Bits, lines: &[Line], stroke_px: f64, restored: Restore) {
    let before = ink.clone();
    lines.iter().for_each(|line| cut(ink, line));
    if restored == Restore::Crossings {
        lines.iter().for_each(|line| cross(ink, line));
        return;
    }
    for line in lines {
        let runs = contacts(ink, line, stroke_px);
        if runs.len() < 2 {
            continue;
        }
        let with = |step: usize| {
            let mut ink = ink.clone();
            restore(&mut ink, &before, line, stroke_px, &runs, step);
            let area = filled(&ink).count() as f64;
            (ink, area)
        };
        let (alternating, area) = with(2);
        let (all, all_area) = with(1);
        *ink = if area >= ALTERNATING * all_area { alternating } else { all };
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

/// Draws strokes again that go on across a line that was removed.
fn cross(ink: &mut Bits, line: &Line) {
    const REACH: i64 = 3;
    const ASIDE: i64 = 2;
    let mut view = Along { ink, upright: line.upright };
    let half = line.thickness / 2.0 + 0.3;
    let mut again = Vec::new();
    for along in line.from as i64..line.to as i64 {
        let middle = line.across(along as usize);
        let (low, high) = ((middle - half).floor() as i64, (middle + half).ceil() as i64);
        let near = |across: std::ops::Range<i64>| {
            across.into_iter().any(|y| (-ASIDE..=ASIDE).any(|dx| view.at(along + dx, y)))
        };
        if near(low - REACH..low) && near(high..high + REACH) {
            again.extend((low - 1..high + 1).map(|across| (along, across)));
        }
    }
    again.into_iter().for_each(|(along, across)| view.set(along, across, true));
}

/// Where strokes meet a line, as runs along it, if they come from one side only.
fn contacts(ink: &Bits, line: &Line, stroke_px: f64) -> Vec<Contact> {
    let mut copy = ink.clone();
    let view = Along { ink: &mut copy, upright: line.upright };
    let offset = contact_offset(line, stroke_px);
    let deeper = offset + 2.0 * stroke_px + 1.0;
    let of_side = |side: f64| {
        let at = |along: usize, offset: f64| {
            view.at(along as i64, (line.across(along) + side * offset).floor() as i64)
        };
        let mut runs: Vec<Contact> = Vec::new();
        // What meets the very ends is a frame's other side.
        let end = (offset + line.thickness).ceil() as usize;
        for along in line.from + end..line.to.saturating_sub(end) {
            if at(along, offset) {
                match runs.last_mut() {
                    Some(run) if run.to + 1 >= along => run.to = along,
                    _ => runs.push(Contact { from: along, to: along, side }),
                }
            }
        }
        // Filled areas are their own barrier.
        runs.retain(|run| {
            let long = (run.to - run.from) as f64 >= 4.0 * stroke_px + 4.0;
            let filled = (run.from..=run.to).filter(|along| at(*along, deeper)).count();
            !long || filled * 2 < run.to - run.from
        });
        runs
    };
    let (above, below) = (of_side(-1.0), of_side(1.0));
    match (above.is_empty(), below.is_empty()) {
        (false, true) => above,
        (true, false) => below,
        _ => Vec::new(),
    }
}

/// A stroke that meets a line from `side`, -1 before it and 1 behind.
struct Contact {
    from: usize,
    to: usize,
    side: f64,
}

fn contact_offset(line: &Line, stroke_px: f64) -> f64 {
    (line.thickness / 2.0).ceil() + (1.5 * stroke_px).max(3.0)
}

/// Draws a line again between strokes that meet it: between all, or between
/// every second two, which are the figure's own edges if it stands on feet.
fn restore(
    ink: &mut Bits,
    before: &Bits,
    line: &Line,
    stroke_px: f64,
    runs: &[Contact],
    step: usize,
) {
    let mut copy = before.clone();
    let old = Along { ink: &mut copy, upright: line.upright };
    let mut view = Along { ink, upright: line.upright };
    let offset = contact_offset(line, stroke_px);
    let odd = step == 2 && runs.len() % 2 == 1;
    for pair in runs.windows(2).step_by(if odd { 1 } else { step }) {
        let side = pair[0].side;
        // Lines inside spoil the count: then shallow areas are the figure's feet.
        if odd && !is_shallow(&view, line, side, pair[0].to + 1..pair[1].from) {
            continue;
        }
        let (from, to) = (pair[0].from, pair[1].to);
        let drawn = |along: &usize| {
            let near = line.across(*along) + side * (line.thickness / 2.0 + 0.5);
            (-1..3).any(|d| view.at(*along as i64, (near + side * f64::from(d)).floor() as i64))
        };
        let own = (from..=to).filter(drawn).count();
        if own as f64 > 0.8 * (to - from + 1) as f64 {
            continue;
        }
        for along in from..=to {
            let (middle, half) = (line.across(along), line.thickness / 2.0);
            let low = (middle - half).round() as i64;
            let high = ((middle + half).round() as i64).max(low + 1);
            (low..high).for_each(|y| view.set(along as i64, y, true));
        }
        // The figure's strokes go down to the line.
        for along in (pair[0].from..=pair[0].to).chain(pair[1].from..=pair[1].to) {
            let middle = line.across(along);
            let far = middle + side * offset;
            let (a, b) = (middle.min(far).floor() as i64, middle.max(far).ceil() as i64);
            for y in (a..=b).filter(|y| old.at(along as i64, *y)) {
                view.set(along as i64, y, true);
            }
        }
    }
}

/// Whether strokes bound the paper beside a stretch of the line not much
/// farther away than the stretch is long.
fn is_shallow(view: &Along<'_>, line: &Line, side: f64, stretch: std::ops::Range<usize>) -> bool {
    let reach = (1.5 * stretch.len() as f64 + 3.0 * line.thickness) as i64;
    let from = line.thickness.ceil() as i64 + 1;
    let bounded = |along: &usize| {
        let middle = line.across(*along).floor() as i64;
        (from..=reach).any(|d| view.at(*along as i64, middle + side as i64 * d))
    };
    let count = stretch.len();
    stretch.filter(bounded).count() * 10 >= count * 8
}
