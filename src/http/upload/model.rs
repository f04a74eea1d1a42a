//! Reads the parts of an upload of a model.

use bytes::Bytes;
use multer::Field;
use serde_json::{Map, Value};

use super::option_parts::GivenOptions;
use super::parts::{expect_new, is_option_name, part_name, read_limited, read_text};
use super::{Form, Inputs, JobForm, Upload, reuse};
use crate::http::access::Caller;
use crate::http::problem::{
    CAMERA_INSIDE_MODEL, DUPLICATE_AZIMUTH, EMPTY_FILE, EXTERNAL_REFERENCE, INVALID_ANGLE,
    INVALID_MODEL, INVALID_OPTION, INVALID_PART_NAME, MISSING_PART, MODEL_TOO_LARGE,
    PART_TOO_LARGE, Problem, SHEET_TOO_LARGE, TOO_MANY_VIEWS, UNKNOWN_MODEL, UNKNOWN_MODEL_FORMAT,
    UNKNOWN_PART, UNSUPPORTED_MODEL,
};
use crate::http::{Api, HttpLimits};
use crate::kinds::{DRAWING, DrawPayload, ModelFile, ModelSource};
use drawing::{DrawError, DrawOptions, PreparedModel, SheetLimits, check_sheet};
use mesh::builtin::ProceduralModel;
use mesh::read::{Limits, ModelError, ModelFormat};

use frames::{UpAxis, Viewpoint, ViewpointList};

/// What a text that names a built-in model begins with, as on the command line.
const BUILTIN: &str = "builtin:";
/// The views that are drawn if none are asked for.
const DEFAULT_AZIMUTHS: &str = "0:90:5";

/// The parts of an upload that is to be drawn.
#[derive(Debug, Default)]
pub(crate) struct ModelForm {
    model: Option<Given>,
    azimuths: Option<ViewpointList>,
    up_axis: Option<UpAxis>,
    /// Whether an earlier result will do.
    reuse: Option<bool>,
    options: GivenOptions,
}

#[derive(Debug)]
enum Given {
    Builtin(ProceduralModel),
    File { name: String, format: ModelFormat, bytes: Bytes },
}

impl Form for ModelForm {
    async fn read_one(&mut self, field: Field<'_>, limits: &HttpLimits) -> Result<(), Problem> {
        let name = part_name(&field)?;
        let file_name = field.file_name().filter(|file| !file.is_empty()).map(str::to_owned);
        match (name.as_str(), file_name) {
            ("model", file) => {
                expect_new(self.model.is_none(), &name)?;
                self.model = Some(match file {
                    Some(file) => read_file(field, &file, &limits.model).await?,
                    None => Given::Builtin(builtin(&read_text(field, &name).await?)?),
                });
            }
            ("azimuths", _) => {
                expect_new(self.azimuths.is_none(), &name)?;
                self.azimuths = Some(azimuths(&read_text(field, &name).await?)?);
            }
            ("up_axis", _) => {
                expect_new(self.up_axis.is_none(), &name)?;
                self.up_axis = Some(up_axis(&read_text(field, &name).await?)?);
            }
            ("reuse", None) => {
                expect_new(self.reuse.is_none(), &name)?;
                self.reuse = Some(reuse::read(field, &name).await?);
            }
            ("options", _) => self.options.read_document(field, &name, limits).await?,
            (_, None) if is_option_name(&name) => self.options.read_field(field, name).await?,
            _ => return Err(unknown_part(&name)),
        }
        Ok(())
    }
}

impl JobForm for ModelForm {
    async fn check(self, api: &Api, _: &Caller) -> Result<Upload, Problem> {
        let Some(model) = self.model else {
            let detail = "no model was sent; add -F 'model=@NAME.glb' or -F model=builtin:teapot";
            return Err(Problem::new(MISSING_PART, detail).part("model"));
        };
        let given = self.options.over(Value::Object(Map::new()))?;
        let options: DrawOptions =
            options::parse_set(&given).map_err(|problems| Problem::options(&problems))?;
        let azimuths = self.azimuths.map_or_else(|| azimuths(DEFAULT_AZIMUTHS), Ok)?;
        let (source, bytes) = model.place(self.up_axis);
        let viewpoints = azimuths.at(options.elevation());
        let drawing = Drawing { source, bytes, viewpoints, options };
        let (model, sheet) = (api.limits.model, api.limits.sheet);
        let upload = api.decoders.run(move || drawing.checked(&model, &sheet)).await??;
        Ok(Upload { reuse: self.reuse.unwrap_or(true), ..upload })
    }
}

impl Given {
    fn place(self, up_axis: Option<UpAxis>) -> (ModelSource, Bytes) {
        match self {
            Self::Builtin(model) => (ModelSource::Builtin(model), Bytes::new()),
            Self::File { name, format, bytes } => {
                (ModelSource::File(ModelFile { name, format, up_axis }), bytes)
            }
        }
    }
}

/// A drawing that is asked for.
struct Drawing {
    source: ModelSource,
    /// Of the file, if it is one.
    bytes: Bytes,
    viewpoints: Vec<Viewpoint>,
    options: DrawOptions,
}

impl Drawing {
    /// Reads the model and holds it against all that the drawing asks, which takes its time.
    fn checked(self, model: &Limits, sheet: &SheetLimits) -> Result<Upload, Problem> {
        let built = match &self.source {
            ModelSource::Builtin(builtin) => builtin.build(),
            ModelSource::File(file) => {
                file.load(&self.bytes, model).map_err(|error| model_problem(&error))?
            }
        };
        let prepared = PreparedModel::new(&built);
        prepared
            .and_then(|model| check_sheet(&model, &self.viewpoints, &self.options, sheet))
            .map_err(|error| draw_problem(&error))?;
        let inputs = match &self.source {
            ModelSource::Builtin(_) => Vec::new(),
            ModelSource::File(file) => vec![(file.input().to_owned(), self.bytes)],
        };
        let payload = DrawPayload::new(self.source, &self.viewpoints, self.options);
        Upload::new(DRAWING, &payload, Inputs::Uploaded(inputs))
    }
}

async fn read_file(field: Field<'_>, file: &str, limits: &Limits) -> Result<Given, Problem> {
    let name = file.rsplit(['/', '\\']).next().unwrap_or(file);
    if name.len() > MAX_FILE_NAME_BYTES {
        let detail = format!(
            "the model's file name has {} bytes; give it at most {MAX_FILE_NAME_BYTES}",
            name.len()
        );
        return Err(Problem::new(INVALID_PART_NAME, detail).part("model"));
    }
    let Some(format) = ModelFormat::from_file_name(name) else {
        let detail =
            format!("`{name}` does not end in .glb, .gltf, .obj, .ply or .stl; name it so");
        return Err(Problem::new(UNKNOWN_MODEL_FORMAT, detail).part("model"));
    };
    let bytes = read_limited(field, "model", limits.max_bytes).await?;
    if bytes.is_empty() {
        let detail = format!("`{name}` is an empty file; check the path it was read from");
        return Err(Problem::new(EMPTY_FILE, detail).part("model"));
    }
    Ok(Given::File { name: name.to_owned(), format, bytes })
}

/// Names are kept with the job and sent with every listing.
const MAX_FILE_NAME_BYTES: usize = 200;

fn builtin(text: &str) -> Result<ProceduralModel, Problem> {
    let name = text.trim().strip_prefix(BUILTIN).ok_or_else(|| {
        let detail = "the model has no file name to tell its format by; send a file, as curl -F 'model=@NAME.glb' does, or builtin:NAME";
        Problem::new(UNKNOWN_MODEL_FORMAT, detail).part("model")
    })?;
    ProceduralModel::from_name(name).ok_or_else(|| {
        let names = ProceduralModel::ALL.map(ProceduralModel::name).join(", ");
        let detail = format!("there is no built-in model `{name}`; there are {names}");
        Problem::new(UNKNOWN_MODEL, detail).part("model")
    })
}

fn azimuths(text: &str) -> Result<ViewpointList, Problem> {
    text.parse().map_err(|error| {
        let detail =
            format!("{error}; write azimuths like 0:90:5,135,180, with an elevation like 0@90");
        Problem::new(INVALID_ANGLE, detail).part("azimuths")
    })
}

fn up_axis(text: &str) -> Result<UpAxis, Problem> {
    serde_json::from_value(text.trim().into()).map_err(|_| {
        let detail = format!("`{}` is no axis that may point up; give y or z", text.trim());
        Problem::new(INVALID_OPTION, detail).part("up_axis")
    })
}

fn unknown_part(name: &str) -> Problem {
    let detail =
        format!("`{name}` is no part of this upload; send model, azimuths, up_axis and options");
    Problem::new(UNKNOWN_PART, detail).part(name)
}

fn model_problem(error: &ModelError) -> Problem {
    let kind = match error {
        ModelError::TooManyBytes { .. } => PART_TOO_LARGE,
        ModelError::TooManyVertices { .. } | ModelError::TooManyTriangles { .. } => MODEL_TOO_LARGE,
        ModelError::Unsupported { .. } => UNSUPPORTED_MODEL,
        ModelError::ExternalReference { .. } => EXTERNAL_REFERENCE,
        ModelError::Malformed { .. }
        | ModelError::IndexOutOfRange { .. }
        | ModelError::NonFiniteVertex { .. }
        | ModelError::NoTriangles { .. } => INVALID_MODEL,
    };
    Problem::new(kind, error.to_string()).part("model")
}

fn draw_problem(error: &DrawError) -> Problem {
    let (kind, part) = match error {
        DrawError::Options(problems) => return Problem::options(problems),
        DrawError::NoTriangles | DrawError::InvalidModel { .. } => (INVALID_MODEL, "model"),
        DrawError::CameraInsideModel { .. } => (CAMERA_INSIDE_MODEL, "model"),
        DrawError::TooManySamples { .. } | DrawError::TooManyPixels { .. } => {
            (SHEET_TOO_LARGE, "options")
        }
        DrawError::TooManyViews { .. } => (TOO_MANY_VIEWS, "azimuths"),
        DrawError::NoViews => (INVALID_ANGLE, "azimuths"),
        DrawError::DuplicateView { .. } => (DUPLICATE_AZIMUTH, "azimuths"),
        DrawError::TooComplex { .. } | DrawError::Cancelled(_) | DrawError::Encoding { .. } => {
            return Problem::internal("checking a drawing", error);
        }
    };
    Problem::new(kind, error.to_string()).part(part)
}
