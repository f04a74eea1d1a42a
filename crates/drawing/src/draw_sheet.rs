//! A sheet from a model: views in parallel, files in order.

use std::sync::atomic::{AtomicUsize, Ordering};

use image::DynamicImage;
use rayon::prelude::*;

use super::documents::{DegradationDocument, sheet_document};
use super::files::{ArtifactKind, depth_counts};
use super::page::{InkBounds, PageView, compose_page};
use super::paint::mixed;
use super::svg::svg;
use super::truth::{disparity_towards, normalised_inverse_depth};
use super::view::check_camera;
use super::{DrawError, DrawOptions, Drawer, DrawnView, PreparedModel, SheetLimits, ViewError};
use artifacts::Artifact;
use frames::Viewpoint;
use picture::encode_pfm;
use progress::{Observer, Progress, Stage};

/// Views farther apart are no neighbours, degrees.
const MAX_PAIR_ANGLE_DEG: f64 = 30.0;
/// Depth images count in fractions of a unit; finer ones would not fit 16 bits.
const DEPTH_COUNTS_PER_UNIT: f64 = 4096.0;
/// Pixels of the views whose files are in memory at a time, unless threads need more.
const PIXELS_AT_A_TIME: u64 = 1 << 23;

/// Draws all views and hands over the files of the sheet as they are made: views by azimuth and
/// elevation, the sheet's own last.
///
/// Views are drawn in parallel; the files do not depend on how many at a time.
///
/// * `observer`: told after each view, from any thread; may cancel before the next.
/// * `emit`: takes each file; its error ends the drawing.
///
/// # Errors
/// What [`check_sheet`] finds, [`DrawError::TooComplex`], [`DrawError::Cancelled`], or an error of
/// `emit`.
pub fn draw_sheet<E: From<DrawError>>(
    model: &PreparedModel,
    viewpoints: &[Viewpoint],
    options: &DrawOptions,
    limits: &SheetLimits,
    observer: &dyn Observer,
    emit: &mut (dyn FnMut(Artifact) -> Result<(), E> + Send),
) -> Result<(), E> {
    let viewpoints = limits.check(viewpoints, options)?;
    let model = model.placed_for(options, &viewpoints);
    let drawer = Drawer::new(&model, options)?;
    let depth_scale = depth_counts_per_unit(&model, options);
    let counter = ViewCounter::new(observer, viewpoints.len());
    let draw = |index: usize| {
        observer.check()?;
        let view = drawer.draw_view(viewpoints[index])?;
        let files = view_files(&view, &neighbours(&viewpoints, index), options, depth_scale)?;
        counter.done();
        Ok(files)
    };
    let at_a_time = (PIXELS_AT_A_TIME / options.pixels()) as usize;
    let at_a_time = at_a_time.max(rayon::current_num_threads());
    let indices: Vec<usize> = (0..viewpoints.len()).collect();
    let mut views = Vec::with_capacity(viewpoints.len());
    for indices in indices.chunks(at_a_time) {
        let drawn: Vec<ViewFiles> =
            indices.par_iter().map(|&index| draw(index)).collect::<Result<_, DrawError>>()?;
        for view in drawn {
            view.files.into_iter().try_for_each(&mut *emit)?;
            views.push(view.summary);
        }
    }
    finished_sheet(&views, &model, options, depth_scale)?.into_iter().try_for_each(emit)
}

/// Checks everything that can be known before drawing.
///
/// # Errors
/// [`DrawError`] if an option or the list of viewpoints is unusable, the sheet is over a limit, or
/// the model does not fit the camera.
pub fn check_sheet(
    model: &PreparedModel,
    viewpoints: &[Viewpoint],
    options: &DrawOptions,
    limits: &SheetLimits,
) -> Result<(), DrawError> {
    let viewpoints = limits.check(viewpoints, options)?;
    check_camera(model.placed_radius(options, &viewpoints), options)
}

/// The views of the same elevation before and after one, across 0 too, where they are near enough;
/// each with the signed angle to it.
fn neighbours(viewpoints: &[Viewpoint], index: usize) -> Vec<(Viewpoint, f64)> {
    let own = viewpoints[index];
    let level: Vec<Viewpoint> =
        viewpoints.iter().copied().filter(|view| view.elevation == own.elevation).collect();
    let count = level.len();
    let index = level.iter().position(|view| *view == own).unwrap_or(0);
    let next = level[(index + 1) % count];
    let previous = level[(index + count - 1) % count];
    let ahead = own.azimuth.degrees_to(next.azimuth);
    let behind = previous.azimuth.degrees_to(own.azimuth);
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
    let farthest = options.camera_distance() + model.radius;
    let mut counts = DEPTH_COUNTS_PER_UNIT;
    while counts * farthest > f64::from(u16::MAX) {
        counts /= 2.0;
    }
    counts
}

/// Counts views that several threads draw.
struct ViewCounter<'a> {
    observer: &'a dyn Observer,
    done: AtomicUsize,
    total: usize,
}

impl<'a> ViewCounter<'a> {
    fn new(observer: &'a dyn Observer, total: usize) -> Self {
        Self { observer, done: AtomicUsize::new(0), total }
    }

    fn done(&self) {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        self.observer.progress(Progress {
            stage: Stage::Views,
            done,
            total: self.total,
            unit: None,
            // The page and the bundle are about as much work as a view.
            fraction: done as f64 / (self.total + 1) as f64,
        });
    }
}

struct ViewFiles {
    files: Vec<Artifact>,
    summary: ViewSummary,
}

/// What the sheet's own files need of a view.
struct ViewSummary {
    page_view: PageView,
    error: Option<ViewError>,
}

fn view_files(
    view: &DrawnView,
    neighbours: &[(Viewpoint, f64)],
    options: &DrawOptions,
    depth_scale: f64,
) -> Result<ViewFiles, DrawError> {
    let own = view.viewpoint;
    let truth = &view.truth;
    let grey = |image: &image::GrayImage| DynamicImage::ImageLuma8(image.clone());
    let mut files = vec![
        ArtifactKind::View(own).with_image(&view.image)?,
        ArtifactKind::Strokes(own).with(svg(&view.strokes, options).into_bytes()),
        ArtifactKind::Depth(own).with_image(&depth_counts(&truth.depth, depth_scale))?,
        ArtifactKind::DepthFloat(own).with(encode_pfm(&truth.depth)),
        ArtifactKind::InverseDepth(own)
            .with_image(&grey(&normalised_inverse_depth(&truth.depth)))?,
        ArtifactKind::Mask(own).with_image(&grey(&truth.mask))?,
        ArtifactKind::Normals(own).with_image(&DynamicImage::ImageRgb8(truth.normals.clone()))?,
    ];
    for &(other, angle_deg) in neighbours {
        let disparity = disparity_towards(&truth.depth, view, options, angle_deg);
        files.push(ArtifactKind::Disparity(own, other).with(encode_pfm(&disparity)));
    }
    let page_view = PageView {
        viewpoint: own,
        image: on_white(&view.image),
        ink: InkBounds::of(&view.strokes),
    };
    Ok(ViewFiles { files, summary: ViewSummary { page_view, error: view.error } })
}

/// The page is white behind views that have nothing behind them.
fn on_white(image: &DynamicImage) -> DynamicImage {
    let level = |colour: u8, alpha: u8| mixed(255, colour, alpha);
    match image {
        DynamicImage::ImageLumaA8(inked) => {
            image::GrayImage::from_fn(inked.width(), inked.height(), |x, y| {
                let [grey, alpha] = inked.get_pixel(x, y).0;
                image::Luma([level(grey, alpha)])
            })
            .into()
        }
        DynamicImage::ImageRgba8(painted) => {
            image::RgbImage::from_fn(painted.width(), painted.height(), |x, y| {
                let [r, g, b, alpha] = painted.get_pixel(x, y).0;
                image::Rgb([r, g, b].map(|colour| level(colour, alpha)))
            })
            .into()
        }
        other => other.clone(),
    }
}

fn finished_sheet(
    views: &[ViewSummary],
    model: &PreparedModel,
    options: &DrawOptions,
    depth_scale: f64,
) -> Result<Vec<Artifact>, DrawError> {
    let viewpoints: Vec<_> = views.iter().map(|view| view.page_view.viewpoint).collect();
    let errors = views.iter().filter_map(|view| Some((view.page_view.viewpoint, view.error?)));
    let page_views: Vec<_> = views.iter().map(|view| &view.page_view).collect();
    let page = compose_page(&page_views, options);
    let mut artifacts = vec![
        ArtifactKind::Page.with_image(&page)?,
        ArtifactKind::Model.with(super::obj::obj(model).into_bytes()),
    ];
    if let Some(degradation) = DegradationDocument::new(errors, options) {
        artifacts.push(ArtifactKind::Degradation.with_json(&degradation)?);
    }
    let document = sheet_document(&viewpoints, options, depth_scale);
    artifacts.push(ArtifactKind::Sheet.with_json(&document)?);
    Ok(artifacts)
}
