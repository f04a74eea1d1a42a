//! Turnaround turns a model sheet, the drawn views of one subject at known
//! angles, into depth maps, metrics and a 3D draft.
//!
//! `ARCHITECTURE.md` maps the modules and says which may use which.

pub mod geometry;
pub mod sheet;
pub mod turntable;
