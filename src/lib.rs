//! Turnaround turns a model sheet, the drawn views of one subject at known
//! angles, into depth maps, metrics and a 3D draft.
//!
//! This package is the service and the command line; `ARCHITECTURE.md` maps
//! the crates that it wires together.

pub mod app;
pub mod draft;
pub mod failure_code;
pub mod http;
pub mod kinds;
pub mod outbound;
pub mod provenance;
pub mod webhooks;
pub mod worker;
