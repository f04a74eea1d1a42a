//! How long a claim takes while many jobs wait, on both job stores.
//!
//! ```text
//! cargo run --release -p jobs --example backlog -- [ROUNDS [QUEUED ...]]
//! ```
//!
//! For each number of waiting jobs (1000 and 100000 unless given): one worker claims and ends 500
//! of them one after the other, then eight do so at once. The numbers take turns, as many rounds
//! as given (7), and medians of the rounds are told: other programs use the disk, too. Only the
//! claims are timed, in ms. PostgreSQL is one of its own in a temporary folder and syncs its writes,
//! as SQLite does.

use std::env;
use std::sync::Arc;
use std::time::{Duration, Instant};

use jobs::{
    JobId, JobStore, NewJob, PostgresOptions, PostgresStore, SqliteStore, StoreError, SystemClock,
};
use serde_json::json;
use testbed::{Durability, Postgres};
use tokio::runtime::Runtime;

const CLAIMS: usize = 500;
const LEASE: Duration = Duration::from_secs(60);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let numbers =
        env::args().skip(1).map(|text| text.parse()).collect::<Result<Vec<usize>, _>>()?;
    let rounds = numbers.first().copied().unwrap_or(7).max(1);
    let backlogs = numbers.get(1..).filter(|given| !given.is_empty()).unwrap_or(&[1_000, 100_000]);
    let runtime = Runtime::new()?;
    println!("| store | waiting | workers | p50 ms | p99 ms | claims a second |");
    println!("|---|---|---|---|---|---|");
    let folder = tempfile::tempdir()?;
    let mut stores: Vec<Arc<dyn JobStore>> = Vec::new();
    for number in 0..backlogs.len() {
        let database = folder.path().join(format!("{number}.sqlite"));
        let store = runtime.block_on(SqliteStore::open(&database, Arc::new(SystemClock)))?;
        stores.push(Arc::new(store));
    }
    runtime.block_on(measure("SQLite", &stores, backlogs, rounds))?;
    let postgres = Postgres::start(Durability::Full);
    stores.clear();
    for _ in backlogs {
        let (url, options) = (postgres.database(), PostgresOptions::default());
        stores.push(Arc::new(runtime.block_on(PostgresStore::open(&url, &options))?));
    }
    runtime.block_on(measure("PostgreSQL", &stores, backlogs, rounds))?;
    Ok(())
}

/// One round's figures.
struct Round {
    p50_ms: f64,
    p99_ms: f64,
    rate: f64,
}

async fn measure(
    name: &str,
    stores: &[Arc<dyn JobStore>],
    backlogs: &[usize],
    rounds: usize,
) -> Result<(), StoreError> {
    for (store, queued) in stores.iter().zip(backlogs) {
        fill(store, *queued).await?;
    }
    for workers in [1, 8] {
        let mut found: Vec<Vec<Round>> = backlogs.iter().map(|_| Vec::new()).collect();
        for _ in 0..rounds {
            for (store, found) in stores.iter().zip(&mut found) {
                found.push(round(store, workers).await?);
                fill(store, CLAIMS).await?;
            }
        }
        for (rounds, queued) in found.iter().zip(backlogs) {
            let (p50, p99) = (median(rounds, |it| it.p50_ms), median(rounds, |it| it.p99_ms));
            let rate = median(rounds, |it| it.rate);
            println!("| {name} | {queued} | {workers} | {p50:.2} | {p99:.2} | {rate:.0} |");
        }
    }
    Ok(())
}

fn median(rounds: &[Round], of: impl Fn(&Round) -> f64) -> f64 {
    let mut values: Vec<_> = rounds.iter().map(of).collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

async fn round(store: &Arc<dyn JobStore>, workers: usize) -> Result<Round, StoreError> {
    let begun = Instant::now();
    let working: Vec<_> =
        (0..workers).map(|_| tokio::spawn(work(Arc::clone(store), CLAIMS / workers))).collect();
    let mut times_ms = Vec::new();
    for worker in working {
        times_ms.extend(worker.await.expect("a worker")?);
    }
    let all_s = begun.elapsed().as_secs_f64();
    times_ms.sort_by(f64::total_cmp);
    let at = |share: f64| times_ms[(share * (times_ms.len() - 1) as f64).round() as usize];
    Ok(Round { p50_ms: at(0.5), p99_ms: at(0.99), rate: times_ms.len() as f64 / all_s })
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
