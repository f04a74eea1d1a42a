//! A view's outermost columns row by row.

use image::GrayImage;

/// So many rows stand for a figure.
pub(crate) const ROWS: usize = 96;

/// Per image row the outermost columns of the mask.
#[derive(Clone, Debug)]
pub(crate) struct Profile {
    rows: Vec<Option<(f64, f64)>>,
    /// The first row, and the one after the last, px.
    pub(crate) top: f64,
    pub(crate) bottom: f64,
    /// The middle of all columns, px.
    pub(crate) middle: f64,
}

/// Sampled rows from top to bottom: left and right extent from the assumed
/// axis, canvas px.
pub(crate) type Rows = Vec<Option<(f64, f64)>>;

impl Profile {
    pub(crate) fn of(mask: &GrayImage) -> Self {
        let extent = |row: &[u8]| {
            let first = row.iter().position(|level| *level >= 128)?;
            let last = row.iter().rposition(|level| *level >= 128)?;
            Some((first as f64, last as f64 + 1.0))
        };
        let rows: Vec<_> =
            mask.as_raw().chunks_exact(mask.width().max(1) as usize).map(extent).collect();
        let top = rows.iter().position(Option::is_some).unwrap_or(0) as f64;
        let bottom = rows.iter().rposition(Option::is_some).map_or(0.0, |y| y as f64 + 1.0);
        let mut own = Self { rows, top, bottom, middle: 0.0 };
        let (left, right) = own.extent();
        own.middle = (left + right) / 2.0;
        own
    }

    pub(crate) fn height(&self) -> f64 {
        self.bottom - self.top
    }

    pub(crate) fn extent(&self) -> (f64, f64) {
        let all = self.rows.iter().flatten();
        all.copied().reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap_or((0.0, 0.0))
    }

    /// [`ROWS`] rows over `height` from `top`, about column `axis`, times `scale`.
    pub(crate) fn sampled(&self, top: f64, height: f64, axis: f64, scale: f64) -> Rows {
        let step = height / ROWS as f64;
        let row = |k: usize| {
            let middle = top + (k as f64 + 0.5) * step;
            let at = self.rows.get(middle.max(0.0) as usize).copied().flatten()?;
            Some(((at.0 - axis) * scale, (at.1 - axis) * scale))
        };
        (0..ROWS).map(row).collect()
    }
}

/// The same figure seen in a mirror.
pub(crate) fn mirrored(rows: &Rows) -> Rows {
    rows.iter().map(|row| row.map(|(left, right)| (-right, -left))).collect()
}
