//! The main job: a sheet document and its image bytes in, artifacts out.

use std::io;

use serde::{Deserialize, Serialize};

use crate::export::Artifact;
use crate::options::{self, Options};
use crate::pipeline::{Cancelled, Observer, Progress, Stage};
use crate::sheet::{self, Azimuth, ImageLimits, Sheet, SheetDocument, View, ViewDocument};

/// Why there is no draft.
#[derive(Debug, thiserror::Error)]
pub enum DraftError {
    /// The input is to blame: trying again cannot help.
    #[error("{detail}")]
    Input {
        /// Stable name, such as `no_usable_pair`.
        code: &'static str,
        /// What happened and how to mend it.
        detail: String,
    },
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Inputs could not be read or artifacts not be written.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// Our own fault.
    #[error("{0}")]
    Internal(String),
}

/// What came out, in a few numbers; the metrics artifact has the rest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    pub views: usize,
    pub pairs: usize,
    pub usable_pairs: usize,
    /// Names of all artifacts, in the order they were emitted.
    pub artifacts: Vec<String>,
    pub warnings: Vec<String>,
}

/// Makes a 3D draft from a sheet.
///
/// * `document`: views and options.
/// * `read`: the bytes of an image the document names; called from several
///   threads.
/// * `limits`: what one image may cost.
/// * `threads`: how many threads may compute; no artifact but `timings.json`
///   depends on it.
/// * `emit`: takes each artifact as soon as it is made, in a fixed order.
///
/// # Errors
/// [`DraftError::Input`] if document, images or options cannot give a draft,
/// [`DraftError::Cancelled`] if `observer` says so, [`DraftError::Io`] from
/// `read` and `emit`.
pub fn produce(
    document: &SheetDocument,
    read: &(dyn Fn(&str) -> io::Result<Vec<u8>> + Sync),
    limits: &ImageLimits,
    threads: usize,
    observer: &dyn Observer,
    emit: &mut dyn FnMut(Artifact) -> io::Result<()>,
) -> Result<Summary, DraftError> {
    let options = options_of(document)?;
    let sheet = decode_sheet(document, &options, read, limits, observer)?;
    let _ = (threads, emit);
    Err(DraftError::Internal(format!("{} views decoded; no method yet", sheet.views().len())))
}

fn input(code: &'static str, detail: impl ToString) -> DraftError {
    DraftError::Input { code, detail: detail.to_string() }
}

fn options_of(document: &SheetDocument) -> Result<Options, DraftError> {
    match &document.options {
        None => Ok(Options::default()),
        Some(value) => options::parse(value).map_err(|problems| input("invalid_options", problems)),
    }
}

fn decode_sheet(
    document: &SheetDocument,
    options: &Options,
    read: &(dyn Fn(&str) -> io::Result<Vec<u8>> + Sync),
    limits: &ImageLimits,
    observer: &dyn Observer,
) -> Result<Sheet, DraftError> {
    let required = options.method.minimum_views();
    let total = document.views.len();
    if total < required {
        return Err(input(
            "too_few_views",
            format!("the sheet has {total} views; the method takes at least {required}"),
        ));
    }
    let mut views = Vec::with_capacity(total);
    for (index, view) in document.views.iter().enumerate() {
        observer.check()?;
        views.push(decode_view(view, document.elevation_deg, read, limits)?);
        observer.progress(Progress {
            stage: Stage::Decode,
            done: index + 1,
            total,
            unit: Some(view.image.clone()),
            fraction: 0.0,
        });
    }
    Sheet::new(views).map_err(|error| input("invalid_sheet", error))
}

fn decode_view(
    view: &ViewDocument,
    default_elevation_deg: f64,
    read: &(dyn Fn(&str) -> io::Result<Vec<u8>> + Sync),
    limits: &ImageLimits,
) -> Result<View, DraftError> {
    let azimuth =
        Azimuth::from_degrees(view.azimuth_deg).map_err(|error| input("invalid_azimuth", error))?;
    let decode = |name: &str| {
        let bytes = read(name)?;
        sheet::decode(&bytes, limits)
            .map_err(|error| input("invalid_image", format!("image {name} {error}")))
    };
    let drawing = decode(&view.image)?;
    let mask = match &view.mask {
        Some(name) => Some(decode(name)?.gray),
        None => drawing.alpha,
    };
    let elevation_deg = view.elevation_deg.unwrap_or(default_elevation_deg);
    Ok(View { azimuth, elevation_deg, image: drawing.gray, mask })
}
