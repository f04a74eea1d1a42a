//! The process that works on the jobs of a service.

use anyhow::Context;

use super::failure::Failure;
use super::{serve, telemetry};
use crate::worker::isolation;

/// Works for the service that started this process.
pub(super) fn run() -> Result<(), Failure> {
    let served = isolation::serve(|settings| {
        if let Err(error) = telemetry::init_child(&settings.log) {
            eprintln!("{error:#}");
        }
        serve::works(settings.draft, settings.model)
    });
    served.context("only a service starts this").map_err(Failure::Internal)
}
