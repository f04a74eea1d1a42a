//! The suites of job store and byte store, run over every implementation, and
//! what only the SQLite store must show.

mod bytes;
mod import;
mod outbox;
mod postgres;
mod storage;
mod suite;
mod upgrade;

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use jiff::Timestamp;
use jobs::bytes::BytesOf;
use jobs::{
    Clock, JobId, JobState, JobStore, ListQuery, ManualClock, NewJob, SqliteStore, StoreError,
    SystemClock,
};
use serde_json::json;
use suite::Subject;

const LEASE: Duration = Duration::from_secs(30);

fn clock() -> Arc<ManualClock> {
    Arc::new(ManualClock::new("2026-01-02T03:04:05.678Z".parse::<Timestamp>().unwrap()))
}

async fn open(path: &Path, clock: &Arc<ManualClock>) -> SqliteStore {
    SqliteStore::open(path, Arc::clone(clock) as Arc<dyn Clock>).await.unwrap()
}

/// The names of what was forgotten.
fn gone(forgotten: Result<Vec<BytesOf>, StoreError>) -> Vec<JobId> {
    forgotten.unwrap().into_iter().map(|of| of.id).collect()
}

fn new_job() -> NewJob {
    NewJob::new(JobId::new(), "test", json!({}), 3)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn sqlite_passes_the_suite() {
    let folder = tempfile::tempdir().unwrap();
    suite::run(async || {
        let clock = clock();
        let path = folder.path().join(format!("{}.sqlite", JobId::new()));
        let store = Arc::new(open(&path, &clock).await);
        Subject { store: store.clone(), access: store, clock }
    })
    .await;
}

#[tokio::test]
async fn what_is_stored_survives_closing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("jobs.sqlite");
    let clock = clock();
    let store = open(&path, &clock).await;
    let queued = store.enqueue(new_job()).await.unwrap();
    let claim = store.claim("tester", LEASE).await.unwrap().unwrap();
    store.close().await;
    let store = open(&path, &clock).await;
    assert_eq!(store.get(queued.id).await.unwrap(), claim.job);
    store.succeed(queued.id, claim.attempt, Vec::new(), None).await.unwrap();
    assert_eq!(store.get(queued.id).await.unwrap().state, JobState::Succeeded);
}

/// Enqueues, claims and ends jobs while other stores do the same.
async fn work_through(store: Arc<dyn JobStore>) {
    for _ in 0..5 {
        store.enqueue(new_job()).await.unwrap();
        let Some(claim) = store.claim("tester", LEASE).await.unwrap() else { continue };
        store.succeed(claim.job.id, claim.attempt, Vec::new(), None).await.unwrap();
    }
}

/// Separate stores over one file stand for separate processes.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn processes_can_share_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("jobs.sqlite");
    let opening: Vec<_> = (0..4)
        .map(|_| {
            let path = path.clone();
            tokio::spawn(async move { SqliteStore::open(&path, Arc::new(SystemClock)).await })
        })
        .collect();
    let mut stores = Vec::new();
    for store in opening {
        stores.push(Arc::new(store.await.unwrap().unwrap()));
    }
    share_the_work(&stores).await;
}

/// Works through all stores over one database at once: each job ends once.
async fn share_the_work<S: JobStore + 'static>(stores: &[Arc<S>]) {
    let working: Vec<_> =
        stores.iter().map(|store| tokio::spawn(work_through(store.clone()))).collect();
    for work in working {
        work.await.unwrap();
    }
    let store = &stores[0];
    while let Some(claim) = store.claim("tester", LEASE).await.unwrap() {
        store.succeed(claim.job.id, claim.attempt, Vec::new(), None).await.unwrap();
    }
    let ids = store.ids().await.unwrap();
    assert_eq!(ids.len(), 20);
    for id in ids {
        let job = store.get(id).await.unwrap();
        assert_eq!((job.state, job.attempt, job.version), (JobState::Succeeded, 1, 3));
    }
}

/// What was read stays right for as long as the revision is the same: every commit changes it,
/// also one of another process, and nothing else does.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_revision_tells_of_every_commit_by_whomever() {
    use sqlx::Connection;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("jobs.sqlite");
    let (store, other) = (open(&path, &clock()).await, open(&path, &clock()).await);
    let empty = store.revision().unwrap();
    let job = store.enqueue(new_job()).await.unwrap();
    let own = store.revision().unwrap();
    assert_ne!(own, empty, "a commit of its own");
    assert_eq!(store.get(job.id).await.unwrap(), job);
    let url = format!("sqlite://{}", path.display());
    let mut writing = sqlx::SqliteConnection::connect(&url).await.unwrap();
    let mut transaction = writing.begin_with("BEGIN IMMEDIATE").await.unwrap();
    sqlx::query("UPDATE jobs SET priority = 7").execute(&mut *transaction).await.unwrap();
    assert_eq!(store.revision(), Some(own), "nothing was committed");
    transaction.commit().await.unwrap();
    let raw = store.revision().unwrap();
    assert_ne!(raw, own, "a commit of a bare connection");
    assert_eq!(store.get(job.id).await.unwrap().priority, 7);
    other.request_cancel(job.id).await.unwrap();
    let cancelled = store.revision().unwrap();
    assert_ne!(cancelled, raw, "a commit of another store");
    assert_eq!(store.get(job.id).await.unwrap().state, JobState::Cancelled);
    assert_eq!(store.revision(), Some(cancelled), "reading commits nothing");
    store.close().await;
    assert_eq!(store.revision(), None, "it is closed");
}

/// A write that takes long, here one that another process holds open, must not
/// keep a status request waiting.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn reads_do_not_wait_for_writes() {
    use sqlx::Connection;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("jobs.sqlite");
    let store = Arc::new(open(&path, &clock()).await);
    let job = store.enqueue(new_job()).await.unwrap();
    let url = format!("sqlite://{}", path.display());
    let mut other = sqlx::SqliteConnection::connect(&url).await.unwrap();
    let holding = other.begin_with("BEGIN IMMEDIATE").await.unwrap();
    let writing = tokio::spawn({
        let store = Arc::clone(&store);
        async move { store.request_cancel(job.id).await.unwrap() }
    });
    tokio::time::timeout(Duration::from_secs(2), async {
        for _ in 0..20 {
            assert_eq!(store.get(job.id).await.unwrap(), job);
        }
    })
    .await
    .expect("reads waited for the write lock");
    assert!(!writing.is_finished());
    holding.rollback().await.unwrap();
    assert_eq!(writing.await.unwrap().state, JobState::Cancelled);
}

/// Changes what is stored, as a fault of the disk or a person may.
async fn tamper(path: &Path, sql: &'static str) {
    use sqlx::Connection;
    let url = format!("sqlite://{}", path.display());
    let mut other = sqlx::SqliteConnection::connect(&url).await.unwrap();
    sqlx::query(sql).execute(&mut other).await.unwrap();
    other.close().await.unwrap();
}

#[tokio::test]
async fn a_row_that_cannot_be_read_stands_in_nobody_s_way() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("jobs.sqlite");
    let store = open(&path, &clock()).await;
    let [running, queued, good] =
        [store.enqueue(new_job()), store.enqueue(new_job()), store.enqueue(new_job())];
    let (running, queued, good) =
        (running.await.unwrap().id, queued.await.unwrap().id, good.await.unwrap().id);
    assert_eq!(store.claim("tester", LEASE).await.unwrap().unwrap().job.id, running);
    tamper(&path, "UPDATE jobs SET payload = '{', boot = 'earlier' WHERE rowid <= 2").await;
    assert_eq!(store.reap().await.unwrap(), 1);
    assert_eq!(store.claim("tester", LEASE).await.unwrap().unwrap().job.id, good);
    assert!(store.claim("tester", LEASE).await.unwrap().is_none());
    let listed = store.list(&ListQuery { limit: 10, ..ListQuery::default() }).await.unwrap();
    assert_eq!(listed.jobs.iter().map(|job| job.id).collect::<Vec<_>>(), [good]);
    assert!(matches!(store.get(queued).await, Err(StoreError::Unreadable(_))));
    assert_eq!(store.counts().await.unwrap().failed, 2);
    for id in [running, queued] {
        store.delete(id).await.unwrap();
    }
}

/// A write that finds no room ends its transaction in SQLite, but not in the
/// driver: that connection is not used again.
#[tokio::test]
async fn a_full_disk_takes_no_job_and_passes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("jobs.sqlite");
    let store = open(&path, &clock()).await;
    let kept = store.enqueue(new_job()).await.unwrap().id;
    let large = || NewJob { payload: json!("x".repeat(1 << 20)), ..new_job() };
    for _ in 0..2 {
        store.refuse_growth().await.unwrap();
        assert!(matches!(store.enqueue(large()).await, Err(StoreError::Full)));
        assert_eq!(store.ids().await.unwrap(), [kept]);
    }
    store.request_cancel(kept).await.unwrap();
    store.delete(kept).await.unwrap();
    store.enqueue(large()).await.unwrap();
    store.ping().await.unwrap();
}

#[tokio::test]
async fn room_is_kept_beside_the_database() {
    let folder = tempfile::tempdir().unwrap();
    let _store = open(&folder.path().join("jobs.sqlite"), &clock()).await;
    let reserve = std::fs::metadata(folder.path().join("jobs.sqlite.reserve")).unwrap();
    assert_eq!(reserve.len(), 4 << 20);
}
