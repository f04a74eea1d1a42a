//! How a page is searched.

/// How a page is searched for views.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PageOptions {
    /// The longer side of a page of three by two at which figures are looked
    /// for, px; larger pages are reduced to its area.
    pub working_side_px: u32,
    /// More figures than this are refused.
    pub max_figures: usize,
}

impl Default for PageOptions {
    fn default() -> Self {
        Self { working_side_px: 2400, max_figures: 36 }
    }
}
