//! The part of the suite about cancellation.

use super::*;

pub(super) async fn a_queued_job_is_cancelled_at_once(subject: &Subject) {
    let id = subject.enqueue(3).await.id;
    let job = subject.store.request_cancel(id).await.unwrap();
    assert_eq!(job.state, JobState::Cancelled);
    assert_eq!(job.finished_at, Some(subject.clock.now()));
    assert!(subject.claim().await.is_none());
    assert_eq!(subject.kinds(id).await, [EventKind::Queued, EventKind::Cancelled]);
}

pub(super) async fn a_running_job_is_cancelled_when_its_worker_sees_it(subject: &Subject) {
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

pub(super) async fn an_accepted_cancellation_wins_over_every_ending(subject: &Subject) {
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

pub(super) async fn cancelling_races_with_succeeding(subject: &Subject) {
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

pub(super) async fn a_finished_job_cannot_be_cancelled(subject: &Subject) {
    let id = subject.running(3).await.job.id;
    subject.store.succeed(id, 1, artifacts(), None).await.unwrap();
    let before = subject.get(id).await;
    let refused = subject.store.request_cancel(id).await;
    assert!(matches!(refused, Err(StoreError::Finished { id: named }) if named == id));
    assert_eq!(subject.get(id).await, before);
}
