//! The HTTP interface: resources, uploads, problems and their description.
//!
//! Handlers read and write the job store and the byte store and nothing else;
//! heavy work (decoding an upload's pictures) runs on blocking threads, a few at
//! a time, so that status requests stay quick.

mod artifacts;
mod conditional;
mod drawn_pages;
mod events;
mod health;
mod layers;
mod limits;
mod openapi;
mod pages;
mod problem;
mod range;
mod reconstructions;
mod representation;
mod resource;
mod router;
mod server;
mod sheet_representation;
mod sheets;
mod state;
mod telemetry;
mod upload;
mod wait;
mod web;

pub use limits::{HttpLimits, ServerTimeouts};
pub use openapi::openapi;
pub use problem::{Problem, ProblemDocument, ProblemType};
pub use representation::Reconstruction;
pub use router::router;
pub use server::serve;
pub use state::ApiState;
pub use telemetry::prometheus;

use state::Api;
