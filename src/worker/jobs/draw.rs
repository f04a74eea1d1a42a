//! The work of jobs that draw a sheet.

use std::fmt::Display;
use std::thread;

use rayon::ThreadPoolBuilder;
use serde::Deserialize;

use super::failure;
use super::sink::AttemptSink;
use super::watch::Watch;
use crate::failure_code::FailureCode;
use crate::kinds::{DRAWING, DrawPayload, ModelSource};
use crate::worker::{Attempt, Work, WorkError};
use artifacts::Delivery;
use drawing::{DrawError, PreparedModel, SheetLimits, draw_sheet};
use mesh::read::{Limits, Model, ModelError};

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

    fn run(&self, attempt: &dyn Attempt) -> Result<(), WorkError> {
        let unreadable = |error: &dyn Display| WorkError::Broken(format!("payload: {error}"));
        let payload = DrawPayload::deserialize(&attempt.task().payload)
            .map_err(|error| unreadable(&error))?;
        let viewpoints = payload.viewpoints().ok_or_else(|| unreadable(&"an angle is none"))?;
        let model = PreparedModel::new(&self.load(&payload.model, attempt)?)?;
        let pool = ThreadPoolBuilder::new().num_threads(attempt.task().threads.max(1)).build();
        let pool = pool.map_err(|error| WorkError::Troubled(error.to_string()))?;
        let mut sink = AttemptSink(attempt);
        thread::scope(|scope| {
            let delivery = Delivery::start(scope, &mut sink);
            let mut keep = |artifact| {
                let stopped = || WorkError::Broken("files are taken no more".to_owned());
                delivery.send(artifact).then_some(()).ok_or_else(stopped)
            };
            let drawn = pool.install(|| {
                draw_sheet(
                    &model,
                    &viewpoints,
                    &payload.options,
                    &self.sheet,
                    &Watch(attempt),
                    &mut keep,
                )
            });
            // Why files are taken no more, if so.
            delivery.finish()?;
            drawn
        })
    }
}

impl Draw {
    fn load(&self, model: &ModelSource, attempt: &dyn Attempt) -> Result<Model, WorkError> {
        match model {
            ModelSource::Builtin(model) => Ok(model.build()),
            ModelSource::File(file) => Ok(file.load(&attempt.read(file.input())?, &self.model)?),
        }
    }
}

impl From<DrawError> for WorkError {
    fn from(error: DrawError) -> Self {
        match error {
            DrawError::Cancelled(_) => Self::Cancelled,
            DrawError::Encoding { .. } => Self::Broken(error.to_string()),
            _ => Self::Input(failure(FailureCode::from(&error), error)),
        }
    }
}

/// Uploads are checked, so this is a model that an older version took.
impl From<ModelError> for WorkError {
    fn from(error: ModelError) -> Self {
        Self::Input(failure(FailureCode::InvalidModel, error))
    }
}
