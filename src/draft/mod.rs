//! The main job: a sheet document and its image bytes in, artifacts out.

mod carrier;
mod decode;
mod export;
mod outbox;
mod timing;
mod truth;
mod turntable;
mod turntable_export;

use std::io;
use std::thread;

use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::{Deserialize, Serialize};

use crate::export::{ArtifactSink, EncodeError};
use crate::options::{self, Method, Options};
use crate::pipeline::{Cancelled, Observer, PipelineError, measure, reconstruct};
use crate::sheet::{ImageLimits, Sheet, SheetDocument};

pub use carrier::Carrier;
use decode::decode_sheet;
use export::Exporter;
use timing::Timed;
use truth::Truths;
use turntable_export::TurntableExporter;

pub use truth::true_model;
pub use turntable::TurntableDraft;

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

impl DraftError {
    fn input(code: &'static str, detail: impl ToString) -> Self {
        Self::Input { code, detail: detail.to_string() }
    }
}

impl From<PipelineError> for DraftError {
    fn from(error: PipelineError) -> Self {
        match error {
            PipelineError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            PipelineError::NoThreads { .. } => Self::Internal(error.to_string()),
            _ => Self::input(error.code(), error),
        }
    }
}

impl From<EncodeError> for DraftError {
    fn from(error: EncodeError) -> Self {
        Self::Internal(error.to_string())
    }
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

/// Reads the bytes of an image that a document names.
pub type ReadImage<'a> = &'a (dyn Fn(&str) -> io::Result<Vec<u8>> + Sync);

/// Makes a 3D draft from a sheet.
///
/// * `document`: views and options.
/// * `read`: the bytes of an image the document names; called from several
///   threads.
/// * `limits`: what one image may cost.
/// * `threads`: how many threads may compute; no artifact but `timings.json`
///   depends on it.
/// * `sink`: takes each artifact as soon as it is made, in a fixed order, from
///   another thread.
///
/// # Errors
/// [`DraftError::Input`] if document, images or options cannot give a draft,
/// [`DraftError::Cancelled`] if `observer` says so, [`DraftError::Io`] from
/// `read` and `sink`.
pub fn produce(
    document: &SheetDocument,
    read: ReadImage<'_>,
    limits: &ImageLimits,
    threads: usize,
    observer: &dyn Observer,
    sink: &mut dyn ArtifactSink,
) -> Result<Summary, DraftError> {
    let options = options_of(document)?;
    let pool = pool(threads)?;
    let timed = Timed::new(observer);
    let sheet = decode_sheet(document, &options, read, limits, &pool, &timed.decoding())?;
    let inputs = (read, limits, &options.evaluation);
    let truths = Truths::read(document, &sheet, inputs, &pool, &timed.decoding())?;
    let (truths, timed) = (truths.as_ref(), &timed);
    let run = Run { sheet: &sheet, options: &options, truths, pool: &pool, threads, timed };
    thread::scope(|scope| {
        let carrier = Carrier::start(scope, sink);
        match options.method {
            Method::Uncalibrated => uncalibrated(&run, carrier),
            Method::Turntable => turntable(&run, document, carrier),
        }
    })
}

/// What the method `turntable` finds, without artifacts; see [`produce`].
///
/// # Errors
/// As [`produce`].
pub fn turntable_draft(
    document: &SheetDocument,
    read: ReadImage<'_>,
    limits: &ImageLimits,
    threads: usize,
    observer: &dyn Observer,
) -> Result<TurntableDraft, DraftError> {
    let options = options_of(document)?;
    let pool = pool(threads)?;
    let sheet = decode_sheet(document, &options, read, limits, &pool, observer)?;
    turntable::compute(&sheet, document, &options, &pool, observer)
}

/// What both methods work from.
struct Run<'a> {
    sheet: &'a Sheet,
    options: &'a Options,
    truths: Option<&'a Truths<'a>>,
    pool: &'a ThreadPool,
    threads: usize,
    timed: &'a Timed<'a>,
}

fn uncalibrated(run: &Run<'_>, carrier: Carrier<'_>) -> Result<Summary, DraftError> {
    let Run { sheet, options, truths, pool, threads, timed } = *run;
    let reconstruction = reconstruct(sheet, options, threads, &timed.reconstructing())?;
    timed.computed();
    let (width_px, height_px) =
        sheet.views().first().map_or((0, 0), |view| view.image.dimensions());
    let metrics = measure(&reconstruction, width_px, height_px);
    let exporting = timed.exporting();
    let truth = export::against_truth(&reconstruction, truths, pool, &exporting)?;
    let mut exporter = Exporter::new(sheet, &reconstruction, options, pool, &exporting, carrier);
    exporter.views()?;
    exporter.pairs()?;
    exporter.cloud()?;
    exporter.mesh()?;
    exporter.metrics(&metrics, truth.as_ref())?;
    Ok(Summary {
        views: sheet.views().len(),
        pairs: reconstruction.pairs.len(),
        usable_pairs: reconstruction.usable_pairs().count(),
        artifacts: exporter.finish(timed, threads)?,
        warnings: metrics.warnings,
    })
}

fn turntable(
    run: &Run<'_>,
    document: &SheetDocument,
    carrier: Carrier<'_>,
) -> Result<Summary, DraftError> {
    let Run { sheet, options, truths, pool, threads, timed } = *run;
    let draft = turntable::compute(sheet, document, options, pool, &timed.reconstructing())?;
    timed.computed();
    let metrics = turntable_export::measure(&draft, options);
    let exporting = timed.exporting();
    let truth = turntable_export::against_truth(&draft, truths, pool, &exporting)?;
    let mut exporter = TurntableExporter::new(&draft, options, pool, &exporting, carrier)?;
    exporter.views()?;
    exporter.mesh()?;
    exporter.metrics(&metrics, truth.as_ref())?;
    Ok(Summary {
        views: sheet.views().len(),
        pairs: 0,
        usable_pairs: 0,
        artifacts: exporter.finish(timed, threads)?,
        warnings: metrics.warnings,
    })
}

fn options_of(document: &SheetDocument) -> Result<Options, DraftError> {
    match &document.options {
        None => Ok(Options::default()),
        Some(value) => {
            options::parse(value).map_err(|problems| DraftError::input("invalid_options", problems))
        }
    }
}

fn pool(threads: usize) -> Result<ThreadPool, DraftError> {
    ThreadPoolBuilder::new()
        .num_threads(threads.max(1))
        .build()
        .map_err(|error| DraftError::Internal(error.to_string()))
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod turntable_tests;
