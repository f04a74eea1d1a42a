//! Turnaround turns a model sheet, the drawn views of one subject at known
//! angles, into depth maps, metrics and a 3D draft.
//!
//! `ARCHITECTURE.md` maps the modules and says which may use which.

pub mod app;
pub mod artifacts;
pub mod draft;
pub mod draw;
pub mod evaluation;
pub mod export;
pub mod float_image;
pub mod geometry;
pub mod http;
pub mod jobs;
pub mod model_io;
pub mod models;
pub mod options;
pub mod pipeline;
pub mod sheet;
pub mod study;
pub mod turntable;
pub mod vision;
pub mod worker;
