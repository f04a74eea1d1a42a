//! Reconstruction: a sheet in, depth, clouds and a mesh out.
//!
//! Stages are pure functions; only this module calls several of them.

mod observer;

pub use observer::{Cancelled, Observer, Progress, Silent, Stage};
