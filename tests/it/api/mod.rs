//! The service from outside: what clients send and get, one file a matter.

mod access;
mod artifacts;
mod faults;
pub(crate) mod harness;
mod matches;
mod page_uploads;
mod pages;
mod resources;
mod service;
mod sheet_problems;
mod sheets;
mod tags;
mod truth;
mod upload_problems;
