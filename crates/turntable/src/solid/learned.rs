//! The learned prior and the solid's distances as one field.

use std::sync::OnceLock;

use prior::{LogitField, Prior, PriorError, PriorInput, PriorView};
use progress::Observer;

use super::outline::Outline;
use super::smoothing;
use super::solid_views::{SolidSheet, SolidView};
use crate::surface::field::{Field, Plane};
use crate::views::ViewSet;

/// What the prior says of the subject on `sheet`, of drawn views alone: mirrored
/// ones tell it nothing that it does not know.
///
/// * `guessed`: what a view from the side is taken to show, where none was drawn.
pub(super) fn logits(
    sheet: &SolidSheet,
    views: &ViewSet,
    guessed: Option<&Outline>,
    observer: &dyn Observer,
) -> Result<LogitField, PriorError> {
    static PRIOR: OnceLock<Option<Prior>> = OnceLock::new();
    let loaded = PRIOR.get_or_init(|| Prior::load().ok()).as_ref();
    let prior = loaded.ok_or_else(|| PriorError::Weights("the file".to_owned()))?;
    let drawn = || sheet.views.iter().filter(|view| view.mirror_sum_px.is_none());
    let masks: Vec<Vec<f32>> = drawn().map(|view| coverage(sheet, &view.outline)).collect();
    let ink: Vec<Vec<f32>> = drawn().map(|view| darkness(views, view)).collect();
    let of_view = |((view, mask), ink): ((&SolidView, _), _)| -> PriorView<'_> {
        let (mask, ink): (&Vec<f32>, &Vec<f32>) = (mask, ink);
        PriorView { azimuth_rad: view.outline.azimuth_rad, mask, ink }
    };
    let input = PriorInput {
        views: drawn().zip(&masks).zip(&ink).map(of_view).collect(),
        size: (sheet.width, sheet.height),
        axis_px: sheet.axis_px,
        origin_row_px: sheet.origin_row_px,
        half_depth_px: guessed.and_then(Outline::column_range).map(|(_, high)| high),
    };
    prior.occupancy(&input, observer)
}

/// How far each pixel lies within the outline's intervals.
fn coverage(sheet: &SolidSheet, outline: &Outline) -> Vec<f32> {
    let mut mask = vec![0.0; sheet.width * sheet.height];
    for (y, row) in mask.chunks_exact_mut(sheet.width).enumerate() {
        for &(low, high) in outline.row(y) {
            let (low, high) = (low + sheet.axis_px, high + sheet.axis_px);
            let first = low.floor().max(0.0) as usize;
            let end = (high.ceil().max(0.0) as usize).min(sheet.width);
            for (x, value) in row.iter_mut().enumerate().take(end).skip(first) {
                let shared = high.min((x + 1) as f64) - low.max(x as f64);
                *value += shared.max(0.0) as f32;
            }
        }
    }
    mask
}

/// How dark the view's drawing is at each pixel.
fn darkness(views: &ViewSet, view: &SolidView) -> Vec<f32> {
    let image = views.views()[view.drawing].image.as_raw();
    image.iter().map(|&level| 1.0 - f32::from(level) / 255.0).collect()
}

/// How much more the prior must say against the solid than for it, logits.
const MARGIN: f32 = 1.0;
/// How much more that is where depth maps had their say.
const DEPTH_GAIN: f32 = 2.0;
/// The same where lines show most corners of a slice: its walls are known.
const DRAWN_GAIN: f32 = 6.0;
/// From the first share of drawn corners on that is said to some degree, from
/// the second on wholly.
const DRAWN_SHARES: (f32, f32) = (0.6, 0.9);
/// The distance from the solid's surface from which on the margin is whole,
/// nodes of the lattice.
const RAMP: f32 = 3.0;
/// How much a logit counts as distance, nodes of the lattice.
const PITCHES_PER_LOGIT: f32 = 0.7;

/// The solid and the prior as one field.
///
/// Signed distances of `field` become logits of at most [`MARGIN`] and are added
/// to the prior's, of more where depth maps had their say (`has_depth`) and where
/// lines show the corners of a slice; nothing lies beyond `hulls`. The less the
/// drawings agree (`apart`, 0 to 1), the less the solid says: its slices are of
/// rows that show different heights of the subject.
///
/// * `hulls`: the sections of the slices.
/// * `drawn`: per slice, the share of its corners that are drawn as lines.
pub(super) fn blend(
    field: &Field,
    hulls: &[Plane],
    directions: &[Outline],
    logits: &LogitField,
    has_depth: bool,
    drawn: &[f32],
    apart: f32,
) -> Field {
    use rayon::prelude::*;
    let lattice = field.lattice;
    let limit = lattice.truncation_px() as f32;
    let pitch = lattice.pitch_px as f32;
    let margin = if has_depth { MARGIN * DEPTH_GAIN } else { MARGIN } * (1.0 - apart);
    let blended = |(k, (plane, hull)): (usize, (&Plane, &Plane))| {
        let mut out = Plane { creases: plane.creases.clone(), ..hull.clone() };
        let z = lattice.z(k);
        let (low, high) = DRAWN_SHARES;
        let known =
            drawn.get(k).map_or(0.0, |share| ((share - low) / (high - low)).clamp(0.0, 1.0));
        let margin = margin * (1.0 + (DRAWN_GAIN - 1.0) * known);
        for (index, value) in out.values.iter_mut().enumerate() {
            if *value > 0.0 {
                let (i, j) = hull.node(index);
                let own = plane.at(i, j, -limit);
                let logit = logits.sample([lattice.x(i), lattice.y(j), z]);
                let sum = logit + margin * (own / (RAMP * pitch)).clamp(-1.0, 1.0);
                *value = (sum * PITCHES_PER_LOGIT * pitch).min(*value).clamp(-limit, limit);
            }
        }
        out
    };
    let planes: Vec<Plane> = field.planes.par_iter().zip(hulls).enumerate().map(blended).collect();
    let mut field = Field { lattice, planes };
    smoothing::smooth(&mut field, hulls, directions, apart);
    field
}
