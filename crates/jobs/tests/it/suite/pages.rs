//! The part of the suite about pages of drawings.

use super::*;

/// A page of the default tenant.
pub(crate) fn new_page(id: JobId, bytes: u64) -> NewPage {
    let (tenant, content) = (TenantName::default(), json!({ "figures": [] }));
    let (tags, idempotency) = (Tags::default(), None);
    NewPage { id, tenant, content, bytes, max_bytes: None, tags, idempotency }
}

pub(super) async fn pages_change_one_version_at_a_time(subject: &Subject) {
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

pub(super) async fn pages_are_found_by_what_is_said_of_them(subject: &Subject) {
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

pub(super) async fn pages_sent_again_are_stored_once(subject: &Subject) {
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
