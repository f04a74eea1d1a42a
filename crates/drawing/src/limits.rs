//! How large a sheet may be.

use super::{DrawError, DrawOptions};
use frames::Viewpoint;

/// How large a sheet may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SheetLimits {
    /// Views of one sheet.
    pub max_views: usize,
    /// Pixels of all views together.
    pub max_pixels: u64,
    /// Samples of one view: its pixels times supersampling squared.
    pub max_view_samples: u64,
}

impl Default for SheetLimits {
    fn default() -> Self {
        Self { max_views: 360, max_pixels: 1 << 28, max_view_samples: 1 << 26 }
    }
}

impl SheetLimits {
    /// The viewpoints in ascending order, if options and list can be drawn within the limits.
    pub(super) fn check(
        &self,
        viewpoints: &[Viewpoint],
        options: &DrawOptions,
    ) -> Result<Vec<Viewpoint>, DrawError> {
        options.check(self.max_view_samples)?;
        let mut viewpoints = viewpoints.to_vec();
        viewpoints.sort_unstable();
        let (found, limit) = (viewpoints.len(), self.max_views);
        if found == 0 {
            return Err(DrawError::NoViews);
        }
        if found > limit {
            return Err(DrawError::TooManyViews { found, limit });
        }
        for (index, &view) in viewpoints.iter().enumerate() {
            if viewpoints[..index].iter().any(|earlier| earlier.looks_like(view)) {
                return Err(DrawError::DuplicateView { view });
            }
        }
        let (found, limit) = (options.pixels() * found as u64, self.max_pixels);
        (found <= limit).then_some(viewpoints).ok_or(DrawError::TooManyPixels { found, limit })
    }
}
