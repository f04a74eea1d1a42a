//! The part of the suite about the life of a job: its states, attempts and events.

use super::*;

pub(super) async fn a_job_goes_from_queued_to_succeeded(subject: &Subject) {
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

pub(super) async fn the_oldest_queued_job_is_claimed_first(subject: &Subject) {
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

pub(super) async fn a_released_attempt_is_given_back_but_not_its_number(subject: &Subject) {
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

pub(super) async fn failing_is_final(subject: &Subject) {
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

pub(super) async fn progress_belongs_to_its_attempt(subject: &Subject) {
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

pub(super) async fn unknown_jobs_are_not_found(subject: &Subject) {
    let id = JobId::new();
    for result in subject.write_everything(id, 1).await {
        assert!(matches!(result, Err(StoreError::NotFound(named)) if named == id), "{result:?}");
    }
    assert!(matches!(subject.store.request_cancel(id).await, Err(StoreError::NotFound(_))));
    assert_eq!(subject.store.heartbeat(id, 1, LEASE).await.unwrap(), Heartbeat::Lost);
}

pub(super) async fn names_are_taken_once(subject: &Subject) {
    let job = subject.enqueue(3).await;
    let again = NewJob::new(job.id, "other", json!(null), 1);
    assert!(matches!(subject.store.enqueue(again).await, Err(StoreError::Backend(_))));
    assert_eq!(subject.get(job.id).await, job);
    subject.events(job.id).await;
}

pub(super) async fn changes_are_announced(subject: &Subject) {
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

pub(super) async fn writers_at_the_same_time_leave_no_gap(subject: &Subject) {
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
