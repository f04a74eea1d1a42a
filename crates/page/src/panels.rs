//! Frames around drawings: rectangles of lines that hold something with paper
//! about it.

use subject::raster::{Bits, Components};
use subject::{Box2, Marks};

/// A frame's sides, share of the page's longer side.
const LEAST_SIDE: f64 = 0.06;
/// The share of a side along which the line is there.
const DRAWN: f64 = 0.93;
/// How far the line may stray from straight, share of the frame's size.
const STRAY: f64 = 0.012;
/// Lines are at most this thick, share of the frame's size.
const THICKEST: f64 = 0.03;
/// What a frame holds is at least this share of its height.
const HELD: f64 = 0.25;
/// Paper between the frame and what it holds, share of its size.
const MARGIN: f64 = 0.015;
/// A frame about the whole page has sides of this share of the page's.
const PAGE: f64 = 0.75;
/// Frames in frames.
const ROUNDS: usize = 3;

/// Removes frames from `marks`; their bounds, working px.
pub(crate) fn remove(marks: &mut Marks) -> Vec<Box2> {
    let mut found = Vec::new();
    for _ in 0..ROUNDS {
        let parts = marks.lines.components(true);
        let page = marks.lines.width.max(marks.lines.height) as f64;
        let mut gone = Bits::filled(marks.lines.width, marks.lines.height, false);
        let mut any = false;
        for (index, part) in parts.parts.iter().enumerate() {
            let bounds = part.bounds;
            let least = (LEAST_SIDE * page).max(24.0);
            if f64::from(bounds.width().min(bounds.height())) < least {
                continue;
            }
            let label = index as u32 + 1;
            let ring = Ring::of(&parts, label, bounds, marks.lines.width);
            let is_frame = |ring: &Ring| {
                found.iter().any(|other| is_level_with(&bounds, other))
                    || holds_a_drawing(&marks.lines, &parts, label, ring)
            };
            if ring.is_drawn() && is_frame(&ring) {
                ring.erase(&mut gone);
                found.push(bounds);
                any = true;
            }
        }
        if !any {
            break;
        }
        marks.clear(&gone);
    }
    found
}

/// Whether two rectangles have the same top and bottom, as panels in a row do.
fn is_level_with(a: &Box2, b: &Box2) -> bool {
    let near = 2 + a.height() / 50;
    a.top.abs_diff(b.top) <= near && a.bottom.abs_diff(b.bottom) <= near
}

/// Runs of one part that begin at the sides of its bounds, one a row or column.
struct Ring {
    bounds: Box2,
    /// Left, right, top, bottom: where each run begins and how long it is.
    sides: [Vec<Option<(usize, usize)>>; 4],
    thickness: [usize; 4],
}

impl Ring {
    fn of(parts: &Components, label: u32, bounds: Box2, width: usize) -> Self {
        let size = f64::from(bounds.width().max(bounds.height()));
        let stray = (STRAY * size).max(3.0) as usize;
        let (w, h) = (bounds.width() as usize, bounds.height() as usize);
        let is = |x: usize, y: usize| {
            let (x, y) = (bounds.left as usize + x, bounds.top as usize + y);
            parts.labels[y * width + x] == label
        };
        let run = |along: usize, count: usize, at: &dyn Fn(usize, usize) -> bool| {
            let from = (0..stray.min(count)).find(|&d| at(along, d))?;
            Some((from, (from..count).take_while(|&d| at(along, d)).count()))
        };
        let sides = [
            (0..h).map(|y| run(y, w, &|y, d| is(d, y))).collect::<Vec<_>>(),
            (0..h).map(|y| run(y, w, &|y, d| is(w - 1 - d, y))).collect(),
            (0..w).map(|x| run(x, h, &|x, d| is(x, d))).collect(),
            (0..w).map(|x| run(x, h, &|x, d| is(x, h - 1 - d))).collect(),
        ];
        let thickness = std::array::from_fn(|k: usize| {
            let mut long: Vec<usize> = sides[k].iter().flatten().map(|run| run.1).collect();
            long.sort_unstable();
            long.get(long.len() / 2).copied().unwrap_or(0)
        });
        Self { bounds, sides, thickness }
    }

    fn size(&self) -> f64 {
        f64::from(self.bounds.width().max(self.bounds.height()))
    }

    fn is_drawn(&self) -> bool {
        let drawn = |side: &Vec<Option<(usize, usize)>>| {
            side.iter().flatten().count() as f64 >= DRAWN * side.len() as f64
        };
        let thickest = (THICKEST * self.size()).max(4.0) as usize;
        self.sides.iter().all(drawn) && self.thickness.iter().all(|px| *px <= thickest)
    }

    /// The rectangle within the lines.
    fn inner(&self) -> Option<Box2> {
        let inset = (STRAY * self.size()).max(3.0) as u32 + 1;
        let by = self.thickness.map(|px| px as u32 + inset);
        let b = self.bounds;
        let inner = Box2 {
            left: b.left + by[0],
            right: b.right.saturating_sub(by[1]),
            top: b.top + by[2],
            bottom: b.bottom.saturating_sub(by[3]),
        };
        (inner.left < inner.right && inner.top < inner.bottom).then_some(inner)
    }

    fn erase(&self, gone: &mut Bits) {
        let (w, h) = (self.bounds.width() as i64, self.bounds.height() as i64);
        let (left, top) = (i64::from(self.bounds.left), i64::from(self.bounds.top));
        for (k, side) in self.sides.iter().enumerate() {
            let usual = self.thickness[k];
            for (along, run) in side.iter().enumerate() {
                let Some((from, long)) = *run else { continue };
                // Where something meets the line only the line goes.
                let long = if long > usual + 2 { usual } else { long };
                for d in from as i64..(from + long) as i64 {
                    let along = along as i64;
                    let (x, y) =
                        [(d, along), (w - 1 - d, along), (along, d), (along, h - 1 - d)][k];
                    gone.set(left + x, top + y, true);
                }
            }
        }
    }
}

/// Whether things that do not touch the frame fill a good part of it and paper
/// is around them.
fn holds_a_drawing(lines: &Bits, parts: &Components, label: u32, ring: &Ring) -> bool {
    let Some(inner) = ring.inner() else { return false };
    let (w, h) = (f64::from(ring.bounds.width()), f64::from(ring.bounds.height()));
    if w >= PAGE * lines.width as f64 && h >= PAGE * lines.height as f64 {
        // Guides may join what is in it to a frame about the whole page.
        let row = |y: u32| &lines.row(y as usize)[inner.left as usize..inner.right as usize];
        return (inner.top..inner.bottom).any(|y| row(y).contains(&true));
    }
    let mut held: Option<Box2> = None;
    for y in inner.top..inner.bottom {
        for x in inner.left..inner.right {
            let at = y as usize * lines.width + x as usize;
            if parts.labels[at] != 0 && parts.labels[at] != label {
                let pixel = Box2 { left: x, top: y, right: x + 1, bottom: y + 1 };
                held = Some(held.map_or(pixel, |all| all.joined(&pixel)));
            }
        }
    }
    let Some(held) = held else { return false };
    let margin = (MARGIN * ring.size()) as u32;
    let clear = [
        held.left >= inner.left + margin,
        held.right + margin <= inner.right,
        held.top >= inner.top + margin,
        held.bottom + margin <= inner.bottom,
    ];
    let clear = clear.iter().filter(|is| **is).count();
    f64::from(held.height()) >= HELD * f64::from(ring.bounds.height()) && clear >= 3
}
