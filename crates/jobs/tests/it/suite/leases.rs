//! The part of the suite about leases, lost workers and attempts.

use super::*;

pub(super) async fn no_two_claimers_get_the_same_job(subject: &Subject) {
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

pub(super) async fn a_lease_lasts_as_long_as_it_is_renewed(subject: &Subject) {
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

pub(super) async fn a_worker_that_lost_its_lease_changes_nothing(subject: &Subject) {
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

pub(super) async fn attempts_are_used_up_by_silent_workers(subject: &Subject) {
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

pub(super) async fn attempts_are_used_up_by_breaking_ones(subject: &Subject) {
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

pub(super) async fn a_broken_attempt_pauses_before_the_next(subject: &Subject) {
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

pub(super) async fn trouble_of_the_machine_uses_no_attempts_for_an_hour(subject: &Subject) {
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

pub(super) async fn a_clock_that_is_set_changes_nothing(subject: &Subject) {
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

pub(super) async fn what_ran_when_the_machine_stopped_runs_again_at_once(subject: &Subject) {
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
