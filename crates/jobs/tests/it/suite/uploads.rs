//! The part of the suite about uploads that come again, and what is left of those that end.

use super::*;

fn keyed(key: &str, fingerprint: &str) -> NewJob {
    let given = Idempotency { key: key.to_owned(), fingerprint: fingerprint.to_owned() };
    let job = NewJob::new(JobId::new(), "test", json!(null), 1);
    NewJob { idempotency: Some(given), ..job }
}

pub(super) async fn an_upload_that_is_sent_again_is_one_job(subject: &Subject) {
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

pub(super) async fn a_result_is_found_by_its_key_and_answers_others(subject: &Subject) {
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

pub(super) async fn bytes_are_ownerless_before_a_job_and_after_it(subject: &Subject) {
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
