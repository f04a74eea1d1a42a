//! The part of the suite about stored bytes.

use std::time::Duration;

use jiff::SignedDuration;
use jobs::bytes::{BytesOf, Home};
use jobs::{ArtifactEntry, Clock, JobId, NewJob, NewPage, PageQuery, StoreError, Tags, TenantName};
use serde_json::json;

use crate::gone;
use crate::suite::{LEASE, Subject, new_page};

impl Subject {
    /// A job that has ended, of 10 bytes sent and 90 made.
    async fn ended(&self, pinned: bool) -> JobId {
        let tags = Tags { pinned, ..Tags::default() };
        let job = NewJob::new(JobId::new(), "test", json!({}), 1);
        let id = self.store.enqueue(NewJob { bytes: 10, tags, ..job }).await.unwrap().id;
        let claim = self.store.claim("tester", LEASE).await.unwrap().unwrap();
        let (name, media_type) = ("a".to_owned(), "text/plain".to_owned());
        let made = ArtifactEntry { name, media_type, bytes: 90, sha256: String::new() };
        self.store.succeed(id, claim.attempt, vec![made], None).await.unwrap();
        id
    }

    async fn stored(&self) -> u64 {
        self.store.stored_bytes(None).await.unwrap()
    }
}

/// Where bytes lie is known until they are to be deleted.
pub(crate) async fn homes_are_told_with_what_is_forgotten(subject: &Subject) {
    let store = &subject.store;
    let name: TenantName = "show-7".parse().unwrap();
    subject.access.create_tenant(&name).await.unwrap();
    let own = Home::Tenant(name.clone());
    let of = |id, home: &Home| BytesOf { id, home: home.clone() };
    let job = |tenant: &TenantName, by_tenant| {
        let (id, tenant) =
            (if by_tenant { JobId::new_by_tenant() } else { JobId::new() }, tenant.clone());
        NewJob { tenant, ..NewJob::new(id, "test", json!({}), 1) }
    };
    let ended = async |tenant: &TenantName, by_tenant| {
        let job = store.enqueue(job(tenant, by_tenant)).await.unwrap();
        assert_eq!(store.get(job.id).await.unwrap(), job);
        store.request_cancel(job.id).await.unwrap();
        assert_eq!(store.get(job.id).await.unwrap().home(), job.home());
        job
    };
    let shared = ended(&name, false).await;
    let first = ended(&name, true).await;
    assert_eq!((shared.home(), first.home()), (Home::Shared, own.clone()));
    let page = NewPage { tenant: name.clone(), ..new_page(JobId::new_by_tenant(), 7) };
    let page = store.add_page(page).await.unwrap();
    assert_eq!(store.page(page.id).await.unwrap().home(), own);
    let forgotten = store.make_room(0).await.unwrap();
    let expected = [of(shared.id, &Home::Shared), of(first.id, &own), of(page.id, &own)];
    // Those of the same moment go by their names.
    assert_eq!(forgotten, expected);
    // As one that was to be deleted when it ends.
    let running = store.enqueue(job(&name, true)).await.unwrap();
    let claim = store.claim("tester", LEASE).await.unwrap().unwrap();
    assert_eq!(claim.job.home(), own);
    assert!(store.delete_when_ended(running.id).await.unwrap());
    store.cancelled(running.id, claim.attempt).await.unwrap();
    assert_eq!(store.expire().await.unwrap(), [of(running.id, &own)]);
    // And with its tenant.
    let last = store.enqueue(job(&name, true)).await.unwrap();
    assert_eq!(subject.access.delete_tenant(&name).await.unwrap(), [of(last.id, &own)]);
}

pub(crate) async fn stored_bytes_are_counted_and_bounded(subject: &Subject) {
    let store = &subject.store;
    let other: TenantName = "other".parse().unwrap();
    subject.access.create_tenant(&other).await.unwrap();
    assert_eq!(subject.stored().await, 0);
    let job = subject.ended(false).await;
    assert_eq!(subject.stored().await, 100);
    let page = JobId::new();
    store.add_page(new_page(page, 30)).await.unwrap();
    store.replace_page(page, 1, json!({}), 50).await.unwrap();
    let own = store.stored_bytes(Some(&TenantName::default())).await.unwrap();
    assert_eq!((own, store.stored_bytes(Some(&other)).await.unwrap()), (150, 0));

    let new = |tenant: &TenantName, bytes| {
        let job = NewJob::new(JobId::new(), "test", json!({}), 1);
        NewJob { tenant: tenant.clone(), bytes, max_bytes: Some(160), ..job }
    };
    let over = store.enqueue(new(&TenantName::default(), 11)).await;
    assert!(matches!(over, Err(StoreError::TooManyBytes { most: 160, .. })), "{over:?}");
    let over = NewPage { max_bytes: Some(160), ..new_page(JobId::new(), 11) };
    let over = store.add_page(over).await;
    assert!(matches!(over, Err(StoreError::TooManyBytes { most: 160, .. })), "{over:?}");
    store.enqueue(new(&TenantName::default(), 10)).await.unwrap();
    // What others store is not held against it.
    store.enqueue(new(&other, 160)).await.unwrap();
    assert_eq!(subject.stored().await, 320);
    store.delete(job).await.unwrap();
    assert_eq!(subject.stored().await, 220);
    assert_eq!(store.unmeasured().await.unwrap(), []);
}

pub(crate) async fn pages_go_when_their_time_is_over(subject: &Subject) {
    let store = &subject.store;
    let hour = subject.clock.now() + SignedDuration::from_hours(1);
    let [short, long] = [JobId::new(), JobId::new()];
    let tags = Tags { expires_at: Some(hour), ..Tags::default() };
    store.add_page(NewPage { tags, ..new_page(short, 1) }).await.unwrap();
    store.add_page(new_page(long, 1)).await.unwrap();
    let listed = async |before, limit| -> Vec<JobId> {
        let newest = PageQuery::newest(TenantName::default(), limit);
        let pages = store.pages(&PageQuery { before, ..newest }).await.unwrap();
        pages.into_iter().map(|page| page.id).collect()
    };
    assert_eq!(listed(None, 10).await, [long, short]);
    assert_eq!(listed(None, 1).await, [long]);
    assert_eq!(listed(Some(long), 10).await, [short]);
    assert_eq!(gone(store.expire().await), []);
    subject.clock.advance(Duration::from_secs(3600));
    assert_eq!(gone(store.expire().await), [short]);
    assert!(store.is_ownerless(short, Duration::ZERO).await.unwrap());
    assert_eq!(listed(None, 10).await, [long]);
}

pub(crate) async fn room_is_made_of_the_oldest(subject: &Subject) {
    let store = &subject.store;
    let second = Duration::from_secs(1);
    let pinned = subject.ended(true).await;
    subject.clock.advance(second);
    let first = subject.ended(false).await;
    subject.clock.advance(second);
    let page = JobId::new();
    store.add_page(new_page(page, 100)).await.unwrap();
    subject.clock.advance(second);
    let last = subject.ended(false).await;
    let waiting = NewJob::new(JobId::new(), "test", json!({}), 1);
    let waiting = store.enqueue(NewJob { bytes: 100, ..waiting }).await.unwrap().id;
    assert_eq!(gone(store.make_room(500).await), []);
    assert_eq!(gone(store.make_room(399).await), [first, page]);
    assert!(store.is_ownerless(first, Duration::ZERO).await.unwrap());
    // What waits and what is pinned stays, however much there is.
    assert_eq!(gone(store.make_room(0).await), [last]);
    assert_eq!(subject.stored().await, 200);
    for stays in [pinned, waiting] {
        store.get(stays).await.unwrap();
    }
}
