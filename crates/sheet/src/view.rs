//! Decoded views, and the sheet that they make.

use image::{GrayImage, RgbImage};

use super::PictureSize;
use super::matches::{MatchEdit, MatchesProblem, PairEdit, PairMatchesDocument, check_matches};
use frames::{Azimuth, Elevation, Viewpoint};

/// One decoded view.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Where its camera stands on the turntable.
    pub azimuth: Azimuth,
    /// How far above the ground it looks from.
    pub elevation: Elevation,
    /// The drawing, 8-bit grey, lines dark on light.
    pub image: GrayImage,
    /// The subject's mask, above 127 inside, of the drawing's size.
    pub mask: Option<GrayImage>,
    /// Whether the mask was found in the drawing: it then includes the stroke
    /// of the outline, which a mask given by hand does not.
    pub mask_was_found: bool,
    /// How wide the outline's stroke is in a mask that was found, px; measured if `None`.
    pub outline_px: Option<f64>,
    /// Whether the mask leaves out what one sees through, as a painted drawing's or a cut-out's
    /// does; lines alone don't tell holes from panels.
    pub mask_has_holes: bool,
    /// The drawing's colours on white paper, of its size; `None` if it has none.
    pub color: Option<RgbImage>,
}

impl View {
    /// A drawing seen by a level camera.
    pub fn level(azimuth: Azimuth, image: GrayImage, mask: Option<GrayImage>) -> Self {
        let elevation = Elevation::LEVEL;
        Self {
            azimuth,
            elevation,
            image,
            mask,
            mask_was_found: false,
            outline_px: None,
            mask_has_holes: false,
            color: None,
        }
    }

    /// Where its camera stands.
    pub fn viewpoint(&self) -> Viewpoint {
        Viewpoint { azimuth: self.azimuth, elevation: self.elevation }
    }
}

/// Views of one subject, sorted by azimuth and elevation, no two alike.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    views: Vec<View>,
    edits: Vec<PairEdit>,
}

/// Why views do not make a sheet.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SheetError {
    /// Two views look along one direction.
    #[error(
        "views {first} and {second} look along one direction; give each once (360 and 0 are the same, and so is every azimuth straight from above or below)"
    )]
    Duplicate {
        /// Where one stands.
        first: Viewpoint,
        /// Where the other stands.
        second: Viewpoint,
    },
    /// A mask is not of its drawing's size.
    #[error(
        "the mask of view {view} is {mask_width}x{mask_height}, its drawing {width}x{height}; make them the same size"
    )]
    MaskSize {
        /// Which view.
        view: Viewpoint,
        /// Of the drawing, px.
        width: u32,
        /// Of the drawing, px.
        height: u32,
        /// Of the mask, px.
        mask_width: u32,
        /// Of the mask, px.
        mask_height: u32,
    },
}

impl Sheet {
    /// Sorts `views` by azimuth and elevation.
    ///
    /// # Errors
    /// [`SheetError`] if two views share a direction or a mask does not fit.
    pub fn new(mut views: Vec<View>) -> Result<Self, SheetError> {
        views.sort_by_key(View::viewpoint);
        for (index, view) in views.iter().enumerate() {
            let (second, mut earlier) = (view.viewpoint(), views[..index].iter());
            if let Some(same) = earlier.find(|other| other.viewpoint().looks_like(second)) {
                return Err(SheetError::Duplicate { first: same.viewpoint(), second });
            }
        }
        for view in &views {
            let (width, height) = view.image.dimensions();
            if let Some((mask_width, mask_height)) = view.mask.as_ref().map(GrayImage::dimensions)
                && (mask_width, mask_height) != (width, height)
            {
                return Err(SheetError::MaskSize {
                    view: view.viewpoint(),
                    width,
                    height,
                    mask_width,
                    mask_height,
                });
            }
        }
        Ok(Self { views, edits: Vec::new() })
    }

    /// Takes the matches that a document brings for its level views.
    ///
    /// # Errors
    /// [`MatchesProblem`], see [`check_matches`].
    pub fn with_matches(
        self,
        documents: &[PairMatchesDocument],
        max_pair_angle_deg: f64,
    ) -> Result<Self, MatchesProblem> {
        let size = |view: &View| {
            let (width, height) = view.image.dimensions();
            (view.azimuth, PictureSize { width, height })
        };
        let level = self.views.iter().filter(|view| view.viewpoint().is_level());
        let sizes: Vec<_> = level.map(size).collect();
        let edits = check_matches(documents, &sizes, max_pair_angle_deg)?;
        Ok(Self { edits, ..self })
    }

    /// What is done to the automatic matches of a pair of neighbours.
    pub fn match_edit(&self, left: Azimuth, right: Azimuth) -> Option<&MatchEdit> {
        let found = self.edits.iter().find(|edit| (edit.left, edit.right) == (left, right));
        found.map(|edit| &edit.edit)
    }

    /// The views by rising azimuth and elevation.
    pub fn views(&self) -> &[View] {
        &self.views
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(degrees: f64) -> View {
        View::level(Azimuth::from_degrees(degrees).unwrap(), GrayImage::new(4, 3), None)
    }

    #[test]
    fn views_come_out_by_azimuth() {
        let sheet = Sheet::new(vec![view(90.0), view(0.0), view(-45.0)]).unwrap();
        let degrees: Vec<_> = sheet.views().iter().map(|v| v.azimuth.degrees()).collect();
        assert_eq!(degrees, [0.0, 90.0, 315.0]);
    }

    #[test]
    fn one_angle_written_twice_is_refused() {
        let error = Sheet::new(vec![view(0.0), view(45.0), view(360.0)]).unwrap_err();
        assert!(matches!(error, SheetError::Duplicate { .. }), "{error}");
        let raised = |azimuth: f64, elevation: f64| View {
            elevation: Elevation::from_degrees(elevation).unwrap(),
            ..view(azimuth)
        };
        let sheet = |views: &[(f64, f64)]| {
            Sheet::new(
                views.iter().map(|&(azimuth, elevation)| raised(azimuth, elevation)).collect(),
            )
        };
        assert_eq!(sheet(&[(0.0, 0.0), (0.0, 30.0), (0.0, -30.0)]).unwrap().views().len(), 3);
        assert!(sheet(&[(0.0, 30.0), (360.0, 30.0)]).is_err());
        assert!(sheet(&[(0.0, 90.0), (45.0, 90.0)]).is_err());
    }

    #[test]
    fn a_mask_must_fit_its_drawing() {
        let masked = View { mask: Some(GrayImage::new(3, 4)), ..view(0.0) };
        assert!(matches!(Sheet::new(vec![masked]), Err(SheetError::MaskSize { .. })));
    }
}
