//! The part of the suite about lists, labels and time to stay.

use super::*;

pub(super) async fn listings_go_from_new_to_old_in_parts(subject: &Subject) {
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

pub(super) async fn a_deleted_job_is_gone_with_its_events(subject: &Subject) {
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

pub(super) async fn jobs_are_found_by_what_people_say_of_them(subject: &Subject) {
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

pub(super) async fn jobs_go_when_their_time_is_over(subject: &Subject) {
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
