//! What of a drawing, at working size, is the subject: lines and areas without
//! clutter, the outline closed, holes and pieces decided.

use image::GrayImage;

use crate::options::{Hints, SubjectOptions};
use crate::pieces;
use crate::raster::{Bits, Raster, filled};
use crate::report::{Box2, DrawingKind, Gap, Piece, Point, Removed, RemovedKind, Warning};
use crate::subject::erased;
use crate::tone::Tone;
use crate::{clutter, edges, gaps, holes, lettering, mosaic, strokes, widths};

/// A set of pixels at any size.
pub(crate) type Area = Bits;

/// More of the subject in areas of colour is a coloured drawing.
const COLOURED: f64 = 0.3;
/// Of what is dark in a coloured drawing, at least this share is lines: dark areas are ink as well.
const LINES: f64 = 0.25;
/// And with more it is painted all over.
pub(crate) const PAINTED: f64 = 0.6;
/// Strokes are at most this wide, share of the figure's size.
const THICKEST: f64 = 0.025;
/// Colour differs clearly from paper from here on, levels.
pub(crate) const CLEAR_COLOUR: f32 = 11.0;
/// What differs from paper by less than this share of what painted areas do is
/// a halo of their compression.
const HALO: f32 = 0.18;
/// A gap that matters shuts in this share of the figure's size, squared.
const LEAST_GAIN: f64 = 0.012;
/// An outline that encloses less of its bounds is open.
const OPEN_SHARE: f64 = 0.045;
/// A border with more that is not paper is a backdrop.
const BUSY: f64 = 0.5;
const LEAST_CONTRAST: f32 = 40.0;
/// Painted pieces of a mosaic are at least twice so wide, share of the figure's size,
const PIECE: f64 = 0.003;
/// and no further apart.
const MOSAIC_REACH: f64 = 0.02;

/// The subject at working size.
pub(crate) struct Structure {
    pub(crate) kind: DrawingKind,
    /// Working pixels are so many drawing pixels wide.
    pub(crate) factor: usize,
    pub(crate) inside: Area,
    /// Pixels that hold paper off though nothing is drawn there.
    pub(crate) bridged: Area,
    /// Removed strokes, which are drawn but count for nothing.
    pub(crate) cleared: Area,
    /// The least colour difference that counts at full size; none in line art.
    pub(crate) colour_from: Option<f32>,
    pub(crate) stroke: f64,
    /// The width of the outline's stroke in what is painted; 0 if it has none.
    pub(crate) outline: Option<f64>,
    pub(crate) removed: Vec<Removed>,
    pub(crate) pieces: Vec<Piece>,
    pub(crate) gaps: Vec<Gap>,
    pub(crate) warnings: Vec<Warning>,
}

/// The share of what the barrier encloses that is in areas of colour.
fn coverage(barrier: &Bits, areas: &Bits) -> f64 {
    areas.count() as f64 / filled(barrier).count().max(1) as f64
}

/// The figure's size, to which lengths are scaled: its height, or most of its
/// width if that is larger.
pub(crate) fn figure_size(bounds: &Box2) -> f64 {
    f64::from(bounds.height()).max(0.6 * f64::from(bounds.width())).max(1.0)
}

impl Structure {
    /// Of a drawing whose mask is known: only its pieces are decided.
    pub(crate) fn of_mask(
        mask: &GrayImage,
        kind: DrawingKind,
        tone: &Tone<'_>,
        factor: usize,
        hints: &Hints,
        options: &SubjectOptions,
    ) -> Self {
        let (ink, _) = tone.reduced(factor);
        let mut inside = reduced_mask(mask, factor);
        let lines = above(&ink, tone.threshold);
        let mut own = Self::empty(kind, factor, &inside);
        own.stroke = stroke_of(&lines);
        own.erase(hints, &mut inside);
        if kind == DrawingKind::CutOut {
            let mosaic = own.mosaic(&inside);
            own.bridged = mosaic.clone().and_not(&inside);
            inside = inside.or(&mosaic);
            own.clean(&mut inside, options);
            own.decide_pieces(inside, hints, options);
        } else {
            own.inside = inside;
        }
        own.measure_lines(&ink);
        own
    }

    /// How wide lines are where all that is painted is ink.
    fn measure_lines(&mut self, ink: &Raster<f32>) {
        if self.colour_from.is_some() || self.kind == DrawingKind::CutOut {
            let size = self.inside.bounds().map_or(1.0, |bounds| figure_size(&bounds));
            let widths = widths::of_painted(ink, &self.inside, THICKEST * size);
            (self.stroke, self.outline) = (widths.line.max(1.0), Some(widths.outline));
        }
    }

    /// Of a drawing on paper.
    pub(crate) fn of_drawing(
        tone: &Tone<'_>,
        factor: usize,
        hints: &Hints,
        options: &SubjectOptions,
    ) -> Self {
        let (ink, colour) = tone.reduced(factor);
        let mut lines = above(&ink, tone.threshold);
        let mut own = Self::empty(DrawingKind::LineArt, factor, &lines);
        own.stroke = stroke_of(&lines);
        own.erase(hints, &mut lines);
        let mut painted = above(&colour, tone.tolerance.max(CLEAR_COLOUR));
        let painted_all = painted.clone();
        let mosaic = own.mosaic(&painted);
        let drawn_lines = lines.clone();
        own.clean(&mut lines, options);
        own.keep_all_of(&mosaic, &drawn_lines, &mut lines);
        let around = own.cleared.dilated(2.0);
        painted = painted.and_not(&around);
        let areas_beside = |stroke: f64| painted.opened((1.5 * stroke + 1.0) as f32).or(&mosaic);
        let areas = areas_beside(own.stroke);
        let mut barrier = lines.clone().or(&areas);
        let mut all_over = false;
        if coverage(&barrier, &areas) > COLOURED {
            let areas_of_lines = areas_beside(strokes::width_of(&lines, LINES).min(own.stroke));
            let both = lines.clone().or(&areas_of_lines);
            all_over = coverage(&both, &areas_of_lines) > PAINTED;
            let from = tone.tolerance.max(CLEAR_COLOUR).max(HALO * typical(&colour, &areas));
            let painted = painted.and_not(&above(&colour, from).not());
            let wide = painted.opened((0.5 * own.stroke).max(1.0) as f32);
            barrier = lines.clone().or(&wide).or(&mosaic);
            own.colour_from = Some(from);
            own.kind = if tone.is_shaded(&areas, factor) {
                DrawingKind::Shaded
            } else {
                DrawingKind::Flat
            };
        }
        let drawn = barrier.clone().and_not(&mosaic.and_not(&painted_all));
        for side in edges::close(&mut barrier, own.stroke) {
            own.warnings.push(Warning::CutByEdge { side });
        }
        // What is painted nearly all over has no gaps; its limbs are no strokes.
        let inside =
            if all_over { filled(&barrier) } else { own.close_gaps(&mut barrier, &lines, options) };
        own.bridged = barrier.clone().and_not(&drawn);
        let inside = holes::without(&own, inside, &barrier, &colour, &lines, options, hints);
        own.decide_pieces(inside, hints, options);
        own.measure_lines(&ink);
        own.judge(tone);
        own
    }

    /// A figure of painted pieces with seams of paper between them, seams shut; nothing if it is none.
    fn mosaic(&self, painted: &Bits) -> Bits {
        let drawn = painted.clone().and_not(&self.cleared);
        let size = drawn.bounds().map_or(1.0, |bounds| figure_size(&bounds));
        let pieces = drawn.opened((PIECE * size).max(1.0) as f32);
        mosaic::figures(&pieces, MOSAIC_REACH * size)
    }

    /// Takes back that strokes within `whole`, of which `drawn` are all, are letters or lines.
    fn keep_all_of(&mut self, whole: &Bits, drawn: &Bits, lines: &mut Bits) {
        *lines = lines.clone().or(&drawn.clone().and_not(&whole.not()));
        self.cleared = self.cleared.clone().and_not(whole);
        self.removed.retain(|removed| {
            let place = &removed.place;
            let (x, y) =
                (u32::midpoint(place.left, place.right), u32::midpoint(place.top, place.bottom));
            removed.kind == RemovedKind::Erased || !whole.at(i64::from(x), i64::from(y))
        });
    }

    fn empty(kind: DrawingKind, factor: usize, like: &Bits) -> Self {
        let none = Bits::filled(like.width, like.height, false);
        Self {
            kind,
            factor,
            inside: none.clone(),
            bridged: none.clone(),
            cleared: none,
            colour_from: None,
            stroke: 1.0,
            outline: None,
            removed: Vec::new(),
            pieces: Vec::new(),
            gaps: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// Clears what the hints say is paper.
    fn erase(&mut self, hints: &Hints, bits: &mut Bits) {
        for polygon in &hints.erase {
            let mut area = Bits::filled(bits.width, bits.height, false);
            let factor = self.factor as f64;
            let scaled: Vec<Point> =
                polygon.iter().map(|p| Point { x: p.x / factor, y: p.y / factor }).collect();
            area.fill_polygon(&scaled, true);
            if let Some(place) = area.bounds() {
                self.removed.push(erased(place));
            }
            *bits = bits.clone().and_not(&area);
            self.cleared = self.cleared.clone().or(&area);
        }
    }

    /// Removes straight lines and lettering from `bits`, save where nothing else is
    /// drawn: a crate's outline is no frame, and then its edges are no guides.
    fn clean(&mut self, bits: &mut Bits, options: &SubjectOptions) {
        let before = bits.clone();
        let removed = self.removed.len();
        for frames in [options.clean.frames.is_on(), false] {
            self.clean_once(bits, frames, options);
            if bits.count() > 0 || before.count() == 0 {
                break;
            }
            self.removed.truncate(removed);
            *bits = before.clone();
        }
        self.cleared = self.cleared.clone().or(&before.and_not(bits));
    }

    fn clean_once(&mut self, bits: &mut Bits, frames: bool, options: &SubjectOptions) {
        if frames {
            let cleaned = clutter::without_frame(bits, self.stroke);
            self.removed.extend(cleaned.removed);
            *bits = cleaned.ink;
        }
        self.clean_lettering(bits, options);
        let cleaned = clutter::without_lines(bits, self.stroke, &options.clean);
        let lined = !cleaned.removed.is_empty();
        self.removed.extend(cleaned.removed);
        *bits = cleaned.ink;
        if lined {
            self.clean_lettering(bits, options);
        }
    }

    fn clean_lettering(&mut self, bits: &mut Bits, options: &SubjectOptions) {
        if options.clean.captions.is_on() {
            let text = lettering::find(bits, self.stroke);
            let caption = |place| Removed { kind: RemovedKind::Caption, place };
            self.removed.extend(text.lines.into_iter().map(caption));
            *bits = bits.clone().and_not(&text.pixels);
        }
    }

    fn close_gaps(&mut self, barrier: &mut Bits, lines: &Bits, options: &SubjectOptions) -> Bits {
        let open = barrier.clone();
        let bounds = main_bounds(barrier);
        let size = figure_size(&bounds);
        let least_area = ((LEAST_GAIN * size).powi(2) as usize).max(6);
        let closed = gaps::close(barrier, lines, self.stroke, options.max_gap * size, least_area);
        let gap = |b: &gaps::Bridge| Gap {
            place: Point { x: b.middle.0, y: b.middle.1 },
            width_px: b.width_px,
        };
        self.gaps = closed.bridges.iter().map(gap).collect();
        let mut inside = closed.inside;
        *barrier = closed.barrier;
        if options.max_guessed_gap > options.max_gap {
            let least_area = ((0.05 * size).powi(2) as usize).max(16);
            let reach = options.max_guessed_gap * size;
            let lines = lines.clone().or(&barrier.clone().and_not(&open));
            let guessed = gaps::close(barrier, &lines, self.stroke, reach, least_area);
            for bridge in &guessed.bridges {
                let gap = gap(bridge);
                self.gaps.push(gap);
                if gap.width_px > options.max_gap * size {
                    self.warnings.push(Warning::WideGap { gap });
                }
            }
            if !guessed.bridges.is_empty() {
                inside = guessed.inside;
                *barrier = guessed.barrier;
            }
        }
        inside
    }

    fn decide_pieces(&mut self, inside: Bits, hints: &Hints, options: &SubjectOptions) {
        let decided = pieces::decide(&inside, hints, self.factor, options.attach_distance);
        self.pieces = decided.pieces;
        self.warnings.extend(decided.warnings);
        self.removed.extend(decided.specks);
        self.inside = decided.kept;
    }

    /// Warns of what makes the silhouette doubtful.
    fn judge(&mut self, tone: &Tone<'_>) {
        let bounds = self.inside.bounds().unwrap_or_default();
        let area = self.inside.count() as f64;
        let share = area / (f64::from(bounds.width()) * f64::from(bounds.height())).max(1.0);
        if share < OPEN_SHARE && area > 0.0 {
            let gap = self.gaps.iter().max_by(|a, b| a.width_px.total_cmp(&b.width_px)).copied();
            self.warnings.push(Warning::OpenOutline { share, gap });
        }
        if tone.contrast < LEAST_CONTRAST.max(8.0 * tone.noise()) && self.colour_from.is_none() {
            self.warnings.push(Warning::LowContrast {
                contrast: f64::from(tone.contrast),
                noise: f64::from(tone.noise()),
            });
        }
        if tone.foreign_border() > BUSY {
            self.warnings.push(Warning::BusyPaper { share: tone.foreign_border() });
        }
    }
}

/// What lines enclose once the gaps between them are closed.
pub(crate) fn enclosed_lines(
    barrier: &Bits,
    lines: &Bits,
    stroke_px: f64,
    options: &SubjectOptions,
) -> Bits {
    let mut own = Structure::empty(DrawingKind::LineArt, 1, barrier);
    own.stroke = stroke_px;
    own.close_gaps(&mut barrier.clone(), lines, options)
}

/// The width of most strokes; filled figures have none that counts.
pub(crate) fn stroke_of(lines: &Bits) -> f64 {
    let most = (THICKEST * figure_size(&main_bounds(lines))).max(1.0);
    strokes::typical_width(lines).min(most)
}

/// The median of `values` in `area`.
fn typical(values: &Raster<f32>, area: &Bits) -> f32 {
    let mut inner: Vec<f32> =
        values.data.iter().zip(&area.data).filter(|(_, is)| **is).map(|(v, _)| *v).collect();
    if inner.is_empty() {
        return 0.0;
    }
    let middle = inner.len() / 2;
    *inner.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// The bounds of the largest connected part and of what is near its size.
fn main_bounds(bits: &Bits) -> Box2 {
    let parts = bits.components(true).parts;
    let side = |b: &Box2| b.width().max(b.height());
    let largest = parts.iter().map(|part| side(&part.bounds)).max().unwrap_or(1);
    let large = parts.iter().filter(|part| side(&part.bounds) * 5 >= largest);
    large.map(|part| part.bounds).reduce(|a, b| a.joined(&b)).unwrap_or_default()
}

pub(crate) fn above(values: &Raster<f32>, threshold: f32) -> Bits {
    let data = values.data.iter().map(|value| *value > threshold).collect();
    Bits { width: values.width, height: values.height, data }
}

pub(crate) fn reduced_mask(mask: &GrayImage, factor: usize) -> Bits {
    let (w, h) = (mask.width() as usize, mask.height() as usize);
    let (rw, rh) = (w.div_ceil(factor), h.div_ceil(factor));
    let mut counts = vec![0_u32; rw * rh];
    for (y, row) in mask.as_raw().chunks_exact(w.max(1)).enumerate() {
        for (x, level) in row.iter().enumerate() {
            counts[y / factor * rw + x / factor] += u32::from(*level >= 128);
        }
    }
    // A thin part of the mask stays.
    let data = counts
        .iter()
        .map(|count| *count as usize * 4 > factor * factor || (factor == 1 && *count > 0))
        .collect();
    Bits { width: rw, height: rh, data }
}
