//! Work in processes of its own, so that a job which aborts, overflows its stack
//! or takes too much memory takes no neighbour along.
//!
//! The service starts its own program again as a child that has one end of a
//! socket and nothing else: no file, no network, no more memory than a job may
//! take (`confine`). Inputs come and artifacts go over the socket (`wire`),
//! so that all stores stay with the service. A child that has done its job waits
//! for the next one of the same tenant (`children`).

mod child;
mod children;
mod confine;
mod conversation;
#[cfg(debug_assertions)]
mod faults;
mod wire;

use std::path::Path;
use std::sync::Arc;
use std::{io, thread};

use mesh::read::Limits;
use serde::{Deserialize, Serialize};

use super::{Attempt, Work, WorkError};
use crate::draft::DraftLimits;
pub use child::serve;
use children::Children;

/// What a child is told when it starts.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ChildSettings {
    /// Least level of its log lines, or directives.
    pub log: String,
    /// Memory that it may write to, bytes; its own code and libraries apart.
    pub memory_bytes: u64,
    /// What a reconstruction may cost.
    pub draft: DraftLimits,
    /// What a model may cost.
    pub model: Limits,
}

/// A kind of work, done by children.
pub struct Isolated {
    kind: &'static str,
    children: Arc<Children>,
}

impl Isolated {
    /// Lets children do each of `works`, by `program child`; `warm` of them are
    /// kept waiting. They end with the last of what is returned.
    ///
    /// # Errors
    /// If the system gives no thread.
    pub fn all(
        works: &[Arc<dyn Work>],
        program: &Path,
        settings: ChildSettings,
        warm: usize,
    ) -> io::Result<Vec<Arc<dyn Work>>> {
        let children = Children::start(program, settings, warm)?;
        let isolated = |work: &Arc<dyn Work>| -> Arc<dyn Work> {
            Arc::new(Self { kind: work.kind(), children: Arc::clone(&children) })
        };
        Ok(works.iter().map(isolated).collect())
    }
}

impl Work for Isolated {
    fn kind(&self) -> &'static str {
        self.kind
    }

    fn run(&self, attempt: &dyn Attempt) -> Result<(), WorkError> {
        let tenant = &attempt.task().tenant;
        let mut child = self.children.take(tenant).map_err(|error| {
            WorkError::Troubled(format!("no process for the job's work: {error}"))
        })?;
        let outcome = child.work(attempt);
        if matches!(outcome, Ok(()) | Err(WorkError::Input(_))) {
            self.children.give_back(child);
        } else {
            // Killing it and giving its memory back takes a moment.
            let _ = thread::Builder::new().spawn(|| drop(child));
            self.children.warm_up();
        }
        outcome
    }
}
