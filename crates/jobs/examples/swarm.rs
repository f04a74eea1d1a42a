//! What many workers meet at one PostgreSQL database: how long claims take while they all work.
//!
//! ```text
//! cargo run --release -p jobs --example swarm -- [WORKERS ...]
//! ```
//!
//! For each number of workers (10, 100 and 1000 unless given), of one tenant's jobs and of ten
//! tenants': workers on up to 30 nodes, each node with a pool of four connections as a process of
//! its own has, claim jobs, renew nothing, sleep as long as a job takes (two seconds, give or take
//! one), and end them, for 30 seconds; one that finds none asks again after a second or when a
//! change wakes it, as real workers do. Uploads keep twice as many jobs waiting as there are
//! workers. The work itself is not done: this is about the database. `busy` is the share of the
//! workers' time that was work; the rest is waiting for claims and endings. `failed` are statements
//! that got no connection in time and were tried again.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use jobs::{
    AccessStore, EventKind, JobId, JobStore, NewJob, PostgresOptions, PostgresStore, StoreError,
    TenantName,
};
use rand::Rng;
use serde_json::json;
use testbed::{Durability, Postgres};
use tokio::sync::Notify;
use tokio::sync::broadcast::error::RecvError;

const LEASE: Duration = Duration::from_secs(60);
const SPAN: Duration = Duration::from_secs(30);
const WORK_MS: std::ops::Range<u64> = 1000..3000;
const MOST_NODES: usize = 30;
const CLIENTS: usize = 8;

struct Swarm {
    is_over: AtomicBool,
    waiting: AtomicU64,
    worked_ms: AtomicU64,
    empty: AtomicU64,
    failed: AtomicU64,
}

struct Node {
    store: Arc<PostgresStore>,
    woken: Notify,
}

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let numbers = std::env::args().skip(1).map(|text| text.parse());
    let mut numbers = numbers.collect::<Result<Vec<usize>, _>>()?;
    if numbers.is_empty() {
        numbers = vec![10, 100, 1000];
    }
    let postgres = Postgres::start(Durability::Full);
    println!(
        "| workers | nodes | tenants | claims | claims a second | p50 ms | p99 ms | busy | found none | failed |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for workers in numbers {
        for tenants in [1, 10] {
            run(&postgres.database(), workers, tenants).await?;
        }
    }
    Ok(())
}

async fn run(url: &str, workers: usize, tenants: usize) -> Result<(), StoreError> {
    let options = PostgresOptions { max_connections: 4, ..PostgresOptions::default() };
    let mut nodes = Vec::new();
    for _ in 0..workers.min(MOST_NODES) {
        let store = Arc::new(PostgresStore::open(url, &options).await?);
        let node = Arc::new(Node { store, woken: Notify::new() });
        tokio::spawn(listen(Arc::clone(&node)));
        nodes.push(node);
    }
    let mut names = Vec::new();
    for number in 0..tenants {
        let name = TenantName::try_from(format!("tenant-{number}")).expect("a name");
        nodes[0].store.create_tenant(&name).await?;
        names.push(name);
    }
    let swarm = Arc::new(Swarm {
        is_over: AtomicBool::new(false),
        waiting: AtomicU64::new(0),
        worked_ms: AtomicU64::new(0),
        empty: AtomicU64::new(0),
        failed: AtomicU64::new(0),
    });
    let upload = |client: usize| {
        let (store, swarm, names) =
            (Arc::clone(&nodes[client % nodes.len()].store), Arc::clone(&swarm), names.clone());
        tokio::spawn(upload(store, swarm, names, 2 * workers as u64))
    };
    let uploads: Vec<_> = (0..CLIENTS).map(upload).collect();
    while swarm.waiting.load(Ordering::SeqCst) < workers as u64 {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let begun = Instant::now();
    let work = |number: usize| {
        let (node, swarm) = (Arc::clone(&nodes[number % nodes.len()]), Arc::clone(&swarm));
        tokio::spawn(async move { work(&node, &swarm, begun + SPAN).await })
    };
    let working: Vec<_> = (0..workers).map(work).collect();
    let mut times_ms = Vec::new();
    for worker in working {
        times_ms.extend(worker.await.expect("a worker"));
    }
    let all_s = begun.elapsed().as_secs_f64();
    swarm.is_over.store(true, Ordering::SeqCst);
    for upload in uploads {
        upload.await.expect("a client");
    }
    times_ms.sort_by(f64::total_cmp);
    let at = |share: f64| times_ms[(share * (times_ms.len() - 1) as f64).round() as usize];
    let busy = swarm.worked_ms.load(Ordering::SeqCst) as f64 / 1000.0 / (all_s * workers as f64);
    println!(
        "| {workers} | {} | {tenants} | {} | {:.0} | {:.1} | {:.1} | {busy:.2} | {} | {} |",
        nodes.len(),
        times_ms.len(),
        times_ms.len() as f64 / all_s,
        at(0.5),
        at(0.99),
        swarm.empty.load(Ordering::SeqCst),
        swarm.failed.load(Ordering::SeqCst),
    );
    for node in nodes {
        node.store.close().await;
    }
    Ok(())
}

/// Wakes an idle worker of the node for each job that comes.
async fn listen(node: Arc<Node>) {
    let mut changes = node.store.changes();
    loop {
        match changes.recv().await {
            Ok(change) if matches!(change.kind, EventKind::Queued | EventKind::Requeued) => {
                node.woken.notify_one();
            }
            Ok(_) => {}
            Err(RecvError::Lagged(_)) => node.woken.notify_waiters(),
            Err(RecvError::Closed) => return,
        }
    }
}

/// Keeps jobs waiting.
async fn upload(store: Arc<PostgresStore>, swarm: Arc<Swarm>, tenants: Vec<TenantName>, most: u64) {
    while !swarm.is_over.load(Ordering::SeqCst) {
        if swarm.waiting.load(Ordering::SeqCst) >= most {
            tokio::time::sleep(Duration::from_millis(5)).await;
            continue;
        }
        let tenant = tenants[rand::rng().random_range(0..tenants.len())].clone();
        let job = NewJob { tenant, ..NewJob::new(JobId::new(), "test", json!({}), 3) };
        if store.enqueue(job).await.is_err() {
            swarm.failed.fetch_add(1, Ordering::SeqCst);
            continue;
        }
        swarm.waiting.fetch_add(1, Ordering::SeqCst);
    }
}

/// How long each claim that got a job took, ms.
async fn work(node: &Node, swarm: &Swarm, until: Instant) -> Vec<f64> {
    let (mut times_ms, store) = (Vec::new(), &node.store);
    // Not all at once, as workers are that have been at work for a while.
    let start_ms = rand::rng().random_range(0..WORK_MS.end);
    tokio::time::sleep(Duration::from_millis(start_ms)).await;
    while Instant::now() < until {
        let asked = Instant::now();
        let claim = store.claim("worker", LEASE).await;
        let Ok(Some(claim)) = claim else {
            let count = if claim.is_err() { &swarm.failed } else { &swarm.empty };
            count.fetch_add(1, Ordering::SeqCst);
            let _ = tokio::time::timeout(Duration::from_secs(1), node.woken.notified()).await;
            continue;
        };
        times_ms.push(asked.elapsed().as_secs_f64() * 1000.0);
        swarm.waiting.fetch_sub(1, Ordering::SeqCst);
        let work_ms = rand::rng().random_range(WORK_MS);
        tokio::time::sleep(Duration::from_millis(work_ms)).await;
        swarm.worked_ms.fetch_add(work_ms, Ordering::SeqCst);
        while store.succeed(claim.job.id, claim.attempt, Vec::new(), None).await.is_err() {
            swarm.failed.fetch_add(1, Ordering::SeqCst);
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    }
    times_ms
}
