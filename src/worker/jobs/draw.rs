use std::fmt::Display;
use std::io;
use std::ops::ControlFlow;
use std::thread;

use rayon::ThreadPoolBuilder;
use serde::Deserialize;
use serde_json::json;

use super::sink::AttemptSink;
use crate::draft::Carrier;
use crate::draw::{
    DRAWING, DrawError, DrawPayload, ModelSource, PreparedModel, SheetLimits, draw_sheet,
};
use crate::jobs::Failure;
use crate::model_io::{Limits, Model, ModelError};
use crate::sheet::Azimuth;
use crate::worker::{Attempt, Work, WorkError};

/// Draws a sheet of the job's model.
#[derive(Clone, Copy, Debug, Default)]
pub struct Draw {
    /// What the model may cost.
    pub model: Limits,
    /// What the sheet may cost.
    pub sheet: SheetLimits,
}

impl Work for Draw {
    fn kind(&self) -> &'static str {
        DRAWING
    }

    fn run(&self, attempt: &Attempt<'_>) -> Result<(), WorkError> {
        let unreadable = |error: &dyn Display| WorkError::Broken(format!("payload: {error}"));
        let payload =
            DrawPayload::deserialize(&attempt.job().payload).map_err(|error| unreadable(&error))?;
        let azimuths = payload.azimuths_deg.iter().map(|&degrees| Azimuth::from_degrees(degrees));
        let azimuths: Vec<_> = azimuths.collect::<Result<_, _>>().map_err(|e| unreadable(&e))?;
        let model = PreparedModel::new(&self.load(&payload.model, attempt)?)?;
        let progress = |done: usize| report(attempt, done, azimuths.len());
        let pool = ThreadPoolBuilder::new().num_threads(attempt.threads().max(1)).build();
        let pool = pool.map_err(|error| WorkError::Broken(error.to_string()))?;
        let mut sink = AttemptSink(attempt);
        thread::scope(|scope| {
            let carrier = Carrier::start(scope, &mut sink);
            let mut keep = |artifact| {
                let stopped = || WorkError::Broken("files are taken no more".to_owned());
                carrier.send(artifact).then_some(()).ok_or_else(stopped)
            };
            let drawn = pool.install(|| {
                draw_sheet(&model, &azimuths, &payload.options, &self.sheet, &progress, &mut keep)
            });
            // Why files are taken no more, if so.
            carrier.finish()?;
            drawn
        })
    }
}

impl Draw {
    fn load(&self, model: &ModelSource, attempt: &Attempt<'_>) -> Result<Model, WorkError> {
        match model {
            ModelSource::Builtin(model) => Ok(model.build()),
            ModelSource::File(file) => Ok(file.load(&attempt.read(file.input())?, &self.model)?),
        }
    }
}

/// The page and the bundle are about as much work as a view.
fn report(attempt: &Attempt<'_>, done: usize, total: usize) -> ControlFlow<()> {
    let fraction = done as f64 / (total + 1) as f64;
    let progress = json!({"stage": "views", "done": done, "total": total, "fraction": fraction});
    attempt.report(fraction, progress);
    if attempt.is_cancelled() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}

impl From<DrawError> for WorkError {
    fn from(error: DrawError) -> Self {
        match error {
            DrawError::Cancelled => Self::Cancelled,
            DrawError::Encoding { .. } => Self::Broken(error.to_string()),
            _ => Self::Input(Failure { code: error.code().to_owned(), detail: error.to_string() }),
        }
    }
}

/// Uploads are checked, so this is a model that an older version took.
impl From<ModelError> for WorkError {
    fn from(error: ModelError) -> Self {
        Self::Input(Failure { code: "invalid_model".to_owned(), detail: error.to_string() })
    }
}

impl From<io::Error> for WorkError {
    fn from(error: io::Error) -> Self {
        Self::Broken(error.to_string())
    }
}
