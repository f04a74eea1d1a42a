//! One canvas for all views of a subject: scale, height and turning axis of
//! each reconciled with the others.

pub(crate) mod axis;
mod by_hand;
pub(crate) mod profile;
mod resample;
pub(crate) mod section;
mod trusted;

use serde::Serialize;

use crate::subject::Subject;
use profile::{Profile, Rows};

pub use by_hand::{ByHand, place_by_hand};
pub use resample::{Aligned, apply, reduced, reduced_mask};
pub use trusted::trust;

/// One subject and the azimuth at which it was drawn.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Degrees; 0 is the front.
    pub azimuth_deg: f64,
    /// What was found in the drawing.
    pub subject: &'a Subject,
}

/// How far views may be off.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AlignOptions {
    /// The largest factor between drawings of one image size.
    pub max_scale: f64,
    /// The largest factor between drawings each in a frame of its own.
    pub max_frame_scale: f64,
    /// The farthest shift, share of the figure's height.
    pub max_shift: f64,
    /// Views of one image size that agree within this are left as they are,
    /// share of the figure's height; at least 1.25 px.
    pub tolerance: f64,
}

impl Default for AlignOptions {
    fn default() -> Self {
        Self { max_scale: 1.35, max_frame_scale: 8.0, max_shift: 0.34, tolerance: 0.003 }
    }
}

/// From a view's pixels to the canvas: `canvas = scale * view + (dx, dy)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Transform {
    /// Canvas pixels per view pixel.
    pub scale: f64,
    /// To the right, canvas px.
    pub dx: f64,
    /// Downward, canvas px.
    pub dy: f64,
}

impl Transform {
    /// Leaves everything where it is.
    pub const IDENTITY: Self = Self { scale: 1.0, dx: 0.0, dy: 0.0 };

    /// Where a place of the view lies on the canvas, px.
    pub fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.scale * x + self.dx, self.scale * y + self.dy]
    }

    /// This and after it `other`.
    #[must_use]
    pub fn then(&self, other: &Self) -> Self {
        let [dx, dy] = other.place([self.dx, self.dy]);
        Self { scale: self.scale * other.scale, dx, dy }
    }
}

/// What was found about one view.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ViewAlignment {
    /// Its azimuth, degrees.
    pub azimuth_deg: f64,
    /// How it is laid on the canvas.
    pub transform: Transform,
    /// The column of the turning axis in the view's own image, px.
    pub axis_x: f64,
    /// The figure's first row and the one after its last in the view, px.
    pub rows: [f64; 2],
    /// How much of this view's row extents no other view can explain, share of
    /// their widths, after the alignment.
    pub unexplained: f64,
    /// Whether it would have to be scaled or moved by more than is allowed;
    /// then it is left at scale 1.
    pub out_of_range: bool,
    /// Whether a person said where it belongs.
    pub by_hand: bool,
}

/// The common image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Canvas {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The turning axis' column: the middle, px.
    pub axis_x: f64,
    /// The figure's first row and the one after its last, px.
    pub rows: [f64; 2],
}

/// How all views are laid on one canvas. In the views' order.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Alignment {
    /// The common image.
    pub canvas: Canvas,
    /// Per view.
    pub views: Vec<ViewAlignment>,
    /// Whether any view is scaled, moved or put in another frame.
    pub changes: bool,
}

/// Margin around the figure on a canvas of its own, share of its height.
const MARGIN: f64 = 0.08;
/// The least tolerance, px.
const LEAST_TOLERANCE_PX: f64 = 1.25;
/// Shifts that explain no more than this of the rows' widths are not made.
const CONSISTENT: f64 = 0.002;
/// A view of which one end differs is taken at its size, without a part, if it
/// fits twice as well, and better by this share of the rows' widths.
const LACKS_A_PART: f64 = 0.001;
/// How far off views of one image size usually are sideways, share of height.
const USUAL_SHIFT: f64 = 0.012;
/// The same for views each in its own frame, about the middle of its figure.
const FRAME_SHIFT: f64 = 0.15;

/// Finds scales and shifts that make all views share their top and bottom rows
/// and turn about the canvas' middle column.
///
/// Level views of one subject share its rows. Sideways, the middle of a row is
/// an odd function of the azimuth, a wave of order 1 and a little of order 3 and
/// 5: what no such wave fits is how far a view is off. A shift of the subject
/// itself fits always; of all solutions the smallest shifts are taken, from the
/// images' middles, or from the figures' if the images differ in size. Views
/// of one size that agree within the tolerance stay exactly as they are.
pub fn align(views: &[View<'_>], options: &AlignOptions) -> Alignment {
    let profiles: Vec<Profile> = views.iter().map(|view| Profile::of(&view.subject.mask)).collect();
    let sizes: Vec<(u32, u32)> = views.iter().map(|view| view.subject.mask.dimensions()).collect();
    let framed = sizes.windows(2).any(|pair| pair[0] != pair[1]);
    let heights: Vec<f64> = profiles.iter().map(Profile::height).collect();
    let height = median(&heights).max(1.0);
    let tolerance = (options.tolerance * height).max(LEAST_TOLERANCE_PX);
    let top = median(&profiles.iter().map(|p| p.top).collect::<Vec<_>>());
    let bottom = median(&profiles.iter().map(|p| p.bottom).collect::<Vec<_>>());
    let most = if framed { options.max_frame_scale } else { options.max_scale };
    let mut out_of_range = vec![false; views.len()];
    let mut scales = vec![1.0; views.len()];
    let mut tops: Vec<f64> = profiles.iter().map(|p| p.top).collect();
    for (k, profile) in profiles.iter().enumerate().filter(|(_, p)| p.height() > 0.0) {
        let off = (profile.top - top).abs().max((profile.bottom - bottom).abs());
        if !framed && off <= tolerance {
            tops[k] = top;
            continue;
        }
        let scale = (bottom - top) / profile.height();
        let scale = if framed { height / profile.height() } else { scale };
        let shift = (profile.top - top).abs().max((profile.bottom - bottom).abs());
        out_of_range[k] = !(1.0 / most..=most).contains(&scale)
            || (!framed && shift > options.max_shift * height);
        if !out_of_range[k] {
            scales[k] = scale;
        }
    }
    let middle = |k: usize| if framed { profiles[k].middle } else { f64::from(sizes[k].0) / 2.0 };
    let usual = if framed { FRAME_SHIFT } else { USUAL_SHIFT } * height;
    let azimuths: Vec<f64> = views.iter().map(|view| view.azimuth_deg).collect();
    let placed = |scales: &[f64], tops: &[f64]| -> (Vec<Rows>, Vec<f64>) {
        let sampled = |(k, p): (usize, &Profile)| {
            p.sampled(tops[k], height / scales[k], middle(k), scales[k])
        };
        let rows: Vec<Rows> = profiles.iter().enumerate().map(sampled).collect();
        let shifts = axis::shifts(&azimuths, &rows, usual);
        (rows, shifts)
    };
    let (mut rows, mut shifts) = placed(&scales, &tops);
    // A view that differs at one end only may lack a part there.
    for k in 0..views.len() {
        let p = &profiles[k];
        let ends = [(p.top - top).abs() <= tolerance, (p.bottom - bottom).abs() <= tolerance];
        if framed || scales[k] == 1.0 || ends[0] == ends[1] {
            continue;
        }
        let (mut as_drawn, mut as_drawn_tops) = (scales.clone(), tops.clone());
        (as_drawn[k], as_drawn_tops[k]) = (1.0, top);
        let (other_rows, other_shifts) = placed(&as_drawn, &as_drawn_tops);
        let scaled = disagreement(&azimuths, &rows, &shifts);
        let kept = disagreement(&azimuths, &other_rows, &other_shifts);
        if kept + LACKS_A_PART < scaled && kept < 0.5 * scaled {
            (scales, tops, rows, shifts) = (as_drawn, as_drawn_tops, other_rows, other_shifts);
        }
    }
    let largest = shifts.iter().fold(0.0_f64, |most, s| most.max(s.abs()));
    if !framed && (largest <= tolerance || is_consistent(&azimuths, &rows, &shifts)) {
        shifts.fill(0.0);
    }
    for (shift, out) in shifts.iter_mut().zip(&mut out_of_range) {
        if shift.abs() > options.max_shift * height {
            (*shift, *out) = (0.0, true);
        }
    }
    let axes: Vec<f64> = (0..views.len()).map(|k| middle(k) + shifts[k] / scales[k]).collect();
    let canvas = if framed {
        own_canvas(&profiles, &scales, &axes, height)
    } else {
        let (width, height) = sizes.first().copied().unwrap_or((0, 0));
        Canvas { width, height, axis_x: f64::from(width) / 2.0, rows: [top, bottom] }
    };
    let unexplained = section::unexplained(&azimuths, &rows, &shifts);
    let found = |k: usize| {
        let moved = framed || scales[k] != 1.0 || shifts[k] != 0.0;
        let transform = Transform {
            scale: scales[k],
            dx: canvas.axis_x - scales[k] * axes[k],
            dy: canvas.rows[0] - scales[k] * tops[k],
        };
        ViewAlignment {
            azimuth_deg: azimuths[k],
            transform: if moved { transform } else { Transform::IDENTITY },
            axis_x: axes[k],
            rows: [profiles[k].top, profiles[k].bottom],
            unexplained: unexplained[k],
            out_of_range: out_of_range[k],
            by_hand: false,
        }
    };
    let views: Vec<ViewAlignment> = (0..views.len()).map(found).collect();
    let changes = views.iter().any(|view| view.transform != Transform::IDENTITY);
    Alignment { canvas, views, changes }
}

/// Whether the views agree as they are about as well as after `shifts`.
fn is_consistent(azimuths: &[f64], rows: &[Rows], shifts: &[f64]) -> bool {
    let still = vec![0.0; shifts.len()];
    disagreement(azimuths, rows, &still) <= disagreement(azimuths, rows, shifts) + CONSISTENT
}

/// How much of the rows' widths no common section explains, mean of the views.
fn disagreement(azimuths: &[f64], rows: &[Rows], shifts: &[f64]) -> f64 {
    let missing = section::unexplained(azimuths, rows, shifts);
    missing.iter().sum::<f64>() / missing.len().max(1) as f64
}

/// A canvas around figures that come in frames of their own.
fn own_canvas(profiles: &[Profile], scales: &[f64], axes: &[f64], height: f64) -> Canvas {
    let reach = profiles.iter().zip(scales.iter().zip(axes)).map(|(profile, (scale, axis))| {
        let (left, right) = profile.extent();
        ((axis - left).max(right - axis) * scale).max(1.0)
    });
    let margin = (MARGIN * height).ceil();
    let half = reach.fold(1.0, f64::max).ceil() + margin;
    let (width, rows) = (2.0 * half, [margin, margin + height]);
    Canvas {
        width: width as u32,
        height: (height + 2.0 * margin).ceil() as u32,
        axis_x: half,
        rows,
    }
}

/// The middle value, or the mean of the two; 0 of none.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let half = sorted.len() / 2;
    match sorted.len() {
        0 => 0.0,
        n if n % 2 == 1 => sorted[half],
        _ => (sorted[half - 1] + sorted[half]) / 2.0,
    }
}

#[cfg(test)]
mod tests;
