//! Where views belong as a person says, over what was found.

use super::profile::Profile;
use super::{Alignment, Canvas, Transform, View};

/// What a person says of a view's place on the canvas. Places are in the view's own pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ByHand {
    /// The column of the turning axis.
    pub axis_x: Option<f64>,
    /// The row on which the subject stands.
    pub ground_y: Option<f64>,
    /// Canvas pixels per pixel of the view.
    pub scale: Option<f64>,
}

/// A canvas grows to hold what was placed by hand, at most to so many times its size.
const MAX_GROWTH: f64 = 2.0;

impl ByHand {
    fn says_something(&self) -> bool {
        *self != Self::default()
    }
}

/// Places views as a person says; what is not said stays as it was found. The canvas grows where
/// it must, by what is known to be finite.
///
/// * `hands`: one a view.
pub fn place_by_hand(alignment: &mut Alignment, views: &[View<'_>], hands: &[ByHand]) {
    let canvas = alignment.canvas;
    for (found, hand) in alignment.views.iter_mut().zip(hands) {
        if !hand.says_something() {
            continue;
        }
        let scale = hand.scale.unwrap_or(found.transform.scale);
        found.axis_x = hand.axis_x.unwrap_or(found.axis_x);
        if hand.axis_x.is_some() || hand.scale.is_some() {
            found.transform.dx = canvas.axis_x - scale * found.axis_x;
        }
        if hand.ground_y.is_some() || hand.scale.is_some() {
            let ground = hand.ground_y.unwrap_or(found.rows[1]);
            found.transform.dy = canvas.rows[1] - scale * ground;
        }
        found.transform.scale = scale;
        (found.by_hand, found.out_of_range) = (true, false);
        alignment.changes = true;
    }
    if hands.iter().any(ByHand::says_something) {
        grow(alignment, views);
    }
}

/// Makes room for figures that reach beyond the canvas; the axis stays in its middle.
fn grow(alignment: &mut Alignment, views: &[View<'_>]) {
    let canvas = alignment.canvas;
    let (width, height) = (f64::from(canvas.width), f64::from(canvas.height));
    let (mut half, mut above, mut below) = (0.0_f64, 0.0_f64, 0.0_f64);
    for (found, view) in alignment.views.iter().zip(views) {
        let Transform { scale, dx, dy } = found.transform;
        let (left, right) = Profile::of(&view.subject.mask).extent();
        half =
            half.max(canvas.axis_x - (scale * left + dx)).max(scale * right + dx - canvas.axis_x);
        above = above.max(-(scale * found.rows[0] + dy));
        below = below.max(scale * found.rows[1] + dy - height);
    }
    let within = |growth: f64, most: f64| growth.ceil().clamp(0.0, most);
    let aside = within(half - width / 2.0, (MAX_GROWTH - 1.0) * (width / 2.0).floor());
    let above = within(above, (MAX_GROWTH - 1.0) * height);
    let below = within(below, (MAX_GROWTH - 1.0) * height - above);
    // Whole numbers of at most twice the size.
    alignment.grow(aside as u32, above as u32, below as u32);
}

impl Alignment {
    /// Makes the canvas larger by so many columns on both sides and so many rows; what is on it
    /// stays where it is.
    pub fn grow(&mut self, aside_px: u32, above_px: u32, below_px: u32) {
        let (aside, above) = (f64::from(aside_px), f64::from(above_px));
        for found in &mut self.views {
            found.transform.dx += aside;
            found.transform.dy += above;
        }
        let canvas = &mut self.canvas;
        canvas.width += 2 * aside_px;
        canvas.height += above_px + below_px;
        canvas.axis_x += aside;
        canvas.rows = canvas.rows.map(|row| row + above);
        self.changes |= aside_px + above_px + below_px > 0;
    }

    /// Gives the canvas `factor` times fewer columns and rows, rounded up, with what is on it;
    /// axis and middle row stay in the middle. Returns where places on the canvas are now.
    ///
    /// * `factor`: at least 1.
    pub fn shrink(&mut self, factor: f64) -> Transform {
        let factor = factor.max(1.0);
        let canvas = &mut self.canvas;
        let side = |side: u32| ((f64::from(side) / factor).ceil() as u32).max(1);
        let (width, height) = (side(canvas.width), side(canvas.height));
        // What is added by rounding is added on both sides.
        let added = |now: u32, before: u32| (f64::from(now) - f64::from(before) / factor) / 2.0;
        let onto = Transform {
            scale: 1.0 / factor,
            dx: added(width, canvas.width),
            dy: added(height, canvas.height),
        };
        *canvas = Canvas {
            width,
            height,
            axis_x: onto.place([canvas.axis_x, 0.0])[0],
            rows: canvas.rows.map(|row| onto.place([0.0, row])[1]),
        };
        for found in &mut self.views {
            found.transform = found.transform.then(&onto);
        }
        self.changes |= factor > 1.0;
        onto
    }
}
