//! The suite that every implementation of `JobStore` passes. Each part gets an
//! empty store and the clock that the store reads.

mod cancelling;
mod leases;
mod lists;
mod pages;
mod queue;
mod tenants;
mod uploads;

pub(crate) use pages::new_page;

use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;
use std::time::Duration;

use jiff::Timestamp;
use jobs::{
    AccessStore, ArtifactEntry, Claim, Clock, EarlierResult, Event, EventKind, Failure, Heartbeat,
    Idempotency, Job, JobCounts, JobId, JobState, JobStore, KeyText, ListQuery, ManualClock,
    NewJob, NewKey, NewPage, PageQuery, Scope, StoreError, Tags, TenantLimits, TenantName,
};
use serde_json::json;

use crate::{gone, outbox, storage};

pub(crate) const LEASE: Duration = Duration::from_secs(30);

/// A store under test.
pub(crate) struct Subject {
    pub store: Arc<dyn JobStore>,
    /// The same store.
    pub access: Arc<dyn AccessStore>,
    pub clock: Arc<ManualClock>,
}

impl Subject {
    async fn enqueue(&self, max_attempts: u32) -> Job {
        let payload = json!({ "views": [0, 22.5], "name": "Zeichnung „Ä“" });
        let job = NewJob::new(JobId::new(), "test", payload, max_attempts);
        self.store.enqueue(job).await.unwrap()
    }

    async fn claim(&self) -> Option<Claim> {
        self.store.claim("tester", LEASE).await.unwrap()
    }

    async fn running(&self, max_attempts: u32) -> Claim {
        let job = self.enqueue(max_attempts).await;
        let claim = self.claim().await.unwrap();
        assert_eq!(claim.job.id, job.id);
        claim
    }

    async fn get(&self, id: JobId) -> Job {
        self.store.get(id).await.unwrap()
    }

    async fn kinds(&self, id: JobId) -> Vec<EventKind> {
        self.events(id).await.into_iter().map(|event| event.kind).collect()
    }

    /// All events, after checking that their numbers have no gap and end with
    /// the job's version.
    async fn events(&self, id: JobId) -> Vec<Event> {
        let events = self.store.events(id, 0).await.unwrap();
        let numbers: Vec<u64> = events.iter().map(|event| event.number).collect();
        assert_eq!(numbers, (1..=events.len() as u64).collect::<Vec<_>>());
        assert_eq!(self.get(id).await.version, events.len() as u64);
        events
    }

    /// Every way an attempt can write.
    async fn write_everything(&self, id: JobId, attempt: u32) -> Vec<Result<(), StoreError>> {
        let store = &self.store;
        vec![
            store.progress(id, attempt, json!({ "fraction": 1.0 })).await,
            store.succeed(id, attempt, artifacts(), None).await.map(drop),
            store.fail(id, attempt, broken()).await.map(drop),
            store.cancelled(id, attempt).await.map(drop),
            store.retry(id, attempt, broken(), Duration::ZERO).await.map(drop),
            store.postpone(id, attempt, broken()).await.map(drop),
            store.release(id, attempt).await.map(drop),
        ]
    }

    async fn assert_fenced(&self, id: JobId, attempt: u32) {
        let before = (self.get(id).await, self.events(id).await);
        for result in self.write_everything(id, attempt).await {
            match result {
                Err(StoreError::LeaseLost { id: lost, attempt: by }) => {
                    assert_eq!((lost, by), (id, attempt));
                }
                other => panic!("attempt {attempt} was not fenced: {other:?}"),
            }
        }
        assert_eq!(self.store.heartbeat(id, attempt, LEASE).await.unwrap(), Heartbeat::Lost);
        assert_eq!((self.get(id).await, self.events(id).await), before);
    }
}

fn broken() -> Failure {
    Failure { code: "internal".to_owned(), detail: "the disk is full".to_owned() }
}

fn artifacts() -> Vec<ArtifactEntry> {
    ["views/22.5/disparity.png", "hull.glb"]
        .map(|name| ArtifactEntry {
            name: name.to_owned(),
            media_type: "image/png".to_owned(),
            bytes: 7_000_000_000,
            sha256: "ab".repeat(32),
        })
        .to_vec()
}

fn tenant(name: &str) -> TenantName {
    name.parse().unwrap()
}

/// Runs the whole suite. `fresh` gives an empty store each time.
pub(crate) async fn run<F: AsyncFn() -> Subject>(fresh: F) {
    queue::a_job_goes_from_queued_to_succeeded(&fresh().await).await;
    queue::the_oldest_queued_job_is_claimed_first(&fresh().await).await;
    uploads::an_upload_that_is_sent_again_is_one_job(&fresh().await).await;
    uploads::a_result_is_found_by_its_key_and_answers_others(&fresh().await).await;
    tenants::only_so_many_jobs_of_a_tenant_wait(&fresh().await).await;
    tenants::tenants_are_served_in_turn(&fresh().await).await;
    tenants::a_tenant_s_jobs_are_its_own(&fresh().await).await;
    tenants::keys_are_known_until_they_are_revoked(&fresh().await).await;
    tenants::without_its_keys_it_stays_closed_until_it_is_opened(&fresh().await).await;
    leases::no_two_claimers_get_the_same_job(&fresh().await).await;
    leases::a_lease_lasts_as_long_as_it_is_renewed(&fresh().await).await;
    leases::a_worker_that_lost_its_lease_changes_nothing(&fresh().await).await;
    leases::attempts_are_used_up_by_silent_workers(&fresh().await).await;
    leases::attempts_are_used_up_by_breaking_ones(&fresh().await).await;
    leases::a_broken_attempt_pauses_before_the_next(&fresh().await).await;
    leases::trouble_of_the_machine_uses_no_attempts_for_an_hour(&fresh().await).await;
    leases::a_clock_that_is_set_changes_nothing(&fresh().await).await;
    leases::what_ran_when_the_machine_stopped_runs_again_at_once(&fresh().await).await;
    queue::a_released_attempt_is_given_back_but_not_its_number(&fresh().await).await;
    queue::failing_is_final(&fresh().await).await;
    cancelling::a_queued_job_is_cancelled_at_once(&fresh().await).await;
    cancelling::a_running_job_is_cancelled_when_its_worker_sees_it(&fresh().await).await;
    cancelling::an_accepted_cancellation_wins_over_every_ending(&fresh().await).await;
    cancelling::cancelling_races_with_succeeding(&fresh().await).await;
    cancelling::a_finished_job_cannot_be_cancelled(&fresh().await).await;
    queue::progress_belongs_to_its_attempt(&fresh().await).await;
    lists::listings_go_from_new_to_old_in_parts(&fresh().await).await;
    lists::a_deleted_job_is_gone_with_its_events(&fresh().await).await;
    lists::jobs_are_found_by_what_people_say_of_them(&fresh().await).await;
    lists::jobs_go_when_their_time_is_over(&fresh().await).await;
    queue::unknown_jobs_are_not_found(&fresh().await).await;
    queue::names_are_taken_once(&fresh().await).await;
    uploads::bytes_are_ownerless_before_a_job_and_after_it(&fresh().await).await;
    queue::changes_are_announced(&fresh().await).await;
    pages::pages_change_one_version_at_a_time(&fresh().await).await;
    pages::pages_are_found_by_what_is_said_of_them(&fresh().await).await;
    pages::pages_sent_again_are_stored_once(&fresh().await).await;
    queue::writers_at_the_same_time_leave_no_gap(&fresh().await).await;
    storage::stored_bytes_are_counted_and_bounded(&fresh().await).await;
    storage::homes_are_told_with_what_is_forgotten(&fresh().await).await;
    storage::pages_go_when_their_time_is_over(&fresh().await).await;
    storage::room_is_made_of_the_oldest(&fresh().await).await;
    tenants::secrets_of_the_service_are_made_once(&fresh().await).await;
    outbox::every_end_is_told_once(&fresh().await).await;
    outbox::messages_are_sent_until_they_are_taken(&fresh().await).await;
    outbox::secrets_overlap(&fresh().await).await;
}
