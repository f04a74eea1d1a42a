//! The main job: a sheet document and its image bytes in, artifacts out.

mod cleaned;
mod decode;
mod elevated;
mod error;
mod exporter;
pub mod options;
mod report;
mod subjects;
mod timing;
mod truth;
mod turntable;
mod uncalibrated;

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::{io, thread};

use artifacts::{ArtifactSink, Delivery};
use frames::Viewpoint;
use image::{GrayImage, RgbaImage};
use progress::{Observer, Silent};
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use sheet::{HoleDocument, Sheet, SheetDocument};

use crate::failure_code::FailureCode;
use crate::kinds::FitSummary;
use crate::provenance::PROGRAM;
pub use decode::{DEFAULT_WORKING_BYTES, DraftLimits, check_memory};
use decode::{DecodedSheet, decode_sheet};
use options::{Method, Options};
use report::Provenance;
use subjects::Preparation;
use timing::Timed;
use truth::Truths;

pub use error::DraftError;
pub use truth::true_model;

/// What came out, in a few numbers; the metrics artifact has the rest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Views of the sheet.
    pub views: usize,
    /// Neighbouring views that were worked on; 0 for a method without pairs.
    pub pairs: usize,
    /// How many of them gave disparity; 0 for a method without pairs.
    pub usable_pairs: usize,
    /// Names of all artifacts, in the order they were emitted.
    pub artifacts: Vec<String>,
    /// How well the draft, drawn again, matches each drawing; empty for a method
    /// that makes no solid.
    pub fit: Vec<FitSummary>,
    /// What a person should look at, in sentences.
    pub warnings: Vec<String>,
}

/// Reads the bytes of an image that a document names.
pub type ReadImage<'a> = &'a (dyn Fn(&str) -> io::Result<Vec<u8>> + Sync);

/// Makes a 3D draft from a sheet.
///
/// * `document`: views and options.
/// * `read`: the bytes of an image the document names; called from several
///   threads.
/// * `limits`: what images and the whole may cost.
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
    limits: &DraftLimits,
    threads: usize,
    observer: &dyn Observer,
    sink: &mut dyn ArtifactSink,
) -> Result<Summary, DraftError> {
    let options = options_of(document)?;
    let pool = pool(threads)?;
    let timed = Timed::new(observer);
    let hashes = Mutex::new(BTreeMap::new());
    let read: ReadImage<'_> = &|name| {
        let bytes = read(name)?;
        let hash = hex::encode(Sha256::digest(&bytes));
        hashes.lock().unwrap_or_else(PoisonError::into_inner).insert(name.to_owned(), hash);
        Ok(bytes)
    };
    let DecodedSheet { sheet, holes, preparation } =
        decode_sheet(document, &options, read, limits, &pool, &timed.decoding())?;
    let moved = preparation.as_ref().is_some_and(|done| done.alignment.is_some());
    let in_place = (!moved).then_some(&sheet);
    let inputs = (read, &limits.image, &options.evaluation);
    let truths = Truths::read(document, in_place, inputs, &pool, &timed.decoding())?;
    let (truths, timed) = (truths.as_ref(), &timed);
    let inputs_sha256 = hashes.lock().unwrap_or_else(PoisonError::into_inner).clone();
    let provenance = provenance(&options, inputs_sha256)?;
    let run = Run {
        document,
        sheet: &sheet,
        holes: &holes,
        preparation: preparation.as_ref(),
        options: &options,
        provenance: &provenance,
        truths,
        pool: &pool,
        threads,
        timed,
    };
    thread::scope(|scope| {
        let delivery = Delivery::start(scope, sink);
        match options.method {
            Method::Uncalibrated => uncalibrated::run(&run, delivery),
            Method::Turntable => turntable::run(&run, delivery),
        }
    })
}

/// A decoded sheet, to try the method `turntable` on without artifacts.
pub struct Decoded {
    sheet: Sheet,
    holes: Vec<HoleDocument>,
    preparation: Option<Preparation>,
    options: Options,
    pool: ThreadPool,
}

impl Decoded {
    /// Decodes a sheet; see [`produce`].
    ///
    /// # Errors
    /// As [`produce`].
    pub fn read(
        document: &SheetDocument,
        read: ReadImage<'_>,
        limits: &DraftLimits,
        threads: usize,
    ) -> Result<Self, DraftError> {
        let (options, pool) = (options_of(document)?, pool(threads)?);
        let DecodedSheet { sheet, holes, preparation } =
            decode_sheet(document, &options, read, limits, &pool, &Silent)?;
        Ok(Self { sheet, holes, preparation, options, pool })
    }

    /// What a person should know of the drawings.
    pub fn warnings(&self) -> &[String] {
        self.preparation.as_ref().map_or(&[], |done| &done.warnings)
    }

    /// Each subject's area as it was found, 255 inside.
    pub fn masks(&self) -> Vec<(Viewpoint, GrayImage)> {
        let pictures = self.preparation.as_ref().map_or(&[][..], |done| &done.cut_outs);
        let mask = |(viewpoint, picture): &(Viewpoint, RgbaImage)| {
            let alpha = picture.pixels().map(|pixel| pixel.0[3]).collect();
            (
                *viewpoint,
                GrayImage::from_raw(picture.width(), picture.height(), alpha).unwrap_or_default(),
            )
        };
        pictures.iter().map(mask).collect()
    }

    /// What the method finds.
    ///
    /// # Errors
    /// As [`produce`].
    pub fn turntable(&self) -> Result<::turntable::Draft<'_>, DraftError> {
        let (sheet, holes, own) = (&self.sheet, &self.holes, &self.options.turntable);
        Ok(self.pool.install(|| ::turntable::reconstruct(sheet, holes, own, &Silent))?)
    }
}

/// What both methods work from.
struct Run<'a> {
    document: &'a SheetDocument,
    sheet: &'a Sheet,
    /// Of the sheet's views.
    holes: &'a [HoleDocument],
    /// What was done to the drawings; `None` if they were taken as they are.
    preparation: Option<&'a Preparation>,
    options: &'a Options,
    provenance: &'a Provenance,
    truths: Option<&'a Truths<'a>>,
    pool: &'a ThreadPool,
    threads: usize,
    timed: &'a Timed<'a>,
}

fn options_of(document: &SheetDocument) -> Result<Options, DraftError> {
    match &document.options {
        None => Ok(Options::default()),
        Some(value) => options::parse(value)
            .map_err(|problems| DraftError::input(FailureCode::InvalidOptions, problems)),
    }
}

fn provenance(
    options: &Options,
    inputs_sha256: BTreeMap<String, String>,
) -> Result<Provenance, DraftError> {
    let options = serde_json::to_vec(options).map_err(DraftError::internal)?;
    let options_sha256 = hex::encode(Sha256::digest(&options));
    Ok(Provenance { program: PROGRAM, options_sha256, inputs_sha256 })
}

fn pool(threads: usize) -> Result<ThreadPool, DraftError> {
    ThreadPoolBuilder::new().num_threads(threads.max(1)).build().map_err(DraftError::internal)
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod turntable_tests;
