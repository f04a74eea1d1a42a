//! From drawings of any kind to clean views on one canvas.
//!
//! Clean line art on white stays exactly as it was drawn; of everything else the
//! subject is found, its lines are cleaned and its colours kept.

use frames::{Azimuth, Viewpoint};
use image::{GrayImage, Rgb, RgbImage, RgbaImage, imageops};
use progress::Observer;
use rayon::prelude::*;
use serde::Serialize;
use sheet::{HoleDocument, SheetDocument, View, ViewDocument};
use subject::{
    AlignOptions, Aligned, Alignment, ByHand, Canvas, DrawingKind, Gap, Hints, HypothesisOptions,
    PaperSummary, Piece, Point, Polarity, Removed, Subject, SubjectError, SubjectOptions,
    Suggestion, Transform, align, apply, find, hypotheses, place_by_hand, trust,
};

use super::DraftError;
use super::decode::{Change, DecodedView};
use super::elevated;
use super::options::{Options, Repair};
use crate::failure_code::FailureCode;

/// Views of one image size whose scale is off by less are left to the method's
/// own registration.
const REGISTERED_SCALE: f64 = 0.08;
/// The same for shifts, share of the figure's height.
const REGISTERED_SHIFT: f64 = 0.04;
/// Paper that changes by more, or is darker, or has more grain, is not taken as white, grey levels.
const MAX_UNEVENNESS: f64 = 16.0;
const LEAST_WHITE: u8 = 240;
const MAX_NOISE: f64 = 2.0;
/// Figures of fewer rows are enlarged to at least as many, unless all are clean line art: a pixel
/// of a sprite would be a step of its draft.
const MIN_FIGURE_ROWS: f64 = 200.0;
/// No canvas is enlarged beyond this, px.
const MAX_ENLARGED_SIDE: f64 = 2048.0;
/// A view that lacks more of the others' subject is wrong as a whole, share of
/// its own area.
const MAX_LACKING: f64 = 0.35;
/// More views are not tested against each other: their number of pairs grows.
const MAX_TESTED_VIEWS: usize = 12;

/// What was found in the drawings and done to them.
pub(super) struct Preparation {
    /// Level views by rising azimuth, then the others.
    pub drawings: Vec<DrawingReport>,
    /// Each subject cut out of its drawing, on the common canvas.
    pub cut_outs: Vec<(Viewpoint, RgbaImage)>,
    /// 0 where a view shows paper and the others the subject, of views that do.
    pub trust: Vec<(Viewpoint, GrayImage)>,
    /// How views were laid on one canvas; `None` if they were left in place.
    pub alignment: Option<Alignment>,
    /// What fits better otherwise.
    pub suggestions: Vec<SuggestionReport>,
    /// What a person should look at.
    pub warnings: Vec<String>,
    /// One a drawing.
    places: Vec<PlaceOnCanvas>,
}

/// How the places of a drawing as sent become those of its view.
struct PlaceOnCanvas {
    /// As the document has it.
    azimuth_deg: f64,
    viewpoint: Viewpoint,
    change: Change,
    transform: Transform,
}

impl PlaceOnCanvas {
    fn new(view: &DecodedView<'_>, transform: Transform) -> Self {
        Self {
            azimuth_deg: view.document.azimuth_deg,
            viewpoint: view.viewpoint(),
            change: view.change,
            transform,
        }
    }
}

impl Preparation {
    /// How many times fewer columns and rows the drawings were given.
    pub(super) fn reduction(&self) -> f64 {
        self.places.first().map_or(1.0, |place| place.change.reduction)
    }

    /// The holes of a document where they are on the views that the drawings became; those of
    /// views that there are not stay.
    pub(super) fn holes(&self, document: &SheetDocument) -> Vec<HoleDocument> {
        let moved = |hole: &HoleDocument| {
            let elevation_deg = hole.elevation_deg.unwrap_or(0.0);
            let place = self.places.iter().find(|place| {
                let viewpoint = &place.viewpoint;
                let apart = (place.azimuth_deg - hole.azimuth_deg).rem_euclid(360.0);
                apart == 0.0 && viewpoint.elevation.degrees() == elevation_deg
            });
            let Some(place) = place else { return hole.clone() };
            let [x, y] = place.transform.place(place.change.place([hole.x, hole.y]));
            HoleDocument { azimuth_deg: place.viewpoint.azimuth.degrees(), x, y, ..hole.clone() }
        };
        document.holes.iter().map(moved).collect()
    }
}

/// One drawing, as `metrics.json` tells of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct DrawingReport {
    azimuth_deg: f64,
    elevation_deg: f64,
    kind: DrawingKind,
    polarity: Polarity,
    paper: PaperSummary,
    /// How many times fewer columns and rows the drawing was given; places are told in these.
    #[serde(skip_serializing_if = "is_one")]
    reduced_by: f64,
    /// Whether the drawing is used as it was drawn.
    as_drawn: bool,
    /// Whether a person gave mask, outline or pieces.
    by_hand: bool,
    stroke_px: f64,
    /// The width of the outline's stroke in what is painted, 0 if it has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    outline_px: Option<f64>,
    removed: Vec<Removed>,
    pieces: Vec<Piece>,
    closed_gaps: Vec<Gap>,
    warnings: Vec<String>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_one(factor: &f64) -> bool {
    *factor == 1.0
}

/// A view that fits better otherwise.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct SuggestionReport {
    text: String,
    suggestion: Suggestion,
    /// By how much the views' disagreement sinks.
    margin: f64,
    applied: bool,
}

/// Finds the subject in each drawing and lays the views on one canvas where
/// they differ in size, scale or place.
///
/// * `has_truth`: whether the sheet has; small figures are not enlarged then.
/// * `max_working_bytes`: what the job may hold in memory.
///
/// # Errors
/// [`DraftError::Input`] for a drawing without a subject, naming its view, and for a canvas that
/// memory does not allow.
pub(super) fn prepare(
    mut views: Vec<DecodedView<'_>>,
    options: &Options,
    has_truth: bool,
    max_working_bytes: u64,
    observer: &dyn Observer,
) -> Result<(Vec<View>, Preparation), DraftError> {
    views.sort_by_key(DecodedView::viewpoint);
    if let Some((view, (field, value, accepted))) =
        views.iter().find_map(|view| Some((view, view.document.wrong_place()?)))
    {
        let detail = format!("view {}: {field} is {value}; give {accepted}", view.viewpoint());
        return Err(DraftError::input(FailureCode::InvalidSheet, detail));
    }
    let found: Vec<_> =
        views.par_iter().with_max_len(1).map(|view| find_in(view, options, observer)).collect();
    let found = found.into_iter().collect::<Result<Vec<Subject>, _>>()?;
    let found = views.into_iter().zip(found);
    let (level, elevated): (Vec<_>, Vec<_>) =
        found.partition(|(view, _)| view.viewpoint().is_level());
    let (mut views, mut subjects): (Vec<DecodedView<'_>>, Vec<Subject>) = level.into_iter().unzip();
    let mut alignment = aligned(&views, &subjects);
    let mut suggestions = suggestions(&views, &subjects, &alignment);
    if options.sheet.repair == Repair::Apply
        && let Some(best) = suggestions.first_mut()
    {
        best.applied = follow(best.suggestion, &mut views, &mut subjects)?;
        alignment = aligned(&views, &subjects);
    }
    observer.check()?;
    let mut warnings: Vec<String> = Vec::new();
    if let Some(view) = views.first().filter(|view| view.change.reduction > 1.0) {
        let digits = if view.change.reduction < 1.01 { 4 } else { 2 };
        warnings.push(format!(
            "the drawings are larger than {} megapixels and were reduced by {:.digits$}; places in \
             warnings and maps are in the reduced drawings' pixels (sheet.max_megapixels)",
            options.sheet.max_megapixels, view.change.reduction
        ));
    }
    let all = views.iter().zip(&subjects);
    for (view, subject) in all.chain(elevated.iter().map(|(view, subject)| (view, subject))) {
        let of_view = |text: &dyn std::fmt::Display| format!("view {}: {text}", view.viewpoint());
        warnings.extend(subject.warnings.iter().map(|warning| of_view(warning)));
    }
    warnings.extend(suggestions.iter().map(|suggestion| {
        let done = if suggestion.applied { "; it is used so" } else { "; check angle and drawing" };
        format!("{}{done}", suggestion.text)
    }));
    let enlarges = !has_truth && !subjects.iter().all(is_clean) && enlarge(&mut alignment);
    let moved = enlarges || !are_of_one_size(&views) || needs_canvas(&alignment);
    let size = (alignment.canvas.width, alignment.canvas.height);
    let mut places = elevated::places(&mut alignment, (&views, &subjects), &elevated);
    let drawn = views.iter().chain(elevated.iter().map(|(view, _)| view));
    if let Some(warning) = fit_in(&mut alignment, &mut places, drawn, options, max_working_bytes)? {
        warnings.push(warning);
    }
    let moves = moved || size != (alignment.canvas.width, alignment.canvas.height);
    let laid = if moves { apply(&alignment, &paired(&views, &subjects)) } else { Vec::new() };
    let doubts = if suggestions.iter().all(|suggestion| suggestion.applied) {
        doubts(&views, &subjects, &alignment, moves.then_some(&laid))
    } else {
        vec![None; views.len()]
    };
    let mut trust = Vec::new();
    let mut drawings = Vec::with_capacity(views.len());
    let mut sheet = Vec::with_capacity(views.len());
    let mut cut_outs = Vec::with_capacity(views.len());
    let mut places_on_canvas = Vec::with_capacity(views.len() + elevated.len());
    places_on_canvas.extend(views.iter().zip(&alignment.views).map(|(view, found)| {
        PlaceOnCanvas::new(view, if moves { found.transform } else { Transform::IDENTITY })
    }));
    let on_canvas: Vec<_> = alignment.views.iter().map(|found| found.transform).collect();
    let mut laid = laid.into_iter().zip(on_canvas);
    for ((view, subject), doubt) in views.into_iter().zip(subjects).zip(doubts) {
        let by_hand = is_by_hand(view.document) || view.mask.is_some();
        let as_drawn =
            !moves && !by_hand && doubt.is_none() && is_clean(&subject) && is_opaque(&view.drawing);
        drawings.push(report(&view, &subject, as_drawn, by_hand));
        let viewpoint = view.viewpoint();
        let (mut view, cut_out) = view_of(view, subject, laid.next(), as_drawn);
        if let (Some(doubt), Some(mask)) = (&doubt, &mut view.mask) {
            // What the others show there is not cut off.
            let pixels = mask.iter_mut().zip(doubt.as_raw());
            pixels.filter(|(_, trust)| **trust == 0).for_each(|(level, _)| *level = 255);
            warnings.push(lacking(viewpoint, doubt));
        }
        trust.extend(doubt.map(|doubt| (viewpoint, doubt)));
        cut_outs.push((viewpoint, cut_out));
        sheet.push(view);
    }
    for ((view, subject), place) in elevated.into_iter().zip(places) {
        let canvas = (alignment.canvas.width, alignment.canvas.height);
        let stays = place == Transform::IDENTITY && (!moves || view.drawing.dimensions() == canvas);
        let by_hand = is_by_hand(view.document) || view.mask.is_some();
        let as_drawn = stays && !by_hand && is_clean(&subject) && is_opaque(&view.drawing);
        drawings.push(report(&view, &subject, as_drawn, by_hand));
        let laid = if stays { None } else { elevated::laid(&alignment, place, &view, &subject) };
        let laid = laid.map(|laid| (laid, place));
        let viewpoint = view.viewpoint();
        places_on_canvas.push(PlaceOnCanvas::new(&view, place));
        let (view, cut_out) = view_of(view, subject, laid, as_drawn);
        cut_outs.push((viewpoint, cut_out));
        sheet.push(view);
    }
    let alignment = moves.then_some(alignment);
    let places = places_on_canvas;
    let done = Preparation { drawings, cut_outs, trust, alignment, suggestions, warnings, places };
    Ok((sheet, done))
}

/// Per view where it lacks a part that the others show, if it does.
///
/// * `laid`: the views on the common canvas, if they were moved there.
fn doubts(
    views: &[DecodedView<'_>],
    subjects: &[Subject],
    alignment: &Alignment,
    laid: Option<&Vec<Aligned>>,
) -> Vec<Option<GrayImage>> {
    if views.len() < 3 {
        return vec![None; views.len()];
    }
    let masks: Vec<&GrayImage> = match laid {
        Some(laid) => laid.iter().map(|view| &view.mask).collect(),
        None => subjects.iter().map(|subject| &subject.mask).collect(),
    };
    let found = trust(alignment, &masks, laid.is_some());
    let count = |image: &GrayImage, is: &dyn Fn(u8) -> bool| {
        image.as_raw().iter().filter(|level| is(**level)).count() as f64
    };
    let of_view = |((doubt, mask), subject): ((Option<GrayImage>, &&GrayImage), &Subject)| {
        let lacking = count(doubt.as_ref()?, &|level| level == 0);
        let small = lacking <= MAX_LACKING * count(mask, &|level| level >= 128);
        doubt.filter(|_| small && subject.kind != DrawingKind::Given)
    };
    found.into_iter().zip(&masks).zip(subjects).map(of_view).collect()
}

fn lacking(view: Viewpoint, doubt: &GrayImage) -> String {
    let places = doubt.enumerate_pixels().filter(|(.., level)| level.0[0] == 0);
    let bounds = places.fold((u32::MAX, 0, u32::MAX, 0), |b, (x, y, _)| {
        (b.0.min(x), b.1.max(x), b.2.min(y), b.3.max(y))
    });
    let (left, right, top, bottom) = bounds;
    format!(
        "view {view}: nothing is drawn where the other views show the subject, at columns \
         {left} to {right}, rows {top} to {bottom}; the draft is not cut off there"
    )
}

fn find_in(
    view: &DecodedView<'_>,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Subject, DraftError> {
    let document = view.document;
    let point = |&given: &[f64; 2]| {
        let [x, y] = view.change.place(given);
        Point { x, y }
    };
    let points = |given: &[[f64; 2]]| given.iter().map(point).collect();
    let hints = Hints {
        mask: view.mask.clone(),
        polygon: (!document.polygon.is_empty()).then(|| points(&document.polygon)),
        erase: document.erase.iter().map(|area| points(area)).collect(),
        attach: points(&document.attach),
        ignore: points(&document.ignore),
    };
    let subject_options = SubjectOptions { clean: options.clean, ..SubjectOptions::default() };
    let cancelled = || observer.is_cancelled();
    find(&view.drawing, &hints, &subject_options, &cancelled).map_err(|error| {
        let code = match error {
            SubjectError::Cancelled => return DraftError::Cancelled(progress::Cancelled),
            SubjectError::CoversImage => FailureCode::NoPaper,
            SubjectError::Empty { .. } | SubjectError::NoPixels { .. } => FailureCode::BlankView,
            SubjectError::MaskSizeDiffers { .. } | SubjectError::TooFewPoints { .. } => {
                FailureCode::InvalidSheet
            }
        };
        let detail = format!("view {}: {error}; {}", view.viewpoint(), code.remedy());
        DraftError::input(code, detail)
    })
}

fn is_by_hand(document: &ViewDocument) -> bool {
    let lists = [document.polygon.len(), document.erase.len()];
    lists.iter().any(|count| *count > 0)
        || !(document.attach.is_empty() && document.ignore.is_empty())
}

/// Whether a drawing is clean line art, which needs no help.
fn is_clean(subject: &Subject) -> bool {
    subject.kind == DrawingKind::LineArt
        && subject.polarity == Polarity::DarkOnLight
        && subject.paper.unevenness < MAX_UNEVENNESS
        && subject.paper.noise < MAX_NOISE
        && subject.paper.colour.iter().all(|&level| level >= LEAST_WHITE)
        && subject.removed.is_empty()
        && subject.closed_gaps.is_empty()
        && subject.warnings.is_empty()
}

fn is_opaque(drawing: &RgbaImage) -> bool {
    drawing.pixels().all(|pixel| pixel.0[3] == 255)
}

fn paired<'a>(views: &[DecodedView<'_>], subjects: &'a [Subject]) -> Vec<subject::View<'a>> {
    let pairs = views.iter().zip(subjects);
    let view = |(view, subject): (&DecodedView<'_>, &'a Subject)| subject::View {
        azimuth_deg: view.azimuth.degrees(),
        subject,
    };
    pairs.map(view).collect()
}

fn aligned(views: &[DecodedView<'_>], subjects: &[Subject]) -> Alignment {
    let pairs = paired(views, subjects);
    let mut alignment = align(&pairs, &AlignOptions::default());
    let hands: Vec<ByHand> = views.iter().map(DecodedView::by_hand).collect();
    place_by_hand(&mut alignment, &pairs, &hands);
    alignment
}

/// Whether the drawings have the same columns and rows, without which they have no place in common.
fn are_of_one_size(views: &[DecodedView<'_>]) -> bool {
    views.windows(2).all(|pair| pair[0].drawing.dimensions() == pair[1].drawing.dimensions())
}

/// Whether views differ by more than the method's own registration mends.
fn needs_canvas(alignment: &Alignment) -> bool {
    let canvas = &alignment.canvas;
    let height = (canvas.rows[1] - canvas.rows[0]).max(1.0);
    alignment.views.iter().any(|view| {
        let transform = &view.transform;
        let top = transform.scale * view.rows[0] + transform.dy - view.rows[0];
        let axis = transform.scale * view.axis_x + transform.dx - view.axis_x;
        view.by_hand
            || (transform.scale - 1.0).abs() > REGISTERED_SCALE
            || top.abs().max(axis.abs()) > REGISTERED_SHIFT * height
    })
}

/// Lays small figures on a larger canvas, by a whole factor; whether they are.
fn enlarge(alignment: &mut Alignment) -> bool {
    let canvas = &mut alignment.canvas;
    let wanted = (MIN_FIGURE_ROWS / (canvas.rows[1] - canvas.rows[0]).max(1.0)).ceil();
    let factor =
        wanted.min((MAX_ENLARGED_SIDE / f64::from(canvas.width.max(canvas.height))).floor());
    if factor <= 1.0 {
        return false;
    }
    (canvas.width, canvas.height) = (canvas.width * factor as u32, canvas.height * factor as u32);
    canvas.axis_x *= factor;
    canvas.rows = canvas.rows.map(|row| row * factor);
    for view in &mut alignment.views {
        let Transform { scale, dx, dy } = view.transform;
        view.transform = Transform { scale: scale * factor, dx: dx * factor, dy: dy * factor };
    }
    alignment.changes = true;
    true
}

/// Holds the canvas, which can be larger than every drawing, against what the job may take: one
/// that is larger than `sheet.max_megapixels` and the drawings is reduced, with a warning.
///
/// * `places`: those of `elevated` on the canvas.
/// * `drawn`: all views.
fn fit_in<'a>(
    alignment: &mut Alignment,
    places: &mut [Transform],
    drawn: impl Iterator<Item = &'a DecodedView<'a>>,
    options: &Options,
    max_working_bytes: u64,
) -> Result<Option<String>, DraftError> {
    let (width, height) = (alignment.canvas.width, alignment.canvas.height);
    let pixels = f64::from(width) * f64::from(height);
    let sizes: Vec<(u32, u32)> = drawn.map(|view| view.drawing.dimensions()).collect();
    let largest = |side: fn(&(u32, u32)) -> u32| sizes.iter().map(side).max().unwrap_or(0);
    let drawings = f64::from(largest(|size| size.0)) * f64::from(largest(|size| size.1));
    let factor = (pixels / drawings.max(options.sheet.max_megapixels * 1e6)).sqrt();
    let mut warning = None;
    if factor > 1.0 {
        let onto = alignment.shrink(factor);
        places.iter_mut().for_each(|place| *place = place.then(&onto));
        let canvas = &alignment.canvas;
        warning = Some(format!(
            "the canvas on which the views fit together is {width}x{height} px and was reduced to \
             {}x{} (sheet.max_megapixels); maps and the draft are of that size",
            canvas.width, canvas.height
        ));
    }
    let Canvas { width, height, .. } = alignment.canvas;
    let needed = turntable::working_bytes(sizes.len(), u64::from(width) * u64::from(height));
    if needed <= max_working_bytes {
        return Ok(warning);
    }
    let code = FailureCode::TooLarge;
    let detail = format!(
        "the {} views fit together on a canvas of {width}x{height} px, which needs about {needed} \
         bytes of memory, over the limit of {max_working_bytes}; draw them to one scale or lower \
         sheet.max_megapixels",
        sizes.len()
    );
    Err(DraftError::input(code, detail))
}

fn suggestions(
    views: &[DecodedView<'_>],
    subjects: &[Subject],
    alignment: &Alignment,
) -> Vec<SuggestionReport> {
    if !(3..=MAX_TESTED_VIEWS).contains(&views.len()) {
        return Vec::new();
    }
    let tested = hypotheses(&paired(views, subjects), alignment, &HypothesisOptions::default());
    let best = tested.suggestions.into_iter().take(1);
    best.map(|verdict| SuggestionReport {
        text: verdict.suggestion.to_string(),
        suggestion: verdict.suggestion,
        margin: verdict.margin,
        applied: false,
    })
    .collect()
}

/// Changes azimuths or mirrors drawings as a suggestion says.
fn follow(
    suggestion: Suggestion,
    views: &mut Vec<DecodedView<'_>>,
    subjects: &mut Vec<Subject>,
) -> Result<bool, DraftError> {
    let azimuth = |degrees: f64| {
        Azimuth::from_degrees(degrees)
            .map_err(|error| DraftError::input(FailureCode::InvalidAzimuth, error))
    };
    let place = |views: &[DecodedView<'_>], degrees: f64| {
        views.iter().position(|view| view.azimuth.degrees() == degrees)
    };
    match suggestion {
        Suggestion::OtherSide { azimuth_deg, better_deg }
        | Suggestion::Angle { azimuth_deg, better_deg } => {
            let Some(at) = place(views, azimuth_deg) else { return Ok(false) };
            views[at].azimuth = azimuth(better_deg)?;
        }
        Suggestion::Mirrored { azimuth_deg } => {
            let Some(at) = place(views, azimuth_deg) else { return Ok(false) };
            views[at].change.turned ^= true;
            imageops::flip_horizontal_in_place(&mut views[at].drawing);
            let subject = &mut subjects[at];
            imageops::flip_horizontal_in_place(&mut subject.mask);
            imageops::flip_horizontal_in_place(&mut subject.ink);
            imageops::flip_horizontal_in_place(&mut subject.colour);
        }
        Suggestion::Swapped { azimuths_deg: [one, other] } => {
            let (Some(a), Some(b)) = (place(views, one), place(views, other)) else {
                return Ok(false);
            };
            (views[a].azimuth, views[b].azimuth) = (azimuth(other)?, azimuth(one)?);
        }
    }
    let mut both: Vec<_> = views.drain(..).zip(subjects.drain(..)).collect();
    both.sort_by_key(|(view, _)| view.azimuth);
    (*views, *subjects) = both.into_iter().unzip();
    Ok(true)
}

fn report(
    view: &DecodedView<'_>,
    subject: &Subject,
    as_drawn: bool,
    by_hand: bool,
) -> DrawingReport {
    DrawingReport {
        azimuth_deg: view.azimuth.degrees(),
        elevation_deg: view.elevation.degrees(),
        kind: subject.kind,
        polarity: subject.polarity,
        paper: subject.paper,
        reduced_by: view.change.reduction,
        as_drawn,
        by_hand,
        stroke_px: subject.stroke_px,
        outline_px: subject.outline_px,
        removed: subject.removed.clone(),
        pieces: subject.pieces.clone(),
        closed_gaps: subject.closed_gaps.clone(),
        warnings: subject.warnings.iter().map(ToString::to_string).collect(),
    }
}

/// What the method works from, the drawing as it is or what was found in it,
/// and the subject cut out.
fn view_of(
    view: DecodedView<'_>,
    subject: Subject,
    aligned: Option<(Aligned, Transform)>,
    as_drawn: bool,
) -> (View, RgbaImage) {
    let (azimuth, elevation) = (view.azimuth, view.elevation);
    let given = matches!(subject.kind, DrawingKind::Given | DrawingKind::CutOut);
    let mask_was_found = !given || view.document.mask_with_outline;
    let leaves_out =
        matches!(subject.kind, DrawingKind::Flat | DrawingKind::Shaded | DrawingKind::CutOut);
    let mask_has_holes = leaves_out || view.document.mask_has_holes;
    let scale = aligned.as_ref().map_or(1.0, |(_, place)| place.scale);
    let outline_px = view.document.outline_px.map(|width| width / view.change.reduction);
    let outline_px = outline_px.or(subject.outline_px).map(|width| width * scale);
    let (image, mask, color, cut_out): (GrayImage, GrayImage, _, _) = match aligned {
        Some((Aligned { mask, ink, colour }, _)) => (ink, mask, color_of(&colour), colour),
        None => (subject.ink, subject.mask, color_of(&view.drawing), subject.colour),
    };
    let level = if as_drawn {
        View::level(azimuth, picture::flatten(&view.drawing).gray, None)
    } else {
        let level = View::level(azimuth, image, Some(mask));
        View { mask_was_found, outline_px, mask_has_holes, ..level }
    };
    (View { elevation, color, ..level }, cut_out)
}

/// A drawing's colours on white paper; `None` if it is grey.
fn color_of(drawing: &RgbaImage) -> Option<RgbImage> {
    let is_grey = |[r, g, b, a]: [u8; 4]| a == 0 || (r.abs_diff(g) < 8 && g.abs_diff(b) < 8);
    if drawing.pixels().all(|pixel| is_grey(pixel.0)) {
        return None;
    }
    Some(RgbImage::from_fn(drawing.width(), drawing.height(), |x, y| {
        let [r, g, b, a] = drawing.get_pixel(x, y).0.map(u16::from);
        Rgb([r, g, b].map(|level| ((level * a + 255 * (255 - a) + 127) / 255) as u8))
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use frames::Elevation;
    use image::Rgba;
    use progress::Silent;

    #[test]
    fn points_of_a_mirrored_drawing_are_of_the_drawing_as_sent() {
        let mut drawing = RgbaImage::from_pixel(120, 100, Rgba([255; 4]));
        for (x, y) in (20..50).flat_map(|x| (20..80).map(move |y| (x, y))) {
            drawing.put_pixel(x, y, Rgba([40, 40, 40, 255]));
        }
        imageops::flip_horizontal_in_place(&mut drawing);
        let document = ViewDocument {
            polygon: vec![[20.0, 20.0], [50.0, 20.0], [50.0, 80.0], [20.0, 80.0]],
            mirrored: true,
            ..ViewDocument::default()
        };
        let azimuth = Azimuth::from_degrees(0.0).unwrap();
        let elevation = Elevation::LEVEL;
        let view = DecodedView {
            document: &document,
            azimuth,
            elevation,
            change: Change { turned: true, width_px: drawing.width(), reduction: 1.0 },
            drawing,
            mask: None,
        };
        let mask = find_in(&view, &Options::default(), &Silent).unwrap().mask;
        let columns = |columns: std::ops::Range<u32>| {
            columns.filter(|x| mask.get_pixel(*x, 50).0[0] != 0).count()
        };
        assert_eq!((columns(0..68), columns(72..98)), (0, 26));
    }
}
