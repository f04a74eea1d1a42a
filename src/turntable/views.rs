use image::GrayImage;

use crate::sheet::Azimuth;

/// The longest side of an image that the turntable method accepts, pixels.
pub const MAX_SIDE_PX: u32 = 16_384;

/// One drawing of the subject, camera level.
#[derive(Clone, Debug)]
pub struct View {
    pub azimuth: Azimuth,
    /// The drawing, dark lines on light paper.
    pub image: GrayImage,
    /// The subject's area where it is known, from an alpha channel or a mask
    /// file: 128 and above is inside. The image's size.
    pub mask: Option<GrayImage>,
}

/// Views that fit together: at least two, of one size, at different angles,
/// ordered by azimuth.
#[derive(Clone, Debug)]
pub struct ViewSet {
    views: Vec<View>,
}

/// Why views cannot be used together.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ViewSetError {
    #[error("found {found} views, {required} are required")]
    TooFewViews { found: usize, required: usize },
    #[error("two views are at azimuth {azimuth}")]
    DuplicateAzimuth { azimuth: Azimuth },
    #[error("view {azimuth} is {found:?} px where {expected:?} px is expected")]
    SizesDiffer { azimuth: Azimuth, found: (u32, u32), expected: (u32, u32) },
    #[error("the mask of view {azimuth} is {found:?} px, its image {expected:?} px")]
    MaskSizeDiffers { azimuth: Azimuth, found: (u32, u32), expected: (u32, u32) },
    #[error("view {azimuth} is {found:?} px, sides are 8 to {MAX_SIDE_PX} px")]
    SideOutOfRange { azimuth: Azimuth, found: (u32, u32) },
}

impl ViewSet {
    /// Orders `views` by azimuth and checks that they fit together.
    ///
    /// # Errors
    /// [`ViewSetError`] for fewer than two views, equal azimuths, differing
    /// sizes, and sides outside 8 to [`MAX_SIDE_PX`].
    pub fn new(mut views: Vec<View>) -> Result<Self, ViewSetError> {
        if views.len() < 2 {
            return Err(ViewSetError::TooFewViews { found: views.len(), required: 2 });
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

    /// The views, ordered by azimuth.
    pub fn views(&self) -> &[View] {
        &self.views
    }

    pub fn width(&self) -> u32 {
        self.views[0].image.width()
    }

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

    pub fn azimuths(&self) -> impl Iterator<Item = Azimuth> + '_ {
        self.views.iter().map(|view| view.azimuth)
    }
}

fn check_size(view: &View, expected: (u32, u32)) -> Result<(), ViewSetError> {
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
    use super::*;

    fn view(degrees: f64, width: u32) -> View {
        View {
            azimuth: Azimuth::from_degrees(degrees).unwrap(),
            image: GrayImage::new(width, 16),
            mask: None,
        }
    }

    #[test]
    fn orders_views_by_azimuth() {
        let set = ViewSet::new(vec![view(90.0, 16), view(-45.0, 16), view(0.0, 16)]).unwrap();
        let degrees: Vec<f64> = set.azimuths().map(Azimuth::degrees).collect();
        assert_eq!(degrees, [0.0, 90.0, 315.0]);
        assert_eq!((set.axis_px(), set.origin_row_px()), (8.0, 8.0));
    }

    #[test]
    fn names_what_does_not_fit() {
        let error = |views| ViewSet::new(views).unwrap_err();
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
            ViewSet::new(vec![odd, view(90.0, 16)]).unwrap_err(),
            ViewSetError::MaskSizeDiffers { found: (15, 16), .. }
        ));
    }
}
