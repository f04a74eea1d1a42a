//! The suite that every implementation of `JobStore` passes. Each part gets an
//! empty store and the clock that the store reads.

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

/// Runs the whole suite. `fresh` gives an empty store each time.
pub(crate) async fn run<F: AsyncFn() -> Subject>(fresh: F) {
    a_job_goes_from_queued_to_succeeded(&fresh().await).await;
    the_oldest_queued_job_is_claimed_first(&fresh().await).await;
    an_upload_that_is_sent_again_is_one_job(&fresh().await).await;
    a_result_is_found_by_its_key_and_answers_others(&fresh().await).await;
    only_so_many_jobs_of_a_tenant_wait(&fresh().await).await;
    tenants_are_served_in_turn(&fresh().await).await;
    a_tenant_s_jobs_are_its_own(&fresh().await).await;
    keys_are_known_until_they_are_revoked(&fresh().await).await;
    without_its_keys_it_stays_closed_until_it_is_opened(&fresh().await).await;
    no_two_claimers_get_the_same_job(&fresh().await).await;
    a_lease_lasts_as_long_as_it_is_renewed(&fresh().await).await;
    a_worker_that_lost_its_lease_changes_nothing(&fresh().await).await;
    attempts_are_used_up_by_silent_workers(&fresh().await).await;
    attempts_are_used_up_by_breaking_ones(&fresh().await).await;
    a_broken_attempt_pauses_before_the_next(&fresh().await).await;
    trouble_of_the_machine_uses_no_attempts_for_an_hour(&fresh().await).await;
    a_clock_that_is_set_changes_nothing(&fresh().await).await;
    what_ran_when_the_machine_stopped_runs_again_at_once(&fresh().await).await;
    a_released_attempt_is_given_back_but_not_its_number(&fresh().await).await;
    failing_is_final(&fresh().await).await;
    a_queued_job_is_cancelled_at_once(&fresh().await).await;
    a_running_job_is_cancelled_when_its_worker_sees_it(&fresh().await).await;
    an_accepted_cancellation_wins_over_every_ending(&fresh().await).await;
    cancelling_races_with_succeeding(&fresh().await).await;
    a_finished_job_cannot_be_cancelled(&fresh().await).await;
    progress_belongs_to_its_attempt(&fresh().await).await;
    listings_go_from_new_to_old_in_parts(&fresh().await).await;
    a_deleted_job_is_gone_with_its_events(&fresh().await).await;
    jobs_are_found_by_what_people_say_of_them(&fresh().await).await;
    jobs_go_when_their_time_is_over(&fresh().await).await;
    unknown_jobs_are_not_found(&fresh().await).await;
    names_are_taken_once(&fresh().await).await;
    bytes_are_ownerless_before_a_job_and_after_it(&fresh().await).await;
    changes_are_announced(&fresh().await).await;
    pages_change_one_version_at_a_time(&fresh().await).await;
    pages_are_found_by_what_is_said_of_them(&fresh().await).await;
    pages_sent_again_are_stored_once(&fresh().await).await;
    writers_at_the_same_time_leave_no_gap(&fresh().await).await;
    storage::stored_bytes_are_counted_and_bounded(&fresh().await).await;
    storage::homes_are_told_with_what_is_forgotten(&fresh().await).await;
    storage::pages_go_when_their_time_is_over(&fresh().await).await;
    storage::room_is_made_of_the_oldest(&fresh().await).await;
    secrets_of_the_service_are_made_once(&fresh().await).await;
    outbox::every_end_is_told_once(&fresh().await).await;
    outbox::messages_are_sent_until_they_are_taken(&fresh().await).await;
    outbox::secrets_overlap(&fresh().await).await;
}

async fn a_job_goes_from_queued_to_succeeded(subject: &Subject) {
    let store = &subject.store;
    store.ping().await.unwrap();
    assert!(subject.claim().await.is_none());
    let created = subject.clock.now();
    let job = subject.enqueue(3).await;
    assert_eq!((job.state, job.attempt, job.attempts_used), (JobState::Queued, 0, 0));
    assert_eq!((job.created_at, job.started_at, job.version), (created, None, 1));
    assert_eq!(subject.get(job.id).await, job);
    assert_eq!(store.depth().await.unwrap(), (1, 0));

    subject.clock.advance(Duration::from_secs(5));
    let started = subject.clock.now();
    let claim = subject.claim().await.unwrap();
    assert_eq!(claim.attempt, 1);
    assert_eq!((claim.job.state, claim.job.attempt), (JobState::Running, 1));
    assert_eq!((claim.job.attempts_used, claim.job.started_at), (1, Some(started)));
    assert_eq!(claim.job.payload, job.payload);
    assert_eq!(store.depth().await.unwrap(), (0, 1));

    store.progress(job.id, 1, json!({ "fraction": 0.5 })).await.unwrap();
    assert_eq!(subject.get(job.id).await.progress, Some(json!({ "fraction": 0.5 })));

    subject.clock.advance(Duration::from_secs(7));
    let state = store.succeed(job.id, 1, artifacts(), None).await.unwrap();
    let done = subject.get(job.id).await;
    assert_eq!((state, done.state), (JobState::Succeeded, JobState::Succeeded));
    assert_eq!(done.artifacts, artifacts());
    assert_eq!((done.finished_at, done.failure), (Some(subject.clock.now()), None));
    assert_eq!(store.depth().await.unwrap(), (0, 0));
    let counts = JobCounts { succeeded: 1, ..JobCounts::default() };
    assert_eq!(store.counts().await.unwrap(), counts);
    assert!(subject.claim().await.is_none());

    use EventKind::{Progress, Queued, Started, Succeeded};
    let events = subject.events(job.id).await;
    let kinds: Vec<_> = events.iter().map(|event| event.kind).collect();
    assert_eq!(kinds, [Queued, Started, Progress, Succeeded]);
    assert_eq!((events[0].at, events[1].at), (created, started));
    assert_eq!(events[1].data["attempt"], 1);
    assert_eq!(store.events(job.id, 2).await.unwrap(), events[2..]);
    assert_eq!(store.events(job.id, 4).await.unwrap(), []);
    assert_eq!(store.events(job.id, u64::MAX).await.unwrap(), []);
}

async fn the_oldest_queued_job_is_claimed_first(subject: &Subject) {
    let mut ids = Vec::new();
    for _ in 0..5 {
        ids.push(subject.enqueue(3).await.id);
    }
    let mut claimed = Vec::new();
    while let Some(claim) = subject.claim().await {
        claimed.push(claim.job.id);
    }
    assert_eq!(claimed, ids);
}

fn tenant(name: &str) -> TenantName {
    name.parse().unwrap()
}

impl Subject {
    async fn enqueue_for(&self, tenant: &TenantName, priority: i32) -> JobId {
        let job = NewJob::new(JobId::new(), "test", json!(null), 1);
        let job = NewJob { tenant: tenant.clone(), priority, ..job };
        self.store.enqueue(job).await.unwrap().id
    }
}

fn keyed(key: &str, fingerprint: &str) -> NewJob {
    let given = Idempotency { key: key.to_owned(), fingerprint: fingerprint.to_owned() };
    let job = NewJob::new(JobId::new(), "test", json!(null), 1);
    NewJob { idempotency: Some(given), ..job }
}

async fn an_upload_that_is_sent_again_is_one_job(subject: &Subject) {
    let store = &subject.store;
    let posts: Vec<_> = (0..100)
        .map(|_| {
            let store = Arc::clone(store);
            tokio::spawn(async move { store.enqueue(keyed("k", "a")).await.unwrap().id })
        })
        .collect();
    let mut ids = HashSet::new();
    for post in posts {
        ids.insert(post.await.unwrap());
    }
    assert_eq!((ids.len(), store.ids().await.unwrap().len()), (1, 1));
    let first = subject.claim().await.unwrap().job;
    assert!(ids.contains(&first.id));
    let again = store.enqueue(keyed("k", "a")).await.unwrap();
    assert_eq!((again.id, again.state), (first.id, JobState::Running));
    assert_eq!(again.as_enqueued(), Job { created_at: first.created_at, ..first.as_enqueued() });
    assert!(matches!(store.enqueue(keyed("k", "b")).await, Err(StoreError::OtherUpload(_))));
    // Another tenant's key of the same name is another.
    let other = tenant("other");
    subject.access.create_tenant(&other).await.unwrap();
    let of_other = NewJob { tenant: other.clone(), ..keyed("k", "b") };
    let of_other = store.enqueue(of_other).await.unwrap();
    assert_ne!(of_other.id, first.id);
    let given = |fingerprint: &str| keyed("k", fingerprint).idempotency.unwrap();
    assert_eq!(store.enqueued(&other, &given("b")).await.unwrap(), Some(of_other));
    let default = TenantName::default();
    assert!(matches!(store.enqueued(&default, &given("b")).await, Err(StoreError::OtherUpload(_))));
    // Deleted jobs do not come back, and a day later all is forgotten.
    store.succeed(first.id, 1, Vec::new(), None).await.unwrap();
    store.delete(first.id).await.unwrap();
    assert!(matches!(store.enqueue(keyed("k", "a")).await, Err(StoreError::NotFound(_))));
    subject.clock.advance(Duration::from_secs(24 * 3600));
    assert_eq!(store.enqueued(&default, &given("a")).await.unwrap(), None);
    assert_ne!(store.enqueue(keyed("k", "c")).await.unwrap().id, first.id);
}

async fn a_result_is_found_by_its_key_and_answers_others(subject: &Subject) {
    let (store, key) = (&subject.store, "ab".repeat(32));
    let other = TenantName::try_from("other".to_owned()).unwrap();
    subject.access.create_tenant(&other).await.unwrap();
    let keyed = |tenant: &TenantName, result| NewJob {
        tenant: tenant.clone(),
        result_key: Some(key.clone()),
        result,
        ..NewJob::new(JobId::new(), "test", json!({}), 3)
    };
    let find = async |tenant: &TenantName, kind: &str| {
        store.with_result(tenant, kind, &key).await.unwrap().map(|job| job.id)
    };
    let own = TenantName::default();
    let first = store.enqueue(keyed(&own, None)).await.unwrap();
    assert_eq!(find(&own, "test").await, None, "it has no result yet");
    let claim = subject.claim().await.unwrap();
    store.succeed(first.id, claim.attempt, artifacts(), Some(json!({ "fit": 1 }))).await.unwrap();
    assert_eq!(find(&own, "test").await, Some(first.id));
    assert_eq!(find(&own, "drawing").await, None);
    assert_eq!(find(&other, "test").await, None);

    let summary = subject.get(first.id).await.summary;
    let result = EarlierResult { of: first.id, artifacts: artifacts(), summary };
    let mut again = keyed(&own, Some(result));
    again.tags.expires_at = Some(Timestamp::from_millisecond(0).unwrap());
    // Nothing waits for it: it does not count among those that do.
    again.max_queued = Some(0);
    let again = store.enqueue(again).await.unwrap();
    assert_eq!(again, subject.get(again.id).await);
    assert_eq!((again.state, again.attempt), (JobState::Succeeded, 1));
    assert_eq!((again.reused_from, &again.artifacts), (Some(first.id), &artifacts()));
    assert_eq!(again.summary, Some(json!({ "fit": 1 })));
    assert_eq!(subject.kinds(again.id).await, [EventKind::Queued, EventKind::Succeeded]);
    assert!(subject.claim().await.is_none());
    // The later one's time is over already.
    assert_eq!(find(&own, "test").await, Some(first.id));
    store.delete(first.id).await.unwrap();
    assert_eq!(find(&own, "test").await, None);
    assert_eq!(subject.get(again.id).await.reused_from, Some(first.id));
}

async fn only_so_many_jobs_of_a_tenant_wait(subject: &Subject) {
    let limited = || {
        let job = NewJob::new(JobId::new(), "test", json!(null), 1);
        NewJob { max_queued: Some(2), ..job }
    };
    let other = tenant("other");
    subject.access.create_tenant(&other).await.unwrap();
    subject.enqueue_for(&other, 0).await;
    for _ in 0..2 {
        subject.store.enqueue(limited()).await.unwrap();
    }
    let refused = subject.store.enqueue(limited()).await;
    assert!(matches!(refused, Err(StoreError::TooManyQueued { most: 2, .. })));
    while subject.claim().await.is_some() {}
    subject.store.enqueue(limited()).await.unwrap();
}

async fn tenants_are_served_in_turn(subject: &Subject) {
    let [many, few, limited] = ["many", "few", "limited"].map(tenant);
    for name in [&many, &few, &limited] {
        subject.access.create_tenant(name).await.unwrap();
    }
    let limits = TenantLimits { max_running: Some(0), ..TenantLimits::default() };
    subject.access.limit_tenant(&limited, &limits).await.unwrap();
    subject.enqueue_for(&limited, 9).await;
    let mut of_many = Vec::new();
    for _ in 0..4 {
        of_many.push(subject.enqueue_for(&many, 0).await);
    }
    let urgent = subject.enqueue_for(&many, 5).await;
    let first = subject.claim().await.unwrap().job;
    assert_eq!((first.id, first.tenant), (urgent, many.clone()));
    // One that comes late with one job does not wait for all of the others'.
    let single = subject.enqueue_for(&few, 0).await;
    assert_eq!(subject.claim().await.unwrap().job.id, single);
    // With as many running, in turn.
    let again = subject.enqueue_for(&few, 0).await;
    let claimed = [subject.claim().await.unwrap(), subject.claim().await.unwrap()];
    assert_eq!(claimed.map(|claim| claim.job.id), [of_many[0], again]);
    for id in &of_many[1..] {
        assert_eq!(subject.claim().await.unwrap().job.id, *id);
    }
    assert!(subject.claim().await.is_none(), "a tenant got more than its limit");
}

async fn a_tenant_s_jobs_are_its_own(subject: &Subject) {
    let (access, other) = (&subject.access, tenant("other"));
    let unknown = NewJob::new(JobId::new(), "test", json!(null), 1);
    let unknown = NewJob { tenant: other.clone(), ..unknown };
    let refused = subject.store.enqueue(unknown).await;
    assert!(matches!(refused, Err(StoreError::NoTenant(name)) if name == other));
    access.create_tenant(&other).await.unwrap();
    assert!(matches!(access.create_tenant(&other).await, Err(StoreError::TenantExists(_))));
    let (mine, own) = (subject.enqueue(1).await.id, subject.enqueue_for(&other, 0).await);
    let list = async |tenant| {
        let query = ListQuery { tenant: Some(tenant), limit: 10, ..ListQuery::default() };
        let page = subject.store.list(&query).await.unwrap();
        page.jobs.iter().map(|job| job.id).collect::<Vec<_>>()
    };
    assert_eq!(list(TenantName::default()).await, [mine]);
    assert_eq!(list(other.clone()).await, [own]);
    assert_eq!(subject.claim().await.unwrap().job.id, mine);
    assert_eq!(subject.claim().await.unwrap().job.id, own);
    for name in [&other, &TenantName::default()] {
        assert!(matches!(access.delete_tenant(name).await, Err(StoreError::TenantInUse(_))));
    }
    subject.store.succeed(own, 1, Vec::new(), None).await.unwrap();
    assert_eq!(gone(access.delete_tenant(&other).await), [own]);
    assert!(matches!(access.delete_tenant(&other).await, Err(StoreError::NoTenant(_))));
    assert!(subject.store.is_ownerless(own, Duration::ZERO).await.unwrap());
    assert_eq!(subject.store.ids().await.unwrap(), [mine]);
    let names: Vec<_> = access.tenants().await.unwrap().into_iter().map(|it| it.name).collect();
    assert_eq!(names, [TenantName::default()]);
}

async fn keys_are_known_until_they_are_revoked(subject: &Subject) {
    let access = &subject.access;
    assert!(!access.has_keys().await.unwrap());
    assert!(!access.is_closed().await.unwrap());
    let text = KeyText::generate();
    let new = |name| NewKey { tenant: tenant(name), label: "farm".into(), scope: Scope::Write };
    let refused = access.add_key(&new("nobody"), &text).await;
    assert!(matches!(refused, Err(StoreError::NoTenant(_))));
    let key = access.add_key(&new("default"), &text).await.unwrap();
    assert!(access.has_keys().await.unwrap());
    assert!(access.is_closed().await.unwrap());
    assert!(!access.open_to_all().await.unwrap(), "a key is in use");
    assert!(access.is_closed().await.unwrap());
    assert_eq!(access.authenticate(&text).await.unwrap(), Some(key.clone()));
    // The same id with another secret.
    let forged = format!("{}_{}", text.id(), "0".repeat(64)).parse().unwrap();
    assert_eq!(access.authenticate(&forged).await.unwrap(), None);
    assert_eq!(access.authenticate(&KeyText::generate()).await.unwrap(), None);
    let revoked = access.revoke_key(&key.id).await.unwrap();
    assert_eq!(revoked.revoked_at, Some(subject.clock.now()));
    subject.clock.advance(Duration::from_secs(1));
    assert_eq!(access.revoke_key(&key.id).await.unwrap(), revoked);
    assert_eq!(access.authenticate(&text).await.unwrap(), None);
    assert_eq!(access.keys().await.unwrap(), [revoked]);
    assert!(!access.has_keys().await.unwrap());
    assert!(matches!(access.revoke_key("ta_none").await, Err(StoreError::NoKey(_))));
}

async fn without_its_keys_it_stays_closed_until_it_is_opened(subject: &Subject) {
    let access = &subject.access;
    let add = async |name: &str| {
        let new = NewKey { tenant: tenant(name), label: String::new(), scope: Scope::Admin };
        access.add_key(&new, &KeyText::generate()).await.unwrap()
    };
    let first = add("default").await;
    access.revoke_key(&first.id).await.unwrap();
    assert!(access.is_closed().await.unwrap(), "its last key was revoked");
    assert!(access.open_to_all().await.unwrap());
    assert!(!access.is_closed().await.unwrap());
    // A tenant's keys go with it, and leave no row behind.
    access.create_tenant(&tenant("other")).await.unwrap();
    add("other").await;
    access.delete_tenant(&tenant("other")).await.unwrap();
    assert!(!access.has_keys().await.unwrap());
    assert!(access.is_closed().await.unwrap(), "its last key went with its tenant");
}

async fn no_two_claimers_get_the_same_job(subject: &Subject) {
    let mut ids = HashSet::new();
    for _ in 0..24 {
        ids.insert(subject.enqueue(3).await.id);
    }
    let claimers: Vec<_> = (0..6)
        .map(|number| {
            let store = Arc::clone(&subject.store);
            tokio::spawn(async move {
                let mut claimed = Vec::new();
                while let Some(claim) = store.claim(&number.to_string(), LEASE).await.unwrap() {
                    assert_eq!(claim.attempt, 1);
                    claimed.push(claim.job.id);
                }
                claimed
            })
        })
        .collect();
    let mut claimed = Vec::new();
    for claimer in claimers {
        claimed.extend(claimer.await.unwrap());
    }
    assert_eq!(claimed.len(), 24);
    assert_eq!(claimed.into_iter().collect::<HashSet<_>>(), ids);
}

async fn a_lease_lasts_as_long_as_it_is_renewed(subject: &Subject) {
    let claim = subject.running(3).await;
    for _ in 0..4 {
        subject.clock.advance(LEASE * 2 / 3);
        assert_eq!(subject.store.reap().await.unwrap(), 0);
        let beat = subject.store.heartbeat(claim.job.id, 1, LEASE).await.unwrap();
        assert_eq!(beat, Heartbeat::Held { cancel_requested: false });
    }
    // A renewed lease is no visible change.
    assert_eq!(subject.get(claim.job.id).await, claim.job);
    subject.clock.advance(LEASE);
    assert_eq!(subject.store.reap().await.unwrap(), 1);
    assert_eq!(subject.get(claim.job.id).await.state, JobState::Queued);
    assert_eq!(subject.store.reap().await.unwrap(), 0);
}

async fn a_worker_that_lost_its_lease_changes_nothing(subject: &Subject) {
    let first = subject.running(3).await;
    let id = first.job.id;
    subject.clock.advance(LEASE);
    assert_eq!(subject.store.reap().await.unwrap(), 1);
    // The job waits: its former worker is out already.
    subject.assert_fenced(id, 1).await;
    let second = subject.claim().await.unwrap();
    assert_eq!((second.job.id, second.attempt, second.job.attempts_used), (id, 2, 2));
    subject.assert_fenced(id, 1).await;
    // Attempts that were never given out are no better.
    subject.assert_fenced(id, 3).await;
    subject.store.progress(id, 2, json!({ "fraction": 0.1 })).await.unwrap();
    subject.store.succeed(id, 2, artifacts(), None).await.unwrap();
    subject.assert_fenced(id, 1).await;
    subject.assert_fenced(id, 2).await;
    use EventKind::{Progress, Queued, Requeued, Started, Succeeded};
    let kinds = subject.kinds(id).await;
    assert_eq!(kinds, [Queued, Started, Requeued, Started, Progress, Succeeded]);
}

async fn attempts_are_used_up_by_silent_workers(subject: &Subject) {
    let id = subject.enqueue(2).await.id;
    for attempt in 1..=2 {
        assert_eq!(subject.claim().await.unwrap().attempt, attempt);
        subject.clock.advance(LEASE);
        assert_eq!(subject.store.reap().await.unwrap(), 1);
    }
    let job = subject.get(id).await;
    assert_eq!((job.state, job.attempts_used), (JobState::Failed, 2));
    assert_eq!(job.failure.unwrap().code, "attempts_exhausted");
    assert_eq!(job.finished_at, Some(subject.clock.now()));
    assert!(subject.claim().await.is_none());
    use EventKind::{Failed, Queued, Requeued, Started};
    assert_eq!(subject.kinds(id).await, [Queued, Started, Requeued, Started, Failed]);
}

async fn attempts_are_used_up_by_breaking_ones(subject: &Subject) {
    let id = subject.enqueue(2).await.id;
    for (attempt, state) in [(1, JobState::Queued), (2, JobState::Failed)] {
        assert_eq!(subject.claim().await.unwrap().attempt, attempt);
        let left = subject.store.retry(id, attempt, broken(), Duration::ZERO).await.unwrap();
        assert_eq!(left, state);
    }
    let failure = subject.get(id).await.failure.unwrap();
    assert_eq!(failure.code, "attempts_exhausted");
    assert!(failure.detail.contains("the disk is full"), "{}", failure.detail);
}

async fn a_broken_attempt_pauses_before_the_next(subject: &Subject) {
    let first = subject.running(3).await.job.id;
    let pause = Duration::from_secs(10);
    subject.store.retry(first, 1, broken(), pause).await.unwrap();
    assert!(subject.claim().await.is_none());
    // Others need not wait for it, though it is the older.
    let second = subject.running(3).await.job.id;
    subject.clock.advance(pause - Duration::from_millis(1));
    assert!(subject.claim().await.is_none());
    subject.clock.advance(Duration::from_millis(1));
    assert_eq!(subject.claim().await.unwrap().job.id, first);
    assert_eq!(subject.get(second).await.state, JobState::Running);
}

async fn trouble_of_the_machine_uses_no_attempts_for_an_hour(subject: &Subject) {
    let id = subject.enqueue(1).await.id;
    let mut pauses = Vec::new();
    loop {
        let mut seconds = 0;
        let claim = loop {
            match subject.claim().await {
                Some(claim) => break claim,
                None => subject.clock.advance(Duration::from_secs(1)),
            }
            seconds += 1;
        };
        pauses.push(seconds);
        assert_eq!(claim.job.attempts_used, 1);
        let state = subject.store.postpone(id, claim.attempt, broken()).await.unwrap();
        if state == JobState::Failed {
            break;
        }
        assert_eq!((state, subject.get(id).await.attempts_used), (JobState::Queued, 0));
    }
    assert_eq!(pauses[..9], [0, 1, 2, 4, 8, 16, 32, 60, 60]);
    assert_eq!(pauses.iter().sum::<u64>(), 3603);
    assert_eq!(subject.get(id).await.failure, Some(broken()));
}

async fn a_clock_that_is_set_changes_nothing(subject: &Subject) {
    let start = subject.clock.now();
    let years = |count: i64| start + jiff::SignedDuration::from_hours(24 * 365 * count);
    let claim = subject.running(1).await;
    for now in [start - jiff::SignedDuration::from_hours(1), years(10), start] {
        subject.clock.set(now);
        assert_eq!(subject.store.reap().await.unwrap(), 0);
        // What is enqueued now is claimed now, the oldest first.
        let (first, second) = (subject.enqueue(3).await.id, subject.enqueue(3).await.id);
        assert_eq!(subject.claim().await.unwrap().job.id, first);
        assert_eq!(subject.claim().await.unwrap().job.id, second);
        for id in [first, second] {
            let beat = subject.store.heartbeat(id, 1, LEASE).await.unwrap();
            assert_eq!(beat, Heartbeat::Held { cancel_requested: false });
            subject.store.succeed(id, 1, Vec::new(), None).await.unwrap();
        }
    }
    // A lease given while the clock was wrong ends when its time has passed.
    subject.clock.set(years(10));
    subject.store.heartbeat(claim.job.id, 1, LEASE).await.unwrap();
    subject.clock.set(start);
    subject.clock.advance(LEASE);
    assert_eq!(subject.store.reap().await.unwrap(), 1);
}

async fn what_ran_when_the_machine_stopped_runs_again_at_once(subject: &Subject) {
    subject.clock.advance(Duration::from_secs(1000));
    let id = subject.running(3).await.job.id;
    let paused = subject.running(3).await.job.id;
    let pause = Duration::from_secs(3000);
    subject.store.retry(paused, 1, broken(), pause).await.unwrap();
    subject.clock.reboot("second");
    assert_eq!(subject.store.reap().await.unwrap(), 1);
    assert_eq!(subject.claim().await.unwrap().job.id, id);
    assert_eq!(subject.claim().await.unwrap().job.id, paused);
}

async fn bytes_are_ownerless_before_a_job_and_after_it(subject: &Subject) {
    let (store, hour) = (&subject.store, Duration::from_secs(3600));
    let id = JobId::new();
    assert!(!store.is_ownerless(id, Duration::ZERO).await.unwrap());
    store.expect_bytes(id).await.unwrap();
    assert!(!store.is_ownerless(id, hour).await.unwrap());
    // However wrong the time is that people read.
    subject.clock.set(subject.clock.now() + jiff::SignedDuration::from_hours(100));
    assert!(!store.is_ownerless(id, hour).await.unwrap());
    subject.clock.advance(hour);
    assert!(store.is_ownerless(id, hour).await.unwrap());
    let job = NewJob::new(id, "test", json!(null), 1);
    store.enqueue(job).await.unwrap();
    assert!(!store.is_ownerless(id, Duration::ZERO).await.unwrap());
    store.delete(id).await.unwrap();
    assert!(store.is_ownerless(id, Duration::ZERO).await.unwrap());
    store.forget_bytes(id).await.unwrap();
    assert!(!store.is_ownerless(id, Duration::ZERO).await.unwrap());
}

async fn a_released_attempt_is_given_back_but_not_its_number(subject: &Subject) {
    let id = subject.enqueue(1).await.id;
    for attempt in 1..=3 {
        assert_eq!(subject.claim().await.unwrap().attempt, attempt);
        assert_eq!(subject.store.release(id, attempt).await.unwrap(), JobState::Queued);
        assert_eq!(subject.get(id).await.attempts_used, 0);
        subject.assert_fenced(id, attempt).await;
    }
    assert_eq!(subject.claim().await.unwrap().attempt, 4);
    subject.assert_fenced(id, 3).await;
    subject.clock.advance(LEASE);
    assert_eq!(subject.store.reap().await.unwrap(), 1);
    let job = subject.get(id).await;
    assert_eq!((job.state, job.attempt, job.attempts_used), (JobState::Failed, 4, 1));
}

async fn failing_is_final(subject: &Subject) {
    let id = subject.running(3).await.job.id;
    let failure = Failure { code: "no_usable_pair".to_owned(), detail: "0 of 18".to_owned() };
    let state = subject.store.fail(id, 1, failure.clone()).await.unwrap();
    let job = subject.get(id).await;
    assert_eq!((state, job.state), (JobState::Failed, JobState::Failed));
    assert_eq!(job.failure, Some(failure));
    assert!(subject.claim().await.is_none());
    let events = subject.events(id).await;
    assert_eq!(events.last().unwrap().data["failure"]["code"], "no_usable_pair");
}

async fn a_queued_job_is_cancelled_at_once(subject: &Subject) {
    let id = subject.enqueue(3).await.id;
    let job = subject.store.request_cancel(id).await.unwrap();
    assert_eq!(job.state, JobState::Cancelled);
    assert_eq!(job.finished_at, Some(subject.clock.now()));
    assert!(subject.claim().await.is_none());
    assert_eq!(subject.kinds(id).await, [EventKind::Queued, EventKind::Cancelled]);
}

async fn a_running_job_is_cancelled_when_its_worker_sees_it(subject: &Subject) {
    let id = subject.running(3).await.job.id;
    let job = subject.store.request_cancel(id).await.unwrap();
    assert_eq!((job.state, job.cancel_requested), (JobState::Running, true));
    // Asking again changes nothing.
    assert_eq!(subject.store.request_cancel(id).await.unwrap(), job);
    let beat = subject.store.heartbeat(id, 1, LEASE).await.unwrap();
    assert_eq!(beat, Heartbeat::Held { cancel_requested: true });
    subject.store.cancelled(id, 1).await.unwrap();
    assert_eq!(subject.get(id).await.state, JobState::Cancelled);
    use EventKind::{CancelRequested, Cancelled, Queued, Started};
    assert_eq!(subject.kinds(id).await, [Queued, Started, CancelRequested, Cancelled]);
}

async fn an_accepted_cancellation_wins_over_every_ending(subject: &Subject) {
    for ending in 0..5 {
        let id = subject.running(3).await.job.id;
        subject.store.request_cancel(id).await.unwrap();
        let store = &subject.store;
        let state = match ending {
            0 => store.succeed(id, 1, artifacts(), None).await.unwrap(),
            1 => store.fail(id, 1, broken()).await.unwrap(),
            2 => store.retry(id, 1, broken(), Duration::ZERO).await.unwrap(),
            3 => store.release(id, 1).await.unwrap(),
            _ => {
                subject.clock.advance(LEASE);
                assert_eq!(store.reap().await.unwrap(), 1);
                JobState::Cancelled
            }
        };
        let job = subject.get(id).await;
        assert_eq!((state, job.state), (JobState::Cancelled, JobState::Cancelled), "{ending}");
        assert_eq!((job.artifacts, job.failure), (vec![], None));
    }
}

async fn cancelling_races_with_succeeding(subject: &Subject) {
    for _ in 0..12 {
        let id = subject.running(3).await.job.id;
        let (cancelling, ending) = (Arc::clone(&subject.store), Arc::clone(&subject.store));
        let cancelling = tokio::spawn(async move { cancelling.request_cancel(id).await });
        let ending = tokio::spawn(async move { ending.succeed(id, 1, artifacts(), None).await });
        let accepted = match cancelling.await.unwrap() {
            Ok(_) => true,
            Err(StoreError::Finished { .. }) => false,
            Err(other) => panic!("{other}"),
        };
        let state = ending.await.unwrap().unwrap();
        let expected = if accepted { JobState::Cancelled } else { JobState::Succeeded };
        assert_eq!((state, subject.get(id).await.state), (expected, expected));
        subject.events(id).await;
    }
}

async fn a_finished_job_cannot_be_cancelled(subject: &Subject) {
    let id = subject.running(3).await.job.id;
    subject.store.succeed(id, 1, artifacts(), None).await.unwrap();
    let before = subject.get(id).await;
    let refused = subject.store.request_cancel(id).await;
    assert!(matches!(refused, Err(StoreError::Finished { id: named }) if named == id));
    assert_eq!(subject.get(id).await, before);
}

async fn progress_belongs_to_its_attempt(subject: &Subject) {
    let id = subject.running(3).await.job.id;
    subject.store.progress(id, 1, json!({ "fraction": 0.9 })).await.unwrap();
    subject.clock.advance(LEASE);
    subject.store.reap().await.unwrap();
    let job = subject.get(id).await;
    assert_eq!((job.progress, job.started_at), (None, None));
    subject.claim().await.unwrap();
    subject.store.progress(id, 2, json!({ "fraction": 0.1 })).await.unwrap();
    assert_eq!(subject.get(id).await.progress, Some(json!({ "fraction": 0.1 })));
    let event = subject.events(id).await.pop().unwrap();
    assert_eq!(event.data, json!({ "attempt": 2, "progress": { "fraction": 0.1 } }));
}

async fn listings_go_from_new_to_old_in_parts(subject: &Subject) {
    let mut ids = Vec::new();
    for _ in 0..7 {
        ids.push(subject.enqueue(3).await.id);
    }
    ids.reverse();
    let other = NewJob::new(JobId::new(), "drawing", json!(null), 1);
    let other = subject.store.enqueue(other).await.unwrap();
    assert_eq!(subject.claim().await.unwrap().job.id, ids[6]);

    let mut query = ListQuery { kind: Some("test".to_owned()), limit: 3, ..ListQuery::default() };
    let (mut seen, mut sizes) = (Vec::new(), Vec::new());
    loop {
        let page = subject.store.list(&query).await.unwrap();
        sizes.push(page.jobs.len());
        seen.extend(page.jobs.iter().map(|job| job.id));
        match page.next {
            Some(next) => query.before = Some(next),
            None => break,
        }
    }
    assert_eq!((seen, sizes), (ids.clone(), vec![3, 3, 1]));

    let list = async |state, limit| {
        let query = ListQuery { state, limit, ..ListQuery::default() };
        let page = subject.store.list(&query).await.unwrap();
        (page.jobs.iter().map(|job| job.id).collect::<Vec<_>>(), page.next)
    };
    assert_eq!(list(Some(JobState::Running), 10).await, (vec![ids[6]], None));
    assert_eq!(list(Some(JobState::Succeeded), 10).await, (vec![], None));
    assert_eq!(list(None, 1).await, (vec![other.id], Some(other.id)));
    // A part that ends exactly with the last job says that it is the last.
    assert_eq!(list(None, 8).await.1, None);
    let mut all = subject.store.ids().await.unwrap();
    all.sort();
    all.reverse();
    assert_eq!(all[1..], ids);
}

async fn a_deleted_job_is_gone_with_its_events(subject: &Subject) {
    let running = subject.running(3).await.job.id;
    let refused = subject.store.delete(running).await;
    assert!(matches!(refused, Err(StoreError::Running { id }) if id == running));
    subject.store.succeed(running, 1, artifacts(), None).await.unwrap();
    let queued = subject.enqueue(3).await.id;
    for id in [running, queued] {
        subject.store.delete(id).await.unwrap();
        assert!(matches!(subject.store.get(id).await, Err(StoreError::NotFound(_))));
        assert!(matches!(subject.store.events(id, 0).await, Err(StoreError::NotFound(_))));
        assert!(matches!(subject.store.delete(id).await, Err(StoreError::NotFound(_))));
    }
    assert!(subject.claim().await.is_none());
    assert_eq!(subject.store.ids().await.unwrap(), []);
}

async fn jobs_are_found_by_what_people_say_of_them(subject: &Subject) {
    let labels = |pairs: &[(&str, &str)]| {
        pairs.iter().map(|(name, value)| (name.to_string(), value.to_string())).collect()
    };
    let tags = Tags { labels: labels(&[("show", "7"), ("shot", "ä")]), ..Tags::default() };
    let job = NewJob::new(JobId::new(), "test", json!(null), 1);
    let first = subject.store.enqueue(NewJob { tags: tags.clone(), ..job }).await.unwrap();
    assert_eq!(first.tags, tags);
    subject.clock.advance(Duration::from_secs(60));
    let second = subject.enqueue(1).await.id;
    let list = async |query: ListQuery| {
        let page = subject.store.list(&ListQuery { limit: 10, ..query }).await.unwrap();
        page.jobs.iter().map(|job| job.id).collect::<Vec<_>>()
    };
    let by = |pairs| ListQuery { labels: labels(pairs), ..ListQuery::default() };
    assert_eq!(list(by(&[("show", "7"), ("shot", "ä")])).await, [first.id]);
    for none in [[("show", "8")].as_slice(), &[("show", "7"), ("take", "1")], &[("%", "7")]] {
        assert_eq!(list(by(none)).await, []);
    }
    let named = Tags { name: Some("Ida".into()), labels: labels(&[("show", "8")]), ..tags };
    let tagged = subject.store.tag(second, &named).await.unwrap();
    assert_eq!((&tagged.tags, tagged.version), (&named, 2));
    assert_eq!(subject.kinds(second).await, [EventKind::Queued, EventKind::Tagged]);
    assert_eq!(list(by(&[("show", "8")])).await, [second]);
    let time = Some(subject.clock.now());
    let default = ListQuery::default;
    assert_eq!(list(ListQuery { created_from: time, ..default() }).await, [second]);
    assert_eq!(list(ListQuery { created_before: time, ..default() }).await, [first.id]);
}

async fn jobs_go_when_their_time_is_over(subject: &Subject) {
    let store = &subject.store;
    let hour = jiff::SignedDuration::from_hours(1);
    let mut ids = Vec::new();
    for pinned in [false, true, false] {
        let tags = Tags { expires_at: Some(subject.clock.now() + hour), pinned, ..Tags::default() };
        let job = NewJob::new(JobId::new(), "test", json!(null), 1);
        ids.push(store.enqueue(NewJob { tags, ..job }).await.unwrap().id);
    }
    for id in &ids[..2] {
        assert_eq!(subject.claim().await.unwrap().job.id, *id);
        store.succeed(*id, 1, artifacts(), None).await.unwrap();
    }
    assert_eq!(gone(store.expire().await), []);
    subject.clock.advance(Duration::from_secs(3600));
    // The one that waits still has not ended.
    assert_eq!(gone(store.expire().await), [ids[0]]);
    assert!(store.is_ownerless(ids[0], Duration::ZERO).await.unwrap());
    // One that runs goes when it has ended.
    assert!(!store.delete_when_ended(ids[1]).await.unwrap());
    let running = subject.claim().await.unwrap().job.id;
    assert_eq!(running, ids[2]);
    assert!(store.delete_when_ended(running).await.unwrap());
    assert_eq!(gone(store.expire().await), []);
    let beat = store.heartbeat(running, 1, LEASE).await.unwrap();
    assert_eq!(beat, Heartbeat::Held { cancel_requested: true });
    store.cancelled(running, 1).await.unwrap();
    assert_eq!(gone(store.expire().await), [running]);
    assert_eq!(store.ids().await.unwrap(), [ids[1]]);
}

async fn unknown_jobs_are_not_found(subject: &Subject) {
    let id = JobId::new();
    for result in subject.write_everything(id, 1).await {
        assert!(matches!(result, Err(StoreError::NotFound(named)) if named == id), "{result:?}");
    }
    assert!(matches!(subject.store.request_cancel(id).await, Err(StoreError::NotFound(_))));
    assert_eq!(subject.store.heartbeat(id, 1, LEASE).await.unwrap(), Heartbeat::Lost);
}

async fn names_are_taken_once(subject: &Subject) {
    let job = subject.enqueue(3).await;
    let again = NewJob::new(job.id, "other", json!(null), 1);
    assert!(matches!(subject.store.enqueue(again).await, Err(StoreError::Backend(_))));
    assert_eq!(subject.get(job.id).await, job);
    subject.events(job.id).await;
}

async fn changes_are_announced(subject: &Subject) {
    let mut changes = subject.store.changes();
    let id = subject.running(3).await.job.id;
    subject.store.request_cancel(id).await.unwrap();
    subject.store.cancelled(id, 1).await.unwrap();
    use EventKind::{CancelRequested, Cancelled, Queued, Started};
    for (version, kind) in (1..).zip([Queued, Started, CancelRequested, Cancelled]) {
        let change = changes.try_recv().unwrap();
        assert_eq!((change.id, change.kind, change.version), (id, kind, version));
    }
    assert!(changes.try_recv().is_err());
}

/// A page of the default tenant.
pub(crate) fn new_page(id: JobId, bytes: u64) -> NewPage {
    let (tenant, content) = (TenantName::default(), json!({ "figures": [] }));
    let (tags, idempotency) = (Tags::default(), None);
    NewPage { id, tenant, content, bytes, max_bytes: None, tags, idempotency }
}

async fn pages_change_one_version_at_a_time(subject: &Subject) {
    let (store, id) = (&subject.store, JobId::new());
    let added = store.add_page(new_page(id, 0)).await.unwrap();
    assert_eq!((added.version, added.created_at), (1, subject.clock.now()));
    assert_eq!(store.page(id).await.unwrap(), added);
    subject.clock.advance(Duration::from_secs(5));
    let changed = store.replace_page(id, 1, json!({ "figures": [1] }), 0).await.unwrap();
    assert_eq!((changed.version, changed.created_at), (2, added.created_at));
    assert_eq!(changed.changed_at, subject.clock.now());
    let late = store.replace_page(id, 1, json!({}), 0).await;
    assert!(matches!(late, Err(StoreError::Changed { version: 2, .. })), "{late:?}");
    assert_eq!(store.page(id).await.unwrap(), changed);
    // No job, and claimed by nobody.
    assert!(matches!(store.get(id).await, Err(StoreError::NotFound(_))));
    assert!(subject.claim().await.is_none());
    store.delete_page(id).await.unwrap();
    for gone in [store.page(id).await, store.replace_page(id, 2, json!({}), 0).await] {
        assert!(matches!(gone, Err(StoreError::NotFound(named)) if named == id), "{gone:?}");
    }
    assert!(matches!(store.delete_page(id).await, Err(StoreError::NotFound(_))));
}

async fn pages_are_found_by_what_is_said_of_them(subject: &Subject) {
    let store = &subject.store;
    let labels = |pairs: &[(&str, &str)]| -> BTreeMap<String, String> {
        pairs.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect()
    };
    let [first, second] = [JobId::new(), JobId::new()];
    let tags = Tags { labels: labels(&[("show", "7"), ("shot", "1")]), ..Tags::default() };
    store.add_page(NewPage { tags, ..new_page(first, 1) }).await.unwrap();
    let then = subject.clock.now();
    subject.clock.advance(Duration::from_secs(60));
    let tags = Tags { labels: labels(&[("show", "7")]), ..Tags::default() };
    let added = store.add_page(NewPage { tags, ..new_page(second, 1) }).await.unwrap();
    let newest = PageQuery::newest(TenantName::default(), 10);
    let listed = async |query: PageQuery| -> Vec<JobId> {
        store.pages(&query).await.unwrap().iter().map(|page| page.id).collect()
    };
    let of = |pairs| PageQuery { labels: labels(pairs), ..newest.clone() };
    assert_eq!(listed(of(&[("show", "7")])).await, [second, first]);
    assert_eq!(listed(of(&[("show", "7"), ("shot", "1")])).await, [first]);
    assert_eq!(listed(of(&[("shot", "7")])).await, []);
    let from = Some(subject.clock.now());
    assert_eq!(listed(PageQuery { created_from: from, ..newest.clone() }).await, [second]);
    assert_eq!(listed(PageQuery { created_before: from, ..newest.clone() }).await, [first]);

    let name = Some("Ida, turned".to_owned());
    let tags = Tags { name, expires_at: Some(then), pinned: true, ..Tags::default() };
    let changed = store.tag_page(second, &tags).await.unwrap();
    // Its files lie under its version, which stays.
    assert_eq!((changed.version, changed.tags_version, added.tags_version), (1, 1, 0));
    assert_eq!((&changed.tags, &store.page(second).await.unwrap()), (&tags, &changed));
    let content = store.replace_page(second, 1, json!({}), 0).await.unwrap();
    assert_eq!((content.version, content.tags_version, &content.tags), (2, 1, &tags));
    // It is pinned: neither its time nor want of room takes it.
    assert_eq!(gone(store.expire().await), []);
    assert_eq!(gone(store.make_room(0).await), [first]);
    store.tag_page(second, &Tags { pinned: false, ..tags.clone() }).await.unwrap();
    assert_eq!(gone(store.expire().await), [second]);
    let gone = store.tag_page(second, &tags).await;
    assert!(matches!(gone, Err(StoreError::NotFound(_))), "{gone:?}");
}

async fn pages_sent_again_are_stored_once(subject: &Subject) {
    let store = &subject.store;
    let given = |fingerprint: &str| {
        let (key, fingerprint) = ("k".to_owned(), fingerprint.to_owned());
        Some(Idempotency { key, fingerprint })
    };
    let id = JobId::new();
    store.add_page(NewPage { idempotency: given("a"), ..new_page(id, 5) }).await.unwrap();
    let again = NewPage { idempotency: given("a"), ..new_page(JobId::new(), 5) };
    assert_eq!(store.add_page(again).await.unwrap().id, id);
    let tenant = TenantName::default();
    let known = store.page_of_key(&tenant, &given("a").unwrap()).await.unwrap();
    assert_eq!(known.map(|page| page.id), Some(id));
    let other = NewPage { idempotency: given("b"), ..new_page(JobId::new(), 5) };
    assert!(matches!(store.add_page(other).await, Err(StoreError::OtherUpload(_))));
    // No job takes the key of a page.
    let job = NewJob::new(JobId::new(), "test", json!({}), 1);
    let job = store.enqueue(NewJob { idempotency: given("b"), ..job }).await;
    assert!(matches!(job, Err(StoreError::OtherUpload(_))), "{job:?}");
    assert_eq!(store.stored_bytes(None).await.unwrap(), 5);
    subject.clock.advance(Duration::from_secs(24 * 3600 + 1));
    let next = NewPage { idempotency: given("b"), ..new_page(JobId::new(), 5) };
    assert_ne!(store.add_page(next).await.unwrap().id, id);
}

async fn writers_at_the_same_time_leave_no_gap(subject: &Subject) {
    let id = subject.running(3).await.job.id;
    let writers: Vec<_> = (0..8)
        .map(|number| {
            let store = Arc::clone(&subject.store);
            tokio::spawn(async move {
                for step in 0..5 {
                    store.progress(id, 1, json!({ "by": number, "step": step })).await.unwrap();
                    store.heartbeat(id, 1, LEASE).await.unwrap();
                }
            })
        })
        .collect();
    for writer in writers {
        writer.await.unwrap();
    }
    assert_eq!(subject.events(id).await.len(), 2 + 8 * 5);
}

async fn secrets_of_the_service_are_made_once(subject: &Subject) {
    let secret = async |name| subject.access.secret(name).await.unwrap();
    let (links, other) = (secret("links").await, secret("other").await);
    assert_eq!((links.len(), links == other), (64, false));
    assert_eq!(secret("links").await, links);
}
