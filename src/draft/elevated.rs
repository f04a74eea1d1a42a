//! Views from above and below laid beside the level ones.
//!
//! Where all drawings are of one size they are taken to be of one camera, and left in place. Of a
//! drawing in a frame of its own the figure's middle is laid where the subject's is: its scale is
//! that at which it is as wide as the level view at its azimuth or across, or that of the level
//! views where there is none. What is off by little is found when the silhouettes are there.

use image::GrayImage;
use subject::{Aligned, Alignment, ByHand, Subject, Transform, ViewAlignment, apply, median};

use super::decode::DecodedView;

/// Azimuths this near are one, degrees.
const SAME_DEG: f64 = 0.5;

/// A view and what was found in it.
type Found<'a> = (DecodedView<'a>, Subject);

/// How views from above and below are laid on the canvas, which is made larger where it must.
///
/// * `level`: the level views that `alignment` is of.
pub(super) fn places(
    alignment: &mut Alignment,
    level: (&[DecodedView<'_>], &[Subject]),
    elevated: &[Found<'_>],
) -> Vec<Transform> {
    let place = |(view, subject): &Found<'_>| place(alignment, level, view, subject);
    let mut places: Vec<Transform> = elevated.iter().map(place).collect();
    let (width, height) = (f64::from(alignment.canvas.width), f64::from(alignment.canvas.height));
    let (mut aside, mut more) = (0.0_f64, 0.0_f64);
    for ((_, subject), place) in elevated.iter().zip(&places) {
        let Some([columns, rows]) = extent(&subject.mask) else { continue };
        let on = |value: f64, shift: f64| place.scale * value + shift;
        aside = aside.max(-on(columns[0], place.dx)).max(on(columns[1], place.dx) - width);
        more = more.max(-on(rows[0], place.dy)).max(on(rows[1], place.dy) - height);
    }
    // No view of the subject is larger than its height and width together.
    let most = width + height;
    let (aside, more) = (aside.min(most).ceil(), more.min(most).ceil());
    if aside > 0.0 || more > 0.0 {
        alignment.grow(aside as u32, more as u32, more as u32);
        for place in &mut places {
            place.dx += aside;
            place.dy += more;
        }
    }
    places
}

fn place(
    alignment: &Alignment,
    (views, subjects): (&[DecodedView<'_>], &[Subject]),
    view: &DecodedView<'_>,
    subject: &Subject,
) -> Transform {
    let ByHand { axis_x, ground_y, scale } = view.by_hand();
    let by_hand = [axis_x, ground_y, scale].iter().any(Option::is_some);
    let size = view.drawing.dimensions();
    let one_size = views.iter().all(|other| other.drawing.dimensions() == size);
    let Some([columns, rows]) = extent(&subject.mask).filter(|_| by_hand || !one_size) else {
        return Transform::IDENTITY;
    };
    let canvas = &alignment.canvas;
    let of_azimuth = views.iter().zip(subjects).zip(&alignment.views).find(|((other, _), _)| {
        let apart = view.azimuth.degrees_to(other.azimuth) % 180.0;
        apart.min(180.0 - apart) < SAME_DEG
    });
    let as_wide = of_azimuth.and_then(|((_, level), found)| {
        let [level, _] = extent(&level.mask)?;
        Some(found.transform.scale * (level[1] - level[0]) / (columns[1] - columns[0]))
    });
    let usual = || {
        let scales: Vec<f64> = alignment.views.iter().map(|found| found.transform.scale).collect();
        median(&scales)
    };
    let scale = match (scale, one_size) {
        (Some(scale), _) => scale,
        (None, true) => 1.0,
        (None, false) => as_wide.unwrap_or_else(usual),
    };
    let origin = f64::from(canvas.height) / 2.0;
    let (_, level) = view.elevation.sin_cos();
    let row_of = |level_row: f64| origin + (level_row - origin) * level;
    let middle = |range: [f64; 2]| f64::midpoint(range[0], range[1]);
    let dx = canvas.axis_x - scale * axis_x.unwrap_or(middle(columns));
    let dy = match ground_y {
        Some(ground) => row_of(canvas.rows[1]) - scale * ground,
        None => row_of(middle(canvas.rows)) - scale * middle(rows),
    };
    Transform { scale, dx, dy }
}

/// First and one past the last column and row of the mask.
pub(super) fn extent(mask: &GrayImage) -> Option<[[f64; 2]; 2]> {
    let inside = mask.enumerate_pixels().filter(|(.., level)| level.0[0] != 0);
    let bounds = inside.fold(None, |bounds: Option<[u32; 4]>, (x, y, _)| {
        let [left, right, top, bottom] = bounds.unwrap_or([x, x, y, y]);
        Some([left.min(x), right.max(x), top.min(y), bottom.max(y)])
    });
    let [left, right, top, bottom] = bounds?.map(f64::from);
    Some([[left, right + 1.0], [top, bottom + 1.0]])
}

/// Lays one view on the canvas.
pub(super) fn laid(
    alignment: &Alignment,
    place: Transform,
    view: &DecodedView<'_>,
    subject: &Subject,
) -> Option<Aligned> {
    let azimuth_deg = view.azimuth.degrees();
    let found = ViewAlignment {
        azimuth_deg,
        transform: place,
        axis_x: alignment.canvas.axis_x,
        rows: alignment.canvas.rows,
        unexplained: 0.0,
        out_of_range: false,
        by_hand: false,
    };
    let alone = Alignment { canvas: alignment.canvas, views: vec![found], changes: true };
    apply(&alone, &[subject::View { azimuth_deg, subject }]).pop()
}
