//! Stretches of removed lines that are a figure's own edge.

use std::collections::BTreeMap;

use super::{Along, Drawn, runs};
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
/// Strokes on either side of a line so near each other along it are one that crosses it, px.
const CROSSING: usize = 3;
/// Smaller areas are noise, px².
const LEAST_AREA: usize = 6;

/// Draws those stretches of removed lines again that close the figure best.
///
/// * `before`: `ink` and the lines.
/// * `drawn`: as it was before any line was removed.
pub(crate) fn close(
    ink: &mut Bits,
    before: &Bits,
    drawn: &Drawn<'_>,
    lines: &[Line],
    stroke_px: f64,
) {
    lines.iter().for_each(|line| redraw_edges(ink, drawn, line, stroke_px));
    let chosen = |ink: &Bits, edge: &Edge<'_>| -> Vec<bool> {
        let mut all = ink.clone();
        restore(&mut all, before, edge.line, stroke_px, &edge.stretches());
        figure_stretches(ink, &all, drawn, edge, stroke_px)
    };
    let draw = |ink: &mut Bits, edge: &Edge<'_>, chosen: &[bool]| {
        let stretches = edge.stretches().into_iter().zip(chosen);
        let stretches: Vec<_> = stretches.filter(|(_, is)| **is).map(|(pair, _)| pair).collect();
        restore(ink, before, edge.line, stroke_px, &stretches);
    };
    let mut open: Vec<Edge<'_>> = Vec::new();
    for line in lines {
        for edge in edges(ink, drawn, line, stroke_px) {
            let chosen = chosen(ink, &edge);
            draw(ink, &edge, &chosen);
            if chosen.contains(&false) {
                open.push(edge);
            }
        }
    }
    if open.len() < 2 {
        return;
    }
    // A box whose top and bottom are on two lines is closed by neither alone.
    let alone = ink.clone();
    for (k, edge) in open.iter().enumerate() {
        let mut with_others = alone.clone();
        for (_, other) in open.iter().enumerate().filter(|(other, _)| *other != k) {
            restore(&mut with_others, before, other.line, stroke_px, &other.stretches());
        }
        let chosen = chosen(&with_others, edge);
        draw(ink, edge, &chosen);
    }
}

/// Draws those stretches of a line again along which an edge is drawn, if the figure's strokes come
/// to both of their ends: a neighbour's edge is not its own.
fn redraw_edges(ink: &mut Bits, drawn: &Drawn<'_>, line: &Line, stroke_px: f64) {
    let least = (2.0 * stroke_px).max(6.0) as usize;
    let near = (2.0 * stroke_px).ceil() as usize + 3;
    let reach = (line.thickness / 2.0 + stroke_px + 3.0).ceil() as i64;
    let own = ink.clone();
    let is_own = |end: usize| {
        (end.saturating_sub(near)..=end + near).any(|along| {
            let middle = line.across(along).floor() as i64;
            (middle - reach..=middle + reach).any(|across| {
                let (x, y) = line.pixel(along as i64, across);
                own.at(x, y)
            })
        })
    };
    for (from, to) in drawn.edges_along(line, least) {
        if is_own(from) && is_own(to) {
            (from..=to).for_each(|along| drawn.draw_again(line, along, stroke_px, ink));
        }
    }
}

/// Where strokes end on a line from one side.
struct Edge<'a> {
    line: &'a Line,
    contacts: Vec<Contact>,
    /// Whether strokes end on it from the other side too.
    is_shared: bool,
}

impl Edge<'_> {
    /// What lies between contacts that follow each other.
    fn stretches(&self) -> Vec<(&Contact, &Contact)> {
        self.contacts.iter().zip(self.contacts.iter().skip(1)).collect()
    }
}

/// Which stretches of a line between strokes are the figure's own edge: all that
/// must be drawn to close it, but for paper between its feet.
///
/// Where the line is thicker than elsewhere an edge is drawn along it. Of the rest, paper between
/// feet borders on one stretch alone, on either side of which the figure stands, and is long or high;
/// the first and last stretches are feet. It is also what lies between two feet that are closed
/// without the line or by an edge along it, and what is low: below a base on castors. On a line on
/// which strokes end from both sides all is paper but such edges.
///
/// * `all`: `ink` with all stretches drawn again.
fn figure_stretches(
    ink: &Bits,
    all: &Bits,
    drawn: &Drawn<'_>,
    edge: &Edge<'_>,
    stroke_px: f64,
) -> Vec<bool> {
    let (line, stretches) = (edge.line, edge.stretches());
    let inside = filled(ink);
    let gained = filled(all).and_not(&inside).and_not(all);
    let regions = gained.components(false);
    let (first, last) = (line.thickness / 2.0 + 1.0, contact_offset(line, stroke_px) + stroke_px);
    let across = |b: &Box2| f64::from(if line.upright { b.width() } else { b.height() });
    let beside = |(a, b): &(&Contact, &Contact)| -> Option<usize> {
        let mut counts = BTreeMap::new();
        for along in a.to + 1..b.from {
            for d in first as usize..=last.ceil() as usize {
                let across = (line.across(along) + a.side * d as f64).floor() as i64;
                let (x, y) = line.pixel(along as i64, across);
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
    let is_thicker = drawn.is_thicker(line);
    let is_paper = |k: usize| {
        let Some(region) = own[k] else { return false };
        let (before, behind) = stretches[k];
        if is_thicker(before.to, behind.from) {
            return false;
        }
        if edge.is_shared {
            return true;
        }
        let high = across(&regions.parts[region].bounds);
        // Behind the first stroke is the figure, if that is one stroke and no foot.
        let is_stroke =
            |contact: &Contact| (contact.to - contact.from) as f64 <= 2.0 * stroke_px + 2.0;
        let is_end =
            (k == 0 && is_stroke(before)) || (k + 1 == stretches.len() && is_stroke(behind));
        if high <= LOW * tall && stretches.len() > 1 && !is_end {
            return true;
        }
        // A foot is closed without the line or by an edge that is drawn along it.
        let is_foot = |contact: &Contact, way: i64, next: Option<&(&Contact, &Contact)>| {
            is_closed(&inside, line, contact, way, stroke_px)
                || next.is_some_and(|(from, to)| is_thicker(from.to, to.from))
        };
        let (last, next) = (k.checked_sub(1).map(|k| &stretches[k]), stretches.get(k + 1));
        if is_foot(before, -1, last) && is_foot(behind, 1, next) {
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
        let (x, y) = line.pixel(along, across);
        inside.at(x, y)
    };
    // What ends in the contact is followed to the other side of a stroke and beyond.
    let far = if way < 0 { contact.to } else { contact.from } as i64;
    (first..=first + deep).any(|d| {
        let run = (0..).take_while(|step| at(far + way * step, d)).count();
        // Neither a stroke that leans nor one that stands goes on so far both ways.
        let thick = (0..run as i64).filter(|step| at(far + way * step, d + deep)).count();
        let long = contact.to - contact.from;
        // What is drawn along the line, a sole, has the figure above it.
        let is_sole = long > 2 * deep && run >= long && thick > deep;
        is_sole || (run > long + deep && thick > deep)
    })
}

/// Where strokes end on a line, from either side; what crosses it does not end on it.
fn edges<'a>(ink: &Bits, drawn: &Drawn<'_>, line: &'a Line, stroke_px: f64) -> Vec<Edge<'a>> {
    let mut copy = ink.clone();
    let view = Along { ink: &mut copy, upright: line.upright };
    let is_thicker = drawn.is_thicker(line);
    let offset = contact_offset(line, stroke_px);
    let deeper = offset + 2.0 * stroke_px + 1.0;
    let of_side = |side: f64| {
        let at = |along: usize, offset: f64| {
            view.at(along as i64, (line.across(along) + side * offset).floor() as i64)
        };
        // What meets the very ends is a frame's other side.
        let end = (offset + line.thickness).ceil() as usize;
        let between = line.from + end..line.to.saturating_sub(end);
        let runs = runs(between, |along| at(along, offset)).into_iter();
        let mut runs: Vec<Contact> = runs.map(|(from, to)| Contact { from, to, side }).collect();
        // Filled areas are their own barrier.
        runs.retain(|run| {
            let long = (run.to - run.from) as f64 >= 4.0 * stroke_px + 4.0;
            let filled = (run.from..=run.to).filter(|along| at(*along, deeper)).count();
            !long || filled * 2 < run.to - run.from
        });
        // Two strokes of one edge are no two feet; they are one if an edge is drawn between them.
        let double = (3.0 * stroke_px + 1.0) as usize;
        runs.dedup_by(|next, run| {
            let is_double = next.from - run.to <= double && !is_thicker(run.to, next.from);
            if is_double {
                run.to = next.to;
            }
            is_double
        });
        runs
    };
    let (above, below) = (of_side(-1.0), of_side(1.0));
    let ending = |own: &[Contact], other: &[Contact]| -> Vec<Contact> {
        let crosses = |contact: &&Contact| {
            other.iter().any(|o| o.from <= contact.to + CROSSING && contact.from <= o.to + CROSSING)
        };
        own.iter().filter(|contact| !crosses(contact)).copied().collect()
    };
    let sides = [ending(&above, &below), ending(&below, &above)];
    let is_shared = sides.iter().all(|contacts| !contacts.is_empty());
    let sides = sides.into_iter().filter(|contacts| contacts.len() > 1);
    sides.map(|contacts| Edge { line, contacts, is_shared }).collect()
}

/// A stroke that meets a line from `side`, -1 before it and 1 behind.
#[derive(Clone, Copy)]
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
    /// Strokes that end so far from the line end on it, px.
    const SHORT_PX: i64 = 2;
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
        // Strokes may lean, and end a little before the line.
        let ends = |contact: &Contact| {
            let reach = offset.ceil() as usize;
            contact.from.saturating_sub(reach)..=contact.to + reach
        };
        let short: Vec<(usize, i64)> = ends(start)
            .chain(ends(end))
            .filter_map(|along| {
                let edge = line.across(along) + side * line.thickness / 2.0;
                let at = |px: &i64| (edge + side * *px as f64).floor() as i64;
                let px = (0..=SHORT_PX).find(|px| view.at(along as i64, at(px)))?;
                Some((along, at(&px)))
            })
            .collect();
        let (from, to) = short
            .iter()
            .fold((from, to), |(from, to), (along, _)| (from.min(*along), to.max(*along)));
        for along in from..=to {
            let (middle, half) = (line.across(along), line.thickness / 2.0);
            let low = (middle - half).round() as i64;
            let high = ((middle + half).round() as i64).max(low + 1);
            (low..high).for_each(|y| view.set(along as i64, y, true));
        }
        for (along, last) in short {
            let edge = line.across(along).floor() as i64;
            (edge.min(last)..=edge.max(last)).for_each(|y| view.set(along as i64, y, true));
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
