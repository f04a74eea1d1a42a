//! Lines taken out of a drawing: their pixels go, and what of them the figure
//! needs is drawn again.

use crate::raster::{Bits, filled};
use crate::report::Box2;
use crate::straight::Line;

/// Paper between two feet is so long, of the longer foot, or so many times as
/// high as it is long.
const AS_LONG: f64 = 0.8;
const AS_HIGH: f64 = 2.5;
/// An area borders on a stretch if it is so much of what lies just beside it: a sliver below what
/// is round and just above the line is none.
const BORDERED: f64 = 0.5;
/// An area as low, of the figure's height from the line on, is closed for less than it may spoil.
const LOW: f64 = 0.1;
/// Smaller areas are noise, px².
const LEAST_AREA: usize = 6;

/// What of a removed line is drawn again: what closes the figure on it best, or
/// only where strokes go on across it or meet in it, which leaves several figures apart.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Restore {
    Best,
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
    if restored == Restore::Crossings {
        lines.iter().for_each(|line| cross(ink, line));
        let all = merged(&[earlier, lines].concat());
        meet(ink, &all, stroke_px);
        return;
    }
    for line in lines {
        let runs = contacts(ink, line, stroke_px);
        let stretches: Vec<(&Contact, &Contact)> = runs.iter().zip(runs.iter().skip(1)).collect();
        if stretches.is_empty() {
            continue;
        }
        let draw = |ink: &mut Bits, is: &dyn Fn(usize) -> bool| {
            let chosen = stretches.iter().enumerate().filter(|(k, _)| is(*k));
            let chosen: Vec<_> = chosen.map(|(_, pair)| *pair).collect();
            restore(ink, &before, line, stroke_px, &chosen);
        };
        let mut all = ink.clone();
        draw(&mut all, &|_| true);
        let figure = figure_stretches(ink, &all, line, stroke_px, &stretches);
        draw(ink, &|k| figure[k]);
    }
}

/// Which stretches of a line between strokes are the figure's own edge: all that
/// must be drawn to close it, but for paper between its feet.
///
/// Paper between feet borders on one stretch alone, on either side of which the
/// figure stands, and is long or high; the first and last stretches are feet. It is also what lies
/// between two feet that are closed without the line, and what is low: below a base on castors.
///
/// * `all`: `ink` with all stretches drawn again.
fn figure_stretches(
    ink: &Bits,
    all: &Bits,
    line: &Line,
    stroke_px: f64,
    stretches: &[(&Contact, &Contact)],
) -> Vec<bool> {
    let inside = filled(ink);
    let gained = filled(all).and_not(&inside).and_not(all);
    let regions = gained.components(false);
    let (first, last) = (line.thickness / 2.0 + 1.0, contact_offset(line, stroke_px) + stroke_px);
    let across = |b: &Box2| f64::from(if line.upright { b.width() } else { b.height() });
    let beside = |(a, b): &(&Contact, &Contact)| -> Option<usize> {
        let mut counts = std::collections::BTreeMap::new();
        for along in a.to + 1..b.from {
            for d in first as usize..=last.ceil() as usize {
                let across = (line.across(along) + a.side * d as f64).floor() as i64;
                let along = along as i64;
                let (x, y) = if line.upright { (across, along) } else { (along, across) };
                let inside =
                    x >= 0 && y >= 0 && (x as usize) < ink.width && (y as usize) < ink.height;
                let label =
                    if inside { regions.labels[y as usize * ink.width + x as usize] } else { 0 };
                *counts.entry(label).or_insert(0_usize) += 1;
            }
        }
        let all: usize = counts.values().sum();
        let largest = counts.into_iter().filter(|(label, _)| *label != 0).max_by_key(|c| c.1)?;
        let region = largest.0 as usize - 1;
        let is_most = largest.1 as f64 >= BORDERED * all as f64;
        let is_deep = across(&regions.parts[region].bounds) > last.ceil();
        (is_most && is_deep && regions.parts[region].area >= LEAST_AREA).then_some(region)
    };
    let own: Vec<Option<usize>> = stretches.iter().map(beside).collect();
    let tall = stretches.first().map_or(0.0, |(contact, _)| extent(ink, line, contact.side));
    let length = |k: usize| (stretches[k].1.from.saturating_sub(stretches[k].0.to)) as f64;
    let is_paper = |k: usize| {
        let Some(region) = own[k] else { return false };
        let high = across(&regions.parts[region].bounds);
        if high <= LOW * tall {
            return true;
        }
        let (before, behind) = stretches[k];
        if is_closed(&inside, line, before, -1, stroke_px)
            && is_closed(&inside, line, behind, 1, stroke_px)
        {
            return true;
        }
        let alone = own.iter().filter(|other| **other == Some(region)).count() == 1;
        if k == 0 || k + 1 == stretches.len() || !alone {
            return false;
        }
        let feet = length(k - 1).max(length(k + 1));
        length(k) >= AS_LONG * feet || high >= AS_HIGH * length(k)
    };
    (0..stretches.len()).map(|k| own[k].is_some() && !is_paper(k)).collect()
}

/// How far `ink` goes on from a line on one side.
fn extent(ink: &Bits, line: &Line, side: f64) -> f64 {
    let from = line.across((line.from + line.to) / 2);
    let length = if line.upright { ink.width } else { ink.height };
    let is_inked = |across: &usize| match line.upright {
        true => (0..ink.height).any(|y| ink.at(*across as i64, y as i64)),
        false => ink.row(*across).contains(&true),
    };
    let last = if side < 0.0 { (0..length).find(is_inked) } else { (0..length).rfind(is_inked) };
    last.map_or(0.0, |across| (side * (across as f64 - from)).max(0.0))
}

/// Whether what meets a line is closed without it: on its side `way`, before it or behind, `inside`
/// goes on for longer than a stroke is wide, and away from the line too.
fn is_closed(inside: &Bits, line: &Line, contact: &Contact, way: i64, stroke_px: f64) -> bool {
    let first = contact_offset(line, stroke_px) as usize;
    let deep = (3.0 * stroke_px + 3.0).ceil() as usize;
    let at = |along: i64, d: usize| {
        let offset = contact.side * d as f64;
        let across = (line.across(usize::try_from(along).unwrap_or(0)) + offset).floor() as i64;
        if line.upright { inside.at(across, along) } else { inside.at(along, across) }
    };
    // What ends in the contact is followed to the other side of a stroke and beyond.
    let far = if way < 0 { contact.to } else { contact.from } as i64;
    (first..=first + deep).any(|d| {
        let run = (0..).take_while(|step| at(far + way * step, d)).count();
        // Neither a stroke that leans nor one that stands goes on so far both ways.
        let thick = (0..run as i64).filter(|step| at(far + way * step, d + deep)).count();
        run > (contact.to - contact.from) + deep && thick > deep
    })
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
            let along = along as i64;
            if self.line.upright { areas.at(across, along) } else { areas.at(along, across) }
        })
    }
}

/// Just beside a removed line, px from its edge: what was within is gone with it.
const ASIDE_PX: f64 = 2.0;

/// The strokes that come to a line from `side`, in their order along it.
fn arriving(ink: &mut Bits, line: &Line, stroke_px: f64, side: f64) -> Vec<Arriving> {
    let view = Along { ink, upright: line.upright };
    let first = line.thickness / 2.0 + ASIDE_PX;
    let depth = (2.0 * stroke_px + 2.0).max(4.0) as usize;
    let at = |along: usize, offset: f64| {
        view.at(along as i64, (line.across(along) + side * offset).floor() as i64)
    };
    let runs = |offset: f64, from: usize, to: usize| {
        let mut runs: Vec<(usize, usize)> = Vec::new();
        for along in (from..to).filter(|&along| at(along, offset)) {
            match runs.last_mut() {
                Some(run) if run.1 + 1 >= along => run.1 = along,
                _ => runs.push((along, along)),
            }
        }
        runs
    };
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

/// Draws stretches of a line again between strokes that meet it.
fn restore(
    ink: &mut Bits,
    before: &Bits,
    line: &Line,
    stroke_px: f64,
    stretches: &[(&Contact, &Contact)],
) {
    let mut copy = before.clone();
    let old = Along { ink: &mut copy, upright: line.upright };
    let mut view = Along { ink, upright: line.upright };
    let offset = contact_offset(line, stroke_px);
    for (start, end) in stretches {
        let side = start.side;
        let (from, to) = (start.from, end.to);
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
        for along in (start.from..=start.to).chain(end.from..=end.to) {
            let middle = line.across(along);
            let far = middle + side * offset;
            let (a, b) = (middle.min(far).floor() as i64, middle.max(far).ceil() as i64);
            for y in (a..=b).filter(|y| old.at(along as i64, *y)) {
                view.set(along as i64, y, true);
            }
        }
    }
}
