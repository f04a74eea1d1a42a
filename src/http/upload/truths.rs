//! Ground truth in an upload: checked to its end, then stored as it came.

use std::sync::Arc;

use bytes::Bytes;
use futures::{StreamExt, TryStreamExt, stream};
use serde::Deserialize;

use super::assemble::{Assembled, Picture};
use super::document::Document;
use super::parts::FilePart;
use super::pictures::Decoders;
use crate::http::HttpLimits;
use crate::http::problem::{INVALID_TRUTH, PART_TOO_LARGE, Problem, TOO_MANY_PIXELS};
use evaluation::{TruthEncoding, TruthError, decode_truth, has_values};
use frames::UpAxis;
use mesh::read::{self, ModelError, ModelFormat};
use picture::ImageLimits;
use sheet::{PictureSize, SheetDocument, TruthDocument, TruthKind};

/// A picture of true values, not decoded yet.
#[derive(Clone, Debug)]
pub(super) struct TruthPicture {
    /// What it holds; unsaid, 8-bit PNG are ramps and the others depth.
    pub kind: Option<TruthKind>,
    pub picture: Picture,
}

/// What decoding a picture of true values told.
#[derive(Clone, Copy, Debug)]
pub(super) struct CheckedTruth {
    pub kind: TruthKind,
    pub encoding: TruthEncoding,
    pub size: PictureSize,
}

/// The true model, not read yet.
#[derive(Clone, Debug)]
pub(super) struct ModelFile {
    file: Picture,
    format: ModelFormat,
}

/// The part `truth` of the form `view[…]`: what a sheet document says of its
/// truth.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct TruthFields {
    /// What the pictures of true values hold.
    pub kind: Option<TruthKind>,
    pixels_per_unit: Option<f64>,
    model_up_axis: Option<UpAxis>,
    depth_counts_per_unit: Option<f64>,
    camera_distance: Option<f64>,
    disparity_pair_deg: Option<f64>,
}

impl TruthFields {
    pub(super) fn parse(document: Option<&Document>) -> Result<Self, Problem> {
        let Some(document) = document else { return Ok(Self::default()) };
        if document.first() != Some(b'{') {
            let detail = "the part `truth` must be a JSON object";
            return Err(Problem::new(INVALID_TRUTH, detail).part("truth"));
        }
        document.parse(INVALID_TRUTH)
    }

    /// Puts them into a sheet document.
    pub(super) fn describe(&self, document: &mut SheetDocument, model: Option<&ModelFile>) {
        document.pixels_per_unit = self.pixels_per_unit;
        document.truth = Some(TruthDocument {
            model: model.map(|model| model.file.part.clone()),
            model_up_axis: self.model_up_axis,
            depth_counts_per_unit: self.depth_counts_per_unit,
            camera_distance: self.camera_distance,
            disparity_pair_deg: self.disparity_pair_deg,
        });
    }
}

impl ModelFile {
    /// A model under its file's name.
    pub(super) fn new(file: FilePart) -> Result<Self, Problem> {
        let name = file.file.clone();
        Self::named(&name, Picture { part: "truth_model".to_owned(), ..file.into() })
    }

    pub(super) fn named(name: &str, file: Picture) -> Result<Self, Problem> {
        let format = ModelFormat::from_file_name(name).ok_or_else(|| {
            let detail = format!(
                "the true model's name `{name}` ends in none of .obj, .ply, .stl, .glb, .gltf"
            );
            Problem::new(INVALID_TRUTH, detail).part(file.part.as_str())
        })?;
        Ok(Self { file, format })
    }

    /// Its name in the job's inputs, entered into `document`, and its bytes.
    pub(super) fn store(self, document: &mut SheetDocument) -> (String, Bytes) {
        let name = format!("truth/model.{}", self.format.extension());
        document.truth.get_or_insert_default().model = Some(name.clone());
        (name, self.file.bytes)
    }
}

/// Decodes all pictures of true values and reads the true model, a few at a
/// time, and throws the values away. The first bad one ends it.
pub(super) async fn check_all(
    decoders: &Decoders,
    assembled: &Assembled,
    limits: &HttpLimits,
) -> Result<Vec<CheckedTruth>, Problem> {
    let document = Arc::new(assembled.document.clone());
    // Made before the stream, as futures that borrow nothing from it.
    let checks: Vec<_> = assembled
        .truths()
        .into_iter()
        .map(|truth| check_picture(decoders, truth.clone(), document.clone(), limits.image))
        .collect();
    let checked = stream::iter(checks).buffered(decoders.count()).try_collect().await?;
    if let Some(model) = &assembled.model {
        check_model(decoders, model.clone(), document, limits.model).await?;
    }
    Ok(checked)
}

async fn check_picture(
    decoders: &Decoders,
    truth: TruthPicture,
    document: Arc<SheetDocument>,
    limits: ImageLimits,
) -> Result<CheckedTruth, Problem> {
    let TruthPicture { kind, picture: Picture { part, bytes } } = truth;
    let checked = decoders.run(move || {
        let raw = decode_truth(&bytes, &limits)?;
        let kind = kind.unwrap_or(match raw.encoding {
            TruthEncoding::Png8 => TruthKind::Disparity,
            TruthEncoding::Png16 | TruthEncoding::Pfm | TruthEncoding::Exr => TruthKind::Depth,
        });
        let (width, height) = raw.values.dimensions();
        let size = PictureSize { width, height };
        let usable = has_values(&raw.of_sheet(kind, &document));
        Ok((CheckedTruth { kind, encoding: raw.encoding, size }, usable))
    });
    match checked.await? {
        Ok((checked, true)) => Ok(checked),
        Ok((_, false)) => {
            let detail = format!(
                "`{part}` has no value; 0 is background in a PNG, what is not finite in a PFM or EXR"
            );
            Err(Problem::new(INVALID_TRUTH, detail).part(part))
        }
        Err(error) => Err(truth_problem(&part, &error)),
    }
}

fn truth_problem(part: &str, error: &TruthError) -> Problem {
    let kind = match error {
        TruthError::TooManyBytes { .. } => PART_TOO_LARGE,
        TruthError::TooManyPixels { .. } | TruthError::Inflates(_) => TOO_MANY_PIXELS,
        TruthError::UnknownFormat | TruthError::Pfm(_) | TruthError::Damaged(_) => INVALID_TRUTH,
    };
    Problem::new(kind, format!("`{part}` {error}; export it again")).part(part)
}

async fn check_model(
    decoders: &Decoders,
    model: ModelFile,
    document: Arc<SheetDocument>,
    limits: read::Limits,
) -> Result<(), Problem> {
    let ModelFile { file: Picture { part, bytes }, format } = model;
    let up_axis = document.truth.as_ref().and_then(|truth| truth.model_up_axis);
    let read = decoders.run(move || read::load(&bytes, format, up_axis, &limits).map(drop));
    read.await?.map_err(|error| {
        let kind = match error {
            ModelError::TooManyBytes { .. } => PART_TOO_LARGE,
            _ => INVALID_TRUTH,
        };
        Problem::new(kind, format!("`{part}`: {error}; export it again")).part(part)
    })
}
