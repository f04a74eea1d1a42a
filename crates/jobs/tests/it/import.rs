//! An embedded service that becomes a farm.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use jobs::bytes::{ByteStore, BytesOf, Key};
use jobs::{
    AccessStore, ArtifactEntry, DeliveryAttempt, DeliveryState, Failure, Idempotency, ImportError,
    Imported, Job, JobId, JobState, JobStore, KeyText, NewJob, NewKey, NewPage, PageStore,
    PostgresOptions, PostgresStore, Scope, SqliteStore, SystemClock, Tags, TenantLimits,
    TenantName, WebhookStore,
};
use serde_json::json;
use sha2::{Digest, Sha256};
use tempfile::TempDir;
use testbed::{BUCKET, Durability, Postgres, S3};

use crate::LEASE;

const MINUTE: Duration = Duration::from_secs(60);
const HOUR: Duration = Duration::from_secs(3600);

fn show() -> TenantName {
    "show-7".parse().unwrap()
}

/// More than what is sent at once.
fn large() -> Vec<u8> {
    (0..9_000_000u32).map(|i| (i % 251) as u8).collect()
}

/// A service on one machine that has some of everything.
struct Embedded {
    folder: TempDir,
    store: SqliteStore,
    bytes: ByteStore,
    key: KeyText,
    /// Succeeded, was cancelled, runs, and waits for an hour, by arrival.
    jobs: [JobId; 4],
    page: JobId,
}

impl Embedded {
    async fn start() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("jobs.sqlite");
        let store = SqliteStore::open(&path, Arc::new(SystemClock)).await.unwrap();
        let bytes = ByteStore::local(&folder.path().join("bytes")).unwrap();
        let (key, revoked) = (KeyText::generate(), KeyText::generate());
        store.create_tenant(&show()).await.unwrap();
        let limits = TenantLimits { max_running: Some(3), ..TenantLimits::default() };
        store.limit_tenant(&show(), &limits).await.unwrap();
        for (text, scope) in [(&key, Scope::Write), (&revoked, Scope::Admin)] {
            let key = NewKey { tenant: show(), label: "Ä".to_owned(), scope };
            store.add_key(&key, text).await.unwrap();
        }
        store.revoke_key(revoked.id()).await.unwrap();
        store.secret("links").await.unwrap();
        store.set_webhook(&show(), Some("https://show.example/hook")).await.unwrap();
        store.add_webhook_secret(&show(), "whsec_b2xk", Duration::ZERO).await.unwrap();
        let this = Self { folder, store, bytes, key, jobs: Self::names(), page: JobId::new() };
        this.fill().await;
        this
    }

    /// By arrival, which is not by name; the bytes of two lie below their tenant's prefix.
    fn names() -> [JobId; 4] {
        let [one, two] = [JobId::new(), JobId::new_by_tenant()];
        let [three, four] = [JobId::new(), JobId::new_by_tenant()];
        [four, three, two, one]
    }

    async fn fill(&self) {
        let store = &self.store;
        let [done, cancelled, running, waiting] = self.jobs;
        self.enqueue(done).await;
        let claim = store.claim("tester", LEASE).await.unwrap().unwrap();
        store.progress(done, claim.attempt, json!({ "fraction": 0.5 })).await.unwrap();
        let contents = [("views/0/odd #1%2F.png", b"picture".to_vec()), ("solid.glb", large())];
        let mut entries = Vec::new();
        for (name, content) in contents {
            let key = Key::Artifact { job: done, attempt: claim.attempt, name };
            self.of(done).put(&key, content.clone().into()).await.unwrap();
            entries.push(ArtifactEntry {
                name: name.to_owned(),
                media_type: "image/png".to_owned(),
                bytes: content.len() as u64,
                sha256: hex::encode(Sha256::digest(&content)),
            });
        }
        store.succeed(done, claim.attempt, entries, Some(json!({ "quads": 7 }))).await.unwrap();
        let told = store.claim_delivery(HOUR, &[]).await.unwrap().unwrap();
        let tried = DeliveryAttempt {
            at: "2026-01-02T03:04:05Z".parse().unwrap(),
            duration: Duration::from_millis(12),
            status: Some(500),
            error: Some("the receiver answered 500".to_owned()),
        };
        store.attempted(told.id, &tried, Some(HOUR)).await.unwrap();
        self.enqueue(cancelled).await;
        store.request_cancel(cancelled).await.unwrap();
        self.enqueue(running).await;
        store.claim("tester", HOUR).await.unwrap().unwrap();
        self.enqueue(waiting).await;
        let claim = store.claim("tester", LEASE).await.unwrap().unwrap();
        let failure = Failure { code: "x".to_owned(), detail: "y".to_owned() };
        store.retry(waiting, claim.attempt, failure, HOUR).await.unwrap();
        let (tags, idempotency) = (self.tags(), None);
        let (content, tenant) = (json!({ "figures": [] }), show());
        let page = NewPage {
            id: self.page,
            tenant,
            content,
            bytes: 4,
            max_bytes: None,
            tags,
            idempotency,
        };
        store.add_page(page).await.unwrap();
        let key = Key::Input { job: self.page, name: "1/page.png" };
        self.of(self.page).put(&key, Bytes::from_static(b"page")).await.unwrap();
        // Of an upload that came to nothing: it is left behind.
        let lost = JobId::new();
        store.expect_bytes(lost).await.unwrap();
        let key = Key::Input { job: lost, name: "front.png" };
        self.bytes.put(&key, Bytes::from_static(b"lost")).await.unwrap();
    }

    fn tags(&self) -> Tags {
        let labels = [("shot".to_owned(), "12".to_owned())].into();
        Tags { name: Some("Zeichnung „Ä“".to_owned()), labels, expires_at: None, pinned: true }
    }

    fn idempotency(id: JobId) -> Idempotency {
        Idempotency { key: id.to_string(), fingerprint: "f".to_owned() }
    }

    async fn enqueue(&self, id: JobId) {
        let key = Key::Input { job: id, name: "views/0.png" };
        self.of(id).put(&key, Bytes::from_static(b"drawing")).await.unwrap();
        let job = NewJob::new(id, "test", json!({ "views": [0, 22.5] }), 3);
        let (idempotency, result_key) = (Some(Self::idempotency(id)), Some("hash".to_owned()));
        let (tenant, tags, bytes) = (show(), self.tags(), 7);
        let job = NewJob { tenant, tags, bytes, idempotency, result_key, ..job };
        self.store.enqueue(job).await.unwrap();
    }

    fn of(&self, id: JobId) -> ByteStore {
        self.bytes.of(&id.home(&show()))
    }

    fn file(&self) -> PathBuf {
        self.folder.path().join("jobs.sqlite")
    }

    /// Where an artifact of the job that succeeded is.
    fn artifact(&self) -> PathBuf {
        let key = Key::Artifact { job: self.jobs[0], attempt: 1, name: "solid.glb" };
        let home = match self.jobs[0].home(&show()) {
            jobs::bytes::Home::Shared => "bytes".to_owned(),
            jobs::bytes::Home::Tenant(name) => format!("bytes/tenants/{name}"),
        };
        self.folder.path().join(home).join(key.path().unwrap().as_ref())
    }

    async fn import(&self, into: &Farm) -> Result<Imported, ImportError> {
        into.store.import(&self.file(), &self.bytes, &into.bytes, |_, _| ()).await
    }
}

struct Farm {
    _postgres: Postgres,
    _s3: S3,
    store: PostgresStore,
    bytes: ByteStore,
}

impl Farm {
    async fn start() -> Self {
        let (postgres, s3) = (Postgres::start(Durability::None), S3::start());
        let url = postgres.database();
        let store = PostgresStore::open(&url, &PostgresOptions::default()).await.unwrap();
        let bytes = ByteStore::s3(&format!("s3://{BUCKET}/farm"), s3.environment()).unwrap();
        Self { _postgres: postgres, _s3: s3, store, bytes }
    }
}

/// All that can be asked of a store, as it is told.
async fn told<S: JobStore + AccessStore>(store: &S, of: &Embedded) -> Vec<String> {
    let mut all = vec![
        format!("{:?}", store.tenants().await.unwrap()),
        format!("{:?}", store.tenant(&show()).await.unwrap()),
        format!("{:?}", store.keys().await.unwrap()),
        format!("{:?}", store.authenticate(&of.key).await.unwrap().unwrap()),
        store.secret("links").await.unwrap(),
        format!("{:?}", store.webhook(&show()).await.unwrap()),
        format!("{:?}", store.webhook_secrets(&show()).await.unwrap()),
        format!("{:?}", store.page(of.page).await.unwrap()),
        format!("{:?}", store.counts().await.unwrap()),
        format!("{:?}", store.stored_bytes(Some(&show())).await.unwrap()),
        format!("{:?}", store.with_result(&show(), "test", "hash").await.unwrap()),
        store.is_closed().await.unwrap().to_string(),
    ];
    for id in of.jobs {
        all.push(format!("{:?}", store.get(id).await.unwrap()));
        all.push(format!("{:?}", store.events(id, 0).await.unwrap()));
        all.push(format!("{:?}", store.deliveries(id).await.unwrap()));
        let known = store.enqueued(&show(), &Embedded::idempotency(id)).await.unwrap();
        all.push(format!("{:?}", known.map(|job: Job| job.id)));
    }
    all
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn everything_is_in_the_farm_as_it_was() {
    let (old, farm) = (Embedded::start().await, Farm::start().await);
    let before = told(&old.store, &old).await;
    old.store.close().await;
    let imported = old.import(&farm).await.unwrap();
    // Inputs of four jobs, two artifacts, the page's file.
    let bytes = 4 * 7 + 7 + 9_000_000 + 4;
    assert_eq!(imported, Imported { jobs: 5, files: 7, found: 0, bytes });
    assert_eq!(told(&farm.store, &old).await, before);
    let mut owners: Vec<_> = old.jobs.into_iter().chain([old.page]).collect();
    owners.sort();
    let mut found: Vec<_> =
        farm.bytes.all().await.unwrap().into_iter().map(|BytesOf { id, .. }| id).collect();
    found.sort();
    assert_eq!(found, owners, "bytes of others, or not all");
    let [done, cancelled, running, waiting] = old.jobs;
    for artifact in farm.store.get(done).await.unwrap().artifacts {
        let key = Key::Artifact { job: done, attempt: 1, name: &artifact.name };
        let bytes = farm.bytes.of(&done.home(&show())).get(&key).await.unwrap();
        assert_eq!(hex::encode(Sha256::digest(&bytes)), artifact.sha256, "{}", artifact.name);
    }
    // It goes on: what ran is another one's, what waited need not, and is told at once.
    for id in [cancelled, done] {
        let delivery = farm.store.claim_delivery(HOUR, &[]).await.unwrap().unwrap();
        assert_eq!((delivery.ended.job, delivery.state), (id, DeliveryState::Pending));
    }
    // The database was just started, which gives workers time to renew their leases.
    let begun = Instant::now();
    while farm.store.reap().await.unwrap() == 0 {
        assert!(begun.elapsed() < MINUTE, "the lost worker's job is left");
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
    for id in [running, waiting] {
        let claim = farm.store.claim("tester", LEASE).await.unwrap().unwrap();
        assert_eq!((claim.job.id, claim.attempt), (id, 2), "not by arrival");
    }
    let again = old.import(&farm).await;
    assert!(matches!(again, Err(ImportError::NotEmpty("tenants"))), "{again:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_is_in_use_or_damaged_is_not_imported_and_a_second_try_goes_on() {
    let (old, farm) = (Embedded::start().await, Farm::start().await);
    let in_use = old.import(&farm).await;
    assert!(matches!(in_use, Err(ImportError::InUse(_))), "{in_use:?}");
    assert_eq!(old.store.get(old.jobs[2]).await.unwrap().state, JobState::Running);
    old.store.close().await;
    let whole = std::fs::read(old.artifact()).unwrap();
    for damaged in [Some([&whole[1..], &whole[..1]].concat()), None] {
        match damaged {
            Some(bytes) => std::fs::write(old.artifact(), bytes).unwrap(),
            None => std::fs::remove_file(old.artifact()).unwrap(),
        }
        let refused = old.import(&farm).await.unwrap_err();
        assert!(matches!(refused, ImportError::Artifact { .. }), "{refused}");
        assert_eq!(farm.store.ids().await.unwrap(), []);
        assert!(farm.store.tenant(&show()).await.is_err());
    }
    // The wrong one is in the bucket: it has the right size.
    std::fs::write(old.artifact(), &whole).unwrap();
    let imported = old.import(&farm).await.unwrap();
    assert!((1..7).contains(&imported.found), "{imported:?}");
    let key = Key::Artifact { job: old.jobs[0], attempt: 1, name: "solid.glb" };
    let copied = farm.bytes.of(&old.jobs[0].home(&show())).get(&key).await.unwrap();
    assert_eq!(copied, whole);
    // A node that uses the database keeps another service out of it.
    let other = Embedded::start().await;
    other.store.close().await;
    assert!(matches!(other.import(&farm).await, Err(ImportError::NotEmpty(_))));
}
