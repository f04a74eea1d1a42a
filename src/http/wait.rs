//! Waiting for a job to change.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;
use tokio::time::Instant;

use super::Api;
use super::problem::Problem;
use super::resource::{OwnedId, Resource, status};
use super::statuses::Status;
use jobs::{JobChange, JobId};

/// How often a job is looked at whose changes nobody announces, such as those
/// of workers in other processes.
const POLL: Duration = Duration::from_millis(500);

/// The changes of one job.
pub(super) struct Watch {
    id: JobId,
    changes: Receiver<JobChange>,
    announced: bool,
}

impl Watch {
    /// Begins to listen; read the job after this, or a change may be missed.
    pub(super) fn new(api: &Api, id: JobId) -> Self {
        Self { id, changes: api.state.store.changes(), announced: true }
    }

    /// Returns when the job may have changed, at the latest at `deadline`.
    pub(super) async fn changed(&mut self, deadline: Instant) {
        let poll = tokio::time::sleep_until(deadline.min(Instant::now() + POLL));
        tokio::pin!(poll);
        while self.announced {
            let change = tokio::select! {
                change = self.changes.recv() => change,
                () = &mut poll => return,
            };
            match change {
                Ok(change) if change.id != self.id => {}
                Ok(_) | Err(RecvError::Lagged(_)) => return,
                Err(RecvError::Closed) => self.announced = false,
            }
        }
        poll.await;
    }
}

/// The job's status once `is_reached` holds of it, or as it is at the end of `wait`.
pub(super) async fn wait_until<R: Resource>(
    api: &Api,
    asked: &OwnedId,
    wait: Duration,
    is_reached: impl Fn(&Status) -> bool,
) -> Result<Arc<Status>, Problem> {
    let deadline = Instant::now() + wait;
    let mut watch = Watch::new(api, asked.id);
    loop {
        let status = status::<R>(api, asked).await?;
        let is_over = Instant::now() >= deadline || api.state.shutdown.is_cancelled();
        if is_over || is_reached(&status) {
            return Ok(status);
        }
        tokio::select! {
            () = watch.changed(deadline) => {}
            () = api.state.shutdown.cancelled() => {}
        }
    }
}
