//! Views that the method can use together.

use std::borrow::Cow;

use frames::Azimuth;
use image::GrayImage;
use sheet::View;

/// The longest side of an image that the turntable method accepts, pixels.
pub const MAX_SIDE_PX: u32 = 16_384;

/// The fewest views the method works from.
pub const MINIMUM_VIEWS: usize = 2;

/// Views that fit together: at least two, of one size, at different angles,
/// ordered by azimuth.
#[derive(Clone, Debug)]
pub struct ViewSet<'a> {
    /// Borrowed from the sheet, but for those that were moved.
    views: Vec<Cow<'a, View>>,
}

/// Why views cannot be used together.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ViewSetError {
    /// Depth needs more views.
    #[error("found {found} views, {required} are required")]
    TooFewViews {
        /// Views that were given.
        found: usize,
        /// The fewest that are taken.
        required: usize,
    },
    /// Two views are at one angle.
    #[error("two views are at azimuth {azimuth}")]
    DuplicateAzimuth {
        /// Their azimuth.
        azimuth: Azimuth,
    },
    /// The drawings are not all of one size.
    #[error("view {azimuth} is {found:?} px where {expected:?} px is expected")]
    SizesDiffer {
        /// The view that differs.
        azimuth: Azimuth,
        /// Its width and height, px.
        found: (u32, u32),
        /// Width and height of the first view, px.
        expected: (u32, u32),
    },
    /// A mask is not of its drawing's size.
    #[error("the mask of view {azimuth} is {found:?} px, its image {expected:?} px")]
    MaskSizeDiffers {
        /// Which view.
        azimuth: Azimuth,
        /// Width and height of the mask, px.
        found: (u32, u32),
        /// Width and height of the drawing, px.
        expected: (u32, u32),
    },
    /// The drawing is too small or too large to be worked with.
    #[error("view {azimuth} is {found:?} px, sides are 8 to {MAX_SIDE_PX} px")]
    SideOutOfRange {
        /// Which view.
        azimuth: Azimuth,
        /// Its width and height, px.
        found: (u32, u32),
    },
}

impl<'a> ViewSet<'a> {
    /// Orders `views` by azimuth and checks that they fit together.
    ///
    /// # Errors
    /// [`ViewSetError`] for fewer than two views, equal azimuths, differing
    /// sizes, and sides outside 8 to [`MAX_SIDE_PX`].
    pub fn new(mut views: Vec<Cow<'a, View>>) -> Result<Self, ViewSetError> {
        if views.len() < MINIMUM_VIEWS {
            return Err(ViewSetError::TooFewViews { found: views.len(), required: MINIMUM_VIEWS });
        }
        views.sort_by_key(|view| view.azimuth);
        if let Some(pair) = views.windows(2).find(|pair| pair[0].azimuth == pair[1].azimuth) {
            return Err(ViewSetError::DuplicateAzimuth { azimuth: pair[0].azimuth });
        }
        let expected = views[0].image.dimensions();
        for view in &views {
            check_size(view, expected)?;
        }
        Ok(Self { views })
    }

    /// As [`new`](Self::new), of views that nothing else holds.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn of_owned(views: Vec<View>) -> Result<Self, ViewSetError> {
        Self::new(views.into_iter().map(Cow::Owned).collect())
    }

    /// The views, ordered by azimuth.
    pub fn views(&self) -> &[Cow<'a, View>] {
        &self.views
    }

    /// Those at `kept`, indices in rising order.
    ///
    /// # Errors
    /// [`ViewSetError::TooFewViews`] for fewer than two.
    pub fn subset(&self, kept: &[usize]) -> Result<Self, ViewSetError> {
        Self::new(kept.iter().map(|&index| self.views[index].clone()).collect())
    }

    /// Columns of every view, px.
    pub fn width(&self) -> u32 {
        self.views[0].image.width()
    }

    /// Rows of every view, px.
    pub fn height(&self) -> u32 {
        self.views[0].image.height()
    }

    /// The turntable axis' column, pixels in the sheet frame.
    pub fn axis_px(&self) -> f64 {
        f64::from(self.width()) / 2.0
    }

    /// The row of the turntable frame's origin, pixels in the sheet frame.
    pub fn origin_row_px(&self) -> f64 {
        f64::from(self.height()) / 2.0
    }

    /// Ascending, one a view.
    pub fn azimuths(&self) -> impl Iterator<Item = Azimuth> + '_ {
        self.views.iter().map(|view| view.azimuth)
    }
}

/// Checks that a view has the size of the others.
pub(crate) fn check_size(view: &View, expected: (u32, u32)) -> Result<(), ViewSetError> {
    let azimuth = view.azimuth;
    let found = view.image.dimensions();
    let range = 8..=MAX_SIDE_PX;
    if !range.contains(&found.0) || !range.contains(&found.1) {
        return Err(ViewSetError::SideOutOfRange { azimuth, found });
    }
    if found != expected {
        return Err(ViewSetError::SizesDiffer { azimuth, found, expected });
    }
    match view.mask.as_ref().map(GrayImage::dimensions) {
        Some(found) if found != expected => {
            Err(ViewSetError::MaskSizeDiffers { azimuth, found, expected })
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use image::GrayImage;

    use super::*;

    fn view(degrees: f64, width: u32) -> View {
        let azimuth = Azimuth::from_degrees(degrees).unwrap();
        View::level(azimuth, GrayImage::new(width, 16), None)
    }

    #[test]
    fn orders_views_by_azimuth() {
        let set = ViewSet::of_owned(vec![view(90.0, 16), view(-45.0, 16), view(0.0, 16)]).unwrap();
        let degrees: Vec<f64> = set.azimuths().map(Azimuth::degrees).collect();
        assert_eq!(degrees, [0.0, 90.0, 315.0]);
        assert_eq!((set.axis_px(), set.origin_row_px()), (8.0, 8.0));
    }

    #[test]
    fn names_what_does_not_fit() {
        let error = |views| ViewSet::of_owned(views).unwrap_err();
        assert!(matches!(
            error(vec![view(0.0, 16)]),
            ViewSetError::TooFewViews { found: 1, required: 2 }
        ));
        assert!(matches!(
            error(vec![view(0.0, 16), view(360.0, 16)]),
            ViewSetError::DuplicateAzimuth { .. }
        ));
        assert!(matches!(
            error(vec![view(0.0, 16), view(90.0, 17)]),
            ViewSetError::SizesDiffer { found: (17, 16), .. }
        ));
        assert!(matches!(
            error(vec![view(0.0, 4), view(90.0, 4)]),
            ViewSetError::SideOutOfRange { .. }
        ));
    }

    #[test]
    fn refuses_a_mask_of_another_size() {
        let mut odd = view(0.0, 16);
        odd.mask = Some(GrayImage::new(15, 16));
        assert!(matches!(
            ViewSet::of_owned(vec![odd, view(90.0, 16)]).unwrap_err(),
            ViewSetError::MaskSizeDiffers { found: (15, 16), .. }
        ));
    }
}
