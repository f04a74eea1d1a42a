//! The files of a drawn sheet.

use image::{DynamicImage, ImageBuffer, Luma};

use super::DrawError;
use artifacts::{Artifact, PFM_MEDIA_TYPE};
use frames::Viewpoint;
use picture::{FloatImage, dynamic_png};

/// The files of a drawn sheet. Azimuths are written as the shortest decimal with three digits
/// before the point, and with the elevation of views that are not level: `view_000.png`,
/// `view_022.5.png`, `view_000_e90.png`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArtifactKind {
    /// The drawing.
    View(Viewpoint),
    /// Its strokes as vectors.
    Strokes(Viewpoint),
    /// Distance from the camera plane, 16 bits; 0 is background.
    Depth(Viewpoint),
    /// The same in scene units, NaN is background.
    DepthFloat(Viewpoint),
    /// The dissertation's depth: inverted, normalised to 8 bits.
    InverseDepth(Viewpoint),
    /// Where the model is: 255 on it, 0 on the background.
    Mask(Viewpoint),
    /// Unit normals of the visible surface, as RGB.
    Normals(Viewpoint),
    /// Disparity of the first view towards the second, pixels.
    Disparity(Viewpoint, Viewpoint),
    /// The document that describes the sheet.
    Sheet,
    /// All views on one page.
    Page,
    /// The model as it was drawn.
    Model,
    /// What was made imperfect, and how much.
    Degradation,
}

impl ArtifactKind {
    /// Its file name in the sheet's folder, such as `view_045.png`.
    pub fn name(self) -> String {
        match self {
            Self::View(view) => format!("view_{}.png", view.padded()),
            Self::Strokes(view) => format!("view_{}.svg", view.padded()),
            Self::Depth(view) => format!("depth_{}.png", view.padded()),
            Self::DepthFloat(view) => format!("depth_{}.pfm", view.padded()),
            Self::InverseDepth(view) => format!("inverse_depth_{}.png", view.padded()),
            Self::Mask(view) => format!("mask_{}.png", view.padded()),
            Self::Normals(view) => format!("normals_{}.png", view.padded()),
            Self::Disparity(from, to) => format!("disparity_{}_{}.pfm", from.padded(), to.padded()),
            Self::Sheet => "sheet.json".to_owned(),
            Self::Page => "page.png".to_owned(),
            Self::Model => "model.obj".to_owned(),
            Self::Degradation => "degradation.json".to_owned(),
        }
    }

    fn media_type(self) -> &'static str {
        match self {
            Self::View(_)
            | Self::Depth(_)
            | Self::InverseDepth(_)
            | Self::Mask(_)
            | Self::Normals(_)
            | Self::Page => "image/png",
            Self::Strokes(_) => "image/svg+xml",
            Self::DepthFloat(_) | Self::Disparity(..) => PFM_MEDIA_TYPE,
            Self::Sheet | Self::Degradation => "application/json",
            Self::Model => "model/obj",
        }
    }

    pub(super) fn with(self, bytes: Vec<u8>) -> Artifact {
        Artifact { name: self.name(), media_type: self.media_type(), bytes: bytes.into() }
    }

    pub(super) fn with_image(self, image: &DynamicImage) -> Result<Artifact, DrawError> {
        Ok(self.with(dynamic_png(image).map_err(|error| self.failed(&error))?))
    }

    pub(super) fn with_json(self, document: &impl serde::Serialize) -> Result<Artifact, DrawError> {
        let mut bytes = serde_json::to_vec_pretty(document).map_err(|error| self.failed(&error))?;
        bytes.push(b'\n');
        Ok(self.with(bytes))
    }

    fn failed(self, error: &dyn std::error::Error) -> DrawError {
        DrawError::Encoding { name: self.name(), reason: error.to_string() }
    }
}

/// Depth in counts; background is 0.
pub(super) fn depth_counts(depth: &FloatImage, counts_per_unit: f64) -> DynamicImage {
    let counts = depth.as_raw().iter().map(|&depth| {
        if depth.is_finite() {
            (f64::from(depth) * counts_per_unit).round().clamp(1.0, 65535.0) as u16
        } else {
            0
        }
    });
    let counts: Vec<u16> = counts.collect();
    let image = ImageBuffer::<Luma<u16>, _>::from_raw(depth.width(), depth.height(), counts);
    image.map_or_else(|| DynamicImage::new_luma16(0, 0), DynamicImage::ImageLuma16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_sort_by_azimuth_and_keep_its_decimals() {
        let name = |degrees| {
            ArtifactKind::View(frames::Azimuth::from_degrees(degrees).unwrap().into()).name()
        };
        assert_eq!(name(0.0), "view_000.png");
        assert_eq!(name(22.5), "view_022.5.png");
        assert_eq!(name(315.0), "view_315.png");
    }

    #[test]
    fn depth_counts_keep_the_background_apart() {
        let map = FloatImage::from_raw(3, 1, vec![f32::NAN, 1e-9, 6.224]).unwrap();
        let counts = depth_counts(&map, 4096.0).into_luma16();
        assert_eq!(counts.as_raw(), &[0, 1, 25494]);
    }
}
