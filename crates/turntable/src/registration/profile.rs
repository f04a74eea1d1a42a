//! A silhouette's outermost columns, row by row.

use super::ViewRegistration;
use crate::silhouette::Silhouette;
use crate::views::ViewSet;
use frames::Azimuth;

/// Per row, the outermost columns of the subject, px from the axis.
#[derive(Clone)]
pub(super) struct Profile {
    pub azimuth: Azimuth,
    pub rows: Vec<Option<(f64, f64)>>,
}

impl Profile {
    pub(super) fn new(silhouette: &Silhouette, views: &ViewSet) -> Self {
        let extent = |y: u32| {
            let runs = silhouette.intervals_px(y as usize);
            let (first, last) = (runs.first()?, runs.last()?);
            Some((first.0 - views.axis_px(), last.1 - views.axis_px()))
        };
        Self { azimuth: silhouette.azimuth(), rows: (0..views.height()).map(extent).collect() }
    }

    /// The first row with the subject, and the one after the last.
    pub(super) fn vertical_extent(&self) -> Option<(f64, f64)> {
        let top = self.rows.iter().position(Option::is_some)?;
        let bottom = self.rows.iter().rposition(Option::is_some)?;
        Some((top as f64, bottom as f64 + 1.0))
    }

    /// The profile as it is once the drawing's correction is undone.
    pub(super) fn corrected(&self, found: &ViewRegistration, origin_row_px: f64) -> Self {
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
