//! The PostgreSQL store: the suite, and what many nodes on one database must show.

use std::collections::HashSet;
use std::sync::Arc;
use std::time::{Duration, Instant};

use jobs::{
    Clock, EventKind, JobState, JobStore, ListQuery, NewJob, PostgresOptions, PostgresStore,
    StoreError, TenantName, WebhookStore,
};
use testbed::{Durability, Postgres};

use crate::suite::{self, Subject};
use crate::{LEASE, clock, new_job, share_the_work};

const MINUTE: Duration = Duration::from_secs(60);

async fn open(url: &str) -> Arc<PostgresStore> {
    Arc::new(PostgresStore::open(url, &PostgresOptions::default()).await.unwrap())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn postgres_passes_the_suite() {
    let server = Postgres::start(Durability::None);
    suite::run(async || {
        let clock = clock();
        let reading = Arc::clone(&clock) as Arc<dyn Clock>;
        let store = PostgresStore::open_with_clock(&server.database(), reading).await.unwrap();
        let store = Arc::new(store);
        Subject { store: store.clone(), access: store, clock }
    })
    .await;
}

/// Separate stores stand for separate nodes, which start at once.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nodes_share_a_database() {
    let server = Postgres::start(Durability::None);
    let url = server.database();
    let opening = (0..4).map(|_| open(&url));
    let stores = futures::future::join_all(opening).await;
    share_the_work(&stores).await;
}

/// By NOTIFY, for what polls does so twice a second at most.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn changes_are_told_from_node_to_node() {
    let server = Postgres::start(Durability::None);
    let url = server.database();
    let (here, there) = (open(&url).await, open(&url).await);
    let mut changes = there.changes();
    // Until the other one listens.
    let begun = Instant::now();
    let mut told = None;
    while told.is_none() && begun.elapsed() < MINUTE {
        here.enqueue(new_job()).await.unwrap();
        told = tokio::time::timeout(Duration::from_millis(100), changes.recv()).await.ok();
    }
    told.expect("no change was told").unwrap();
    let claim = here.claim("tester", LEASE).await.unwrap().unwrap();
    let id = claim.job.id;
    let asked = Instant::now();
    here.request_cancel(id).await.unwrap();
    loop {
        let change = tokio::time::timeout(MINUTE, changes.recv()).await.unwrap().unwrap();
        if change.kind == EventKind::CancelRequested {
            assert_eq!((change.id, change.version), (id, 3));
            break;
        }
    }
    assert!(asked.elapsed() < Duration::from_millis(400), "{:?}", asked.elapsed());
}

/// What runs goes on over a restart of the database: its lease is renewed, its
/// end is written, and nobody takes it for lost.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_restart_of_the_database_loses_nothing() {
    let mut server = Postgres::start(Durability::None);
    let store = open(&server.database()).await;
    let short = Duration::from_secs(1);
    let id = store.enqueue(new_job()).await.unwrap().id;
    let claim = store.claim("tester", short).await.unwrap().unwrap();
    server.stop();
    assert!(matches!(store.get(id).await, Err(StoreError::Backend(_))));
    tokio::time::sleep(short).await;
    server.resume();
    assert_eq!(store.reap().await.unwrap(), 0, "the lease ended while nobody could renew it");
    store.heartbeat(id, claim.attempt, LEASE).await.unwrap();
    let ended = store.succeed(id, claim.attempt, Vec::new(), None).await.unwrap();
    assert_eq!(ended, JobState::Succeeded);
    assert_eq!(store.get(id).await.unwrap().version, 3);
}

/// The node's connections are ended under it while it writes.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn lost_connections_fail_no_job() {
    let server = Arc::new(Postgres::start(Durability::None));
    let url = server.database();
    let store = open(&url).await;
    let ending = Arc::clone(&server);
    let (stop, stopped) = std::sync::mpsc::channel();
    let killer = std::thread::spawn(move || {
        let mut kills = 0;
        while stopped.try_recv().is_err() {
            let killed = ending.sql(
                "postgres",
                "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity
                 WHERE application_name = 'turnaround'",
            );
            kills += killed.parse::<u32>().unwrap();
        }
        kills
    });
    let begun = Instant::now();
    let mut ended = HashSet::new();
    // Longer where a busy machine gets little done between two kills.
    let (least, most) = (Duration::from_secs(3), Duration::from_secs(60));
    while begun.elapsed() < least || (ended.len() <= 10 && begun.elapsed() < most) {
        // An upload's client sends it again.
        if store.enqueue(new_job()).await.is_err() {
            continue;
        }
        loop {
            match store.claim("tester", LEASE).await {
                // One whose claim was committed without an answer is not given out again.
                Ok(None) => break,
                Ok(Some(claim)) => {
                    let (id, attempt) = (claim.job.id, claim.attempt);
                    loop {
                        match store.succeed(id, attempt, Vec::new(), None).await {
                            Ok(_) | Err(StoreError::LeaseLost { .. }) => break,
                            Err(_) => {}
                        }
                    }
                    ended.insert(id);
                }
                Err(_) => {}
            }
        }
    }
    stop.send(()).unwrap();
    let kills = killer.join().unwrap();
    assert!(kills > 10 && ended.len() > 10, "{kills} kills, {} jobs", ended.len());
    for id in store.ids().await.unwrap() {
        let job = store.get(id).await.unwrap();
        let events = store.events(id, 0).await.unwrap();
        assert!(events.iter().map(|event| event.number).eq(1..=job.version), "a gap");
        let ends = events.iter().filter(|event| event.kind.is_final()).count();
        assert_eq!((job.state == JobState::Succeeded, ends), (ended.contains(&id), ends.min(1)));
        assert_eq!(ended.contains(&id), ends == 1, "{job:?}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_message_is_claimed_by_one_sender() {
    let server = Postgres::start(Durability::None);
    let url = server.database();
    let stores = futures::future::join_all((0..4).map(|_| open(&url))).await;
    let webhook = Some("https://own.example/hook".to_owned());
    for _ in 0..20 {
        let job = NewJob { webhook: webhook.clone(), ..new_job() };
        let id = stores[0].enqueue(job).await.unwrap().id;
        stores[0].request_cancel(id).await.unwrap();
    }
    let senders = stores.iter().map(|store| {
        let store = Arc::clone(store);
        tokio::spawn(async move {
            let mut claimed = Vec::new();
            // One that finds another at the only message left finds none.
            for _ in 0..40 {
                claimed.extend(store.claim_delivery(LEASE, &[]).await.unwrap().map(|it| it.id));
            }
            claimed
        })
    });
    let mut claimed = Vec::new();
    for sender in futures::future::join_all(senders).await {
        claimed.extend(sender.unwrap());
    }
    assert_eq!(claimed.len(), 20);
    assert_eq!(claimed.into_iter().collect::<HashSet<_>>().len(), 20);
    let busy = stores[0].claim_delivery(LEASE, &[TenantName::default()]).await.unwrap();
    assert_eq!(busy, None);
}

#[tokio::test]
async fn a_row_that_cannot_be_read_stands_in_nobody_s_way() {
    let server = Postgres::start(Durability::None);
    let url = server.database();
    let store = open(&url).await;
    let queued = store.enqueue(new_job()).await.unwrap().id;
    let good = store.enqueue(new_job()).await.unwrap().id;
    let broken = format!("UPDATE jobs SET payload = '{{' WHERE id = '{queued}'");
    server.sql(url.rsplit('/').next().unwrap(), &broken);
    assert_eq!(store.claim("tester", LEASE).await.unwrap().unwrap().job.id, good);
    assert!(store.claim("tester", LEASE).await.unwrap().is_none());
    let listed = store.list(&ListQuery { limit: 10, ..ListQuery::default() }).await.unwrap();
    assert_eq!(listed.jobs.iter().map(|job| job.id).collect::<Vec<_>>(), [good]);
    assert!(matches!(store.get(queued).await, Err(StoreError::Unreadable(_))));
    assert_eq!(store.counts().await.unwrap().failed, 1);
    store.delete(queued).await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn tls_is_used_and_the_server_s_name_is_checked() {
    let server = Postgres::start_encrypted(Durability::None);
    let plain = server.database();
    let database = plain.rsplit('/').next().unwrap();
    let url = |host: &str, root: &str| {
        let url = plain.replace("127.0.0.1", host);
        format!("{url}?sslmode=verify-full&sslrootcert={root}")
    };
    let own = server.certificate();
    let own = own.to_str().unwrap();
    let store = open(&url("localhost", own)).await;
    store.enqueue(new_job()).await.unwrap();
    let encrypted = "SELECT count(*) > 0 AND bool_and(ssl) FROM pg_stat_ssl
                     JOIN pg_stat_activity USING (pid)
                     WHERE datname = current_database() AND pid <> pg_backend_pid()";
    assert_eq!(server.sql(database, encrypted), "t");

    // Another name, and another authority.
    let other = Postgres::start_encrypted(Durability::None);
    let other = other.certificate();
    for wrong in [url("127.0.0.1", own), url("localhost", other.to_str().unwrap())] {
        let options = PostgresOptions::default();
        let told = PostgresStore::open(&wrong, &options).await.map(drop).unwrap_err().to_string();
        assert!(told.contains("certificate"), "{told}");
    }
}
