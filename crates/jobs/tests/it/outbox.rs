//! The part of the suite about messages that tell how jobs ended.

use std::time::Duration;

use jiff::Timestamp;
use jobs::{
    DeliveryAttempt, DeliveryState, Failure, JobId, JobState, NewJob, StoreError, TenantName,
};
use serde_json::json;

use crate::suite::{LEASE, Subject};

const OWN: &str = "https://own.example/hook";
const ALL: &str = "https://all.example/hook";
const MINUTE: Duration = Duration::from_secs(60);

fn attempt(error: Option<&str>) -> DeliveryAttempt {
    DeliveryAttempt {
        at: "2026-01-02T03:04:05Z".parse::<Timestamp>().unwrap(),
        duration: Duration::from_millis(12),
        status: Some(if error.is_some() { 500 } else { 204 }),
        error: error.map(str::to_owned),
    }
}

impl Subject {
    async fn enqueue_told(&self, webhook: Option<&str>) -> JobId {
        let job = NewJob::new(JobId::new(), "test", json!({}), 1);
        let webhook = webhook.map(str::to_owned);
        self.store.enqueue(NewJob { webhook, ..job }).await.unwrap().id
    }

    /// Where each message about the job goes, and what it says.
    async fn told(&self, job: JobId) -> Vec<(String, JobState)> {
        let deliveries = self.store.deliveries(job).await.unwrap();
        deliveries.into_iter().map(|(it, _)| (it.url, it.ended.state)).collect()
    }
}

/// However a job ends, one message is written with it.
pub(crate) async fn every_end_is_told_once(subject: &Subject) {
    let store = &subject.store;
    let tenant = TenantName::default();
    let untold = subject.enqueue_told(None).await;
    store.request_cancel(untold).await.unwrap();
    assert_eq!(subject.told(untold).await, []);

    store.set_webhook(&tenant, Some(ALL)).await.unwrap();
    assert_eq!(store.webhook(&tenant).await.unwrap().as_deref(), Some(ALL));
    let ended = async |webhook, state| {
        let id = subject.enqueue_told(webhook).await;
        let claim = store.claim("tester", LEASE).await.unwrap().unwrap();
        assert_eq!(subject.told(id).await, [], "told before its end");
        let failure = Failure { code: "bad".to_owned(), detail: "it is bad".to_owned() };
        let (attempt, end) = (claim.attempt, claim.job.id);
        assert_eq!(end, id);
        match state {
            JobState::Succeeded => store.succeed(id, attempt, Vec::new(), None).await.unwrap(),
            JobState::Failed => store.fail(id, attempt, failure).await.unwrap(),
            _ => {
                store.request_cancel(id).await.unwrap();
                // It succeeds, but that it is cancelled was promised.
                store.succeed(id, attempt, Vec::new(), None).await.unwrap()
            }
        };
        // A second ending is refused and tells nothing.
        assert!(store.cancelled(id, attempt).await.is_err());
        let url = webhook.unwrap_or(ALL).to_owned();
        assert_eq!(subject.told(id).await, [(url, state)]);
    };
    ended(None, JobState::Succeeded).await;
    ended(Some(OWN), JobState::Failed).await;
    ended(Some(OWN), JobState::Cancelled).await;
    let queued = subject.enqueue_told(None).await;
    store.request_cancel(queued).await.unwrap();
    assert_eq!(subject.told(queued).await, [(ALL.to_owned(), JobState::Cancelled)]);
    // A lost worker's job whose attempts are used up.
    let lost = subject.enqueue_told(None).await;
    store.claim("tester", LEASE).await.unwrap().unwrap();
    subject.clock.advance(LEASE);
    store.reap().await.unwrap();
    assert_eq!(subject.told(lost).await, [(ALL.to_owned(), JobState::Failed)]);
    let nobody: TenantName = "nobody".parse().unwrap();
    let missing = store.set_webhook(&nobody, None).await;
    assert!(matches!(missing, Err(StoreError::NoTenant(_))));
}

/// A message is sent until it is taken or given up, by one sender at a time,
/// also when a sender dies.
pub(crate) async fn messages_are_sent_until_they_are_taken(subject: &Subject) {
    let store = &subject.store;
    let claim = async || store.claim_delivery(MINUTE, &[]).await.unwrap();
    let refused = attempt(Some("the receiver answered 500"));
    let first = subject.enqueue_told(Some(OWN)).await;
    store.request_cancel(first).await.unwrap();
    assert_eq!(store.claim_delivery(MINUTE, &[TenantName::default()]).await.unwrap(), None);
    let one = claim().await.unwrap();
    assert_eq!((one.ended.job, one.tries), (first, 1));
    assert_eq!(claim().await, None, "two senders have it");
    // Its sender died.
    subject.clock.advance(MINUTE);
    assert_eq!(claim().await.unwrap().tries, 2);
    store.attempted(one.id, &refused, Some(2 * MINUTE)).await.unwrap();
    assert_eq!(claim().await, None, "sent before its pause was over");
    // A new one goes before those that were refused.
    subject.clock.advance(2 * MINUTE);
    let second = subject.enqueue_told(Some(ALL)).await;
    store.request_cancel(second).await.unwrap();
    let two = claim().await.unwrap();
    assert_eq!(two.ended.job, second);
    store.attempted(two.id, &attempt(None), None).await.unwrap();
    assert_eq!(claim().await.unwrap().tries, 3);
    store.attempted(one.id, &refused, None).await.unwrap();
    subject.clock.advance(1000 * MINUTE);
    assert_eq!(claim().await, None);
    let log = store.deliveries(first).await.unwrap();
    assert_eq!((log[0].0.state, log[0].1.len()), (DeliveryState::GivenUp, 2));
    assert_eq!(log[0].1[0], refused);

    // By hand, as often as one likes; but a message of another job is none of it.
    assert!(!store.redeliver(second, one.id).await.unwrap());
    assert!(store.redeliver(first, one.id).await.unwrap());
    let again = claim().await.unwrap();
    assert_eq!((again.id, again.tries), (one.id, 1));
    store.attempted(one.id, &attempt(None), None).await.unwrap();
    let log = store.deliveries(first).await.unwrap();
    assert_eq!((log[0].0.state, log[0].1.len()), (DeliveryState::Delivered, 3));

    // What is told goes with its job; what is not, stays until it is.
    store.delete(first).await.unwrap();
    assert_eq!(store.deliveries(first).await.unwrap(), []);
    store.redeliver(second, two.id).await.unwrap();
    store.delete(second).await.unwrap();
    let late = claim().await.unwrap();
    assert_eq!(late.ended.job, second);
    store.attempted(late.id, &attempt(None), None).await.unwrap();
    assert_eq!(store.deliveries(second).await.unwrap(), []);
}

/// A new secret is used at once, the one before for a while besides.
pub(crate) async fn secrets_overlap(subject: &Subject) {
    let (store, tenant) = (&subject.store, TenantName::default());
    let secrets = async || store.webhook_secrets(&tenant).await.unwrap();
    assert!(secrets().await.is_empty());
    for secret in ["one", "two", "three"] {
        store.add_webhook_secret(&tenant, secret, MINUTE).await.unwrap();
    }
    assert_eq!(secrets().await, ["three", "two"]);
    subject.clock.advance(MINUTE);
    assert_eq!(secrets().await, ["three"]);
}
