//! Keeps the leases of running attempts.

use std::collections::HashMap;
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::time::{Duration, Instant};

use tokio::runtime::Handle;

use super::WorkerConfig;
use super::signal::{Signal, StopReason};
use jobs::{Heartbeat, JobId, JobState, JobStore, StoreError};

type Attempts = HashMap<(JobId, u32), Beat>;

/// Keeps the leases of running attempts, on one thread of its own, so that
/// neither the work nor a busy runtime delays it. On the way it looks for
/// cancellation by other processes.
pub(super) struct Heart {
    store: Arc<dyn JobStore>,
    runtime: Handle,
    lease: Duration,
    heartbeat: Duration,
    cancel_poll: Duration,
    max_job_time: Duration,
    state: Mutex<State>,
    stopped: Condvar,
}

#[derive(Default)]
struct State {
    attempts: Attempts,
    is_stopped: bool,
}

/// One attempt whose lease is kept.
#[derive(Clone)]
struct Beat {
    signal: Arc<Signal>,
    claimed: Instant,
    renewed: Instant,
}

impl Heart {
    pub(super) fn new(store: Arc<dyn JobStore>, runtime: Handle, config: &WorkerConfig) -> Self {
        Self {
            store,
            runtime,
            lease: config.lease,
            heartbeat: config.heartbeat,
            cancel_poll: config.cancel_poll,
            max_job_time: config.max_job_time,
            state: Mutex::default(),
            stopped: Condvar::new(),
        }
    }

    /// Keeps the lease of an attempt claimed at `claimed` until [`Self::forget`].
    pub(super) fn keep(&self, job: JobId, attempt: u32, claimed: Instant) -> Arc<Signal> {
        let signal = Arc::new(Signal::default());
        let beat = Beat { signal: Arc::clone(&signal), claimed, renewed: claimed };
        self.state().attempts.insert((job, attempt), beat);
        signal
    }

    pub(super) fn forget(&self, job: JobId, attempt: u32) {
        self.state().attempts.remove(&(job, attempt));
    }

    /// Tells the attempts of a job to stop.
    pub(super) fn cancel(&self, job: JobId) {
        for ((id, _), beat) in &self.state().attempts {
            if *id == job {
                beat.signal.stop(StopReason::Cancel);
            }
        }
    }

    /// Tells all attempts to stop because the pool does.
    pub(super) fn shut_down(&self) {
        for beat in self.state().attempts.values() {
            beat.signal.stop(StopReason::Shutdown);
        }
    }

    /// What runs now.
    pub(super) fn running(&self) -> Vec<(JobId, u32)> {
        self.state().attempts.keys().copied().collect()
    }

    /// Ends [`Self::run`].
    pub(super) fn stop(&self) {
        self.state().is_stopped = true;
        self.stopped.notify_all();
    }

    /// The thread's loop.
    pub(super) fn run(&self) {
        loop {
            let beats: Vec<_> = {
                let tick = self.cancel_poll.min(self.heartbeat);
                let waiting =
                    self.stopped.wait_timeout_while(self.state(), tick, |state| !state.is_stopped);
                let (state, _) = waiting.unwrap_or_else(|poisoned| poisoned.into_inner());
                if state.is_stopped {
                    return;
                }
                state.attempts.iter().map(|(key, beat)| (*key, beat.clone())).collect()
            };
            for ((job, attempt), beat) in beats {
                self.visit(job, attempt, &beat);
            }
        }
    }

    fn visit(&self, job: JobId, attempt: u32, beat: &Beat) {
        let asked = Instant::now();
        if asked.duration_since(beat.claimed) >= self.max_job_time {
            beat.signal.stop(StopReason::TimeLimit);
        }
        let is_due = asked.duration_since(beat.renewed) >= self.heartbeat;
        let answer = if is_due {
            self.runtime.block_on(self.store.heartbeat(job, attempt, self.lease))
        } else {
            self.runtime.block_on(self.look(job, attempt))
        };
        match answer {
            Ok(Heartbeat::Lost) => beat.signal.stop(StopReason::LeaseLost),
            Ok(Heartbeat::Held { cancel_requested }) => {
                if cancel_requested {
                    beat.signal.stop(StopReason::Cancel);
                }
                if is_due && let Some(beat) = self.state().attempts.get_mut(&(job, attempt)) {
                    beat.renewed = asked;
                }
            }
            // The work goes on: where nobody can be asked, nobody may have taken the
            // job over, and if somebody has, the result is refused.
            Err(error) => tracing::warn!(%job, attempt, %error, "could not renew the lease"),
        }
    }

    /// Reads what a heartbeat would say, without writing.
    async fn look(&self, id: JobId, attempt: u32) -> Result<Heartbeat, StoreError> {
        match self.store.get(id).await {
            Ok(job) if job.attempt == attempt && job.state == JobState::Running => {
                Ok(Heartbeat::Held { cancel_requested: job.cancel_requested })
            }
            Ok(_) | Err(StoreError::NotFound(_)) => Ok(Heartbeat::Lost),
            Err(error) => Err(error),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}
