//! Views from above and below: where they belong beside the level ones.
//!
//! They do not share the level views' rows, so that nothing of what works row by row takes them:
//! their silhouettes cut the solid, and they colour it.
//!
//! A view at azimuth `a` has the columns of the level view there, whatever its elevation, and of the
//! one across, mirrored: these tell its scale and where its axis is. Its rows show height and depth
//! at once, `y = -(Z cos e + d sin e)`. They are believed as long as the view lies within what the
//! level views leave possible, else its middle is moved to the middle of that.

use std::borrow::Cow;

use nalgebra::Point3;

use crate::depth::{ViewDepth, depth_of_elevated};
use crate::options::SilhouetteOptions;
use crate::registration::{ViewRegistration, moved_view};
use crate::silhouette::{Silhouette, SilhouetteError};
use crate::solid::{ElevatedInput, Solid};
use crate::surface::projection::Rig;
use crate::views::{ViewSet, ViewSetError, check_size};
use frames::Viewpoint;
use sheet::View;

/// A view that is not level, as the draft has it.
#[derive(Clone, Debug)]
pub struct ElevatedView<'a> {
    /// As registered, if asked for.
    pub view: Cow<'a, View>,
    /// The subject's area in it.
    pub silhouette: Silhouette,
    /// How it was moved; `consistency` is the share of the level views' lines of sight on which it
    /// leaves something.
    pub registration: ViewRegistration,
    /// Read off the solid.
    pub depth: ViewDepth,
}

/// Off by less, scales are the drawing's own noise.
const SCALE_NOISE: f64 = 0.015;
/// The same for places, px.
const NOISE_PX: f64 = 1.25;
/// Azimuths this near are one, degrees.
const SAME_DEG: f64 = 0.5;

/// A view from above or below before there is a solid.
pub(crate) struct Placed<'a> {
    view: Cow<'a, View>,
    silhouette: Silhouette,
    registration: ViewRegistration,
}

/// Finds each view's silhouette and where it belongs; moves it there if asked for.
///
/// * `views`: not level, of the size of the level ones.
/// * `level`: the level views, registered.
/// * `hull`: points around what they leave possible.
///
/// # Errors
/// Views of another size, and drawings without a subject.
pub(crate) fn placed<'a>(
    views: &[&'a View],
    level: &ViewSet<'_>,
    hull: &[Point3<f64>],
    options: &SilhouetteOptions,
    moves: bool,
) -> Result<Vec<Placed<'a>>, ElevatedError> {
    let place = (level.axis_px(), level.origin_row_px());
    let of_view = |view: &&'a View| {
        check_size(view, (level.width(), level.height()))?;
        let silhouette = Silhouette::of_view(view, options)?;
        let registration = registered(view, &silhouette, level, hull);
        if !moves || !registration.corrects() {
            return Ok(Placed { view: Cow::Borrowed(*view), silhouette, registration });
        }
        let view = moved_view(view, &registration, place);
        let silhouette = Silhouette::of_view(&view, options)?;
        Ok(Placed { view: Cow::Owned(view), silhouette, registration })
    };
    views.iter().map(of_view).collect()
}

/// Why a view cannot be placed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ElevatedError {
    /// It is not of the level views' size.
    #[error(transparent)]
    View(#[from] ViewSetError),
    /// It shows no subject.
    #[error(transparent)]
    Silhouette(#[from] SilhouetteError),
}

/// A range of columns or rows from the axis or the origin's row, px.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Range {
    low: f64,
    high: f64,
}

impl Range {
    fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        values.fold(None, |range: Option<Self>, value| {
            let range = range.unwrap_or(Self { low: value, high: value });
            Some(Self { low: range.low.min(value), high: range.high.max(value) })
        })
    }

    fn length(self) -> f64 {
        self.high - self.low
    }

    fn middle(self) -> f64 {
        f64::midpoint(self.low, self.high)
    }

    /// By how much this must be moved to lie where it belongs: in the middle of `other` if that is
    /// known exactly, or does not hold it.
    fn shift_into(self, other: Self, exact: bool) -> f64 {
        let holds = other.low - NOISE_PX <= self.low && self.high <= other.high + NOISE_PX;
        let off = self.middle() - other.middle();
        if (holds && !exact) || off.abs() <= NOISE_PX { 0.0 } else { off }
    }
}

fn registered(
    view: &View,
    silhouette: &Silhouette,
    level: &ViewSet<'_>,
    hull: &[Point3<f64>],
) -> ViewRegistration {
    let found = ViewRegistration::agreeing(view.azimuth);
    let mut rig = Rig::of_views(level);
    rig.viewpoints = vec![view.viewpoint()];
    let pixels: Vec<_> = hull.iter().map(rig.projection(0)).collect();
    let (axis, origin) = (rig.axis_px, rig.origin_row_px);
    let Some((columns, rows)) = Range::of(pixels.iter().map(|pixel| pixel.x - axis))
        .zip(Range::of(pixels.iter().map(|pixel| pixel.y - origin)))
    else {
        return found;
    };
    let Some((own_columns, own_rows)) = extent(silhouette, (axis, origin)) else { return found };
    // Whether a level view has the same columns, or its columns are this one's rows.
    let shown = |ahead_deg: f64| {
        level.azimuths().any(|azimuth| {
            let apart = (view.azimuth.degrees_to(azimuth) - ahead_deg).rem_euclid(180.0);
            apart.min(180.0 - apart) < SAME_DEG
        })
    };
    let exact_columns = shown(0.0);
    let exact_rows = view.elevation.is_vertical() && shown(90.0);
    let scale = if exact_columns {
        own_columns.length() / columns.length().max(1.0)
    } else if exact_rows {
        own_rows.length() / rows.length().max(1.0)
    } else {
        1.0
    };
    let scale = if (scale - 1.0).abs() > SCALE_NOISE { scale } else { 1.0 };
    let scaled = |range: Range| Range { low: range.low / scale, high: range.high / scale };
    ViewRegistration {
        scale,
        shift_x_px: scaled(own_columns).shift_into(columns, exact_columns) * scale,
        shift_y_px: scaled(own_rows).shift_into(rows, exact_rows) * scale,
        ..found
    }
}

/// The silhouette's columns and rows, to the middle of its outline.
fn extent(silhouette: &Silhouette, (axis, origin): (f64, f64)) -> Option<(Range, Range)> {
    let height = silhouette.mask().height() as usize;
    let ends = (0..height).flat_map(|y| silhouette.intervals_px(y));
    let columns = Range::of(ends.flat_map(|&(low, high)| [low - axis, high - axis]))?;
    let filled = || (0..height).filter(|&y| !silhouette.intervals_px(y).is_empty());
    let half = silhouette.half_line_px();
    let rows = Range {
        low: filled().next()? as f64 + half - origin,
        high: (filled().next_back()? + 1) as f64 - half - origin,
    };
    Some((columns, rows))
}

impl<'a> Placed<'a> {
    /// What the solid is cut by.
    pub(crate) fn input(&self) -> ElevatedInput<'_> {
        ElevatedInput {
            viewpoint: self.view.viewpoint(),
            image: &self.view.image,
            silhouette: &self.silhouette,
        }
    }

    /// The view with what the solid says of it.
    pub(crate) fn seen(mut self, solid: &Solid, level: &ViewSet<'_>) -> ElevatedView<'a> {
        let Viewpoint { azimuth, elevation } = self.view.viewpoint();
        let cut = solid.report.cuts.iter().find(|cut| {
            (cut.azimuth_deg, cut.elevation_deg) == (azimuth.degrees(), elevation.degrees())
        });
        if let Some(cut) = cut {
            self.registration.consistency = 1.0 - cut.uncovered;
            self.registration.contradicts = !cut.used;
        }
        let rig = Rig { viewpoints: vec![self.view.viewpoint()], ..Rig::of_views(level) };
        let depth = depth_of_elevated(&solid.mesh, &rig, self.silhouette.mask());
        let Self { view, silhouette, registration } = self;
        ElevatedView { view, silhouette, registration, depth }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use frames::{Azimuth, Elevation};
    use image::{GrayImage, Luma};

    /// A drawing whose mask is a rectangle.
    fn drawn(degrees: (f64, f64), columns: (u32, u32), rows: (u32, u32)) -> View {
        let inside = |x, y| (columns.0..columns.1).contains(&x) && (rows.0..rows.1).contains(&y);
        let mask = GrayImage::from_fn(200, 160, |x, y| Luma([255 * u8::from(inside(x, y))]));
        let image = GrayImage::from_pixel(200, 160, Luma([255]));
        let elevation = Elevation::from_degrees(degrees.1).unwrap();
        let azimuth = Azimuth::from_degrees(degrees.0).unwrap();
        View { elevation, ..View::level(azimuth, image, Some(mask)) }
    }

    /// Where a view belongs beside a box 80 px wide, 40 deep and 60 high.
    fn found(view: &View) -> ViewRegistration {
        let level =
            [drawn((0.0, 0.0), (60, 140), (50, 110)), drawn((90.0, 0.0), (80, 120), (50, 110))];
        let level = ViewSet::of_owned(level.to_vec()).unwrap();
        let corners = (0..8).map(|i: u32| {
            let side = |bit: u32, half: f64| if i >> bit & 1 == 1 { half } else { -half };
            Point3::new(side(0, 40.0), side(1, 20.0), side(2, 30.0))
        });
        let silhouette = Silhouette::of_view(view, &SilhouetteOptions::default()).unwrap();
        registered(view, &silhouette, &level, &corners.collect::<Vec<_>>())
    }

    #[test]
    fn a_view_that_fits_stays() {
        for view in [
            drawn((0.0, 90.0), (60, 140), (60, 100)),
            drawn((90.0, -90.0), (80, 120), (40, 120)),
            // Rows from 30 degrees above: 60 cos 30 + 40 sin 30 at most.
            drawn((0.0, 30.0), (60, 140), (45, 112)),
        ] {
            assert!(!found(&view).corrects(), "{} {:?}", view.viewpoint(), found(&view));
        }
    }

    #[test]
    fn a_top_view_of_another_size_and_place_is_brought_back() {
        let view = drawn((0.0, 90.0), (20, 140), (20, 80));
        let ViewRegistration { scale, shift_x_px, shift_y_px, .. } = found(&view);
        assert_eq!((scale, shift_x_px, shift_y_px), (1.5, -20.0, -30.0));
    }

    #[test]
    fn rows_that_cannot_be_are_centred() {
        let view = drawn((0.0, 30.0), (60, 140), (80, 140));
        let ViewRegistration { scale, shift_x_px, shift_y_px, .. } = found(&view);
        assert_eq!((scale, shift_x_px, shift_y_px), (1.0, 0.0, 30.0));
        // At an azimuth that no level view shows, the scale is believed.
        let view = drawn((45.0, 30.0), (70, 120), (60, 100));
        assert!(!found(&view).corrects());
    }
}
