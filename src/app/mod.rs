//! The program: reads the command line, wires the parts, reports the outcome.
//!
//! Nothing else in the crate knows the command line, the environment or the
//! settings file.

mod child;
mod cli;
mod config;
mod descriptors;
mod draw;
mod evaluate;
mod failure;
mod import;
mod inputs;
mod keys;
mod memory;
mod page;
mod progress_bar;
mod reconstruct;
mod serve;
mod stores;
mod study;
mod telemetry;

use std::process::ExitCode;

/// Runs the command line of this process.
///
/// Exit status: 0 done, 1 the input is to blame, 2 usage, 3 internal.
pub fn main() -> ExitCode {
    match cli::run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}
