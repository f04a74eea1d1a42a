//! The service and its parts from outside, in one program.

mod api;
mod documents;
mod farm;
mod faults;
mod layers;
mod model_regressions;
mod service_crash;
mod worker;
