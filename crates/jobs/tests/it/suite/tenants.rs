//! The part of the suite about tenants and keys.

use super::*;

impl Subject {
    async fn enqueue_for(&self, tenant: &TenantName, priority: i32) -> JobId {
        let job = NewJob::new(JobId::new(), "test", json!(null), 1);
        let job = NewJob { tenant: tenant.clone(), priority, ..job };
        self.store.enqueue(job).await.unwrap().id
    }
}

pub(super) async fn only_so_many_jobs_of_a_tenant_wait(subject: &Subject) {
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

pub(super) async fn tenants_are_served_in_turn(subject: &Subject) {
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

pub(super) async fn a_tenant_s_jobs_are_its_own(subject: &Subject) {
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

pub(super) async fn keys_are_known_until_they_are_revoked(subject: &Subject) {
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

pub(super) async fn without_its_keys_it_stays_closed_until_it_is_opened(subject: &Subject) {
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

pub(super) async fn secrets_of_the_service_are_made_once(subject: &Subject) {
    let secret = async |name| subject.access.secret(name).await.unwrap();
    let (links, other) = (secret("links").await, secret("other").await);
    assert_eq!((links.len(), links == other), (64, false));
    assert_eq!(secret("links").await, links);
}
