//! Figures cut by the page's edge: closed along it.

use crate::raster::Bits;
use crate::report::Side;

/// Runs wider than this many strokes are filled areas.
const FILLED: f64 = 5.0;

/// The ring at some depth inside the border, clockwise from the top left.
struct Ring {
    width: usize,
    height: usize,
    depth: usize,
}

impl Ring {
    fn length(&self) -> usize {
        2 * (self.width - 2 * self.depth - 1) + 2 * (self.height - 2 * self.depth - 1)
    }

    fn sides(&self) -> [usize; 2] {
        [self.width - 2 * self.depth - 1, self.height - 2 * self.depth - 1]
    }

    /// The ring's pixel, the nearest border pixel, and the side.
    fn at(&self, k: usize) -> ((usize, usize), (usize, usize), Side) {
        let ([a, b], d) = (self.sides(), self.depth);
        let (right, bottom) = (self.width - 1, self.height - 1);
        if k < a {
            ((d + k, d), (d + k, 0), Side::Top)
        } else if k < a + b {
            ((right - d, d + k - a), (right, d + k - a), Side::Right)
        } else if k < 2 * a + b {
            ((right - d - (k - a - b), bottom - d), (right - d - (k - a - b), bottom), Side::Bottom)
        } else {
            let down = bottom - d - (k - 2 * a - b);
            ((d, down), (0, down), Side::Left)
        }
    }
}

/// More of the page's border than this is never a figure's cut.
const MOST_CLOSED: f64 = 0.45;
/// If closing every second stretch encloses less than this of what closing all
/// does, lines inside the figure spoilt the count.
const ALTERNATING: f64 = 0.7;

/// A stretch of the ring, cyclic.
#[derive(Clone, Copy)]
struct Span {
    start: usize,
    length: usize,
}

/// Draws ink along the page's edge where a figure leaves the page. Returns the
/// sides where it was open.
///
/// From the longest stretch between strokes on, which is outside, every second
/// one is inside: so the space between two legs stays open.
pub(crate) fn close(barrier: &mut Bits, stroke_px: f64) -> Vec<Side> {
    let depth = (1.5 * stroke_px).ceil() as usize + 1;
    let (w, h) = (barrier.width, barrier.height);
    if w < 4 * depth + 4 || h < 4 * depth + 4 {
        return Vec::new();
    }
    let ring = Ring { width: w, height: h, depth };
    let n = ring.length();
    let touching = touching(barrier, depth);
    let on_ring: Vec<bool> = (0..n)
        .map(|k| {
            let ((x, y), _, _) = ring.at(k);
            touching.data[y * w + x]
        })
        .collect();
    let mut runs = cyclic_runs(&on_ring);
    runs.retain(|&run| !is_filled(barrier, &ring, run, stroke_px));
    let count = runs.len();
    if count < 2 {
        return Vec::new();
    }
    let bare = |k: usize| {
        let (from, length) = runs[k];
        (runs[(k + 1) % count].0 + n - (from + length) % n) % n
    };
    let longest = (0..count).max_by_key(|&k| (bare(k), k)).unwrap_or(0);
    let span = |step: usize| {
        let k = (longest + step) % count;
        let (start, next) = (runs[k].0, runs[(k + 1) % count]);
        Span { start, length: (next.0 + n - start) % n + next.1 }
    };
    let all: Vec<Span> = (1..count).map(span).collect();
    let alternating: Vec<Span> = (1..count).step_by(2).map(span).collect();
    let mut spans = all;
    if count.is_multiple_of(2) && count > 2 {
        let enclosed = |spans: &[Span]| {
            let mut with = barrier.clone();
            draw(&mut with, &ring, spans);
            crate::raster::filled(&with).count() as f64
        };
        if enclosed(&alternating) >= ALTERNATING * enclosed(&spans) {
            spans = alternating;
        }
    }
    let closed: usize = spans.iter().map(|span| span.length).sum();
    if closed as f64 > MOST_CLOSED * n as f64 {
        return Vec::new();
    }
    let sides = open_sides(barrier, &ring, &spans, stroke_px);
    draw(barrier, &ring, &spans);
    sides
}

/// Whether a run on the ring is part of a filled area: farther in it goes on
/// along most of its length. Lines that leave the page at a flat angle do not.
fn is_filled(barrier: &Bits, ring: &Ring, (start, length): (usize, usize), stroke_px: f64) -> bool {
    if (length as f64) < FILLED * stroke_px + 2.0 {
        return false;
    }
    let deep = (2.0 * stroke_px).ceil() as i64 + 1;
    let goes_on = |k: &usize| {
        let ((x, y), _, side) = ring.at((start + k) % ring.length());
        let (dx, dy) = match side {
            Side::Top => (0, deep),
            Side::Bottom => (0, -deep),
            Side::Left => (deep, 0),
            Side::Right => (-deep, 0),
        };
        barrier.at(x as i64 + dx, y as i64 + dy)
    };
    (0..length).filter(goes_on).count() * 2 > length
}

fn draw(barrier: &mut Bits, ring: &Ring, spans: &[Span]) {
    for span in spans {
        for along in 0..span.length {
            let (_, (x, y), _) = ring.at((span.start + along) % ring.length());
            barrier.data[y * ring.width + x] = true;
        }
        corner(barrier, ring, span.start, span.length);
    }
}

/// The sides along which the figure is open for more than a few strokes.
fn open_sides(barrier: &Bits, ring: &Ring, spans: &[Span], stroke_px: f64) -> Vec<Side> {
    let mut sides = Vec::new();
    for span in spans {
        let mut open = 0;
        for along in 0..span.length {
            let (_, (x, y), side) = ring.at((span.start + along) % ring.length());
            open += usize::from(!near_border(barrier, x, y, side, ring.depth));
            if open as f64 > 3.0 * stroke_px + 2.0 && !sides.contains(&side) {
                sides.push(side);
                open = 0;
            }
        }
    }
    sides
}

/// The border pixels of corners within a span, which the ring does not face.
fn corner(barrier: &mut Bits, ring: &Ring, start: usize, span: usize) {
    let n = ring.length();
    let (w, h) = (ring.width, ring.height);
    let d = ring.depth;
    let [a, b] = ring.sides();
    let corners = [(a, w - 1, 0), (a + b, w - 1, h - 1), (2 * a + b, 0, h - 1), (0, 0, 0)];
    for (k, x, y) in corners {
        if (k + n - start) % n < span {
            for step in 0..=d {
                let along = if x == 0 { step } else { w - 1 - step };
                barrier.data[y * w + along] = true;
                let down = if y == 0 { step } else { h - 1 - step };
                barrier.data[down * w + x] = true;
            }
        }
    }
}

/// Whether a line is drawn between the ring and the border.
fn near_border(barrier: &Bits, x: usize, y: usize, side: Side, depth: usize) -> bool {
    (0..=depth as i64).any(|step| {
        let (x, y) = (x as i64, y as i64);
        match side {
            Side::Top => barrier.at(x, y + step),
            Side::Bottom => barrier.at(x, y - step),
            Side::Left => barrier.at(x + step, y),
            Side::Right => barrier.at(x - step, y),
        }
    })
}

/// Ink within `depth` of the border that is connected to ink on it there.
fn touching(barrier: &Bits, depth: usize) -> Bits {
    let (w, h) = (barrier.width, barrier.height);
    let mut strip = barrier.clone();
    for y in depth + 1..h.saturating_sub(depth + 1) {
        strip.data[y * w + depth + 1..(y + 1) * w - depth - 1].fill(false);
    }
    let parts = strip.components(true);
    let on_border = |k: usize| {
        let b = parts.parts[k].bounds;
        b.left < 1 || b.top < 1 || b.right as usize > w - 1 || b.bottom as usize > h - 1
    };
    parts.select(w, on_border)
}

/// Starts and lengths of the runs of a cyclic sequence.
fn cyclic_runs(values: &[bool]) -> Vec<(usize, usize)> {
    let n = values.len();
    let Some(first) = values.iter().position(|is| !is) else { return Vec::new() };
    let mut runs: Vec<(usize, usize)> = Vec::new();
    let mut before = false;
    for k in 0..n {
        let at = (first + k) % n;
        if values[at] {
            match runs.last_mut() {
                Some(run) if before => run.1 += 1,
                _ => runs.push((at, 1)),
            }
        }
        before = values[at];
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_legs_that_leave_the_page_are_closed_apart() {
        let mut ink = Bits::filled(120, 100, false);
        for y in 20..100 {
            for x in [30, 31, 50, 51, 60, 61, 80, 81] {
                if y > 50 || !(45..=65).contains(&x) {
                    ink.set(x, y, true);
                }
            }
        }
        (30..=81).for_each(|x| [20, 21].iter().for_each(|&y| ink.set(x, y, true)));
        (50..=61).for_each(|x| [50, 51].iter().for_each(|&y| ink.set(x, y, true)));
        assert_eq!(close(&mut ink, 2.0), [Side::Bottom]);
        let inside = crate::raster::filled(&ink);
        assert!(inside.at(40, 90) && inside.at(70, 90) && inside.at(40, 40));
        assert!(!inside.at(55, 90) && !inside.at(10, 90));
    }

    #[test]
    fn a_figure_that_stands_on_the_edge_is_not_cut() {
        let mut ink = Bits::filled(120, 100, false);
        for k in 0..40 {
            for (x, y) in [
                (40 + k, 99),
                (40 + k, 98),
                (40, 60 + k),
                (41, 60 + k),
                (79, 60 + k),
                (78, 60 + k),
                (40 + k, 60),
                (40 + k, 61),
            ] {
                ink.set(x, y, true);
            }
        }
        assert!(close(&mut ink, 2.0).is_empty());
    }
}
