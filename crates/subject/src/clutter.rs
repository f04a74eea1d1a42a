//! Frames, guide lines, ground lines and dimension lines: long straight thin
//! strokes that go on where the figure does not.

use crate::cutting::{Drawn, Restore, close, cut_all};
use crate::options::CleanOptions;
use crate::raster::Bits;
use crate::report::{Box2, Removed, RemovedKind};
use crate::straight::{Limits, Line, level_lines, level_rows};

/// The thickest line, share of the page's shorter side.
const THICKNESS: f64 = 0.011;
/// The shortest run of a line's pixels, share of the longer side.
const RUN: f64 = 0.03;
/// Paper beside a line that is alone, share of the shorter side.
const BARE: f64 = 0.012;
/// A guide's length, share of the page's.
const GUIDE_LENGTH: f64 = 0.3;
/// How far it goes on alone, share of the page's length.
const OVERHANG: f64 = 0.03;
/// How far nothing may be drawn straight on from its ends, share of the page's
/// length: what goes on after a gap is an outline.
const AHEAD: f64 = 0.12;
/// The share of its length in which it is alone.
const ALONE: f64 = 0.3;
/// A frame's sides, share of the page's.
const FRAME: f64 = 0.7;
/// What a frame holds is at least this share of its height, and of one along the
/// page's border, which is within the last share of it, the second share.
const FRAMED: f64 = 0.3;
const FRAMED_AT_BORDER: f64 = 0.04;
const AT_BORDER: f64 = 0.03;
/// A line that touches nothing, share of the page's length.
const LOOSE_LENGTH: f64 = 0.1;
/// On pages of several figures: a guide's length, how much of it is alone and
/// drawn at all, shares of the page's length or of its own.
const PAGE_GUIDE_LENGTH: f64 = 0.25;
const PAGE_ALONE: f64 = 0.12;
const PAGE_ALONE_LENGTH: f64 = 0.06;
const PAGE_DRAWN: f64 = 0.96;
/// How much of a line is alone that spans the page, shows in so many stretches and goes on alone
/// beyond the first and the last figure: wide figures leave little of it bare.
const SPANS_ALONE_LENGTH: f64 = 0.03;
const SPANS_STRETCHES: usize = 3;
/// A figure's strokes are at most so many times as wide as the lines that were removed.
const WIDEST_STROKE: f64 = 3.0;
/// So much of a removed line beyond a figure is drawn again to look for its edges, px.
const BEYOND_PX: usize = 16;
/// On pages smaller than this nothing is a guide, px.
const LEAST_PAGE: usize = 120;

/// Straight lines that were found and what is left without them.
pub(crate) struct Cleaned {
    pub(crate) ink: Bits,
    pub(crate) removed: Vec<Removed>,
    /// Those that [`without_lines`] and [`without_page_lines`] removed.
    pub(crate) lines: Vec<Line>,
}

/// Removes a frame around the figure from `ink`, if there is one.
///
/// * `stroke_px`: the width of the drawing's strokes.
pub(crate) fn without_frame(ink: &Bits, stroke_px: f64) -> Cleaned {
    let mut cleaned = Cleaned { ink: ink.clone(), removed: Vec::new(), lines: Vec::new() };
    let (w, h) = (ink.width, ink.height);
    if w.min(h) < LEAST_PAGE {
        return cleaned;
    }
    if let Some(frame) = frame_of(&lines_of(ink), ink) {
        let bounds = frame.iter().map(|line| bounds_of(line, w, h)).reduce(|a, b| a.joined(&b));
        cut_all(&mut cleaned.ink, &frame, &[], stroke_px, Restore::Best);
        cleaned
            .removed
            .push(Removed { kind: RemovedKind::Frame, place: bounds.unwrap_or_default() });
    }
    cleaned
}

/// Removes straight lines that are not of the figure from `ink`.
///
/// * `stroke_px`: the width of the drawing's strokes.
pub(crate) fn without_lines(ink: &Bits, stroke_px: f64, options: &CleanOptions) -> Cleaned {
    without(ink, stroke_px, options, Restore::Best, &view_lines_of, &kind_of)
}

/// Removes straight lines that are of none of the figures on a page.
///
/// * `drawn`: ink and areas of colour; lines may go on behind these.
pub(crate) fn without_page_lines(
    ink: &Bits,
    drawn: &Bits,
    stroke_px: f64,
    options: &CleanOptions,
) -> Cleaned {
    let kind = |line: &Line, ink: &Bits| page_kind_of(line, ink, drawn);
    without(ink, stroke_px, options, Restore::Crossings, &page_lines_of, &kind)
}

fn without(
    ink: &Bits,
    stroke_px: f64,
    options: &CleanOptions,
    restored: Restore,
    lines_of: &dyn Fn(&Bits) -> Vec<Line>,
    kind_of: &dyn Fn(&Line, &Bits) -> Option<RemovedKind>,
) -> Cleaned {
    let mut cleaned = Cleaned { ink: ink.clone(), removed: Vec::new(), lines: Vec::new() };
    let (w, h) = (ink.width, ink.height);
    if w.min(h) < LEAST_PAGE {
        return cleaned;
    }
    let mut earlier: Vec<Line> = Vec::new();
    let mut rounds = 0;
    for _ in 0..2 {
        let wanted = |kind: &RemovedKind| match kind {
            RemovedKind::GroundLine => options.ground.is_on(),
            RemovedKind::DimensionLine => options.dimensions.is_on(),
            _ => options.guides.is_on(),
        };
        let found: Vec<(Line, RemovedKind)> = lines_of(&cleaned.ink)
            .into_iter()
            .filter_map(|line| kind_of(&line, &cleaned.ink).map(|kind| (line, kind)))
            .filter(|(_, kind)| wanted(kind))
            .collect();
        if found.is_empty() {
            break;
        }
        let place = |(line, kind): &(Line, RemovedKind)| Removed {
            kind: *kind,
            place: bounds_of(line, w, h),
        };
        cleaned.removed.extend(found.iter().map(place));
        let lines: Vec<Line> = found.into_iter().map(|(line, _)| line).collect();
        cut_all(&mut cleaned.ink, &lines, &earlier, stroke_px, restored);
        rounds += 1;
        earlier.extend(lines);
    }
    // What the first lines left open may be closed only now that the others are gone.
    if restored == Restore::Best && rounds > 1 {
        let drawn = Drawn { ink, corner: (0, 0) };
        close(&mut cleaned.ink, ink, &drawn, &earlier, stroke_px);
    }
    cleaned.lines = earlier;
    cleaned
}

/// What of removed `lines` is a figure's own edge: the stretches that close it best.
///
/// * `own`: the figure's ink without the lines; they are those of the raster that it was cut from
///   at `left`, `top`.
/// * `drawn`: that raster, before the lines were removed.
pub(crate) fn own_edges(
    own: &Bits,
    drawn: &Bits,
    lines: &[Line],
    (left, top): (i64, i64),
    stroke_px: f64,
) -> Bits {
    // What is painted all over has no strokes, and its dark parts may pass for wide ones.
    let thickness = lines.iter().map(|line| line.thickness).fold(1.0, f64::max);
    let stroke_px = stroke_px.min(WIDEST_STROKE * thickness);
    // A line must go on beyond the figure to be told from it.
    let beyond = (4.0 * stroke_px).ceil() as usize + BEYOND_PX;
    let mut ink = Bits::filled(own.width + 2 * beyond, own.height + 2 * beyond, false);
    for y in 0..own.height {
        let from = (y + beyond) * ink.width + beyond;
        ink.data[from..from + own.width].copy_from_slice(own.row(y));
    }
    let (left, top) = (left - beyond as i64, top - beyond as i64);
    // Edges of figures beside each other may have been taken for one line, that ends with them.
    let lines: Vec<Line> = lines
        .iter()
        .filter_map(|line| within(line, &ink, left, top))
        .map(|line| {
            let from = line.from.saturating_sub(beyond);
            let length = if line.upright { ink.height } else { ink.width };
            Line { from, to: (line.to + beyond).min(length), at: line.across(from), ..line }
        })
        .collect();
    let mut before = ink.clone();
    for line in &lines {
        for along in line.from..line.to {
            let (middle, half) = (line.across(along), line.thickness / 2.0);
            for across in (middle - half).round() as i64..(middle + half).round() as i64 {
                let (x, y) = line.pixel(along as i64, across);
                before.set(x, y, true);
            }
        }
    }
    let drawn = Drawn { ink: drawn, corner: (left, top) };
    close(&mut ink, &before, &drawn, &lines, stroke_px);
    let mut edges = Bits::filled(own.width, own.height, false);
    for y in 0..own.height {
        let from = (y + beyond) * ink.width + beyond;
        edges.data[y * own.width..][..own.width].copy_from_slice(&ink.data[from..][..own.width]);
    }
    edges.and_not(own)
}

/// The part of a line on a raster that was cut out at `left`, `top`.
fn within(line: &Line, cut: &Bits, left: i64, top: i64) -> Option<Line> {
    let (along, across) = if line.upright { (top, left) } else { (left, top) };
    let (length, breadth) =
        if line.upright { (cut.height, cut.width) } else { (cut.width, cut.height) };
    let from = (line.from as i64 - along).max(0);
    let to = (line.to as i64 - along).min(length as i64);
    let at = line.across(line.from) + line.slope * (from + along - line.from as i64) as f64
        - across as f64;
    let is_on_it = from < to && (0.0..breadth as f64).contains(&at);
    is_on_it.then(|| Line { from: from as usize, to: to as usize, at, ..line.clone() })
}

/// As [`lines_of`], and level and upright lines that are thicker where edges lie on them.
fn view_lines_of(ink: &Bits) -> Vec<Line> {
    let mut lines = lines_of(ink);
    let rows = rows_of(ink, &lines);
    lines.extend(rows.into_iter().filter(|row| is_drawn_along(row, ink)));
    lines
}

/// As [`lines_of`], and level and upright lines of which only short stretches
/// show between figures.
fn page_lines_of(ink: &Bits) -> Vec<Line> {
    let mut lines = lines_of(ink);
    lines.extend(rows_of(ink, &lines));
    lines
}

/// Exactly level and upright lines by their rows alone, that are not among `lines`.
fn rows_of(ink: &Bits, lines: &[Line]) -> Vec<Line> {
    let limits = limits(ink);
    let least = |length: usize| (SPANS_ALONE_LENGTH * length as f64) as usize + 1;
    let mut rows = level_rows(ink, &limits, least(ink.width), false);
    rows.extend(level_rows(&ink.transposed(), &limits, least(ink.height), true));
    rows.retain(|row| {
        let same = |line: &Line| {
            line.upright == row.upright
                && (line.across(row.from) - row.at).abs() <= 3.0
                && line.length() * 10 >= row.length() * 9
        };
        !lines.iter().any(same)
    });
    rows
}

fn lines_of(ink: &Bits) -> Vec<Line> {
    let limits = limits(ink);
    let mut lines = level_lines(ink, &limits, false);
    lines.extend(level_lines(&ink.transposed(), &limits, true));
    lines
}

fn limits(ink: &Bits) -> Limits {
    let short = ink.width.min(ink.height) as f64;
    Limits {
        least_run: ((RUN * ink.width.max(ink.height) as f64) as usize).max(8),
        most_thickness: ((THICKNESS * short).round() as usize).max(3),
        bare: ((BARE * short).round() as usize).max(2),
    }
}

fn page_length(line: &Line, w: usize, h: usize) -> f64 {
    if line.upright { h as f64 } else { w as f64 }
}

fn bounds_of(line: &Line, w: usize, h: usize) -> Box2 {
    let half = line.thickness / 2.0;
    let ends = [line.across(line.from), line.across(line.to)];
    let low = (ends[0].min(ends[1]) - half).floor().max(0.0) as u32;
    let high = (ends[0].max(ends[1]) + half).ceil().max(1.0) as u32;
    let (from, to) = (line.from as u32, line.to as u32);
    if line.upright {
        Box2 { left: low, top: from, right: high.min(w as u32), bottom: to }
    } else {
        Box2 { left: from, top: low, right: to, bottom: high.min(h as u32) }
    }
}

/// Whether a line goes on alone beyond what it touches.
fn is_guide(line: &Line, w: usize, h: usize) -> bool {
    let page = page_length(line, w, h);
    let overhangs = line.overhangs();
    let ends = [0, 1].map(|k| {
        let at_border = line.ahead[k] == usize::MAX;
        let least = if at_border { 2.0 } else { OVERHANG * page };
        overhangs[k] as f64 >= least && line.ahead[k] as f64 >= AHEAD * page
    });
    line.length() as f64 >= GUIDE_LENGTH * page
        && line.alone_share() >= ALONE
        && ends == [true, true]
}

/// What a line is, if it is not of the figure.
fn kind_of(line: &Line, ink: &Bits) -> Option<RemovedKind> {
    let (w, h) = (ink.width, ink.height);
    if is_guide(line, w, h) {
        let below = !line.upright && is_bare_below(line, ink);
        return Some(if below { RemovedKind::GroundLine } else { RemovedKind::Guide });
    }
    let page = page_length(line, w, h);
    let long = line.length() as f64;
    let loose = long >= LOOSE_LENGTH * page
        && long >= 16.0 * line.thickness
        && line.alone_share() >= 0.85
        && line.ahead.iter().all(|px| *px as f64 >= AHEAD * page)
        && line.overhangs().iter().all(|px| *px as f64 >= 0.3 * long);
    if !loose {
        return None;
    }
    let long = long >= GUIDE_LENGTH * page;
    Some(if long { RemovedKind::Guide } else { RemovedKind::DimensionLine })
}

/// What a line on a page of several figures is, if it is of none of them: it is
/// drawn all along, alone for a good part and ends free, or is as long as the
/// page.
fn page_kind_of(line: &Line, ink: &Bits, drawn: &Bits) -> Option<RemovedKind> {
    let page = page_length(line, ink.width, ink.height);
    let long = line.length() as f64;
    let alone = line.alone.iter().filter(|is| **is).count() as f64;
    let free = line.ahead.iter().filter(|px| **px > 0).count();
    let ends = free == 2 || (free == 1 && long >= 0.5 * page) || long >= 0.8 * page;
    let is_alone = (alone >= PAGE_ALONE * long && alone >= PAGE_ALONE_LENGTH * page)
        || (alone >= SPANS_ALONE_LENGTH * page && spans_page(line, page));
    if long < PAGE_GUIDE_LENGTH * page || !is_alone || !ends || !is_drawn_along(line, drawn) {
        let loose = kind_of(line, ink).filter(|_| is_drawn_along(line, drawn));
        return loose.filter(|kind| *kind == RemovedKind::DimensionLine);
    }
    let ground = !line.upright && is_bare_just_below(line, ink);
    Some(if ground { RemovedKind::GroundLine } else { RemovedKind::Guide })
}

/// Whether a line goes from one side of a page of length `page` to the other, shows in several
/// stretches, and the first and the last are its ends.
fn spans_page(line: &Line, page: f64) -> bool {
    let stretches = line.alone.chunk_by(|a, b| a == b).filter(|run| run[0] && run.len() > 2);
    let ends_alone = line.overhangs().iter().all(|px| *px > 2);
    line.length() as f64 >= 0.8 * page && ends_alone && stretches.count() >= SPANS_STRETCHES
}

/// Whether a line, or what it may go on behind, is drawn nearly all along.
fn is_drawn_along(line: &Line, drawn: &Bits) -> bool {
    let half = line.thickness / 2.0 + 1.0;
    let is = |along: &usize| {
        let middle = line.across(*along);
        let (low, high) = ((middle - half).floor() as i64, (middle + half).ceil() as i64);
        (low..high).any(|across| {
            let (x, y) = line.pixel(*along as i64, across);
            drawn.at(x, y)
        })
    };
    let count = (line.from..line.to).filter(is).count();
    count as f64 >= PAGE_DRAWN * line.length() as f64
}

/// Whether figures stand on a level line: something is drawn just above it, and
/// hardly anything just below.
fn is_bare_just_below(line: &Line, ink: &Bits) -> bool {
    let reach = 0.03 * ink.height as f64;
    let half = line.thickness / 2.0 + 2.0;
    let count = |side: f64| {
        (line.from..line.to)
            .filter(|&x| {
                let (a, b) = (line.across(x) + side * half, line.across(x) + side * (half + reach));
                let (low, high) = (a.min(b).floor() as i64, a.max(b).ceil() as i64);
                (low..high).any(|y| ink.at(x as i64, y))
            })
            .count() as f64
    };
    count(1.0) < 0.3 * count(-1.0)
}

/// Whether hardly anything is drawn below a level line and something above.
fn is_bare_below(line: &Line, ink: &Bits) -> bool {
    let low = (line.across(line.from).max(line.across(line.to)) + line.thickness + 2.0) as usize;
    let high = (line.across(line.from).min(line.across(line.to)) - line.thickness - 2.0).max(0.0);
    let count = |rows: std::ops::Range<usize>| {
        rows.map(|y| ink.row(y)[line.from..line.to].iter().filter(|is| **is).count()).sum::<usize>()
    };
    let below = count(low.min(ink.height)..ink.height);
    let above = count(0..(high as usize).min(ink.height));
    (below as f64) < 0.15 * above as f64
}

/// Four lines that make a rectangle about most of what is drawn.
fn frame_of(lines: &[Line], ink: &Bits) -> Option<[Line; 4]> {
    let (w, h) = (ink.width as f64, ink.height as f64);
    let near = 0.02 * w.max(h);
    let level: Vec<&Line> =
        lines.iter().filter(|l| !l.upright && l.length() as f64 >= FRAME * w).collect();
    let upright: Vec<&Line> =
        lines.iter().filter(|l| l.upright && l.length() as f64 >= FRAME * h).collect();
    let meet = |line: &Line, a: &Line, b: &Line| {
        (line.from as f64 - a.at).abs() <= near && (line.to as f64 - b.at).abs() <= near
    };
    for top in &level {
        for bottom in level.iter().filter(|bottom| bottom.at > top.at + FRAME * h) {
            for left in &upright {
                for right in upright.iter().filter(|right| right.at > left.at + FRAME * w) {
                    let joined = [top, bottom].iter().all(|line| meet(line, left, right))
                        && [left, right].iter().all(|line| meet(line, top, bottom));
                    let sides = [top, bottom, left, right].map(|line| (*line).clone());
                    if joined && holds_a_figure(&sides, ink) {
                        return Some(sides);
                    }
                }
            }
        }
    }
    None
}

fn holds_a_figure([top, bottom, left, right]: &[Line; 4], ink: &Bits) -> bool {
    let inset = |line: &Line| line.thickness + 3.0;
    let (y0, y1) = (top.at + inset(top), bottom.at - inset(bottom));
    let (x0, x1) = (left.at + inset(left), right.at - inset(right));
    let (y0, y1) = (y0.max(0.0) as usize, (y1.max(0.0) as usize).min(ink.height));
    let (x0, x1) = (x0.max(0.0) as usize, (x1.max(0.0) as usize).min(ink.width));
    if x0 >= x1 || y0 >= y1 {
        return false;
    }
    let inked = (y0..y1).filter(|&y| ink.row(y)[x0..x1].iter().any(|is| *is)).count();
    let (w, h) = (ink.width as f64, ink.height as f64);
    let near = AT_BORDER * w.max(h);
    let at_border =
        top.at <= near && left.at <= near && bottom.at >= h - near && right.at >= w - near;
    let least = if at_border { FRAMED_AT_BORDER } else { FRAMED };
    inked as f64 >= least * (y1 - y0) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::filled;

    /// Two open boxes side by side as feet, on a line if `ground`.
    fn feet(ground: bool) -> Bits {
        let mut ink = Bits::filled(300, 200, false);
        for (left, right) in [(100, 130), (160, 190)] {
            for y in 60..150 {
                for x in [left, left + 1, right - 1, right] {
                    ink.set(x, y, true);
                }
            }
            for x in left..=right {
                for y in [60, 61, 148, 149] {
                    ink.set(x, y, true);
                }
            }
        }
        if ground {
            for x in 20..280 {
                ink.set(x, 148, true);
                ink.set(x, 149, true);
            }
        }
        ink
    }

    #[test]
    fn a_ground_line_goes_and_the_soles_stay() {
        let cleaned = without_lines(&feet(true), 2.0, &CleanOptions::default());
        assert_eq!(cleaned.removed.len(), 1);
        assert_eq!(cleaned.removed[0].kind, RemovedKind::GroundLine);
        let whole = filled(&cleaned.ink).count() as f64;
        let clean = filled(&feet(false)).count() as f64;
        assert!((whole / clean - 1.0).abs() < 0.01, "{whole} {clean}");
    }

    /// A box with a thinner line along its top, one along its bottom and one down its middle, each
    /// `px` thick.
    fn boxed(px: i64) -> Bits {
        let mut ink = Bits::filled(600, 360, false);
        for x in 0..600_i64 {
            for y in 0..360_i64 {
                let in_box = (200..400).contains(&x) && (60..300).contains(&y);
                let within = (203..397).contains(&x) && (63..297).contains(&y);
                let level = (60..60 + px).contains(&y) || (300 - px..300).contains(&y);
                let upright = (300..300 + px).contains(&x);
                ink.set(x, y, (in_box && !within) || ((level || upright) && px > 0));
            }
        }
        ink
    }

    #[test]
    fn a_box_with_guides_along_two_edges_and_through_it_stays_closed() {
        let area = filled(&boxed(0)).count() as f64;
        // Thinner than the edges, which tells these, and as thick.
        for px in [1, 2, 3] {
            let cleaned = without_lines(&boxed(px), 3.0, &CleanOptions::default());
            assert_eq!(cleaned.removed.len(), 3, "{px}: {:?}", cleaned.removed);
            let found = filled(&cleaned.ink).count() as f64;
            assert!((found / area - 1.0).abs() < 0.03, "{px}: {found} of {area}");
        }
    }

    #[test]
    fn paper_between_feet_whose_soles_are_drawn_stays_paper() {
        let legs = |ground: bool| {
            let mut ink = Bits::filled(500, 320, false);
            for (x, y) in (0..500_i64).flat_map(|x| (0..320_i64).map(move |y| (x, y))) {
                let body = (150..350).contains(&x) && (60..260).contains(&y);
                let between = (180..320).contains(&x) && y >= 120;
                let inset = |d: i64| {
                    (150 + d..350 - d).contains(&x)
                        && (60 + d..260 - d).contains(&y)
                        && !((180 - d..320 + d).contains(&x) && y >= 120 - d)
                };
                let on_ground = ground && (40..460).contains(&x) && (259..261).contains(&y);
                ink.set(x, y, (body && !between && !inset(3)) || on_ground);
            }
            ink
        };
        let cleaned = without_lines(&legs(true), 3.0, &CleanOptions::default());
        assert_eq!(cleaned.removed.len(), 1);
        let (found, whole) = (filled(&cleaned.ink).count(), filled(&legs(false)).count());
        assert!(found.abs_diff(whole) * 50 < whole, "{found} of {whole}");
    }

    #[test]
    fn a_clean_drawing_is_left_alone() {
        let cleaned = without_lines(&feet(false), 2.0, &CleanOptions::default());
        assert!(cleaned.removed.is_empty());
        assert_eq!(cleaned.ink.data, feet(false).data);
    }

    /// Rings between two guides that they touch.
    fn between_guides() -> (Bits, usize) {
        let mut ink = Bits::filled(700, 220, false);
        let rings = [90.0, 260.0, 430.0];
        for y in 0..220_i64 {
            for x in 0..700_i64 {
                let on_ring = |middle: &f64| {
                    let r = (x as f64 + 0.5 - middle).hypot(y as f64 + 0.5 - 110.0);
                    (78.0..81.0).contains(&r)
                };
                let on_guide = [29, 30, 189, 190].contains(&y) && (8..692).contains(&x);
                ink.set(x, y, rings.iter().any(on_ring) || on_guide);
            }
        }
        (ink, rings.len())
    }

    #[test]
    fn what_is_round_stays_whole_between_guides() {
        let (ink, rings) = between_guides();
        let cleaned = without_page_lines(&ink, &ink, 3.0, &CleanOptions::default());
        assert!(cleaned.removed.len() >= 2, "{:?}", cleaned.removed);
        let parts = cleaned.ink.components(true).parts;
        let tall = parts.iter().filter(|part| part.bounds.height() > 140);
        let widths: Vec<u32> = tall.map(|part| part.bounds.width()).collect();
        // Each ring in one piece, none joined to the next.
        assert_eq!(widths.len(), rings, "{widths:?}");
        assert!(widths.iter().all(|width| (155..170).contains(width)), "{widths:?}");
        // The rings enclose what they did.
        let area = filled(&cleaned.ink).count() as f64;
        let round = std::f64::consts::PI * 80.0 * 80.0 * rings as f64;
        assert!(area > 0.95 * round, "{area} of {round}");
    }

    /// Painted blocks close beside each other, and a line through them from `from` to `to`.
    fn close_blocks(from: i64, to: i64) -> (Bits, Bits) {
        let (mut ink, mut drawn) = (Bits::filled(700, 160, false), Bits::filled(700, 160, false));
        for x in 0..700_i64 {
            let aside = (x - 20).rem_euclid(132);
            let in_block = (20..680).contains(&x) && aside < 124;
            for y in 0..160_i64 {
                let is_edge =
                    in_block && (!(2..122).contains(&aside) || [30, 31, 128, 129].contains(&y));
                let is_block = in_block && (30..130).contains(&y);
                let on_line = (from..to).contains(&x) && (70..72).contains(&y);
                ink.set(x, y, is_block && is_edge || on_line && !is_block);
                drawn.set(x, y, is_block || on_line);
            }
        }
        (ink, drawn)
    }

    #[test]
    fn a_guide_of_which_little_shows_between_wide_figures_goes() {
        let cleaned = |from, to| {
            let (ink, drawn) = close_blocks(from, to);
            without_page_lines(&ink, &drawn, 2.0, &CleanOptions::default())
        };
        let guide = cleaned(6, 694);
        assert_eq!(guide.removed.len(), 1, "{:?}", guide.removed);
        let parts = guide.ink.components(true).parts;
        assert_eq!(parts.iter().filter(|part| part.bounds.width() > 120).count(), 5);
        // What begins and ends in a figure is of them: a rail.
        assert!(cleaned(40, 660).removed.is_empty());
    }

    #[test]
    fn strokes_that_leave_a_guide_long_after_they_entered_it_go_on() {
        // A wedge whose lower edge crosses the guide at a slope of one in five.
        let edge = |x: i64| 80.0 + 0.2 * (x - 60) as f64;
        let wedge = |guide: bool| {
            let mut ink = Bits::filled(520, 240, false);
            for x in 60..460_i64 {
                for y in 0..240_i64 {
                    let on_edge = (edge(x)..edge(x) + 2.0).contains(&(y as f64));
                    let on_side = (458..460).contains(&x) && (30..edge(x) as i64).contains(&y);
                    let on_end = (60..62).contains(&x) && (30..82).contains(&y);
                    let on_guide = guide && (118..120).contains(&y);
                    let on_top = (30..32).contains(&y);
                    ink.set(x, y, on_edge || on_side || on_end || on_top || on_guide);
                }
            }
            for x in (10..60).chain(460..510) {
                (118..120).for_each(|y| ink.set(x, y, guide));
            }
            ink
        };
        let cleaned = without_page_lines(&wedge(true), &wedge(true), 2.0, &CleanOptions::default());
        assert_eq!(cleaned.removed.len(), 1);
        let (area, whole) = (filled(&cleaned.ink).count(), filled(&wedge(false)).count());
        assert!(area * 100 >= whole * 97 && area * 97 <= whole * 100, "{area} of {whole}");
    }

    #[test]
    fn neighbours_whose_feet_lean_together_stay_apart() {
        // Bells on a ground line, their rims flat on it and almost touching.
        let mut ink = Bits::filled(520, 220, false);
        for middle in [110.0, 260.0, 410.0] {
            for y in 40..190_i64 {
                let half = 20.0 + 52.0 * ((y as f64 - 40.0) / 150.0).powi(6);
                for x in 0..520_i64 {
                    let off = (x as f64 - middle).abs() - half;
                    let next = 52.0 * ((y as f64 - 39.0) / 150.0).powi(6) + 20.0 - half;
                    let on_side = (-3.0..next.max(0.0)).contains(&off);
                    let on_top = (40..43).contains(&y) && off < 0.0;
                    ink.set(x, y, ink.at(x, y) || on_side || on_top);
                }
            }
        }
        for x in 8..512 {
            (188..191).for_each(|y| ink.set(x, y, true));
        }
        let cleaned = without_page_lines(&ink, &ink, 3.0, &CleanOptions::default());
        assert!(!cleaned.removed.is_empty());
        let parts = cleaned.ink.components(true).parts;
        assert!(parts.iter().all(|part| part.bounds.width() < 160), "joined with the next");
    }

    #[test]
    fn a_frame_is_found_and_a_box_alone_is_none() {
        let mut framed = feet(false);
        let only = Bits::filled(300, 200, false);
        let draw = |ink: &mut Bits| {
            for k in 0..3 {
                (10..290).for_each(|x| [10 + k, 187 + k].iter().for_each(|&y| ink.set(x, y, true)));
                (10..190).for_each(|y| [10 + k, 287 + k].iter().for_each(|&x| ink.set(x, y, true)));
            }
        };
        draw(&mut framed);
        let cleaned = without_frame(&framed, 2.0);
        assert_eq!(cleaned.removed[0].kind, RemovedKind::Frame);
        assert_eq!(cleaned.ink.count(), feet(false).count());
        let mut only = only;
        draw(&mut only);
        assert!(without_frame(&only, 2.0).removed.is_empty());
    }
}
