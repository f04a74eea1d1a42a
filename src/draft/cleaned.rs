//! The cleaned sheet: what the draft was made of, to be looked at and sent again.

use artifacts::{Artifact, ArtifactName, CleanArtifact};
use drawing::PageDrawing;
use image::DynamicImage;
use picture::{dynamic_png, png};
use sheet::{HoleDocument, SheetDocument, ViewDocument};
use turntable::{Draft, DraftView};

use super::DraftError;
use super::elevated::extent;
use super::options::Options;

/// The views as the method worked with them, on one canvas, with a document that gives the same
/// draft again, and a page of them all.
///
/// The document names lines and masks; colours are on the page alone.
pub(super) fn cleaned(
    draft: &Draft<'_>,
    document: &SheetDocument,
    holes: &[HoleDocument],
    options: &Options,
) -> Result<Vec<Artifact>, DraftError> {
    let mut views = draft.all_views();
    views.sort_by_key(DraftView::viewpoint);
    let named = |artifact| ArtifactName::Clean(artifact);
    let mut files = vec![Artifact::new(named(CleanArtifact::Page), dynamic_png(&page(&views))?)];
    let mut described = Vec::with_capacity(views.len());
    for DraftView { view, .. } in &views {
        let own = view.viewpoint();
        let (image, mask) = (CleanArtifact::View(own), CleanArtifact::Mask(own));
        files.push(Artifact::new(named(image), png(&view.image)?));
        if let Some(given) = &view.mask {
            files.push(Artifact::new(named(mask), png(given)?));
        }
        let same = |view: &&ViewDocument| view.viewpoint() == Some(own);
        described.push(ViewDocument {
            image: image.file_name(),
            azimuth_deg: own.azimuth.degrees(),
            azimuth_confidence: document.views.iter().find(same).and_then(|v| v.azimuth_confidence),
            elevation_deg: Some(own.elevation.degrees()),
            mask: view.mask.as_ref().map(|_| mask.file_name()),
            mask_with_outline: view.mask.is_some() && view.mask_was_found,
            outline_px: view.outline_px.filter(|_| view.mask.is_some() && view.mask_was_found),
            mask_has_holes: view.mask.is_some() && view.mask_has_holes,
            ..ViewDocument::default()
        });
    }
    let mut options = options.clone();
    // All that this would do is done.
    options.sheet.prepare = super::options::Preparation::Off;
    options.turntable.register = false;
    let cleaned = SheetDocument {
        name: document.name.clone(),
        width: Some(draft.views.width()),
        height: Some(draft.views.height()),
        views: described,
        holes: holes.to_vec(),
        options: Some(serde_json::to_value(&options).map_err(DraftError::internal)?),
        ..SheetDocument::default()
    };
    let json = serde_json::to_vec_pretty(&cleaned).map_err(DraftError::internal)?;
    files.push(Artifact::new(named(CleanArtifact::Document), json));
    Ok(files)
}

/// All views beside each other, on one ground line, with their angles.
fn page(views: &[DraftView<'_>]) -> DynamicImage {
    let drawing = |found: &DraftView<'_>| PageDrawing {
        viewpoint: found.viewpoint(),
        image: match &found.view.color {
            Some(color) => DynamicImage::ImageRgb8(color.clone()),
            None => DynamicImage::ImageLuma8(found.view.image.clone()),
        },
        bounds: extent(found.silhouette.mask()),
    };
    drawing::page(&views.iter().map(drawing).collect::<Vec<_>>())
}
