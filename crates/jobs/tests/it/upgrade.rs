//! A node of the version before and one of this version on one database.

use jobs::{JobState, JobStore, PostgresOptions, PostgresStore};
use sqlx::migrate::Migrator;
use sqlx::{Connection, PgConnection, Row};
use testbed::{Durability, Postgres};

use crate::LEASE;

static ALL: Migrator = sqlx::migrate!("./migrations/postgres");

/// What the version before the last migration enqueues, claims and ends jobs with.
const OLD_ENQUEUE: &str = "INSERT INTO jobs (id, kind, payload, state, attempt, attempts_used,
         max_attempts, cancel_requested, boot, not_before_ms, artifacts, created_ms, version,
         tenant, priority, name, labels, expires_ms, pinned, webhook, bytes)
     VALUES ($1, 'test', '{}', 'queued', 0, 0, 3, 0, '', 0, '[]', 0, 1, 'default', 0, NULL, '{}',
         NULL, 0, NULL, 0)";
const OLD_CLAIM: &str = "SELECT * FROM jobs
     WHERE state = 'queued' AND tenant = $1 AND (boot <> $2 OR not_before_ms <= $3)
     ORDER BY priority DESC, rowid LIMIT 1 FOR NO KEY UPDATE SKIP LOCKED";
const OLD_SAVE: &str = "UPDATE jobs SET state = $2, attempt = $3, attempts_used = $3,
         cancel_requested = 0, worker = NULL, lease_until_ms = $4, not_before_ms = 0,
         progress = NULL, failure = NULL, artifacts = '[]', started_ms = 1, finished_ms = $5,
         version = version + 1, summary = NULL, boot = '', troubles = 0
     WHERE id = $1";

/// What it reads jobs and pages with.
const OLD_READS: [&str; 2] =
    ["SELECT * FROM jobs WHERE id = $1", "SELECT * FROM pages WHERE id = $1"];

async fn enqueue(old: &mut PgConnection) -> String {
    let id = jobs::JobId::new().to_string();
    sqlx::query(OLD_ENQUEUE).bind(&id).execute(&mut *old).await.unwrap();
    let event = "INSERT INTO events (job_id, number, at_ms, kind, data)
                 VALUES ($1, 1, 0, 'queued', '{}')";
    sqlx::query(event).bind(&id).execute(old).await.unwrap();
    id
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nodes_of_the_version_before_go_on_beside_this_one() {
    let server = Postgres::start(Durability::None);
    let url = server.database();
    let mut old = PgConnection::connect(&url).await.unwrap();
    let mut before = Migrator { ..Migrator::DEFAULT };
    let count = ALL.migrations.len() - 1;
    assert!(count >= 1, "there is no version before");
    before.migrations = ALL.migrations[..count].to_vec().into();
    before.run_direct(None, &mut old, false).await.unwrap();
    let first = enqueue(&mut old).await;
    let read = async |old: &mut PgConnection| {
        for table in OLD_READS {
            sqlx::query(table).bind(&first).fetch_all(&mut *old).await.unwrap();
        }
    };
    // Prepared from now on: another column would break them for good.
    read(&mut old).await;

    // This version starts beside it, and takes over its job.
    let store = PostgresStore::open(&url, &PostgresOptions::default()).await.unwrap();
    let claim = store.claim("new", LEASE).await.unwrap().unwrap();
    assert_eq!(claim.job.id.to_string(), first);
    store.succeed(claim.job.id, claim.attempt, Vec::new(), None).await.unwrap();

    read(&mut old).await;

    // The version before goes on: with jobs of its own, and those of this one.
    let second = enqueue(&mut old).await;
    let third = store.enqueue(crate::new_job()).await.unwrap();
    for expected in [second, third.id.to_string()] {
        let row = sqlx::query(OLD_CLAIM).bind("default").bind("").bind(i64::MAX);
        let row = row.fetch_one(&mut old).await.unwrap();
        let id: String = row.get("id");
        assert_eq!(id, expected);
        for (state, lease, end) in
            [("running", Some(i64::MAX), None), ("succeeded", None, Some(2i64))]
        {
            let save = sqlx::query(OLD_SAVE).bind(&id).bind(state).bind(1i64);
            save.bind(lease).bind(end).execute(&mut old).await.unwrap();
        }
        let job = store.get(id.parse().unwrap()).await.unwrap();
        assert_eq!((job.state, job.reused_from), (JobState::Succeeded, None));
    }
    // And may start again.
    before.set_ignore_missing(true);
    before.run_direct(None, &mut old, false).await.unwrap();
}
