use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use image::DynamicImage;
use rayon::prelude::*;

use super::artifacts::{Artifact, ArtifactKind, depth_counts};
use super::documents::{DegradationDocument, SheetDocument};
use super::page::{InkBounds, PageView, compose_page};
use super::svg::svg;
use super::truth::{disparity_towards, normalised_inverse_depth};
use super::{DrawError, DrawOptions, Drawer, DrawnView, PreparedModel, ViewError};
use crate::float_image::encode_pfm;
use crate::sheet::Azimuth;

/// Views of one sheet.
const MAX_VIEWS: usize = 360;
/// Pixels of all views of one sheet.
const MAX_SHEET_PIXELS: u64 = 1 << 28;
/// Views farther apart are no neighbours, degrees.
const MAX_PAIR_ANGLE_DEG: f64 = 30.0;
/// Depth images count in fractions of a unit; finer ones would not fit 16 bits.
const DEPTH_COUNTS_PER_UNIT: f64 = 4096.0;
/// Share of the frame that a fitted model takes.
const FITTED_SHARE: f64 = 0.94;

/// Draws all views and gives the files of the sheet, views by azimuth, the sheet's own last.
///
/// Views are drawn in parallel; the files do not depend on how many at a time.
///
/// * `progress`: called after each view with the number of views done, from any thread; breaking
///   cancels before the next view.
///
/// # Errors
/// [`DrawError`] if an option or the list of azimuths is unusable, the model does not fit the
/// camera, or the drawing was cancelled.
pub fn draw_sheet(
    model: &PreparedModel,
    azimuths: &[Azimuth],
    options: &DrawOptions,
    progress: &(dyn Fn(usize) -> ControlFlow<()> + Sync),
) -> Result<Vec<Artifact>, DrawError> {
    options.check()?;
    let azimuths = ordered(azimuths, options)?;
    let fitted = options.fit.then(|| {
        let height = f64::from(options.height_px) / options.pixels_per_unit();
        model.fitted(options.scale, height, options.elevation_deg, FITTED_SHARE)
    });
    let model = fitted.as_ref().unwrap_or(model);
    let drawer = Drawer::new(model, options)?;
    let depth_scale = depth_counts_per_unit(model, options);
    let gate = Gate::new(progress);
    let views: Vec<ViewFiles> = (0..azimuths.len())
        .into_par_iter()
        .map(|index| {
            gate.check()?;
            let view = drawer.draw_view(azimuths[index])?;
            let files = view_files(&view, &neighbours(&azimuths, index), options, depth_scale)?;
            gate.done();
            Ok(files)
        })
        .collect::<Result<_, DrawError>>()?;
    finished_sheet(views, model, options, depth_scale)
}

/// Ascending, each once, not too many.
fn ordered(azimuths: &[Azimuth], options: &DrawOptions) -> Result<Vec<Azimuth>, DrawError> {
    let mut azimuths = azimuths.to_vec();
    azimuths.sort_unstable();
    if azimuths.is_empty() {
        return Err(DrawError::NoViews);
    }
    if azimuths.len() > MAX_VIEWS {
        return Err(DrawError::TooManyViews { found: azimuths.len(), limit: MAX_VIEWS });
    }
    if let Some(pair) = azimuths.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(DrawError::DuplicateView { azimuth_deg: pair[0].degrees() });
    }
    let view = u64::from(options.width_px) * u64::from(options.height_px);
    let found = view * azimuths.len() as u64;
    if found > MAX_SHEET_PIXELS {
        return Err(DrawError::TooManySamples { found, limit: MAX_SHEET_PIXELS });
    }
    Ok(azimuths)
}

/// The views before and after one, across 0 too, where they are near enough; each with the signed
/// angle to it.
fn neighbours(azimuths: &[Azimuth], index: usize) -> Vec<(Azimuth, f64)> {
    let own = azimuths[index];
    let count = azimuths.len();
    let next = azimuths[(index + 1) % count];
    let previous = azimuths[(index + count - 1) % count];
    let ahead = own.degrees_to(next);
    let behind = previous.degrees_to(own);
    let mut neighbours = Vec::new();
    if behind > 0.0 && behind <= MAX_PAIR_ANGLE_DEG {
        neighbours.push((previous, -behind));
    }
    if ahead > 0.0 && ahead <= MAX_PAIR_ANGLE_DEG && (next != previous || ahead != behind) {
        neighbours.push((next, ahead));
    }
    neighbours
}

/// The same for all views: as fine as 16 bits allow, at most [`DEPTH_COUNTS_PER_UNIT`].
fn depth_counts_per_unit(model: &PreparedModel, options: &DrawOptions) -> f64 {
    let centre = options.distance / options.elevation_deg.to_radians().cos();
    let farthest = centre + model.radius;
    let mut counts = DEPTH_COUNTS_PER_UNIT;
    while counts * farthest > f64::from(u16::MAX) {
        counts /= 2.0;
    }
    counts
}

/// Counts views and passes a request to cancel on to all threads.
struct Gate<'a> {
    progress: &'a (dyn Fn(usize) -> ControlFlow<()> + Sync),
    done: AtomicUsize,
    cancelled: AtomicBool,
}

impl<'a> Gate<'a> {
    fn new(progress: &'a (dyn Fn(usize) -> ControlFlow<()> + Sync)) -> Self {
        Self { progress, done: AtomicUsize::new(0), cancelled: AtomicBool::new(false) }
    }

    fn check(&self) -> Result<(), DrawError> {
        if self.cancelled.load(Ordering::Relaxed) { Err(DrawError::Cancelled) } else { Ok(()) }
    }

    fn done(&self) {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        if (self.progress)(done).is_break() {
            self.cancelled.store(true, Ordering::Relaxed);
        }
    }
}

/// What is left of a view when its files are written.
struct ViewFiles {
    files: Vec<Artifact>,
    page_view: PageView,
    error: Option<ViewError>,
}

fn view_files(
    view: &DrawnView,
    neighbours: &[(Azimuth, f64)],
    options: &DrawOptions,
    depth_scale: f64,
) -> Result<ViewFiles, DrawError> {
    let azimuth = view.azimuth;
    let truth = &view.truth;
    let grey = |image: &image::GrayImage| DynamicImage::ImageLuma8(image.clone());
    let mut files = vec![
        ArtifactKind::View(azimuth).with_image(&view.image)?,
        ArtifactKind::Strokes(azimuth).with(svg(&view.strokes, options).into_bytes()),
        ArtifactKind::Depth(azimuth).with_image(&depth_counts(&truth.depth, depth_scale))?,
        ArtifactKind::DepthFloat(azimuth).with(encode_pfm(&truth.depth)),
        ArtifactKind::InverseDepth(azimuth)
            .with_image(&grey(&normalised_inverse_depth(&truth.depth)))?,
        ArtifactKind::Mask(azimuth).with_image(&grey(&truth.mask))?,
        ArtifactKind::Normals(azimuth)
            .with_image(&DynamicImage::ImageRgb8(truth.normals.clone()))?,
    ];
    for &(other, angle_deg) in neighbours {
        let disparity = disparity_towards(&truth.depth, &view.camera, options, angle_deg);
        files.push(ArtifactKind::Disparity(azimuth, other).with(encode_pfm(&disparity)));
    }
    Ok(ViewFiles {
        files,
        page_view: PageView {
            azimuth,
            image: on_white(&view.image),
            ink: InkBounds::of(&view.strokes),
        },
        error: view.error,
    })
}

/// The page is white, whatever is behind the views.
fn on_white(image: &DynamicImage) -> image::GrayImage {
    match image {
        DynamicImage::ImageLumaA8(inked) => {
            image::GrayImage::from_fn(inked.width(), inked.height(), |x, y| {
                image::Luma([255 - inked.get_pixel(x, y).0[1]])
            })
        }
        other => other.to_luma8(),
    }
}

fn finished_sheet(
    views: Vec<ViewFiles>,
    model: &PreparedModel,
    options: &DrawOptions,
    depth_scale: f64,
) -> Result<Vec<Artifact>, DrawError> {
    let azimuths: Vec<_> = views.iter().map(|view| view.page_view.azimuth).collect();
    let document = SheetDocument::new(&azimuths, options, depth_scale);
    let errors = views.iter().filter_map(|view| Some((view.page_view.azimuth, view.error?)));
    let degradation = DegradationDocument::new(errors, options);
    let (mut artifacts, mut page_views) = (Vec::new(), Vec::new());
    for view in views {
        artifacts.extend(view.files);
        page_views.push(view.page_view);
    }
    let page = compose_page(&page_views, options)?;
    artifacts.push(ArtifactKind::Page.with_image(&DynamicImage::ImageLuma8(page))?);
    artifacts.push(ArtifactKind::Model.with(super::obj::obj(model).into_bytes()));
    if let Some(degradation) = degradation {
        artifacts.push(ArtifactKind::Degradation.with_json(&degradation)?);
    }
    artifacts.push(ArtifactKind::Sheet.with_json(&document)?);
    Ok(artifacts)
}
