//! Connected parts of ink and colour, joined to drawings.

use subject::raster::{Bits, Component, Components, Raster, filled};
use subject::{Box2, Marks, mosaic};

use crate::letters;

/// Parts smaller than this are dirt, share of the figures' height.
const SPECK: f64 = 0.012;
/// Parts at least this tall are drawings of their own.
const OWN: f64 = 0.3;
/// Small parts up to this far from a drawing are of it, share of its height.
const NEAR: f64 = 0.05;
/// Parts up to half its height are of it if they are this near.
const VERY_NEAR: f64 = 0.025;
/// Small parts this near each other are one drawing.
const TOGETHER: f64 = 0.025;
/// Drawings above each other are one if the gap is no wider.
const STACKED: f64 = 0.015;
/// Two drawings of at least this share of the figures' height are two.
const WHOLE: f64 = 0.8;
/// So much of a box that lies in another is of the same drawing if the gap is no wider.
const WITHIN: f64 = 0.9;
const CUT_OFF: f64 = 0.03;
const ROUNDS: usize = 5;
/// Pieces of one figure are no further apart, share of the page's longer side.
const PIECES_APART: f64 = 0.01;

/// A drawing: parts that belong together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Blob {
    pub(crate) bounds: Box2,
    pub(crate) area: usize,
}

/// The drawings on a page, working px.
#[derive(Clone, Debug)]
pub(crate) struct Blobs {
    /// Per pixel 0, or one more than its drawing's index.
    pub(crate) owners: Raster<u16>,
    pub(crate) list: Vec<Blob>,
    /// The bounds of words.
    pub(crate) words: Vec<Box2>,
}

/// The owner of letters' pixels.
pub(crate) const LETTERS: u16 = u16::MAX;
/// More drawings are not told apart: the smallest are dirt.
const MOST: usize = 4000;

/// What lines and areas enclose; paper gets in wherever they do not touch, so
/// that figures next to each other stay apart.
pub(crate) fn inside(marks: &Marks) -> Bits {
    let drawn = marks.lines.clone().or(&marks.areas);
    let reach = PIECES_APART * drawn.width.max(drawn.height) as f64;
    let mosaics = mosaic::figures(&drawn, reach);
    drawn.or(&mosaics).not().reached_from_border().not()
}

/// The height of the largest part that is no mere line, px.
pub(crate) fn largest(parts: &[Component]) -> f64 {
    let is_line = |part: &Component| {
        let (w, h) = (part.bounds.width(), part.bounds.height());
        w * 40 < h || h * 40 < w
    };
    let size = |b: &Box2| f64::from(b.height()).max(0.4 * f64::from(b.width()));
    parts.iter().filter(|part| !is_line(part)).map(|p| size(&p.bounds)).fold(1.0, f64::max)
}

impl Blobs {
    /// Joins the parts of `inside`; `size` is the figures' height, px.
    pub(crate) fn of(inside: &Bits, size: f64) -> Self {
        let parts = inside.components(true);
        let lettering = letters::find(&parts.parts, size);
        let count = parts.parts.len();
        let tall = |k: usize| f64::from(parts.parts[k].bounds.height());
        let side = |k: usize| tall(k).max(f64::from(parts.parts[k].bounds.width()));
        let speck = (SPECK * size).max(2.0);
        let mut drawing: Vec<Option<usize>> = vec![None; count];
        let mut list: Vec<Blob> = Vec::new();
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by_key(|&k| (std::cmp::Reverse(parts.parts[k].area), k));
        for &k in order.iter().take(MOST) {
            if tall(k) >= OWN * size && !lettering.is_letter[k] {
                drawing[k] = Some(list.len());
                list.push(Blob { bounds: parts.parts[k].bounds, area: parts.parts[k].area });
            }
        }
        absorb_islands(&parts, inside.width, &mut drawing, &mut list);
        let absorb = |drawing: &mut [Option<usize>], list: &mut [Blob]| {
            absorb_near(&parts, inside.width, &lettering.is_letter, drawing, list, size);
        };
        absorb(&mut drawing, &mut list);
        if join_stacked(&parts.labels, inside.width, &mut drawing, &mut list, size) {
            // What a guide cut off below may now lie beside its drawing.
            absorb(&mut drawing, &mut list);
        }
        // What is left makes drawings of its own where it is close together.
        let is_left = |k: usize| drawing[k].is_none() && !lettering.is_letter[k] && side(k) > speck;
        let left = parts.select(inside.width, is_left);
        let reach = (TOGETHER * size / 2.0).max(1.0) as f32;
        let joined = left.dilated(reach).components(true);
        let mut own: Vec<Option<usize>> = vec![None; joined.parts.len()];
        for (at, &label) in parts.labels.iter().enumerate() {
            if label == 0 || !left.data[at] || list.len() >= MOST {
                continue;
            }
            let k = label as usize - 1;
            if drawing[k].is_some() {
                continue;
            }
            let to = *own[joined.labels[at] as usize - 1].get_or_insert_with(|| {
                list.push(Blob { bounds: parts.parts[k].bounds, area: 0 });
                list.len() - 1
            });
            list[to].bounds = list[to].bounds.joined(&parts.parts[k].bounds);
            list[to].area += parts.parts[k].area;
            drawing[k] = Some(to);
        }
        let owner = |label: &u32| match label.checked_sub(1).map(|k| k as usize) {
            None => 0,
            Some(k) if lettering.is_letter[k] => LETTERS,
            Some(k) => drawing[k].map_or(0, |to| to as u16 + 1),
        };
        let data = parts.labels.iter().map(owner).collect();
        let owners = Raster { width: inside.width, height: inside.height, data };
        Self { owners, list, words: lettering.words }
    }

    /// The pixels of a drawing within its bounds and `pad` bare ones about it.
    pub(crate) fn pixels(&self, index: usize, pad: usize) -> Bits {
        let (values, width) = (&self.owners.data, self.owners.width);
        pixels(values, width, index as u16 + 1, &self.list[index].bounds, pad)
    }
}

/// The pixels of `value` within `bounds`, with `pad` bare ones about them.
///
/// * `width`: pixels a row of `values`.
fn pixels<T: PartialEq>(values: &[T], width: usize, value: T, bounds: &Box2, pad: usize) -> Bits {
    let (w, h) = (bounds.width() as usize, bounds.height() as usize);
    let mut bits = Bits::filled(w + 2 * pad, h + 2 * pad, false);
    for y in 0..h {
        let from = (y + bounds.top as usize) * width + bounds.left as usize;
        let to = (y + pad) * bits.width + pad;
        let row = values[from..from + w].iter().map(|other| *other == value);
        bits.data[to..to + w].iter_mut().zip(row).for_each(|(bit, is)| *bit = is);
    }
    bits
}

/// Gives small parts that are near a drawing to it.
///
/// * `is_letter`: which parts are of no drawing.
fn absorb_near(
    parts: &Components,
    width: usize,
    is_letter: &[bool],
    drawing: &mut [Option<usize>],
    list: &mut [Blob],
    size: f64,
) {
    let reach = (NEAR * size).ceil() as u16;
    for _ in 0..ROUNDS {
        let near = nearest(&parts.labels, width, drawing, reach);
        let mut changed = false;
        for k in 0..parts.parts.len() {
            if drawing[k].is_some() || is_letter[k] {
                continue;
            }
            let Some((gap, to)) = near[k] else { continue };
            if belongs(&parts.parts[k], &list[to], f64::from(gap)) {
                drawing[k] = Some(to);
                list[to].bounds = list[to].bounds.joined(&parts.parts[k].bounds);
                list[to].area += parts.parts[k].area;
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
}

/// Joins drawings above each other, and one within the other, that nearly touch: one whose outline
/// is open falls apart at its gaps. Whether any were.
fn join_stacked(
    labels: &[u32],
    width: usize,
    drawing: &mut [Option<usize>],
    list: &mut Vec<Blob>,
    size: f64,
) -> bool {
    let reach = (STACKED * size).max(3.0) as usize;
    let of = |at: usize| labels[at].checked_sub(1).and_then(|k| drawing[k as usize]);
    // Pairs that are above each other.
    let mut pairs: std::collections::BTreeSet<(usize, usize, Joined)> = Default::default();
    for x in 0..width {
        // The last drawing met down the column, and where it ended.
        let mut last: Option<(usize, usize)> = None;
        for y in 0..labels.len() / width {
            let Some(own) = of(y * width + x) else { continue };
            if let Some((other, end)) = last
                && other != own
                && y - end <= reach
            {
                pairs.insert((other.min(own), other.max(own), Joined::Stacked));
            }
            last = Some((own, y));
        }
    }
    let within = (CUT_OFF * size).max(3.0) as u16;
    let beside = beside(labels, width, drawing, within);
    pairs.extend(beside.into_iter().map(|(a, b)| (a, b, Joined::Within)));
    let mut to: Vec<usize> = (0..list.len()).collect();
    for (a, b, joined) in pairs {
        let (a, b) = (to[a], to[b]);
        let (one, other) = (&list[a].bounds, &list[b].bounds);
        let is_one = match joined {
            Joined::Stacked => is_stacked(one, other, size),
            Joined::Within => is_within(one, other, size),
        };
        if a != b && is_one {
            list[a].bounds = list[a].bounds.joined(&list[b].bounds);
            list[a].area += list[b].area;
            to.iter_mut().filter(|own| **own == b).for_each(|own| *own = a);
        }
    }
    // Those that were joined to others leave no holes in the list.
    let kept: Vec<usize> = (0..list.len()).filter(|&k| to[k] == k).collect();
    let place = |k: usize| kept.binary_search(&to[k]).expect("a drawing that was kept");
    drawing.iter_mut().flatten().for_each(|own| *own = place(*own));
    let any = kept.len() < list.len();
    *list = kept.iter().map(|&k| list[k]).collect();
    any
}

/// How two drawings may be one.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Joined {
    Stacked,
    Within,
}

/// Pairs of drawings at most `gap` px apart, counted as a king moves; a gap of one more may pass.
fn beside(
    labels: &[u32],
    width: usize,
    drawing: &[Option<usize>],
    gap: u16,
) -> std::collections::BTreeSet<(usize, usize)> {
    let mut near: Vec<Option<(usize, u16)>> =
        labels.iter().map(|label| Some((drawing[label.checked_sub(1)? as usize]?, 0))).collect();
    let mut front: Vec<usize> = (0..near.len()).filter(|&at| near[at].is_some()).collect();
    let mut pairs = std::collections::BTreeSet::new();
    let height = labels.len() / width.max(1);
    // Drawings grow until they meet halfway.
    for _ in 0..=gap.div_ceil(2) {
        let mut next = Vec::new();
        for at in front {
            let (own, far) = near[at].expect("only what is near is in front");
            let (x, y) = (at % width, at / width);
            for v in y.saturating_sub(1)..(y + 2).min(height) {
                for u in x.saturating_sub(1)..(x + 2).min(width) {
                    match &mut near[v * width + u] {
                        Some((other, beyond)) if *other != own => {
                            if far + *beyond <= gap {
                                pairs.insert((own.min(*other), own.max(*other)));
                            }
                        }
                        Some(_) => {}
                        free => {
                            *free = Some((own, far + 1));
                            next.push(v * width + u);
                        }
                    }
                }
            }
        }
        front = next;
    }
    pairs
}

/// Whether one box is above the other, most of the narrower one's width shared.
fn is_stacked(a: &Box2, b: &Box2, size: f64) -> bool {
    let shared = f64::from(a.right.min(b.right)) - f64::from(a.left.max(b.left));
    let narrow = f64::from(a.width().min(b.width()));
    let beside = f64::from(a.bottom.min(b.bottom)) - f64::from(a.top.max(b.top));
    let low = f64::from(a.height().min(b.height()));
    // Two whole figures in rows that nearly touch are no pair of halves.
    let whole = f64::from(a.height().min(b.height())) >= WHOLE * size;
    shared >= 0.7 * narrow && beside <= 0.5 * low && !whole
}

/// Whether one box is nearly all in the other and no whole figure: what a guide that was removed cut
/// off from the rest of its drawing.
fn is_within(a: &Box2, b: &Box2, size: f64) -> bool {
    let area = |b: &Box2| f64::from(b.width()) * f64::from(b.height());
    let (small, large) = if area(a) <= area(b) { (a, b) } else { (b, a) };
    let side = |low: u32, high: u32| f64::from(high.saturating_sub(low));
    let shared = side(small.left.max(large.left), small.right.min(large.right))
        * side(small.top.max(large.top), small.bottom.min(large.bottom));
    shared >= WITHIN * area(small) && f64::from(small.height()) < WHOLE * size
}

/// Parts within what a drawing encloses once its smallest openings are shut
/// are of that drawing.
fn absorb_islands(
    parts: &Components,
    width: usize,
    drawing: &mut [Option<usize>],
    list: &mut [Blob],
) {
    const PAD: usize = 3;
    for k in 0..drawing.len() {
        let Some(to) = drawing[k] else { continue };
        let bounds = parts.parts[k].bounds;
        let (w, h) = (bounds.width() as usize, bounds.height() as usize);
        let at = |x: usize, y: usize| (y + bounds.top as usize) * width + x + bounds.left as usize;
        let enclosed = filled(&pixels(&parts.labels, width, k as u32 + 1, &bounds, PAD));
        for y in 0..h {
            for x in 0..w {
                let label = parts.labels[at(x, y)] as usize;
                let inside = enclosed.data[(y + PAD) * (w + 2 * PAD) + x + PAD];
                if label != 0 && label != k + 1 && inside && drawing[label - 1].is_none() {
                    drawing[label - 1] = Some(to);
                    list[to].area += parts.parts[label - 1].area;
                }
            }
        }
    }
}

/// Whether a part `gap` px from a drawing is of it.
fn belongs(part: &Component, blob: &Blob, gap: f64) -> bool {
    let (tall, size) = (f64::from(part.bounds.height()), f64::from(blob.bounds.height()));
    // What is below the feet is a shadow, a caption or the next row.
    if f64::from(part.bounds.top) >= f64::from(blob.bounds.bottom) - 0.01 * size {
        return false;
    }
    let reach = if tall < OWN * size { NEAR } else { VERY_NEAR };
    tall < 0.5 * size && f64::from(part.bounds.width()) < 0.7 * size && gap <= reach * size
}

/// Per part without a drawing the nearest drawing within `reach` px (counted
/// as a king moves) and the gap.
fn nearest(
    labels: &[u32],
    width: usize,
    drawing: &[Option<usize>],
    reach: u16,
) -> Vec<Option<(u16, usize)>> {
    let mut near: Vec<Option<(u16, usize)>> = vec![None; drawing.len()];
    let mut seen = vec![false; labels.len()];
    let mut front: Vec<(usize, usize)> = Vec::new();
    for (at, &label) in labels.iter().enumerate() {
        if let Some(to) = label.checked_sub(1).and_then(|k| drawing[k as usize]) {
            seen[at] = true;
            front.push((at, to));
        }
    }
    let height = labels.len() / width.max(1);
    for gap in 1..=reach {
        let mut next = Vec::new();
        for &(at, to) in &front {
            let (x, y) = (at % width, at / width);
            for v in y.saturating_sub(1)..(y + 2).min(height) {
                for u in x.saturating_sub(1)..(x + 2).min(width) {
                    let beside = v * width + u;
                    if seen[beside] {
                        continue;
                    }
                    seen[beside] = true;
                    if labels[beside] != 0 {
                        near[labels[beside] as usize - 1].get_or_insert((gap, to));
                    }
                    next.push((beside, to));
                }
            }
        }
        front = next;
    }
    near
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_leg_that_a_guide_cut_off_sideways_is_of_its_body_and_a_prop_further_off_is_not() {
        let drawings = |leg: i64| {
            let mut bits = Bits::filled(400, 260, false);
            let mut block = |x0: i64, y0: i64, x1: i64, y1: i64| {
                (y0..y1).for_each(|y| (x0..x1).for_each(|x| bits.set(x, y, true)));
            };
            block(50, 20, 350, 120);
            block(106, 120, 140, 150);
            block(300, 120, 310, 220);
            // Beside the thigh's end, not below it.
            block(leg - 6, 153, leg, 219);
            Blobs::of(&bits, 200.0).list.len()
        };
        assert_eq!(drawings(102), 1);
        assert_eq!(drawings(86), 2);
    }
}
