//! The service from outside: what clients send and get, one file a matter.

mod artifacts;
mod harness;
mod matches;
mod resources;
mod service;
mod sheets;
mod truth;
mod upload_problems;
