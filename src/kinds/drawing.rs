//! Jobs that draw a sheet.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use drawing::DrawOptions;
use frames::{Azimuth, Elevation, UpAxis, Viewpoint};
use mesh::builtin::ProceduralModel;
use mesh::read::{self, Limits, Model, ModelError, ModelFormat};

/// The kind of jobs that draw a sheet.
pub const DRAWING: &str = "drawing";

/// What a drawing job needs apart from its stored model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DrawPayload {
    /// What to draw.
    pub model: ModelSource,
    /// Of each view.
    pub azimuths_deg: Vec<f64>,
    /// Of each view; empty where all are at the options' elevation.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub elevations_deg: Vec<f64>,
    /// How to draw it.
    pub options: DrawOptions,
}

impl DrawPayload {
    /// * `viewpoints`: ascending, each once.
    pub fn new(model: ModelSource, viewpoints: &[Viewpoint], options: DrawOptions) -> Self {
        let usual = viewpoints.iter().all(|view| view.elevation == options.elevation());
        let elevations = viewpoints.iter().map(|view| view.elevation.degrees());
        Self {
            model,
            azimuths_deg: viewpoints.iter().map(|view| view.azimuth.degrees()).collect(),
            elevations_deg: if usual { Vec::new() } else { elevations.collect() },
            options,
        }
    }

    /// The views to draw; `None` if an angle is none.
    pub fn viewpoints(&self) -> Option<Vec<Viewpoint>> {
        let elevation = |index: usize| match self.elevations_deg.get(index) {
            Some(&degrees) => Elevation::from_degrees(degrees).ok(),
            None => Some(self.options.elevation()),
        };
        let viewpoint = |(index, &degrees): (usize, &f64)| {
            let azimuth = Azimuth::from_degrees(degrees).ok()?;
            Some(Viewpoint { azimuth, elevation: elevation(index)? })
        };
        self.azimuths_deg.iter().enumerate().map(viewpoint).collect()
    }
}

/// Where a drawing's model comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ModelSource {
    /// One that the program makes by itself.
    Builtin(ProceduralModel),
    /// One that the client uploaded.
    File(ModelFile),
}

/// An uploaded model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "the schema describes it")]
pub struct ModelFile {
    /// As the client calls it.
    pub name: String,
    pub format: ModelFormat,
    /// Overrides the format's own.
    pub up_axis: Option<UpAxis>,
}

impl ModelFile {
    /// The name of the job's input that holds it.
    pub fn input(&self) -> &'static str {
        match self.format {
            ModelFormat::Glb => "model.glb",
            ModelFormat::Gltf => "model.gltf",
            ModelFormat::Obj => "model.obj",
            ModelFormat::Ply => "model.ply",
            ModelFormat::Stl => "model.stl",
        }
    }

    /// Reads the model from the file's bytes.
    ///
    /// # Errors
    /// [`ModelError`], which says what is wrong with the bytes.
    pub fn load(&self, bytes: &[u8], limits: &Limits) -> Result<Model, ModelError> {
        read::load(bytes, self.format, self.up_axis, limits)
    }
}
