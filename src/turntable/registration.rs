//! How well drawn views agree, and what makes them agree better.
//!
//! Level views of one subject share its rows: top and bottom must agree. In a
//! row, every view's sight lines at the outline must touch the section that
//! the others leave: for neighbours `s` before and `t` after,
//! `h(a) sin(s + t) <= h(a - s) sin t + h(a + t) sin s` for the section's
//! support `h` on the right, and mirrored on the left. A view shifted sideways
//! breaks one of the two; the smallest shift that mends it is the estimate.

use image::{GrayImage, Luma};
use rayon::prelude::*;

use super::silhouette::{Silhouette, Silhouettes};
use super::views::{View, ViewSet};
use crate::sheet::Azimuth;

/// Differences up to this are the drawing's own noise, px.
const NOISE_PX: f64 = 1.25;
/// Wider angles between neighbours bound a sideways shift too loosely, degrees.
const MAX_SPAN_DEG: f64 = 60.0;
/// The share of rows that may break the condition without a shift.
const OUTLIER_ROWS: f64 = 0.1;
const MIN_ROWS: usize = 8;

/// What was found about one view.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ViewRegistration {
    #[serde(skip)]
    pub azimuth: Azimuth,
    /// The drawing's size relative to the others'; 1 if it agrees.
    pub scale: f64,
    /// How far the drawing is off to the right and downward, px; 0 if it agrees.
    pub shift_x_px: f64,
    pub shift_y_px: f64,
    /// The share of rows in which this view fits its neighbours, after the
    /// correction, 0 to 1.
    pub consistency: f64,
}

impl ViewRegistration {
    /// Whether the drawing must be moved or scaled to agree.
    pub fn corrects(&self) -> bool {
        self.scale != 1.0 || self.shift_x_px != 0.0 || self.shift_y_px != 0.0
    }
}

/// Per row, the outermost columns of the subject, px from the axis.
#[derive(Clone)]
struct Profile {
    azimuth: Azimuth,
    rows: Vec<Option<(f64, f64)>>,
}

impl Profile {
    fn new(silhouette: &Silhouette, views: &ViewSet) -> Self {
        let extent = |y: u32| {
            let runs = silhouette.intervals_px(y as usize);
            let (first, last) = (runs.first()?, runs.last()?);
            Some((first.0 - views.axis_px(), last.1 - views.axis_px()))
        };
        Self { azimuth: silhouette.azimuth(), rows: (0..views.height()).map(extent).collect() }
    }

    /// The first row with the subject, and the one after the last.
    fn vertical_extent(&self) -> Option<(f64, f64)> {
        let top = self.rows.iter().position(Option::is_some)?;
        let bottom = self.rows.iter().rposition(Option::is_some)?;
        Some((top as f64, bottom as f64 + 1.0))
    }

    /// The profile as it is once the drawing's correction is undone.
    fn corrected(&self, found: &ViewRegistration, origin_row_px: f64) -> Self {
        let row = |y: usize| {
            let drawn =
                (y as f64 + 0.5 - origin_row_px) * found.scale + origin_row_px + found.shift_y_px;
            let (left, right) = (*self.rows.get(drawn.floor().max(0.0) as usize)?)?;
            let undo = |x: f64| (x - found.shift_x_px) / found.scale;
            Some((undo(left), undo(right)))
        };
        Self { azimuth: self.azimuth, rows: (0..self.rows.len()).map(row).collect() }
    }
}

/// Estimates each view's scale and shift against the others, and how well it
/// agrees once they are undone. In the views' order.
pub fn register(views: &ViewSet, silhouettes: &Silhouettes) -> Vec<ViewRegistration> {
    let profiles: Vec<Profile> = silhouettes
        .silhouettes
        .par_iter()
        .map(|silhouette| Profile::new(silhouette, views))
        .collect();
    let origin = views.origin_row_px();
    let mut found = vertical(&profiles, origin);
    let mut level: Vec<Profile> = profiles
        .iter()
        .zip(&found)
        .map(|(profile, found)| profile.corrected(found, origin))
        .collect();
    shift_sideways(&mut level, &mut found);
    for (index, found) in found.iter_mut().enumerate() {
        found.consistency = consistency(&level, index);
    }
    found
}

/// Scale and vertical shift, from the top and bottom rows' medians.
fn vertical(profiles: &[Profile], origin_row_px: f64) -> Vec<ViewRegistration> {
    let extents: Vec<_> = profiles.iter().map(Profile::vertical_extent).collect();
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(0.0)
    };
    let top = median(extents.iter().flatten().map(|extent| extent.0).collect());
    let bottom = median(extents.iter().flatten().map(|extent| extent.1).collect());
    let of_view = |(profile, extent): (&Profile, &Option<(f64, f64)>)| {
        let mut found = ViewRegistration {
            azimuth: profile.azimuth,
            scale: 1.0,
            shift_x_px: 0.0,
            shift_y_px: 0.0,
            consistency: 1.0,
        };
        if let Some((own_top, own_bottom)) = *extent {
            let off = (own_top - top).abs().max((own_bottom - bottom).abs());
            if off > NOISE_PX && bottom > top {
                found.scale = (own_bottom - own_top) / (bottom - top);
                found.shift_y_px = own_top - origin_row_px - found.scale * (top - origin_row_px);
            }
        }
        found
    };
    profiles.iter().zip(&extents).map(of_view).collect()
}

/// Mends the view that is farthest off, until none is.
fn shift_sideways(profiles: &mut [Profile], found: &mut [ViewRegistration]) {
    for _ in 0..profiles.len() {
        let shifts: Vec<f64> =
            (0..profiles.len()).map(|index| sideways_shift(profiles, index)).collect();
        let farthest =
            (0..shifts.len()).max_by(|&a, &b| shifts[a].abs().total_cmp(&shifts[b].abs()));
        let Some(index) = farthest.filter(|&index| shifts[index].abs() > NOISE_PX) else {
            return;
        };
        found[index].shift_x_px += shifts[index] * found[index].scale;
        for (left, right) in profiles[index].rows.iter_mut().flatten() {
            *left -= shifts[index];
            *right -= shifts[index];
        }
    }
}

/// By how much view `index` must be off to the right, at least, px.
fn sideways_shift(profiles: &[Profile], index: usize) -> f64 {
    let Some(slacks) = slacks(profiles, index) else {
        return 0.0;
    };
    let tight = |pick: fn(&(f64, f64)) -> f64| {
        let mut values: Vec<f64> = slacks.iter().map(pick).collect();
        values.sort_by(f64::total_cmp);
        values[(values.len() as f64 * OUTLIER_ROWS) as usize]
    };
    let (left, right) = (tight(|slack| slack.0), tight(|slack| slack.1));
    // Broken on both sides, the view is too wide rather than shifted.
    match (left < 0.0, right < 0.0) {
        (false, true) => (-right).min(left - right),
        (true, false) => left.max(left - right),
        _ => 0.0,
    }
}

/// Per row, how far the outline on the left and right is inside what the
/// neighbours allow it to touch, px; negative where it is not.
fn slacks(profiles: &[Profile], index: usize) -> Option<Vec<(f64, f64)>> {
    let own = &profiles[index];
    let nearest = |forward: bool| {
        let angle = |other: &&Profile| {
            let (from, to) = if forward { (own, *other) } else { (*other, own) };
            from.azimuth.degrees_to(to.azimuth)
        };
        let others = profiles.iter().filter(|other| other.azimuth != own.azimuth);
        let found = others.min_by(|a, b| angle(a).total_cmp(&angle(b)))?;
        Some((found, angle(&found))).filter(|(_, degrees)| *degrees <= MAX_SPAN_DEG)
    };
    let ((before, s), (after, t)) = (nearest(false)?, nearest(true)?);
    let (s, t) = (s.to_radians(), t.to_radians());
    let touch = |a: f64, b: f64| (a * t.sin() + b * s.sin()) / (s + t).sin();
    let slack = |y: usize| {
        let (a, own, b) = (before.rows[y]?, own.rows[y]?, after.rows[y]?);
        Some((own.0 - touch(a.0, b.0), touch(a.1, b.1) - own.1))
    };
    let slacks: Vec<_> = (0..own.rows.len()).filter_map(slack).collect();
    (slacks.len() >= MIN_ROWS).then_some(slacks)
}

/// The share of the rows of view `index` or its neighbours that fit.
fn consistency(profiles: &[Profile], index: usize) -> f64 {
    let own = profiles[index].rows.iter().flatten().count();
    let common =
        profiles.iter().filter(|other| other.azimuth != profiles[index].azimuth).map(|other| {
            let both = other
                .rows
                .iter()
                .zip(&profiles[index].rows)
                .filter(|(a, b)| a.is_some() && b.is_some());
            let either = other.rows.iter().flatten().count() + own;
            let both = both.count();
            both as f64 / (either - both).max(1) as f64
        });
    let (sum, count) = common.fold((0.0, 0.0), |(sum, count), share| (sum + share, count + 1.0));
    let shared = if count > 0.0 { sum / count } else { 1.0 };
    let fitting = slacks(profiles, index).map_or(1.0, |slacks| {
        let fits = slacks.iter().filter(|slack| slack.0.min(slack.1) > -NOISE_PX).count();
        fits as f64 / slacks.len() as f64
    });
    shared * fitting
}

/// The views with their corrections undone; `None` if none needs one.
///
/// # Panics
/// If `found` does not have one entry per view.
pub fn corrected(views: &ViewSet, found: &[ViewRegistration]) -> Option<ViewSet> {
    assert_eq!(views.views().len(), found.len());
    if !found.iter().any(ViewRegistration::corrects) {
        return None;
    }
    let (axis, origin) = (views.axis_px(), views.origin_row_px());
    let resample = |image: &GrayImage, found: &ViewRegistration, paper: f64| {
        GrayImage::from_fn(image.width(), image.height(), |x, y| {
            let u = (f64::from(x) + 0.5 - axis) * found.scale + axis + found.shift_x_px;
            let v = (f64::from(y) + 0.5 - origin) * found.scale + origin + found.shift_y_px;
            Luma([bilinear(image, u - 0.5, v - 0.5, paper).round() as u8])
        })
    };
    let moved = |(view, found): (&View, &ViewRegistration)| {
        if !found.corrects() {
            return view.clone();
        }
        View {
            azimuth: view.azimuth,
            image: resample(&view.image, found, f64::from(view.image.get_pixel(0, 0).0[0])),
            mask: view.mask.as_ref().map(|mask| resample(mask, found, 0.0)),
        }
    };
    ViewSet::new(views.views().par_iter().zip(found).map(moved).collect()).ok()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::turntable::silhouette::SilhouetteOptions;

    const HALF_HEIGHT: f64 = 50.0;

    /// A solid box turned to `degrees`, drawn `scale` times as large and moved.
    fn block(degrees: f64, scale: f64, (dx, dy): (f64, f64)) -> View {
        let azimuth = Azimuth::from_degrees(degrees).unwrap();
        let (sine, cosine) = azimuth.radians().sin_cos();
        let half = scale * (40.0 * cosine.abs() + 25.0 * sine.abs());
        let image = GrayImage::from_fn(180, 160, |u, v| {
            let (x, y) = (f64::from(u) + 0.5 - 90.0 - dx, f64::from(v) + 0.5 - 80.0 - dy);
            let depth = (x.abs() - half).max(y.abs() - scale * HALF_HEIGHT);
            let ink = (0.75 + 0.5 - depth.abs()).clamp(0.0, 1.0);
            Luma([(255.0 * (1.0 - ink)).round() as u8])
        });
        View { azimuth, image, mask: None }
    }

    fn registered(odd: View) -> (ViewSet, Vec<ViewRegistration>) {
        let mut views: Vec<View> = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0]
            .into_iter()
            .map(|degrees| block(degrees, 1.0, (0.0, 0.0)))
            .collect();
        views[3] = odd;
        let views = ViewSet::new(views).unwrap();
        let silhouettes = Silhouettes::of_views(&views, &SilhouetteOptions::default()).unwrap();
        let found = register(&views, &silhouettes);
        (views, found)
    }

    #[test]
    fn views_that_agree_are_left_alone() {
        let (views, found) = registered(block(45.0, 1.0, (0.0, 0.0)));
        assert!(found.iter().all(|found| !found.corrects() && found.consistency > 0.95));
        assert!(corrected(&views, &found).is_none());
    }

    #[test]
    fn a_scaled_and_lowered_view_is_put_back() {
        let (views, found) = registered(block(45.0, 1.1, (0.0, 6.0)));
        assert!((found[3].scale - 1.1).abs() < 0.02, "{:?}", found[3]);
        assert!((found[3].shift_y_px - 6.0).abs() < 1.0, "{:?}", found[3]);
        assert!(found.iter().enumerate().all(|(k, found)| k == 3 || found.scale == 1.0));
        let mended = corrected(&views, &found).unwrap();
        let silhouettes = Silhouettes::of_views(&mended, &SilhouetteOptions::default()).unwrap();
        assert!(register(&mended, &silhouettes).iter().all(|found| found.scale == 1.0));
    }

    #[test]
    fn a_view_shifted_sideways_is_named_and_put_back() {
        let (_, found) = registered(block(45.0, 1.0, (7.0, 0.0)));
        assert!((found[3].shift_x_px - 7.0).abs() < 2.5, "{:?}", found[3]);
        let others = found.iter().enumerate().filter(|(k, _)| *k != 3);
        assert!(others.map(|(_, found)| found.shift_x_px.abs()).fold(0.0, f64::max) < 2.5);
    }

    #[test]
    fn a_view_of_something_else_scores_low() {
        let (_, found) = registered(block(45.0, 1.0, (0.0, 0.0)));
        let (_, odd) = registered({
            let mut odd = block(0.0, 1.6, (0.0, 0.0));
            odd.azimuth = Azimuth::from_degrees(45.0).unwrap();
            // As tall as the others, but far too wide.
            odd.image = GrayImage::from_fn(180, 160, |u, v| {
                let (x, y) = (f64::from(u) + 0.5 - 90.0, f64::from(v) + 0.5 - 80.0);
                let depth = (x.abs() - 75.0).max(y.abs() - HALF_HEIGHT);
                Luma([(255.0 * (depth.abs() - 0.25).clamp(0.0, 1.0)).round() as u8])
            });
            odd
        });
        assert!(odd[3].consistency < 0.2 && found[3].consistency > 0.95, "{:?}", odd[3]);
    }
}
