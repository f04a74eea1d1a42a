//! The area that the subject covers in each view.

mod bridges;
mod edges;
mod fill;
mod opposite;

use std::borrow::Cow;

use image::GrayImage;

use crate::ink::{INK_THRESHOLD, InkMap};
use crate::views::ViewSet;
use frames::Azimuth;
use sheet::View;

pub use crate::options::SilhouetteOptions;
pub(crate) use edges::ALONE_PX;
pub use opposite::OppositePair;

/// Where a silhouette comes from.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum SilhouetteSource {
    /// The view's own mask or alpha channel.
    Given,
    /// Found when the drawing was cleaned; includes the outline's stroke.
    Cleaned,
    /// Everything that paper connected to the image's border does not reach.
    Filled {
        /// The width of the widest gap that had to be closed, px.
        closed_gap_px: u32,
    },
    /// The mask given with the opposite view, mirrored.
    Opposite,
    /// The union of this view's filled outline with its opposite's, mirrored.
    Joined,
}

/// The area of the subject in one view.
#[derive(Clone, Debug)]
pub struct Silhouette {
    azimuth: Azimuth,
    mask: GrayImage,
    source: SilhouetteSource,
    half_line_px: f64,
    /// Pixels that close gaps in the drawing's lines.
    bridges: Vec<usize>,
    /// Per row, the subject's runs as column intervals in the sheet frame, px.
    intervals: Vec<Vec<(f64, f64)>>,
}

/// A view in which nothing is drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SilhouetteError {
    /// Hardly anything is drawn.
    #[error(
        "the silhouette of view {azimuth} covers {found_px} px, at least {required_px} are required"
    )]
    TooSmall {
        /// Which view.
        azimuth: Azimuth,
        /// Area of its silhouette, pixels.
        found_px: usize,
        /// The smallest area that counts as a drawing, pixels.
        required_px: usize,
    },
    /// The silhouette has no outside.
    #[error("the silhouette of view {azimuth} covers the whole image: no paper is left around it")]
    CoversImage {
        /// Which view.
        azimuth: Azimuth,
    },
}

/// The smallest area that counts as a drawing, px.
const MIN_AREA_PX: usize = 16;

/// The part of an image where something is drawn: paper around it need not be
/// looked at.
struct Window {
    /// The first column and row, and those after the last.
    from: [usize; 2],
    to: [usize; 2],
}

impl Window {
    /// The lines' bounds, with so much paper around that closing gaps of up to
    /// `max_gap_px` leaves the image's border and theirs connected.
    fn of_ink(ink: &InkMap, max_gap_px: usize) -> Self {
        let mut columns = vec![false; ink.width()];
        let has_ink = |y: usize, columns: &mut [bool]| {
            columns.iter_mut().zip(ink.row(y)).fold(false, |any, (column, share)| {
                let is_ink = *share > INK_THRESHOLD;
                *column |= is_ink;
                any | is_ink
            })
        };
        let rows: Vec<bool> = (0..ink.height()).map(|y| has_ink(y, &mut columns)).collect();
        let bounds = |inked: &[bool]| {
            let first = inked.iter().position(|is| *is)?;
            Some([first, inked.iter().rposition(|is| *is)? + 1])
        };
        let Some(([left, right], [top, bottom])) = bounds(&columns).zip(bounds(&rows)) else {
            return Self { from: [0; 2], to: [ink.width(), ink.height()] };
        };
        let (from, to) = ([left, top], [right, bottom]);
        let margin = max_gap_px.div_ceil(2) + 2;
        Self {
            from: from.map(|from| from.saturating_sub(margin)),
            to: [(to[0] + margin).min(ink.width()), (to[1] + margin).min(ink.height())],
        }
    }

    /// What is in the window, in an image that is 0 around it.
    fn pasted(&self, inner: &GrayImage, (width, height): (u32, u32)) -> GrayImage {
        let mut image = GrayImage::new(width, height);
        let rows = image.chunks_exact_mut(width as usize).skip(self.from[1]);
        for (row, inner) in rows.zip(inner.as_raw().chunks_exact(inner.width().max(1) as usize)) {
            row[self.from[0]..self.to[0]].copy_from_slice(inner);
        }
        image
    }

    /// The index in an image of `width` columns of the window's pixel `index`.
    fn index_outside(&self, index: usize, width: usize) -> usize {
        let own_width = self.to[0] - self.from[0];
        (index / own_width + self.from[1]) * width + index % own_width + self.from[0]
    }
}

impl Silhouette {
    /// Takes the view's mask, or fills the outside of its outline from the
    /// image's border.
    ///
    /// # Errors
    /// [`SilhouetteError`] if nothing, or everything, is inside.
    pub fn of_view(view: &View, options: &SilhouetteOptions) -> Result<Self, SilhouetteError> {
        let ink = InkMap::from_image(&view.image);
        let drawn = Window::of_ink(&ink, options.max_gap_px as usize);
        let lines = ink.cropped(drawn.from, drawn.to);
        let bridges = bridges::bridges(&lines, options.max_gap_px);
        let (mask, source) = match &view.mask {
            Some(mask) if view.mask_was_found => (fill::binarised(mask), SilhouetteSource::Cleaned),
            Some(mask) => (fill::binarised(mask), SilhouetteSource::Given),
            None => {
                let (mask, source) = fill::filled_outline(&lines, &bridges, options.max_gap_px);
                (drawn.pasted(&mask, view.image.dimensions()), source)
            }
        };
        let half_line_px = match source {
            SilhouetteSource::Given => 0.0,
            _ => view.outline_px.map_or_else(|| edges::half_line_px(&ink, &mask), |w| w / 2.0),
        };
        let bridges = bridges.concat().into_iter();
        let bridges = bridges.map(|index| drawn.index_outside(index, ink.width())).collect();
        let intervals = edges::row_intervals(&ink, &mask, half_line_px);
        Self { azimuth: view.azimuth, mask, source, half_line_px, bridges, intervals }.checked()
    }

    fn checked(self) -> Result<Self, SilhouetteError> {
        let found_px = self.area_px();
        let azimuth = self.azimuth;
        if found_px < MIN_AREA_PX {
            Err(SilhouetteError::TooSmall { azimuth, found_px, required_px: MIN_AREA_PX })
        } else if found_px == self.mask.as_raw().len() {
            Err(SilhouetteError::CoversImage { azimuth })
        } else {
            Ok(self)
        }
    }

    /// The view's azimuth.
    pub fn azimuth(&self) -> Azimuth {
        self.azimuth
    }

    /// 255 inside, 0 outside. A filled outline includes its line, so it is
    /// [`half_line_px`](Self::half_line_px) wider than the subject.
    pub fn mask(&self) -> &GrayImage {
        &self.mask
    }

    /// What the mask was made from.
    pub fn source(&self) -> SilhouetteSource {
        self.source
    }

    /// Half the width of the outline's stroke, px; 0 for a given mask.
    pub fn half_line_px(&self) -> f64 {
        self.half_line_px
    }

    /// The pixels, by index, of lines that close gaps in the drawing's own.
    pub fn bridges(&self) -> &[usize] {
        &self.bridges
    }

    /// Where the subject is in row `y`: disjoint column intervals, left to
    /// right, sub-pixel, in the sheet frame, at the middle of the outline's
    /// stroke. Empty for rows outside the image.
    pub fn intervals_px(&self, y: usize) -> &[(f64, f64)] {
        self.intervals.get(y).map_or(&[], Vec::as_slice)
    }

    /// Whether the pixel at column `x`, row `y` is inside; outside the image nothing is.
    pub fn contains(&self, x: i64, y: i64) -> bool {
        match (u32::try_from(x), u32::try_from(y)) {
            (Ok(x), Ok(y)) if x < self.mask.width() && y < self.mask.height() => {
                self.mask.get_pixel(x, y).0[0] != 0
            }
            _ => false,
        }
    }

    /// Pixels inside.
    pub fn area_px(&self) -> usize {
        self.mask.as_raw().iter().filter(|&&level| level != 0).count()
    }
}

/// The silhouettes of a set of views, in its order, and how well views at
/// opposite azimuths agree.
#[derive(Clone, Debug)]
pub struct Silhouettes {
    /// One a view, in the set's order.
    pub silhouettes: Vec<Silhouette>,
    /// The pairs of opposite views, and whether each was joined.
    pub opposites: Vec<OppositePair>,
}

impl Silhouettes {
    /// Finds every view's silhouette and joins those of opposite views.
    ///
    /// # Errors
    /// [`SilhouetteError`] of the first view in which nothing, or everything,
    /// is inside.
    pub fn of_views(views: &ViewSet, options: &SilhouetteOptions) -> Result<Self, SilhouetteError> {
        Ok(Self::of_views_alone(views, options)?.joined(options))
    }

    /// Finds every view's silhouette from that view alone.
    ///
    /// # Errors
    /// As [`of_views`](Self::of_views).
    pub fn of_views_alone(
        views: &ViewSet,
        options: &SilhouetteOptions,
    ) -> Result<Self, SilhouetteError> {
        use rayon::prelude::*;
        let found: Vec<_> =
            views.views().par_iter().map(|view| Silhouette::of_view(view, options)).collect();
        let silhouettes = found.into_iter().collect::<Result<Vec<_>, _>>()?;
        Ok(Self { silhouettes, opposites: Vec::new() })
    }

    /// Finds the silhouettes of those views again that `is_changed` names, by
    /// index; the others are kept. From each view alone, as these are.
    ///
    /// # Errors
    /// As [`of_views`](Self::of_views).
    pub fn with_changed(
        self,
        views: &ViewSet,
        is_changed: impl Fn(usize) -> bool + Sync,
        options: &SilhouetteOptions,
    ) -> Result<Self, SilhouetteError> {
        use rayon::prelude::*;
        let old: Vec<_> = self.silhouettes.into_iter().zip(views.views()).enumerate().collect();
        let renew = |(index, (own, view)): (usize, (Silhouette, &Cow<'_, View>))| {
            if is_changed(index) { Silhouette::of_view(view, options) } else { Ok(own) }
        };
        let found: Vec<_> = old.into_par_iter().map(renew).collect();
        let silhouettes = found.into_iter().collect::<Result<Vec<_>, _>>()?;
        Ok(Self { silhouettes, opposites: Vec::new() })
    }

    /// Those of opposite views made one, if `options` say so.
    #[must_use]
    pub fn joined(mut self, options: &SilhouetteOptions) -> Self {
        if options.join_opposites {
            self.opposites = opposite::join(&mut self.silhouettes);
        }
        self
    }
}

#[cfg(test)]
mod tests;
