//! The life of a job as pure transitions over what a store keeps of it: every
//! store loads a record, applies one of these and saves record and event in the
//! same transaction.

use std::time::Duration;

use jiff::Timestamp;
use serde_json::{Value, json};

use super::{ATTEMPTS_EXHAUSTED, CRASHED, LEASE_EXPIRED};
use super::{
    ArtifactEntry, EarlierResult, EventKind, Failure, Job, JobState, NewJob, StoreError, Uptime,
};

/// The longest pause before a job that the machine broke off is claimed again.
const LONGEST_PAUSE: Duration = Duration::from_secs(60);
/// How often the machine may break a job off: pauses of 1 + 2 + 4 + 8 + 16 + 32
/// and 59 times 60 seconds are an hour.
const MAX_TROUBLES: u32 = 65;

/// A job with what only the store needs to know.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Record {
    pub job: Job,
    /// Who runs it, for people who read the database.
    pub worker: Option<String>,
    /// Set while running.
    pub lease_until: Option<Uptime>,
    /// Not claimed before this.
    pub not_before: Uptime,
    /// Attempts that trouble of the machine broke off.
    pub troubles: u32,
}

/// The present moment, by both clocks.
pub(super) struct Present {
    pub time: Timestamp,
    pub uptime: Uptime,
}

/// The event that a transition writes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Change {
    pub kind: EventKind,
    pub data: Value,
}

/// How an attempt ended.
#[derive(Clone, Debug)]
pub(super) enum Ending {
    Succeeded(Vec<ArtifactEntry>, Option<Value>),
    /// Trying again would not help.
    Failed(Failure),
    Cancelled,
    /// The attempt broke; try again after a pause.
    Broken(Failure, Duration),
    /// The machine is in trouble, not the job: the attempt is given back.
    Troubled(Failure),
    /// The worker stops; the attempt is given back.
    Released,
    /// The lease ended without a word.
    Expired,
}

impl Record {
    pub(crate) fn new(job: NewJob, now: &Present) -> (Self, Change) {
        let data = json!({ "max_attempts": job.max_attempts });
        let job = Job {
            id: job.id,
            tenant: job.tenant,
            kind: job.kind,
            priority: job.priority,
            tags: job.tags,
            webhook: job.webhook,
            request_id: job.request_id,
            payload: job.payload,
            state: JobState::Queued,
            attempt: 0,
            attempts_used: 0,
            max_attempts: job.max_attempts.max(1),
            cancel_requested: false,
            progress: None,
            failure: None,
            artifacts: Vec::new(),
            summary: None,
            reused_from: job.result.map(|result| result.of),
            created_at: now.time,
            started_at: None,
            finished_at: None,
            version: 0,
        };
        let not_before = now.uptime.clone();
        let record = Self { job, worker: None, lease_until: None, not_before, troubles: 0 };
        (record, Change { kind: EventKind::Queued, data })
    }

    /// Gives a queued job to `worker` and counts the attempt.
    pub(crate) fn claim(&mut self, worker: &str, now: &Present, lease: Duration) -> Change {
        self.job.state = JobState::Running;
        self.job.attempt += 1;
        self.job.attempts_used += 1;
        self.job.started_at = Some(now.time);
        self.job.progress = None;
        self.worker = Some(worker.to_owned());
        self.lease_until = Some(now.uptime.after(lease));
        Change { kind: EventKind::Started, data: json!({ "attempt": self.job.attempt }) }
    }

    /// Ends a queued job with an earlier result, as if an attempt had made it.
    pub(crate) fn answer(&mut self, result: EarlierResult, now: &Present) -> Change {
        self.job.attempt = 1;
        self.job.attempts_used = 1;
        self.job.started_at = Some(now.time);
        self.job.artifacts = result.artifacts;
        self.job.summary = result.summary;
        let mut change = self.finish(JobState::Succeeded, now.time);
        change.data["reused_from"] = json!(result.of);
        change
    }

    /// Whether `attempt` is the one that runs now.
    pub(crate) fn is_held_by(&self, attempt: u32) -> bool {
        self.job.state == JobState::Running && self.job.attempt == attempt
    }

    /// Fences writes of attempts that lost their lease.
    pub(crate) fn check_held_by(&self, attempt: u32) -> Result<(), StoreError> {
        if self.is_held_by(attempt) {
            Ok(())
        } else {
            Err(StoreError::LeaseLost { id: self.job.id, attempt })
        }
    }

    pub(crate) fn progress(&mut self, progress: Value) -> Change {
        self.job.progress = Some(progress.clone());
        let data = json!({ "attempt": self.job.attempt, "progress": progress });
        Change { kind: EventKind::Progress, data }
    }

    /// Ends the running attempt. Once cancellation was accepted the job ends as
    /// cancelled, whatever its worker comes back with.
    pub(crate) fn end(&mut self, ending: Ending, now: &Present) -> Change {
        self.worker = None;
        self.lease_until = None;
        if self.job.cancel_requested {
            return self.finish(JobState::Cancelled, now.time);
        }
        match ending {
            Ending::Succeeded(artifacts, summary) => {
                self.job.artifacts = artifacts;
                self.job.summary = summary;
                self.finish(JobState::Succeeded, now.time)
            }
            Ending::Failed(failure) => {
                self.job.failure = Some(failure);
                self.finish(JobState::Failed, now.time)
            }
            Ending::Cancelled => self.finish(JobState::Cancelled, now.time),
            Ending::Broken(failure, pause) => self.try_again(failure, pause, now),
            Ending::Troubled(failure) => self.wait_out(failure, now),
            Ending::Released => {
                self.job.attempts_used -= 1;
                self.put_back(json!({ "reason": "released" }), now.uptime.clone())
            }
            Ending::Expired => {
                let detail = "the worker stopped renewing its lease".to_owned();
                let failure = Failure { code: LEASE_EXPIRED.to_owned(), detail };
                self.try_again(failure, Duration::ZERO, now)
            }
        }
    }

    fn try_again(&mut self, failure: Failure, pause: Duration, now: &Present) -> Change {
        if self.job.attempts_used < self.job.max_attempts {
            let reason = json!({ "reason": failure.code, "detail": failure.detail });
            return self.put_back(reason, now.uptime.after(pause));
        }
        if failure.code == CRASHED {
            self.job.failure = Some(failure);
            return self.finish(JobState::Failed, now.time);
        }
        let detail = format!(
            "all {} attempts broke; the last one: {}: {}",
            self.job.attempts_used, failure.code, failure.detail
        );
        self.job.failure = Some(Failure { code: ATTEMPTS_EXHAUSTED.to_owned(), detail });
        self.finish(JobState::Failed, now.time)
    }

    /// Puts the job back for a time that doubles with every trouble in a row.
    fn wait_out(&mut self, failure: Failure, now: &Present) -> Change {
        if self.troubles == MAX_TROUBLES {
            self.job.failure = Some(failure);
            return self.finish(JobState::Failed, now.time);
        }
        let pause = Duration::from_secs(1 << self.troubles.min(6)).min(LONGEST_PAUSE);
        self.troubles += 1;
        self.job.attempts_used -= 1;
        let reason = json!({ "reason": failure.code, "detail": failure.detail });
        self.put_back(reason, now.uptime.after(pause))
    }

    fn put_back(&mut self, mut data: Value, not_before: Uptime) -> Change {
        data["attempt"] = self.job.attempt.into();
        self.job.state = JobState::Queued;
        self.job.progress = None;
        self.job.started_at = None;
        self.not_before = not_before;
        Change { kind: EventKind::Requeued, data }
    }

    fn finish(&mut self, state: JobState, now: Timestamp) -> Change {
        self.job.state = state;
        self.job.finished_at = Some(now);
        let attempt = self.job.attempt;
        let (kind, data) = match state {
            JobState::Succeeded => (EventKind::Succeeded, json!({ "attempt": attempt })),
            JobState::Failed => {
                (EventKind::Failed, json!({ "attempt": attempt, "failure": self.job.failure }))
            }
            _ => (EventKind::Cancelled, json!({ "attempt": attempt })),
        };
        Change { kind, data }
    }

    /// Cancels a queued job, marks a running one. `None` if it is marked already.
    pub(crate) fn request_cancel(&mut self, now: Timestamp) -> Result<Option<Change>, StoreError> {
        match self.job.state {
            JobState::Queued => {
                self.job.cancel_requested = true;
                Ok(Some(self.finish(JobState::Cancelled, now)))
            }
            JobState::Running if self.job.cancel_requested => Ok(None),
            JobState::Running => {
                self.job.cancel_requested = true;
                let data = json!({ "attempt": self.job.attempt });
                Ok(Some(Change { kind: EventKind::CancelRequested, data }))
            }
            _ => Err(StoreError::Finished { id: self.job.id }),
        }
    }

    pub(crate) fn renew(&mut self, now: &Uptime, lease: Duration) {
        self.lease_until = Some(now.after(lease));
    }
}
