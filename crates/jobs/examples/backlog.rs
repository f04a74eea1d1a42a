//! How long a claim takes while many jobs wait, on both job stores.
//!
//! ```text
//! cargo run --release -p jobs --example backlog -- [QUEUED ...]
//! ```
//!
//! For each number of waiting jobs (1000 and 100000 unless given): one worker claims and ends 500
//! of them one after the other, then eight do so at once. Only the claims are timed, in ms.
//! PostgreSQL is one of its own in a temporary folder and syncs its writes, as SQLite does.

use std::sync::Arc;
use std::time::{Duration, Instant};
use std::{env, fs};

use jobs::{
    JobId, JobStore, NewJob, PostgresOptions, PostgresStore, SqliteStore, StoreError, SystemClock,
};
use serde_json::json;
use testbed::{Durability, Postgres};
use tokio::runtime::Runtime;

const CLAIMS: usize = 500;
const LEASE: Duration = Duration::from_secs(60);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut backlogs =
        env::args().skip(1).map(|text| text.parse()).collect::<Result<Vec<usize>, _>>()?;
    if backlogs.is_empty() {
        backlogs = vec![1_000, 100_000];
    }
    let runtime = Runtime::new()?;
    let postgres = Postgres::start(Durability::Full);
    println!("| store | waiting | workers | p50 ms | p99 ms | claims a second |");
    println!("|---|---|---|---|---|---|");
    for queued in backlogs {
        let folder = tempfile::tempdir()?;
        let database = folder.path().join("jobs.sqlite");
        let sqlite = runtime.block_on(SqliteStore::open(&database, Arc::new(SystemClock)))?;
        measure(&runtime, "SQLite", Arc::new(sqlite), queued)?;
        fs::remove_file(database)?;
        let url = postgres.database();
        let options = PostgresOptions::default();
        let store = runtime.block_on(PostgresStore::open(&url, &options))?;
        measure(&runtime, "PostgreSQL", Arc::new(store), queued)?;
    }
    Ok(())
}

fn measure(
    runtime: &Runtime,
    name: &str,
    store: Arc<dyn JobStore>,
    queued: usize,
) -> Result<(), StoreError> {
    runtime.block_on(async {
        fill(&store, queued + 2 * CLAIMS).await?;
        for workers in [1, 8] {
            let begun = Instant::now();
            let working: Vec<_> = (0..workers)
                .map(|_| tokio::spawn(work(Arc::clone(&store), CLAIMS / workers)))
                .collect();
            let mut times_ms = Vec::new();
            for worker in working {
                times_ms.extend(worker.await.expect("a worker")?);
            }
            let all_s = begun.elapsed().as_secs_f64();
            times_ms.sort_by(f64::total_cmp);
            let at = |share: f64| times_ms[(share * (times_ms.len() - 1) as f64).round() as usize];
            let rate = times_ms.len() as f64 / all_s;
            let (p50, p99) = (at(0.5), at(0.99));
            println!("| {name} | {queued} | {workers} | {p50:.2} | {p99:.2} | {rate:.0} |");
        }
        Ok(())
    })
}

/// Enqueues as clients do, several at a time.
async fn fill(store: &Arc<dyn JobStore>, jobs: usize) -> Result<(), StoreError> {
    let clients: Vec<_> = (0..8)
        .map(|client| {
            let store = Arc::clone(store);
            tokio::spawn(async move {
                for _ in (client..jobs).step_by(8) {
                    store.enqueue(NewJob::new(JobId::new(), "test", json!({}), 3)).await?;
                }
                Ok(())
            })
        })
        .collect();
    for client in clients {
        client.await.expect("a client")?;
    }
    Ok(())
}

async fn work(store: Arc<dyn JobStore>, claims: usize) -> Result<Vec<f64>, StoreError> {
    let mut times_ms = Vec::with_capacity(claims);
    for _ in 0..claims {
        let asked = Instant::now();
        let claim = store.claim("worker", LEASE).await?.expect("a waiting job");
        times_ms.push(asked.elapsed().as_secs_f64() * 1000.0);
        store.succeed(claim.job.id, claim.attempt, Vec::new(), None).await?;
    }
    Ok(times_ms)
}
