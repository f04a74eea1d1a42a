//! Each view of a page as a picture of its own, and the sheet that they make.

use image::{Rgba, RgbaImage};
use sheet::{SheetDocument, ViewDocument};
use subject::Box2;
use subject::raster::Bits;

use crate::blobs::LETTERS;
use crate::proposal::{FIRST, NOBODY, PageProposal};

/// Paper left about a view, share of its height.
const MARGIN: f64 = 0.08;
/// What is not of the view goes with the blur about it, working px.
const BLUR: f32 = 2.0;
/// A speck beside a view is at most so high and wide, share of the view's height.
const SPECK: f64 = 0.04;
/// What differs from the paper by more is drawn, levels.
const DRAWN: f32 = 40.0;

/// What [`cut_out`] and [`cut_box`] cut: the box with a margin, on a page of
/// this width and height.
pub fn with_margin(place: &Box2, (width, height): (u32, u32)) -> Box2 {
    let margin = (MARGIN * f64::from(place.height())).ceil().max(4.0) as u32;
    Box2 {
        left: place.left.saturating_sub(margin),
        top: place.top.saturating_sub(margin),
        right: place.right.saturating_add(margin).min(width),
        bottom: place.bottom.saturating_add(margin).min(height),
    }
}

/// What is drawn in `place`, a box by hand, with paper about it whatever is
/// drawn there. It has the size of [`with_margin`].
///
/// # Panics
/// If the box lies outside of the page or the proposal is of another page.
pub fn cut_box(page: &RgbaImage, proposal: &PageProposal, place: &Box2) -> RgbaImage {
    assert_eq!(page.dimensions(), (proposal.width, proposal.height), "the page searched");
    let around = with_margin(place, page.dimensions());
    let (columns, rows) = (place.left..place.right, place.top..place.bottom);
    let mut cut = RgbaImage::new(around.width(), around.height());
    for y in around.top..around.bottom {
        let paper = proposal.field.row(y as usize);
        for x in around.left..around.right {
            let pixel = if rows.contains(&y) && columns.contains(&x) {
                *page.get_pixel(x, y)
            } else {
                bare(proposal, paper.at(x as usize))
            };
            cut.put_pixel(x - around.left, y - around.top, pixel);
        }
    }
    cut
}

/// Paper of this colour where nothing is drawn.
fn bare(proposal: &PageProposal, colour: [f32; 3]) -> Rgba<u8> {
    let [r, g, b] = colour.map(|level| level.round() as u8);
    Rgba([r, g, b, if proposal.is_clear { 0 } else { 255 }])
}

/// The view `index` of `page` with paper about it. What else is drawn there is
/// painted over with paper; guides that go through it are rubbed out, for a
/// search of the cut-out alone sees too little of them to tell them from it.
///
/// # Panics
/// If the proposal has no such view or is of a page of another size.
pub fn cut_out(page: &RgbaImage, proposal: &PageProposal, index: usize) -> RgbaImage {
    assert_eq!(page.dimensions(), (proposal.width, proposal.height), "the page searched");
    let Box2 { left, top, right, bottom } =
        with_margin(&proposal.figures[index].place, page.dimensions());
    let mut cut = image::imageops::crop_imm(page, left, top, right - left, bottom - top).to_image();
    let factor = proposal.factor as u32;
    let from = [left / factor, top / factor];
    let foreign = foreign(proposal, index, from, [right.div_ceil(factor), bottom.div_ceil(factor)]);
    for y in 0..cut.height() {
        let v = (top + y) / factor - from[1];
        if !foreign.row(v as usize).contains(&true) {
            continue;
        }
        let paper = proposal.field.row((top + y) as usize);
        for x in 0..cut.width() {
            if foreign.at(i64::from((left + x) / factor - from[0]), i64::from(v)) {
                cut.put_pixel(x, y, bare(proposal, paper.at((left + x) as usize)));
            }
        }
    }
    let at = |x: u32| i64::from(x / factor);
    rub_out(&mut cut, |x, y| proposal.rubbed.at(at(left + x), at(top + y)));
    let place = &proposal.figures[index].place;
    for (x, y) in specks(&cut, proposal, place, [left, top]) {
        let paper = proposal.field.row((top + y) as usize);
        cut.put_pixel(x, y, bare(proposal, paper.at((left + x) as usize)));
    }
    cut
}

/// Where `ruled` lines are rubbed out, but for the strokes and edges that are `kept`.
pub(crate) fn rubbed(ruled: &Bits, kept: &Bits) -> Bits {
    ruled.dilated(BLUR).and_not(kept)
}

/// Gives pixels the colour between those on either side of them, across the narrower way.
fn rub_out(cut: &mut RgbaImage, is: impl Fn(u32, u32) -> bool) {
    let before = cut.clone();
    let (w, h) = before.dimensions();
    // The nearest pixel that stays, within `most`, with how far it is.
    let kept = |x: u32, y: u32, (dx, dy): (i64, i64), most: i64| {
        (1..=most).find_map(|far| {
            let u = u32::try_from(i64::from(x) + far * dx).ok().filter(|u| *u < w)?;
            let v = u32::try_from(i64::from(y) + far * dy).ok().filter(|v| *v < h)?;
            (!is(u, v)).then(|| (far, *before.get_pixel(u, v)))
        })
    };
    let across = |x: u32, y: u32, way: (i64, i64), most: i64| {
        Some((kept(x, y, way, most)?, kept(x, y, (-way.0, -way.1), most)?))
    };
    for (x, y, pixel) in cut.enumerate_pixels_mut().filter(|(x, y, _)| is(*x, *y)) {
        let down = across(x, y, (0, 1), i64::from(h));
        let most = down.map_or(i64::from(w), |((a, _), (b, _))| a + b - 1);
        let ends = across(x, y, (1, 0), most).or(down);
        if let Some(((a, one), (b, other))) = ends {
            let share = a as f32 / (a + b) as f32;
            let between = |one: u8, other: u8| {
                (f32::from(one) * (1.0 - share) + f32::from(other) * share).round() as u8
            };
            *pixel = Rgba(std::array::from_fn(|c| between(one.0[c], other.0[c])));
        } else if let Some((_, nearest)) = [(0, 1), (0, -1), (1, 0), (-1, 0)]
            .into_iter()
            .filter_map(|way| kept(x, y, way, i64::from(w.max(h))))
            .min_by_key(|(far, _)| *far)
        {
            *pixel = nearest;
        }
    }
}

/// Pixels of specks in the margin, with the blur about them: too small to have
/// been taken for anything, such as the degree sign of a caption, and no part of
/// a line that goes on.
fn specks(
    cut: &RgbaImage,
    proposal: &PageProposal,
    place: &Box2,
    [left, top]: [u32; 2],
) -> Vec<(u32, u32)> {
    let (w, h) = (cut.width() as usize, cut.height() as usize);
    let mut drawn = Bits::filled(w, h, false);
    for (y, row) in drawn.data.chunks_exact_mut(w).enumerate() {
        let paper = proposal.field.row(top as usize + y);
        for (x, drawn) in row.iter_mut().enumerate() {
            let pixel = cut.get_pixel(x as u32, y as u32).0;
            let bare = paper.at(left as usize + x);
            let apart = (0..3).any(|c| (f32::from(pixel[c]) - bare[c]).abs() > DRAWN);
            *drawn = pixel[3] > 32 && (proposal.is_clear || apart);
        }
    }
    let most = (SPECK * f64::from(place.height())).max(3.0) as u32;
    let parts = drawn.components(true);
    let small = parts.select(w, |k| {
        let Box2 { left: l, top: t, right: r, bottom: b } = parts.parts[k].bounds;
        let outside = l + left >= place.right
            || r + left <= place.left
            || t + top >= place.bottom
            || b + top <= place.top;
        let ends = l == 0 || t == 0 || r as usize == w || b as usize == h;
        outside && !ends && (r - l).max(b - t) <= most
    });
    if !small.data.contains(&true) {
        return Vec::new();
    }
    let around = small.dilated(BLUR).and_not(&drawn.and_not(&small));
    let set = around.data.iter().enumerate().filter(|(_, is)| **is);
    set.map(|(k, _)| ((k % w) as u32, (k / w) as u32)).collect()
}

/// Working pixels that others own, with the blur about them, but for those
/// next to the view's own.
fn foreign(
    proposal: &PageProposal,
    index: usize,
    [left, top]: [u32; 2],
    [right, bottom]: [u32; 2],
) -> Bits {
    let (w, h) = ((right - left) as usize, (bottom - top) as usize);
    let mut own = Bits::filled(w, h, false);
    let mut other = own.clone();
    let place = &proposal.figures[index].place;
    let factor = proposal.factor as u32;
    let within = |x: u32, y: u32| {
        (place.left / factor..place.right.div_ceil(factor)).contains(&x)
            && (place.top / factor..place.bottom.div_ceil(factor)).contains(&y)
    };
    for y in 0..h {
        for x in 0..w {
            let (u, v) = (x + left as usize, y + top as usize);
            let owner = proposal.owners.data[v * proposal.owners.width + u];
            own.data[y * w + x] = owner == FIRST + index as u16;
            // Within the view small marks in a row may be its own pattern.
            let pattern = owner == LETTERS && within(u as u32, v as u32);
            let drawn = owner != NOBODY && owner != FIRST + index as u16;
            other.data[y * w + x] = drawn && !pattern;
        }
    }
    other.dilated(BLUR).and_not(&own.dilated(BLUR / 2.0))
}

/// The sheet of the proposed views; `names` are those of the cut-outs, in order.
pub fn sheet_document(proposals: &[PageProposal], names: &[String]) -> SheetDocument {
    let figures = proposals.iter().flat_map(|proposal| &proposal.figures);
    let view = |(figure, name): (&crate::Figure, &String)| ViewDocument {
        image: name.clone(),
        azimuth_deg: figure.azimuth.degrees(),
        azimuth_confidence: figure.guessed(),
        ..ViewDocument::default()
    };
    SheetDocument { views: figures.zip(names).map(view).collect(), ..SheetDocument::default() }
}
