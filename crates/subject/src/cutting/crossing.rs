//! Strokes that go on across a removed line, or meet in it.

use super::{Along, Drawn, runs};
use crate::raster::{Bits, filled};
use crate::straight::Line;

/// Just beside a removed line, px from its edge: what was within is gone with it.
const ASIDE_PX: f64 = 2.0;

/// Draws strokes again that go on across removed `lines` or meet in them.
///
/// * `drawn`: as it was before.
/// * `earlier`: lines that were removed before.
pub(super) fn restore(
    ink: &mut Bits,
    drawn: &Drawn<'_>,
    lines: &[Line],
    earlier: &[Line],
    stroke_px: f64,
) {
    lines.iter().for_each(|line| cross(ink, drawn, line));
    lines.iter().for_each(|line| cross_slowly(ink, drawn, line, stroke_px));
    let all = merged(&[earlier, lines].concat());
    meet(ink, &all, stroke_px);
}

/// Draws strokes again that go on across a line that was removed.
fn cross(ink: &mut Bits, drawn: &Drawn<'_>, line: &Line) {
    const REACH: i64 = 3;
    const ASIDE: [i64; 5] = [0, -1, 1, -2, 2];
    /// Strokes further from each other along the line are two, unless it is thicker between them.
    const ACROSS: i64 = 3;
    let is_thicker = drawn.is_thicker(line);
    let is_one = |a: i64, b: i64| {
        (a - b).abs() <= ACROSS || is_thicker(a.min(b) as usize, a.max(b) as usize)
    };
    let mut view = Along { ink, upright: line.upright };
    let half = line.thickness / 2.0 + 0.3;
    let mut again = Vec::new();
    for along in line.from as i64..line.to as i64 {
        let middle = line.across(along as usize);
        let (low, high) = ((middle - half).floor() as i64, (middle + half).ceil() as i64);
        let nearest = |from: i64, way: i64| {
            let near = |aside| (0..REACH).map(move |px| (along + aside, from + way * px));
            ASIDE.into_iter().flat_map(near).find(|(along, across)| view.at(*along, *across))
        };
        if let (Some(above), Some(below)) = (nearest(low - 1, -1), nearest(high, 1))
            && is_one(above.0, below.0)
        {
            again.push((above, below));
        }
    }
    again.into_iter().for_each(|(above, below)| view.draw(above, below));
}

/// Draws strokes again that went on within a line that was removed before they left it on its
/// other side.
fn cross_slowly(ink: &mut Bits, drawn: &Drawn<'_>, line: &Line, stroke_px: f64) {
    /// Steeper strokes are seen on both sides at once; flatter ones are as good as the line itself.
    const LEANS: std::ops::RangeInclusive<f64> = 1.0..=5.0;
    /// A stroke comes out after so many times the way on which it was when it went in: what
    /// goes in so slowly often bends.
    const WAY: std::ops::RangeInclusive<f64> = 0.5..=1.8;
    let deep = line.thickness + 2.0 * ASIDE_PX;
    let is_thicker = drawn.is_thicker(line);
    let mut again = Vec::new();
    for side in [-1.0, 1.0] {
        let others = beside(ink, line, -side);
        for stroke in arriving(ink, line, stroke_px, side) {
            if !LEANS.contains(&stroke.lean.abs()) {
                continue;
            }
            let way = stroke.lean.signum();
            let start = if way > 0.0 { stroke.to } else { stroke.from } as i64;
            // How far along the line the other side's run begins.
            let end = |run: &(usize, usize)| if way > 0.0 { run.0 } else { run.1 } as i64;
            let gap = |run: &(usize, usize)| way * (end(run) - start) as f64;
            let aim = (stroke.lean * deep).abs() - (stroke.to - stroke.from) as f64 / 2.0;
            let is_aimed_at = |run: &&(usize, usize)| WAY.contains(&(gap(run) / aim));
            let nearest = others
                .iter()
                .filter(is_aimed_at)
                .min_by(|a, b| (gap(a) - aim).abs().total_cmp(&(gap(b) - aim).abs()));
            let Some(last) = nearest.map(end) else { continue };
            let (from, to) = (start.min(last) as usize, start.max(last) as usize);
            if is_thicker(from, to) {
                again.push((start, side, last));
            }
        }
    }
    let mut view = Along { ink, upright: line.upright };
    let offset = line.thickness / 2.0 + ASIDE_PX;
    for (start, side, end) in again {
        let at = |along: i64, side: f64| {
            (along, (line.across(along as usize) + side * offset).floor() as i64)
        };
        // As wide as a stroke that is so flat, at the least.
        for aside in 0..stroke_px.round().max(1.0) as i64 + 1 {
            let (from, to) = (at(start, side), at(end, -side));
            view.draw((from.0, from.1 - aside), (to.0, to.1 - aside));
        }
    }
}

/// Lines of which several were found along the same pixels, as one.
fn merged(lines: &[Line]) -> Vec<Line> {
    const SAME_PX: f64 = 2.5;
    let mut merged: Vec<Line> = Vec::new();
    for line in lines {
        let same = |other: &&mut Line| {
            let (from, to) = (line.from.max(other.from), line.to.min(other.to));
            line.upright == other.upright
                && from < to
                && (line.across(from) - other.across(from)).abs() <= SAME_PX
                && (line.across(to) - other.across(to)).abs() <= SAME_PX
        };
        match merged.iter_mut().find(same) {
            None => merged.push(line.clone()),
            Some(other) => {
                let low = other.from.min(line.from);
                (other.at, other.from) = (other.across(low), low);
                other.to = other.to.max(line.to);
                other.thickness = other.thickness.max(line.thickness);
            }
        }
    }
    merged
}

/// A stroke that comes to a removed line from one side.
#[derive(Clone, Copy)]
struct Arriving {
    from: usize,
    to: usize,
    /// How far it goes along the line for each pixel towards it.
    lean: f64,
}

/// A stretch of a removed line in which two strokes from one side may meet.
struct Meeting<'a> {
    line: &'a Line,
    side: f64,
    before: Arriving,
    behind: Arriving,
}

/// Draws stretches of removed lines again in which two strokes from one side meet: the top of what
/// is round and touches a guide.
///
/// Figures beside each other lean towards each other too; a stretch is of a figure only if it
/// closes an area.
fn meet(ink: &mut Bits, lines: &[Line], stroke_px: f64) {
    let meetings: Vec<Meeting<'_>> =
        lines.iter().flat_map(|line| meetings(ink, line, stroke_px)).collect();
    if meetings.is_empty() {
        return;
    }
    let mut all = ink.clone();
    meetings.iter().for_each(|meeting| meeting.draw(&mut all));
    let gained = filled(&all).and_not(&filled(ink)).and_not(&all);
    let closing = meetings.iter().filter(|meeting| meeting.borders_on(&gained));
    closing.for_each(|meeting| meeting.draw(ink));
}

fn meetings<'a>(ink: &mut Bits, line: &'a Line, stroke_px: f64) -> Vec<Meeting<'a>> {
    /// Strokes that lean less do not aim at each other; those that lean more are round.
    const LEAN: f64 = 0.15;
    const ROUND: f64 = 1.0;
    /// A parabola's apex is twice as far as its tangent says; drawings are no parabolas.
    const APEX: f64 = 2.0 * 1.3;
    let deep = line.thickness + 2.0;
    let mut meetings = Vec::new();
    for side in [-1.0, 1.0] {
        for pair in arriving(ink, line, stroke_px, side).windows(2) {
            let [before, behind] = *pair else { continue };
            let gap = behind.from.saturating_sub(before.to) as f64;
            let aimed = before.lean >= LEAN && behind.lean <= -LEAN;
            let round = before.lean >= ROUND && behind.lean <= -ROUND;
            let reach = if round { APEX } else { 1.0 };
            if aimed && gap <= reach * deep * (before.lean - behind.lean) {
                meetings.push(Meeting { line, side, before, behind });
            }
        }
    }
    meetings
}

impl Meeting<'_> {
    fn draw(&self, ink: &mut Bits) {
        let Self { line, side, before, behind } = self;
        let mut view = Along { ink, upright: line.upright };
        let half = line.thickness / 2.0;
        for along in before.from..=behind.to {
            let is_end = along <= before.to || along >= behind.from;
            let middle = line.across(along);
            let outer = middle - side * half;
            let inner = middle + side * (half + if is_end { ASIDE_PX } else { 0.0 });
            let (low, high) = (outer.min(inner).round() as i64, outer.max(inner).round() as i64);
            (low..high.max(low + 1)).for_each(|y| view.set(along as i64, y, true));
        }
    }

    /// Whether the stretch is on the edge of one of these areas.
    fn borders_on(&self, areas: &Bits) -> bool {
        /// So many pixels beside the stretch something of the area shows.
        const NEAR_PX: usize = 6;
        let along = usize::midpoint(self.before.to, self.behind.from);
        (1..=NEAR_PX).any(|px| {
            let offset = self.line.thickness / 2.0 + px as f64;
            let across = (self.line.across(along) + self.side * offset).floor() as i64;
            let (x, y) = self.line.pixel(along as i64, across);
            areas.at(x, y)
        })
    }
}

/// What is inked just beside a removed line, on its `side`.
fn beside(ink: &mut Bits, line: &Line, side: f64) -> Vec<(usize, usize)> {
    let view = Along { ink, upright: line.upright };
    let offset = side * (line.thickness / 2.0 + ASIDE_PX);
    let at = |along| view.at(along as i64, (line.across(along) + offset).floor() as i64);
    runs(line.from..line.to, at)
}

/// The strokes that come to a line from `side`, in their order along it.
fn arriving(ink: &mut Bits, line: &Line, stroke_px: f64, side: f64) -> Vec<Arriving> {
    let view = Along { ink, upright: line.upright };
    let first = line.thickness / 2.0 + ASIDE_PX;
    let depth = (2.0 * stroke_px + 2.0).max(4.0) as usize;
    let at = |along: usize, offset: f64| {
        view.at(along as i64, (line.across(along) + side * offset).floor() as i64)
    };
    let runs = |offset: f64, from: usize, to: usize| runs(from..to, |along| at(along, offset));
    let middle = |run: &(usize, usize)| f64::midpoint(run.0 as f64, run.1 as f64);
    let followed = |run: (usize, usize)| {
        let mut here = run;
        for step in 1..=depth {
            // A stroke goes on beside its last pixels.
            let (low, high) = (here.0.saturating_sub(1), here.1 + 2);
            let offset = first + step as f64;
            let touching = runs(offset, low, high);
            let (Some(start), Some(end)) = (touching.first(), touching.last()) else { return None };
            let (mut from, mut to) = (start.0, end.1);
            while from > line.from && at(from - 1, offset) {
                from -= 1;
            }
            while to + 1 < line.to && at(to + 1, offset) {
                to += 1;
            }
            here = (from, to);
        }
        let lean = (middle(&run) - middle(&here)) / depth as f64;
        Some(Arriving { from: run.0, to: run.1, lean })
    };
    runs(first, line.from, line.to).into_iter().filter_map(followed).collect()
}
