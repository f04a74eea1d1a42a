//! The service from outside: what clients send and get, one file a matter.

mod access;
mod artifacts;
mod elevated;
mod faults;
pub(crate) mod harness;
mod links;
mod matches;
mod page_tags;
mod page_uploads;
mod pages;
pub(crate) mod receiver;
mod redirects;
mod resources;
mod reuse;
mod service;
mod sheet_problems;
mod sheets;
mod statuses;
mod storage;
mod tags;
mod truth;
mod upload_problems;
mod url_inputs;
pub(crate) mod webhooks;
