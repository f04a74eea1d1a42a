//! Scale and height of each view from its top and bottom row.

use super::profile::Profile;
use super::{NOISE_PX, ViewRegistration};

/// How far off drawings usually are in size, share.
const USUAL_SCALE: f64 = 0.02;
/// How far off drawings usually are in height, px.
const USUAL_SHIFT_PX: f64 = 3.0;
/// How well a drawing's top and bottom are known, px.
const END_NOISE_PX: f64 = 1.0;
/// Views whose ends are off by less are left alone, px.
const MIN_MOVE_PX: f64 = 0.5;
const ROUNDS: usize = 10;

/// What [`register`] found.
pub(super) struct Vertical {
    /// With scales and heights; the shifts to the side are 0.
    pub views: Vec<ViewRegistration>,
    /// How far the views are off each other vertically, root mean square, px.
    pub scatter_px: f64,
}

/// Scales and heights that make the views' tops and bottoms agree, if they do
/// not as they are.
pub(super) fn register(profiles: &[Profile], origin_row_px: f64) -> Vertical {
    let mut views: Vec<_> =
        profiles.iter().map(|profile| ViewRegistration::agreeing(profile.azimuth)).collect();
    let extents: Vec<_> = profiles.iter().map(Profile::vertical_extent).collect();
    let top = centre(extents.iter().flatten().map(|extent| extent.0).collect());
    let bottom = centre(extents.iter().flatten().map(|extent| extent.1).collect());
    let off = |&(own_top, own_bottom): &(f64, f64)| (own_top - top, own_bottom - bottom);
    let ends = extents.iter().flatten().map(off).flat_map(|(top, bottom)| [top, bottom]);
    let worst_px = ends.fold(0.0, |worst: f64, end| worst.max(end.abs()));
    if worst_px <= NOISE_PX || bottom <= top {
        return Vertical { views, scatter_px: 0.0 };
    }
    for (view, extent) in views.iter_mut().zip(&extents) {
        if let Some(ends) =
            extent.as_ref().map(off).filter(|(a, b)| a.abs().max(b.abs()) > MIN_MOVE_PX)
        {
            let (scale, shift_px) = correction(ends, [top, bottom], origin_row_px);
            (view.scale, view.shift_y_px) = (scale, shift_px);
        }
    }
    let shifts = views.iter().map(|view| view.shift_y_px.powi(2)).sum::<f64>();
    let freedom = (views.len() - 1).max(1) as f64;
    Vertical { views, scatter_px: (shifts / freedom).sqrt() }
}

/// The mean of what is not far off the median.
fn centre(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let Some(&(mut centre)) = values.get(values.len() / 2) else {
        return 0.0;
    };
    for _ in 0..ROUNDS {
        let weight = |value: &f64| 1.0 / (USUAL_SHIFT_PX.powi(2) + (value - centre).powi(2));
        let sum: f64 = values.iter().map(|value| weight(value) * value).sum();
        centre = sum / values.iter().map(weight).sum::<f64>();
    }
    centre
}

/// The scale and the downward shift that most likely put a view's ends where
/// they are: `e(z) = (scale - 1) z + shift` at height `z` from the origin.
///
/// Most drawings are off by little, a few by much: the prior has long tails.
fn correction(ends: (f64, f64), reference: [f64; 2], origin_row_px: f64) -> (f64, f64) {
    let [high, low] = reference.map(|row| row - origin_row_px);
    let (mut stretch, mut shift) = ((ends.1 - ends.0) / (low - high), 0.0);
    shift += ends.0 - stretch * high;
    for _ in 0..ROUNDS {
        let noise = END_NOISE_PX.powi(2);
        let of_stretch = noise / (USUAL_SCALE.powi(2) + stretch * stretch);
        let of_shift = noise / (USUAL_SHIFT_PX.powi(2) + shift * shift);
        let (a, b, d) = (high * high + low * low + of_stretch, high + low, 2.0 + of_shift);
        let (p, q) = (high * ends.0 + low * ends.1, ends.0 + ends.1);
        let determinant = a * d - b * b;
        stretch = (d * p - b * q) / determinant;
        shift = (a * q - b * p) / determinant;
    }
    (1.0 + stretch, shift)
}
