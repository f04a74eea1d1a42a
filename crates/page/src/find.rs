//! The search of a page: marks, frames, drawings, views, azimuths.

use frames::Azimuth;
use image::{GrayImage, RgbaImage};
use progress::{Observer, Stage, Steps};
use rayon::prelude::*;
use subject::raster::{Bits, Raster};
use subject::{Box2, CleanOptions, Marks, Point, SubjectOptions, enclosed, median};

use crate::azimuths::{self, Guess};
use crate::blobs::{self, Blobs, LETTERS};
use crate::error::PageError;
use crate::layouts;
use crate::options::PageOptions;
use crate::outline::TOLERANCE;
use crate::proposal::{FIRST, Figure, LEFT, LeftOut, LeftOutKind, NOBODY, PageProposal};
use crate::select::{self, Selected};
use crate::shape::Shape;
use crate::{cut_out, joins, outline, panels, small};

/// Bare pixels about a figure while its outline is closed.
const PAD: usize = 4;
/// If the figures' height turns out to differ by more, drawings are joined anew.
const SAME_HEIGHT: f64 = 0.25;

/// A page, its figures without azimuths.
struct Found {
    proposal: PageProposal,
    shapes: Vec<Shape>,
}

/// Finds the views of a subject on `page`, 8-bit sRGB with alpha, and guesses
/// their azimuths.
///
/// Figures are looked for on a copy reduced as
/// [`PageOptions::working_side_px`] says; memory is a few bytes a pixel of the page.
/// The same input gives the same output.
///
/// # Errors
/// [`PageError`] if the page has no pixels, no figure or too many, or `observer`
/// wants to stop.
pub fn propose(
    page: &RgbaImage,
    options: &PageOptions,
    observer: &dyn Observer,
) -> Result<PageProposal, PageError> {
    let Found { mut proposal, shapes } = found(page, options, observer)?;
    let count = shapes.len();
    if let Some(guess) = azimuths::guess(&shapes, &layouts::on_page(count)) {
        settle(proposal.figures.iter_mut().collect(), &guess);
        proposal.confidence = guess.whole;
    }
    Ok(proposal)
}

/// Finds one view in each of several pictures that are a turn in even steps,
/// such as the frames of an animation: a proposal each, of one figure.
///
/// # Errors
/// As [`propose`], of the picture to blame; every one must have a figure.
pub fn propose_turn(
    pictures: &[RgbaImage],
    options: &PageOptions,
    observer: &dyn Observer,
) -> Result<Vec<PageProposal>, PageError> {
    if pictures.len() > options.max_figures {
        let (found, limit) = (pictures.len(), options.max_figures);
        return Err(PageError::TooManyFigures { found, limit });
    }
    let mut proposals = Vec::new();
    let mut shapes = Vec::new();
    for (number, picture) in pictures.iter().enumerate() {
        let found = found(picture, options, observer).map_err(|error| match error {
            PageError::Cancelled => error,
            error => PageError::InPicture { number, error: Box::new(error) },
        });
        let Found { mut proposal, shapes: own } = found?;
        let area =
            |figure: &Figure| u64::from(figure.place.width()) * u64::from(figure.place.height());
        let main = (0..own.len())
            .max_by_key(|&k| (area(&proposal.figures[k]), std::cmp::Reverse(k)))
            .unwrap_or(0);
        keep_only(&mut proposal, main);
        shapes.extend(own.into_iter().nth(main));
        proposals.push(proposal);
    }
    // Heights are compared over all pictures.
    let figures = || proposals.iter().flat_map(|p| &p.figures);
    let usual = median(&figures().map(|f| f64::from(f.place.height())).collect::<Vec<_>>());
    for figure in proposals.iter_mut().flat_map(|p| &mut p.figures) {
        figure.scale = f64::from(figure.place.height()) / usual.max(1.0);
    }
    if let Some(guess) = azimuths::guess(&shapes, &layouts::turns(shapes.len())) {
        settle(proposals.iter_mut().flat_map(|p| &mut p.figures).collect(), &guess);
        proposals.iter_mut().for_each(|p| p.confidence = guess.whole);
    }
    Ok(proposals)
}

/// Finds the views in one picture of a page, or in several of a turn.
///
/// # Errors
/// As [`propose`] and [`propose_turn`].
pub fn propose_all(
    pictures: &[RgbaImage],
    options: &PageOptions,
    observer: &dyn Observer,
) -> Result<Vec<PageProposal>, PageError> {
    match pictures {
        [page] => Ok(vec![propose(page, options, observer)?]),
        _ => propose_turn(pictures, options, observer),
    }
}

/// Gives the figures of all `proposals` these azimuths, in reading order.
///
/// # Errors
/// [`PageError::WrongNumber`] if there are more or fewer azimuths than figures,
/// [`PageError::DuplicateAzimuth`] if one is given twice.
pub fn set_azimuths(proposals: &mut [PageProposal], azimuths: &[Azimuth]) -> Result<(), PageError> {
    let found = proposals.iter().map(|proposal| proposal.figures.len()).sum();
    if found != azimuths.len() {
        return Err(PageError::WrongNumber { found, given: azimuths.len() });
    }
    for (k, azimuth) in azimuths.iter().enumerate() {
        if azimuths[..k].contains(azimuth) {
            return Err(PageError::DuplicateAzimuth(azimuth.degrees()));
        }
    }
    let figures = proposals.iter_mut().flat_map(|proposal| &mut proposal.figures);
    for (figure, azimuth) in figures.zip(azimuths) {
        figure.azimuth = *azimuth;
        figure.confidence = 1.0;
    }
    proposals.iter_mut().for_each(|proposal| proposal.confidence = 1.0);
    Ok(())
}

/// Azimuths in the order of the views as people write them: `0,45,90`; `None`
/// for `auto`, which leaves them to be guessed.
///
/// # Errors
/// What is wrong, if the text is neither.
pub fn azimuth_order(text: &str) -> Result<Option<Vec<Azimuth>>, String> {
    if text.trim() == "auto" {
        return Ok(None);
    }
    let azimuth = |part: &str| {
        let degrees = part.trim().parse::<f64>().ok();
        let azimuth = degrees.and_then(|degrees| Azimuth::from_degrees(degrees).ok());
        azimuth.ok_or_else(|| format!("{part:?} is no angle in degrees; write 0,45,90 or auto"))
    };
    text.split(',').map(azimuth).collect::<Result<Vec<Azimuth>, String>>().map(Some)
}

fn settle(figures: Vec<&mut Figure>, guess: &Guess) {
    let guessed = guess.azimuths.iter().zip(&guess.confidence);
    for (figure, (degrees, confidence)) in figures.into_iter().zip(guessed) {
        figure.azimuth = Azimuth::from_degrees(*degrees).expect("layouts are finite");
        figure.confidence = *confidence;
    }
}

fn keep_only(proposal: &mut PageProposal, main: usize) {
    for (k, figure) in proposal.figures.iter().enumerate().filter(|(k, _)| *k != main) {
        let why = "another figure in the picture is larger";
        let other = LeftOut { kind: LeftOutKind::ExtraPose, place: figure.place, why };
        proposal.left_out.push(other);
        proposal.owners.data.iter_mut().filter(|o| **o == FIRST + k as u16).for_each(|o| *o = LEFT);
    }
    let own = FIRST + main as u16;
    proposal.owners.data.iter_mut().filter(|o| **o == own).for_each(|o| *o = FIRST);
    let mut index = 0;
    proposal.figures.retain(|_| {
        index += 1;
        index - 1 == main
    });
}

fn found(
    page: &RgbaImage,
    options: &PageOptions,
    observer: &dyn Observer,
) -> Result<Found, PageError> {
    let (width, height) = page.dimensions();
    let steps = Steps::new(observer, Stage::Silhouettes, 4);
    steps.done(0, "")?;
    let mut marks =
        Marks::of(page, options.working_side_px).ok_or(PageError::NoPixels { width, height })?;
    let colours = small::colours(page, marks.factor, marks.paper.colour);
    steps.done(1, "marks")?;
    let drawn = marks.lines.clone();
    let mut left = removed_lines(&mut marks);
    let ruled = drawn.clone().and_not(&marks.lines);
    steps.done(2, "lines")?;
    let (blobs, selected) = drawings(&marks);
    steps.done(3, "figures")?;
    let count = selected.views.len();
    if count == 0 {
        left.extend(select::left_out(&blobs, &selected, &[], &colours));
        return Err(PageError::NoFigure { left_out: left.len() });
    }
    if count > options.max_figures {
        return Err(PageError::TooManyFigures { found: count, limit: options.max_figures });
    }
    let order = reading_order(&blobs, &selected);
    let detail = small::detail(&colours);
    let views: Vec<View> =
        order.par_iter().map(|at| View::of(&marks, &drawn, &blobs, *at, &detail)).collect();
    steps.done(4, "outlines")?;
    let inner = inner(&blobs, &order, &views);
    left.extend(select::left_out(&blobs, &selected, &inner, &colours));
    let left_out: Vec<LeftOut> = left
        .into_iter()
        .map(|l| LeftOut { place: l.place.scaled(marks.factor as u32, width, height), ..l })
        .collect();
    let mut owners = owners(&blobs, &order, &inner);
    let mut kept = marks.lines.clone();
    for (k, view) in views.iter().enumerate() {
        view.edges_on(&mut kept, &mut owners, FIRST + k as u16);
    }
    let rubbed = cut_out::rubbed(&ruled, &kept);
    let usual =
        median(&views.iter().map(|view| f64::from(view.place.height())).collect::<Vec<_>>());
    let size = (width, height);
    let figures = views.par_iter().map(|view| view.figure(marks.factor, size, usual)).collect();
    let shapes = views.into_iter().map(|view| view.shape).collect();
    let proposal = PageProposal {
        width,
        height,
        paper: marks.paper,
        figures,
        confidence: 0.0,
        left_out,
        owners,
        rubbed,
        factor: marks.factor,
        is_clear: marks.is_clear,
        field: marks.field,
    };
    Ok(Found { proposal, shapes })
}

/// Frames and straight lines, removed from `marks`; working px.
fn removed_lines(marks: &mut Marks) -> Vec<LeftOut> {
    let frame = |place| LeftOut {
        kind: LeftOutKind::Frame,
        place,
        why: "a rectangle of lines around drawings",
    };
    let mut left: Vec<LeftOut> = panels::remove(marks).into_iter().map(frame).collect();
    let removed = marks.remove_straight_lines(&CleanOptions::default());
    left.extend(removed.iter().map(|r| {
        let (kind, why) = match r.kind {
            subject::RemovedKind::GroundLine => (LeftOutKind::GroundLine, "figures stand on it"),
            subject::RemovedKind::DimensionLine => {
                (LeftOutKind::DimensionLine, "straight, thin and apart from the figures")
            }
            _ => (LeftOutKind::Guide, "straight and thin, goes on beyond the figures"),
        };
        LeftOut { kind, place: r.place, why }
    }));
    left
}

/// The drawings on the page and which of them are views.
fn drawings(marks: &Marks) -> (Blobs, Selected) {
    let inside = blobs::inside(marks);
    let mut size = blobs::largest(&inside.components(true).parts);
    let mut result = None;
    // The figures' height scales every length, and is known only afterwards.
    for _ in 0..3 {
        let mut blobs = Blobs::of(&inside, size);
        joins::cut(&mut blobs, size);
        let selected = select::select(&blobs);
        let height = selected.height;
        result = Some((blobs, selected));
        if height <= 0.0 || (height / size - 1.0).abs() <= SAME_HEIGHT {
            break;
        }
        size = height;
    }
    result.expect("one round at least")
}

/// The views row by row, from left to right, with their rows.
fn reading_order(blobs: &Blobs, selected: &Selected) -> Vec<(usize, usize)> {
    let middle = |k: usize| {
        let b = blobs.list[k].bounds;
        f64::from(b.top + b.bottom) / 2.0
    };
    let mut down = selected.views.clone();
    down.sort_by(|&a, &b| middle(a).total_cmp(&middle(b)).then(a.cmp(&b)));
    let mut rows: Vec<Vec<usize>> = Vec::new();
    for k in down {
        let mean =
            |row: &Vec<usize>| row.iter().map(|&k| middle(k)).sum::<f64>() / row.len() as f64;
        match rows.last_mut() {
            Some(row) if middle(k) - mean(row) < 0.5 * selected.height => row.push(k),
            _ => rows.push(vec![k]),
        }
    }
    let mut order = Vec::new();
    for (row, mut figures) in rows.into_iter().enumerate() {
        figures.sort_by_key(|&k| (blobs.list[k].bounds.left + blobs.list[k].bounds.right, k));
        order.extend(figures.into_iter().map(|k| (k, row)));
    }
    order
}

/// Drawings that lie within a view, and its place in the order: what its edge encloses is known
/// only once the stretches of removed lines are back.
fn inner(blobs: &Blobs, order: &[(usize, usize)], views: &[View]) -> Vec<(usize, usize)> {
    let is_view = |k: usize| order.iter().any(|(view, _)| *view == k);
    let of = |k: usize| views.iter().position(|view| view.has_within(blobs, k)).map(|to| (k, to));
    (0..blobs.list.len()).filter(|k| !is_view(*k)).filter_map(of).collect()
}

/// * `inner`: as of [`inner`].
fn owners(blobs: &Blobs, order: &[(usize, usize)], inner: &[(usize, usize)]) -> Raster<u16> {
    let mut of = vec![LEFT; blobs.list.len() + 1];
    of[0] = NOBODY;
    let own = order.iter().enumerate().map(|(place, (k, _))| (*k, place));
    for (k, place) in own.chain(inner.iter().copied()) {
        of[k + 1] = FIRST + place as u16;
    }
    let of = |owner: &u16| of.get(*owner as usize).copied().unwrap_or(LETTERS);
    let data = blobs.owners.data.iter().map(of).collect();
    Raster { width: blobs.owners.width, height: blobs.owners.height, data }
}

/// One view at working size.
struct View {
    place: Box2,
    /// Of the box's size and [`PAD`] about it.
    mask: Bits,
    /// Where its own edge lies on lines that were removed; of the mask's size.
    edges: Bits,
    row: usize,
    shape: Shape,
}

impl View {
    fn of(
        marks: &Marks,
        drawn: &Bits,
        blobs: &Blobs,
        (k, row): (usize, usize),
        detail: &Raster<u8>,
    ) -> Self {
        let place = blobs.list[k].bounds;
        let own = blobs.pixels(k, PAD);
        let within = |bits: &Bits| {
            let mut cut = Bits::filled(own.width, own.height, false);
            for y in 0..place.height() as usize {
                for x in 0..place.width() as usize {
                    let to = (y + PAD) * own.width + x + PAD;
                    let from = (y + place.top as usize) * bits.width + x + place.left as usize;
                    cut.data[to] = own.data[to] && bits.data[from];
                }
            }
            cut
        };
        let (lines, areas) = (within(&marks.lines), within(&marks.areas));
        let options = SubjectOptions::default();
        let corner = (i64::from(place.left) - PAD as i64, i64::from(place.top) - PAD as i64);
        let edges = marks.own_edges(&lines.clone().or(&areas), drawn, corner);
        let closed = lines.or(&edges);
        let mask = enclosed(&closed, &areas, marks.stroke_px, &options).or(&own);
        let mut near = Raster::filled(own.width, own.height, 0_u8);
        for y in 0..place.height() as usize {
            let from = (y + place.top as usize) * detail.width + place.left as usize;
            let to = (y + PAD) * own.width + PAD;
            let count = place.width() as usize;
            near.data[to..to + count].copy_from_slice(&detail.data[from..from + count]);
        }
        // Closing gaps cannot reach beyond the bounds, so there is a shape.
        let shape = Shape::of(&mask, &near).expect("a drawing has pixels");
        Self { place, mask, edges, row, shape }
    }

    /// Whether all of a drawing lies within its mask.
    fn has_within(&self, blobs: &Blobs, k: usize) -> bool {
        let (place, bounds) = (&self.place, &blobs.list[k].bounds);
        let is_in_box = bounds.left >= place.left
            && bounds.right <= place.right
            && bounds.top >= place.top
            && bounds.bottom <= place.bottom;
        if !is_in_box {
            return false;
        }
        let drawing = blobs.pixels(k, 0);
        (0..drawing.data.len()).filter(|&at| drawing.data[at]).all(|at| {
            let (x, y) = (at % drawing.width, at / drawing.width);
            let x = x + (bounds.left - place.left) as usize + PAD;
            let y = y + (bounds.top - place.top) as usize + PAD;
            self.mask.at(x as i64, y as i64)
        })
    }

    /// Adds its edges on removed lines to `kept`, and makes it the owner of those that are nobody's.
    fn edges_on(&self, kept: &mut Bits, owners: &mut Raster<u16>, own: u16) {
        let set = (0..self.edges.data.len()).filter(|&at| self.edges.data[at]);
        for (x, y) in set.map(|at| (at % self.edges.width, at / self.edges.width)) {
            let (x, y) = (x + self.place.left as usize, y + self.place.top as usize);
            let Some((x, y)) = x.checked_sub(PAD).zip(y.checked_sub(PAD)) else { continue };
            if x < kept.width && y < kept.height {
                kept.data[y * kept.width + x] = true;
                let owner = &mut owners.data[y * kept.width + x];
                *owner = if *owner == NOBODY { own } else { *owner };
            }
        }
    }

    fn figure(&self, factor: usize, (width, height): (u32, u32), usual: f64) -> Figure {
        let place = self.place.scaled(factor as u32, width, height);
        let tall = f64::from(self.place.height());
        let page = |p: &Point| Point {
            x: ((p.x - PAD as f64 + f64::from(self.place.left)) * factor as f64)
                .clamp(0.0, f64::from(width)),
            y: ((p.y - PAD as f64 + f64::from(self.place.top)) * factor as f64)
                .clamp(0.0, f64::from(height)),
        };
        let corners = outline::outline(&self.mask, (TOLERANCE * tall).max(0.7));
        let middle = f64::from(self.place.left + self.place.right) / 2.0;
        let axis = (middle + self.shape.profile.axis() * tall) * factor as f64;
        Figure {
            place,
            outline: corners.iter().map(page).collect(),
            mask: enlarged(&self.mask, factor, &place),
            baseline_row: place.bottom,
            axis_column: axis.clamp(0.0, f64::from(width)),
            scale: tall / usual.max(1.0),
            row: self.row,
            azimuth: Azimuth::from_degrees(0.0).expect("0 is finite"),
            confidence: 0.0,
            facing: azimuths::facing(&self.shape),
        }
    }
}

/// The mask at the page's size, its edge smooth between working pixels.
fn enlarged(mask: &Bits, factor: usize, place: &Box2) -> GrayImage {
    let level = |x: usize, y: usize| f32::from(u8::from(mask.at(x as i64, y as i64)));
    GrayImage::from_fn(place.width(), place.height(), |x, y| {
        if factor == 1 {
            return image::Luma([
                if mask.at(i64::from(x) + PAD as i64, i64::from(y) + PAD as i64) { 255 } else { 0 },
            ]);
        }
        let at = |v: u32| (v as f32 + 0.5) / factor as f32 - 0.5 + PAD as f32;
        let (u, v) = (at(x), at(y));
        let (i, j) = (u as usize, v as usize);
        let (s, t) = (u - i as f32, v - j as f32);
        let upper = level(i, j) * (1.0 - s) + level(i + 1, j) * s;
        let lower = level(i, j + 1) * (1.0 - s) + level(i + 1, j + 1) * s;
        image::Luma([if upper * (1.0 - t) + lower * t >= 0.5 { 255 } else { 0 }])
    })
}
