//! A document's pictures, checked by their headers and decoded.

use image::{GrayImage, RgbaImage, imageops};
use picture::Drawing;
use rayon::ThreadPool;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::options::{self, Method, Options};
use super::subjects::{self, Preparation};
use super::{DraftError, ReadImage};
use crate::failure_code::FailureCode;
use frames::{Azimuth, Elevation, Viewpoint};
use picture::ImageLimits;
use progress::{Observer, Progress, Stage};
use sheet::{HoleDocument, Sheet, SheetDocument, View, ViewDocument};
use subject::{ByHand, reduced, reduced_mask};

/// A view's bytes, held against the limits but not yet decoded.
struct Inspected<'a> {
    document: &'a ViewDocument,
    azimuth: Azimuth,
    elevation: Elevation,
    drawing: Vec<u8>,
    mask: Option<Vec<u8>>,
    width_px: u32,
    height_px: u32,
}

/// A sheet that a method can work from, and what was done to its drawings.
pub(super) struct DecodedSheet {
    pub sheet: Sheet,
    /// The document's, on the sheet's views.
    pub holes: Vec<HoleDocument>,
    pub preparation: Option<Preparation>,
}

/// Reads, checks and decodes the views of a document, and prepares them for the
/// method.
///
/// Everything that headers tell is checked before the first pixel is decoded.
pub(super) fn decode_sheet(
    document: &SheetDocument,
    options: &Options,
    read: ReadImage<'_>,
    limits: &DraftLimits,
    pool: &ThreadPool,
    observer: &dyn Observer,
) -> Result<DecodedSheet, DraftError> {
    let required = options.method.minimum_views();
    let found = document.views.len();
    if found < required {
        let detail = format!("the sheet has {found} views; the method takes at least {required}");
        return Err(DraftError::input(FailureCode::TooFewViews, detail));
    }
    let elevations = document.views.iter().map(|view| elevation_of(view, document));
    let elevations = elevations.collect::<Result<Vec<Elevation>, _>>()?;
    let level = elevations.iter().filter(|elevation| **elevation == Elevation::LEVEL).count();
    if level < found && !options.method.takes_elevated() {
        let detail = "the method takes level views alone; leave the others out";
        return Err(DraftError::input(FailureCode::ElevationUnsupported, detail));
    }
    if level < required {
        let detail = format!(
            "{level} of the sheet's {found} views are level; the method takes at least {required}"
        );
        return Err(DraftError::input(FailureCode::TooFewViews, detail));
    }
    let mut inspected = Vec::with_capacity(found);
    for (view, elevation) in document.views.iter().zip(elevations) {
        observer.check()?;
        inspected.push(inspect(view, elevation, read, &limits.image)?);
    }
    let threads = pool.current_num_threads();
    let has_truth = document.has_truth();
    check_sizes(&inspected, options, threads, has_truth, limits.max_working_bytes)?;
    let (width, height) = largest(&inspected);
    let reduction = options.reduction(u64::from(width) * u64::from(height), has_truth);
    let decoded: Vec<_> = pool.install(|| {
        inspected
            .par_iter()
            .with_max_len(1)
            .map(|view| {
                observer.check()?;
                decode(view, &limits.image, reduction)
            })
            .collect()
    });
    // In order, so that the error told is always the same.
    let views = decoded.into_iter().collect::<Result<Vec<_>, _>>()?;
    observer.progress(Progress {
        stage: Stage::Decode,
        done: found,
        total: found,
        unit: None,
        fraction: 1.0,
    });
    let (views, preparation) = match (options.method, options.sheet.prepare) {
        (Method::Turntable, options::Preparation::Auto) => {
            let most = limits.max_working_bytes;
            let (views, done) =
                pool.install(|| subjects::prepare(views, options, has_truth, most, observer))?;
            (views, Some(done))
        }
        _ => (views.into_iter().map(DecodedView::into_drawn).collect(), None),
    };
    let mut sheet =
        Sheet::new(views).map_err(|error| DraftError::input(FailureCode::InvalidSheet, error))?;
    // Those are places of the drawings as sent, for the method that takes them as they are.
    if preparation.is_none() {
        sheet = sheet
            .with_matches(&document.matches, options.max_pair_angle_deg)
            .map_err(|error| DraftError::input(FailureCode::InvalidMatches, error))?;
    }
    let holes = match &preparation {
        None => document.holes.clone(),
        Some(done) => done.holes(document),
    };
    Ok(DecodedSheet { sheet, holes, preparation })
}

fn elevation_of(view: &ViewDocument, document: &SheetDocument) -> Result<Elevation, DraftError> {
    let degrees = view.elevation_deg.unwrap_or(document.elevation_deg);
    Elevation::from_degrees(degrees)
        .map_err(|error| DraftError::input(FailureCode::InvalidAzimuth, error))
}

fn inspect<'a>(
    view: &'a ViewDocument,
    elevation: Elevation,
    read: ReadImage<'_>,
    limits: &ImageLimits,
) -> Result<Inspected<'a>, DraftError> {
    let azimuth = Azimuth::from_degrees(view.azimuth_deg)
        .map_err(|error| DraftError::input(FailureCode::InvalidAzimuth, error))?;
    let header = |name: &str, bytes: &[u8]| {
        picture::inspect(bytes, limits).map_err(|error| {
            DraftError::input(FailureCode::InvalidImage, format!("image {name} {error}"))
        })
    };
    let drawing = read(&view.image)?;
    let (_, width_px, height_px) = header(&view.image, &drawing)?;
    let mask = match &view.mask {
        Some(name) => {
            let bytes = read(name)?;
            header(name, &bytes)?;
            Some(bytes)
        }
        None => None,
    };
    Ok(Inspected { document: view, azimuth, elevation, drawing, mask, width_px, height_px })
}

/// The largest width and the largest height.
fn largest(views: &[Inspected<'_>]) -> (u32, u32) {
    let most = |pick: fn(&Inspected<'_>) -> u32| views.iter().map(pick).max().unwrap_or(0);
    (most(|view| view.width_px), most(|view| view.height_px))
}

fn check_sizes(
    views: &[Inspected<'_>],
    options: &Options,
    threads: usize,
    has_truth: bool,
    max_working_bytes: u64,
) -> Result<(), DraftError> {
    let Some(first) = views.first() else { return Ok(()) };
    if options.method.needs_equal_sizes() {
        let size = |view: &Inspected<'_>| (view.width_px, view.height_px);
        if let Some(other) = views.iter().find(|view| size(view) != size(first)) {
            let detail = format!(
                "view {} is {}x{} px, view {} {}x{} px; make all views one size",
                other.azimuth,
                other.width_px,
                other.height_px,
                first.azimuth,
                first.width_px,
                first.height_px
            );
            return Err(DraftError::input(FailureCode::SizesDiffer, detail));
        }
    }
    check_memory(views.len(), largest(views), options, threads, has_truth, max_working_bytes)
}

/// What a reconstruction may hold in memory at once where nothing else is said,
/// bytes.
pub const DEFAULT_WORKING_BYTES: u64 = 8 << 30;

/// What a reconstruction may cost.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DraftLimits {
    /// Each drawing and mask.
    pub image: ImageLimits,
    /// What it may hold in memory at once, bytes.
    pub max_working_bytes: u64,
}

impl Default for DraftLimits {
    fn default() -> Self {
        Self { image: ImageLimits::default(), max_working_bytes: DEFAULT_WORKING_BYTES }
    }
}

/// Views of an image limit alone.
impl From<ImageLimits> for DraftLimits {
    fn from(image: ImageLimits) -> Self {
        Self { image, ..Self::default() }
    }
}

/// Holds the memory that `views` of one size would take against the limit.
///
/// * `has_truth`: whether the sheet has; it is not reduced then.
///
/// # Errors
/// [`DraftError::Input`] if it is more; the detail has both.
pub fn check_memory(
    views: usize,
    size: (u32, u32),
    options: &Options,
    threads: usize,
    has_truth: bool,
    max_working_bytes: u64,
) -> Result<(), DraftError> {
    let needed = options.working_bytes(views, size, threads, has_truth);
    if needed <= max_working_bytes {
        return Ok(());
    }
    let code = FailureCode::TooLarge;
    let detail = format!(
        "the views and options need about {needed} bytes of memory, over the limit of {max_working_bytes}; {}",
        code.remedy()
    );
    Err(DraftError::input(code, detail))
}

/// A view's pictures, decoded.
pub(super) struct DecodedView<'a> {
    pub document: &'a ViewDocument,
    pub azimuth: Azimuth,
    pub elevation: Elevation,
    /// Reduced, as is the mask.
    pub drawing: RgbaImage,
    /// Given as a file; 128 and above inside.
    pub mask: Option<GrayImage>,
    /// What was done to the drawing as sent.
    pub change: Change,
}

/// How a drawing differs from the one sent.
#[derive(Clone, Copy, Debug)]
pub(super) struct Change {
    /// Whether left and right are exchanged.
    pub turned: bool,
    /// Of the drawing as sent.
    pub width_px: u32,
    /// How many times fewer columns and rows it has.
    pub reduction: f64,
}

impl Change {
    /// Where a place of the drawing as sent, px, is now.
    pub(super) fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let turned = if self.turned { f64::from(self.width_px) - x } else { x };
        [turned / self.reduction, y / self.reduction]
    }
}

impl DecodedView<'_> {
    /// Where its camera stands.
    pub(super) fn viewpoint(&self) -> Viewpoint {
        Viewpoint { azimuth: self.azimuth, elevation: self.elevation }
    }

    /// What the document says of the view's place, in this drawing.
    pub(super) fn by_hand(&self) -> ByHand {
        let ViewDocument { axis_x, ground_y, scale, .. } = *self.document;
        ByHand {
            axis_x: axis_x.map(|x| self.change.place([x, 0.0])[0]),
            ground_y: ground_y.map(|y| self.change.place([0.0, y])[1]),
            scale,
        }
    }

    /// The drawing as it is, in grey, transparency being the mask.
    fn into_drawn(self) -> View {
        let Drawing { gray, alpha } = picture::flatten(&self.drawing);
        let level = View::level(self.azimuth, gray, self.mask.or(alpha));
        let mask_was_found = self.document.mask_with_outline && level.mask.is_some();
        let mask_has_holes = self.document.mask_has_holes && level.mask.is_some();
        let outline_px = self.document.outline_px;
        View { elevation: self.elevation, mask_was_found, outline_px, mask_has_holes, ..level }
    }
}

fn decode<'a>(
    view: &Inspected<'a>,
    limits: &ImageLimits,
    reduction: f64,
) -> Result<DecodedView<'a>, DraftError> {
    let refuse = |name: &str, error: picture::ImageError| {
        DraftError::input(FailureCode::InvalidImage, format!("image {name} {error}"))
    };
    let document = view.document;
    let mut drawing = picture::decode_color(&view.drawing, limits)
        .map_err(|error| refuse(&document.image, error))?;
    let mut mask = match (&view.mask, &document.mask) {
        (Some(bytes), Some(name)) => {
            Some(picture::decode(bytes, limits).map_err(|error| refuse(name, error))?.gray)
        }
        _ => None,
    };
    if document.mirrored {
        imageops::flip_horizontal_in_place(&mut drawing);
        mask.as_mut().map(imageops::flip_horizontal_in_place);
    }
    let width_px = drawing.width();
    if reduction > 1.0 {
        drawing = reduced(&drawing, reduction);
        mask = mask.map(|mask| reduced_mask(&mask, reduction));
    }
    let (azimuth, elevation) = (view.azimuth, view.elevation);
    let change = Change { turned: document.mirrored, width_px, reduction };
    Ok(DecodedView { document, azimuth, elevation, drawing, mask, change })
}

#[cfg(test)]
mod tests {
    use uncalibrated::options::{DisparityOptions, SgbmMode};

    use super::*;

    #[test]
    fn a_usual_sheet_fits_and_a_huge_one_is_refused() {
        let turntable = Options::default();
        let check = |views, size, options: &Options, threads, has_truth| {
            check_memory(views, size, options, threads, has_truth, DEFAULT_WORKING_BYTES)
        };
        assert!(check(19, (1920, 1080), &turntable, 8, true).is_ok());
        assert!(check(64, (8000, 8000), &turntable, 8, false).is_err());
        // Reduced, unless there is a truth.
        assert!(check(5, (6000, 4000), &turntable, 2, false).is_ok());
        assert!(check(5, (6000, 4000), &turntable, 2, true).is_err());
        let options = Options { method: Method::Uncalibrated, ..turntable };
        assert!(check(64, (1920, 1080), &options, 8, false).is_ok());
        assert!(check(64, (8000, 8000), &options, 2, false).is_err());
        let disparity = DisparityOptions {
            mode: SgbmMode::EightPath,
            num_disparities: 1024,
            ..DisparityOptions::default()
        };
        let options = Options { disparity, ..options };
        let error = check(3, (4000, 3000), &options, 1, false).unwrap_err();
        assert!(matches!(error, DraftError::Input { code: FailureCode::TooLarge, .. }), "{error}");
    }
}
