//! The worker pool: claims jobs, runs them on blocking threads, keeps their leases.
//!
//! The pool knows nothing about the work; each kind of job is a [`Work`] in a
//! file of [`jobs`]. Execution is at least once: a worker that dies or stalls
//! loses its lease, and the job runs again. A result is published exactly once,
//! for the store refuses whatever an attempt without the lease comes back with.

mod attempt;
mod collector;
mod config;
pub mod isolation;
pub mod jobs;
mod lease;
pub(crate) mod metrics;
mod pool;
mod run;
mod signal;
mod uploads;
mod work;

pub use collector::{CollectError, Collected, collect};
pub use config::WorkerConfig;
pub use pool::Pool;
pub use work::{Attempt, Task, Work, WorkError};

use pool::Shared;
use run::panic_message;
