//! The HTTP interface: resources, uploads, problems and their description.
//!
//! Handlers read and write the job store and the byte store and nothing else;
//! heavy work (decoding an upload's pictures) runs on blocking threads, a few at
//! a time, so that status requests stay quick.

mod access;
mod artifacts;
mod bare;
mod body;
mod bounded;
mod conditional;
mod drawn_pages;
mod events;
mod files;
mod guard;
mod health;
mod layers;
mod limits;
mod links;
mod openapi;
mod pages;
mod problem;
mod range;
mod reconstructions;
mod redirects;
mod representation;
mod resource;
mod router;
mod server;
mod sheet_representation;
mod sheets;
mod state;
mod statuses;
mod streams;
mod tags;
mod telemetry;
mod unread;
mod upload;
mod wait;
mod web;
mod webhooks;

pub use access::{Access, KeyPolicy};
pub use guard::Guard;
pub use limits::{HttpLimits, ServerTimeouts};
pub use links::LinkKey;
pub use openapi::openapi;
pub use problem::{Problem, ProblemDocument, ProblemType};
pub use redirects::Redirects;
pub use representation::Reconstruction;
pub(crate) use resource::{noun_of, path_of};
pub use router::router;
pub use server::serve;
pub use state::ApiState;
pub use telemetry::{of_worker, prometheus};

use state::Api;
