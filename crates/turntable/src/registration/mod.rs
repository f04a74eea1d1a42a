//! How well drawn views agree, and what makes them agree better.
//!
//! Level views of one subject share its rows: top and bottom tell each view's
//! scale and height. Sideways, a row's middle moves with the azimuth as a wave
//! of odd order does, `X cos a + Y sin a` and little more: what does not fit is
//! how far a view is off. Moving the subject moves all views alike and changes
//! nothing: of all corrections that fit, the smallest are taken.

mod consistency;
mod profile;
mod sideways;
#[cfg(test)]
mod tests;
mod vertical;

use std::borrow::Cow;

use image::{GrayImage, Luma, Rgb, RgbImage};
use rayon::prelude::*;

use crate::silhouette::Silhouettes;
use crate::views::ViewSet;
use consistency::{consistencies, contradicting, mean};
use frames::Azimuth;
use profile::Profile;
use sheet::View;

/// Differences up to this are the drawing's own noise, px.
const NOISE_PX: f64 = 1.25;
/// Shifts to the side may cost this much of the views' mean consistency.
const MAX_LOSS: f64 = 0.005;

/// What was found about one view.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ViewRegistration {
    /// The view's azimuth.
    #[serde(skip)]
    pub azimuth: Azimuth,
    /// The drawing's size relative to the others'; 1 if it agrees.
    pub scale: f64,
    /// How far the drawing is off to the right and downward, px; 0 if it agrees.
    pub shift_x_px: f64,
    /// Downward, px.
    pub shift_y_px: f64,
    /// The share of rows in which this view fits its neighbours, after the
    /// correction, 0 to 1.
    pub consistency: f64,
    /// Whether the others agree clearly better without this view.
    pub contradicts: bool,
}

impl ViewRegistration {
    pub(crate) fn agreeing(azimuth: Azimuth) -> Self {
        Self {
            azimuth,
            scale: 1.0,
            shift_x_px: 0.0,
            shift_y_px: 0.0,
            consistency: 1.0,
            contradicts: false,
        }
    }

    /// Whether the drawing must be moved or scaled to agree.
    pub fn corrects(&self) -> bool {
        self.scale != 1.0 || self.shift_x_px != 0.0 || self.shift_y_px != 0.0
    }
}

/// Estimates each view's scale and shift against the others, and how well it
/// agrees once they are undone. In the views' order.
///
/// * `silhouettes`: each of its own view alone: opposite ones not yet joined.
pub fn register(views: &ViewSet, silhouettes: &Silhouettes) -> Vec<ViewRegistration> {
    let profiles: Vec<Profile> = silhouettes
        .silhouettes
        .par_iter()
        .map(|silhouette| Profile::new(silhouette, views))
        .collect();
    let origin = views.origin_row_px();
    let found = vertical::register(&profiles, origin);
    let upright = Scored::new(found.views, &profiles, origin);
    let shifts = sideways::shifts(&upright.undone, found.scatter_px);
    let mut shifted = upright.views.clone();
    for (view, shift_px) in shifted.iter_mut().zip(shifts) {
        view.shift_x_px = shift_px * view.scale;
    }
    let shifted = Scored::new(shifted, &profiles, origin);
    // What fits the sections' form must fit their bounds too.
    let worse = mean(&upright.scores) - mean(&shifted.scores) > MAX_LOSS;
    if worse { upright.rated() } else { shifted.rated() }
}

/// Corrections, the profiles once they are undone, and how well each then
/// agrees.
struct Scored {
    views: Vec<ViewRegistration>,
    undone: Vec<Profile>,
    scores: Vec<f64>,
}

impl Scored {
    fn new(views: Vec<ViewRegistration>, profiles: &[Profile], origin_row_px: f64) -> Self {
        let pairs = profiles.iter().zip(&views);
        let undone: Vec<Profile> =
            pairs.map(|(profile, found)| profile.corrected(found, origin_row_px)).collect();
        let scores = consistencies(&undone);
        Self { views, undone, scores }
    }

    fn rated(mut self) -> Vec<ViewRegistration> {
        for (view, score) in self.views.iter_mut().zip(&self.scores) {
            view.consistency = *score;
        }
        for index in contradicting(&self.undone, self.scores) {
            self.views[index].contradicts = true;
        }
        self.views
    }
}

/// The views with their corrections undone; `None` if none needs one.
///
/// # Panics
/// If `found` does not have one entry per view.
pub fn corrected<'a>(views: &ViewSet<'a>, found: &[ViewRegistration]) -> Option<ViewSet<'a>> {
    assert_eq!(views.views().len(), found.len());
    if !found.iter().any(ViewRegistration::corrects) {
        return None;
    }
    let place = (views.axis_px(), views.origin_row_px());
    let moved = |(view, found): (&Cow<'a, View>, &ViewRegistration)| {
        if found.corrects() { Cow::Owned(moved_view(view, found, place)) } else { view.clone() }
    };
    ViewSet::new(views.views().par_iter().zip(found).map(moved).collect()).ok()
}

/// A view with its correction undone.
///
/// * `axis`, `origin`: the turning axis' column and the origin's row, px.
pub(crate) fn moved_view(
    view: &View,
    found: &ViewRegistration,
    (axis, origin): (f64, f64),
) -> View {
    let resample = |image: &GrayImage, found: &ViewRegistration, paper: f64| {
        GrayImage::from_fn(image.width(), image.height(), |x, y| {
            let u = (f64::from(x) + 0.5 - axis) * found.scale + axis + found.shift_x_px;
            let v = (f64::from(y) + 0.5 - origin) * found.scale + origin + found.shift_y_px;
            Luma([bilinear(image, u - 0.5, v - 0.5, paper).round() as u8])
        })
    };
    View {
        azimuth: view.azimuth,
        elevation: view.elevation,
        image: resample(&view.image, found, f64::from(view.image.get_pixel(0, 0).0[0])),
        mask: view.mask.as_ref().map(|mask| resample(mask, found, 0.0)),
        mask_was_found: view.mask_was_found,
        outline_px: view.outline_px.map(|width| width / found.scale),
        mask_has_holes: view.mask_has_holes,
        color: view.color.as_ref().map(|color| moved_color(color, found, (axis, origin))),
    }
}

/// The nearest colours; white beyond the image.
fn moved_color(color: &RgbImage, found: &ViewRegistration, (axis, origin): (f64, f64)) -> RgbImage {
    RgbImage::from_fn(color.width(), color.height(), |x, y| {
        let u = (f64::from(x) + 0.5 - axis) * found.scale + axis + found.shift_x_px;
        let v = (f64::from(y) + 0.5 - origin) * found.scale + origin + found.shift_y_px;
        let inside =
            u >= 0.0 && v >= 0.0 && u < f64::from(color.width()) && v < f64::from(color.height());
        if inside { *color.get_pixel(u as u32, v as u32) } else { Rgb([255; 3]) }
    })
}

/// Bilinear interpolation at pixel centres; `outside` beyond the image.
fn bilinear(image: &GrayImage, x: f64, y: f64, outside: f64) -> f64 {
    let (left, top) = (x.floor(), y.floor());
    let at = |dx: f64, dy: f64| {
        let (x, y) = (left + dx, top + dy);
        let inside =
            x >= 0.0 && y >= 0.0 && x < f64::from(image.width()) && y < f64::from(image.height());
        if inside { f64::from(image.get_pixel(x as u32, y as u32).0[0]) } else { outside }
    };
    let (u, v) = (x - left, y - top);
    let upper = at(0.0, 0.0) * (1.0 - u) + at(1.0, 0.0) * u;
    let lower = at(0.0, 1.0) * (1.0 - u) + at(1.0, 1.0) * u;
    upper * (1.0 - v) + lower * v
}
