//! Breaks a farm for a while, and counts what became of its jobs.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;
use std::time::{Duration, Instant};

use jobs::bytes::{ByteStore, Key};
use jobs::{Job, JobId, JobState, JobStore, PostgresOptions, PostgresStore};
use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use reqwest::Client;
use serde_json::Value;
use sha2::{Digest, Sha256};
use testbed::{Durability, Farm, Fault};
use tokio::sync::{RwLock, mpsc};
use turnaround::worker::{WorkerConfig, collect};

use crate::nodes::{Node, api, worker};
use crate::{Result, upload};

/// Different drawings; jobs of the same ones must come to the same bytes.
const SHEETS: u64 = 20;
const API_NODES: usize = 2;
const WORKERS: usize = 3;
const RESTARTS: u64 = 5;
/// From the end of the trouble to the end of the last job.
const PATIENCE: Duration = Duration::from_secs(900);

/// What was done to the farm.
#[derive(Default)]
struct Trouble {
    api_kills: u32,
    worker_kills: u32,
    database_restarts: u32,
    store_faults: u32,
}

pub(crate) async fn run(seconds: u64, jobs: u64, seed: u64) -> Result<()> {
    let mut farm = Farm::start(Durability::Full);
    let mut nodes = (0..API_NODES).map(|_| api(&farm)).collect::<Result<Vec<_>>>()?;
    let mut workers = (0..WORKERS).map(|_| worker(&farm)).collect::<Result<Vec<_>>>()?;
    let addresses = Arc::new(RwLock::new(urls(&nodes)));
    let (tell, mut told) = mpsc::unbounded_channel();
    let span = Duration::from_secs(seconds);
    let client = tokio::spawn(send(Arc::clone(&addresses), jobs, span, tell));

    let (begun, mut rng) = (Instant::now(), ChaCha8Rng::seed_from_u64(seed));
    let mut trouble = Trouble::default();
    while begun.elapsed() < span {
        tokio::time::sleep(Duration::from_millis(rng.random_range(500..3000))).await;
        let part = begun.elapsed().as_secs_f64() / span.as_secs_f64();
        // Spread over the time: each restart after its part of it.
        if f64::from(trouble.database_restarts) < (part * RESTARTS as f64).floor() {
            farm.postgres.stop();
            tokio::time::sleep(Duration::from_millis(rng.random_range(0..4000))).await;
            farm.postgres.resume();
            trouble.database_restarts += 1;
            continue;
        }
        match rng.random_range(0..6) {
            0 => {
                let number = rng.random_range(0..nodes.len());
                nodes[number] = api(&farm)?;
                *addresses.write().await = urls(&nodes);
                trouble.api_kills += 1;
            }
            1..=3 => {
                let number = rng.random_range(0..workers.len());
                workers[number] = worker(&farm)?;
                trouble.worker_kills += 1;
            }
            _ => {
                let faults = [Fault::Error, Fault::LateError, Fault::Hang];
                farm.s3.set_fault(*faults.choose(&mut rng).ok_or("no fault")?);
                tokio::time::sleep(Duration::from_millis(rng.random_range(500..8000))).await;
                farm.s3.set_fault(Fault::None);
                trouble.store_faults += 1;
            }
        }
    }
    let again = client.await??;
    let mut accepted = BTreeMap::new();
    while let Some((number, id)) = told.recv().await {
        accepted.insert(number, id);
    }
    let store = PostgresStore::open(&farm.database, &PostgresOptions::default()).await?;
    wait(&store, &accepted).await?;
    let took = begun.elapsed();
    drop((nodes, workers));
    let bytes = ByteStore::s3(&farm.store(), farm.s3.environment())?;
    let faults = check(&store, &bytes, &accepted).await?;
    print(&trouble, &accepted, again, took, &faults);
    if faults.values().sum::<u64>() > 0 { Err("something was lost".into()) } else { Ok(()) }
}

fn urls(nodes: &[Node]) -> Vec<String> {
    nodes.iter().filter_map(|node| node.url.clone()).collect()
}

/// Sends each job, with a key of its own, until it is taken. Returns how often
/// one was sent again.
async fn send(
    addresses: Arc<RwLock<Vec<String>>>,
    jobs: u64,
    span: Duration,
    tell: mpsc::UnboundedSender<(u64, JobId)>,
) -> std::result::Result<u64, String> {
    let client = Client::builder().no_proxy().timeout(Duration::from_secs(60)).build();
    let client = client.map_err(|error| error.to_string())?;
    let pause = span.mul_f64(0.8 / jobs.max(1) as f64);
    let mut again = 0;
    for number in 0..jobs {
        for tried in 0.. {
            let nodes = addresses.read().await.clone();
            let node = &nodes[(number + tried) as usize % nodes.len()];
            let form = upload::sheet(number % SHEETS).map_err(|error| error.to_string())?;
            let request = client.post(format!("{node}/v1/reconstructions"));
            let request = request.header("idempotency-key", format!("chaos-{number}"));
            if let Ok(response) = request.multipart(form).send().await
                && response.status() == 202
                && let Ok(body) = response.json::<Value>().await
                && let Some(Ok(id)) = body["id"].as_str().map(str::parse)
            {
                tell.send((number, id)).map_err(|error| error.to_string())?;
                break;
            }
            again += 1;
            tokio::time::sleep(Duration::from_millis(500)).await;
        }
        tokio::time::sleep(pause).await;
    }
    Ok(again)
}

async fn wait(store: &PostgresStore, accepted: &BTreeMap<u64, JobId>) -> Result<()> {
    let begun = Instant::now();
    for id in accepted.values() {
        while !store.get(*id).await?.state.is_final() {
            if begun.elapsed() > PATIENCE {
                return Err(format!("job {id} does not end").into());
            }
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    }
    Ok(())
}

/// Counts, by its name, whatever must not be.
async fn check(
    store: &PostgresStore,
    bytes: &ByteStore,
    accepted: &BTreeMap<u64, JobId>,
) -> Result<BTreeMap<&'static str, u64>> {
    let mut faults: BTreeMap<&'static str, u64> = [
        "one key, two jobs",
        "jobs that nobody was told of",
        "not succeeded",
        "not ended exactly once",
        "artifacts missing or with other bytes",
        "other results than another job of the same drawings",
        "bytes left over after collection",
    ]
    .map(|name| (name, 0))
    .into();
    let mut count = |name: &'static str, more: u64| *faults.entry(name).or_default() += more;
    let known: BTreeSet<JobId> = accepted.values().copied().collect();
    count("one key, two jobs", (accepted.len() - known.len()) as u64);
    let stored = store.ids().await?;
    let untold = stored.iter().filter(|id| !known.contains(id)).count();
    count("jobs that nobody was told of", untold as u64);

    let config = WorkerConfig { collect_after: Duration::ZERO, ..WorkerConfig::default() };
    collect(store, bytes, &config).await?;
    let mut results: HashMap<u64, BTreeMap<String, String>> = HashMap::new();
    for (number, id) in accepted {
        let job = store.get(*id).await?;
        count("not succeeded", u64::from(job.state != JobState::Succeeded));
        let events = store.events(*id, 0).await?;
        let is_whole = events.iter().map(|event| event.number).eq(1..=job.version);
        let ends = events.iter().filter(|event| event.kind.is_final()).count();
        count("not ended exactly once", u64::from(ends != 1 || !is_whole));
        count("artifacts missing or with other bytes", broken_artifacts(bytes, &job).await);
        let hashes = job.artifacts.iter().filter(|entry| entry.name != "timings.json");
        let hashes: BTreeMap<_, _> =
            hashes.map(|entry| (entry.name.clone(), entry.sha256.clone())).collect();
        let first = results.entry(number % SHEETS).or_insert_with(|| hashes.clone());
        let is_other = job.state == JobState::Succeeded && *first != hashes;
        count("other results than another job of the same drawings", u64::from(is_other));
        let attempts = bytes.attempts(*id).await?;
        count("bytes left over after collection", u64::from(attempts != [job.attempt]));
    }
    // That of the readiness probe apart.
    let others = bytes.jobs().await?.into_iter().filter(|id| !id.0.is_nil() && !known.contains(id));
    count("bytes left over after collection", others.count() as u64);
    Ok(faults)
}

async fn broken_artifacts(bytes: &ByteStore, job: &Job) -> u64 {
    let mut broken = 0;
    for entry in &job.artifacts {
        let key = Key::Artifact { job: job.id, attempt: job.attempt, name: &entry.name };
        let is_whole = match bytes.get(&key).await {
            Ok(stored) => hex::encode(Sha256::digest(&stored)) == entry.sha256,
            Err(_) => false,
        };
        broken += u64::from(!is_whole);
    }
    broken
}

fn print(
    trouble: &Trouble,
    accepted: &BTreeMap<u64, JobId>,
    again: u64,
    took: Duration,
    faults: &BTreeMap<&'static str, u64>,
) {
    let Trouble { api_kills, worker_kills, database_restarts, store_faults } = trouble;
    println!("API nodes killed: {api_kills}, workers killed: {worker_kills}");
    println!("database restarts: {database_restarts}, times the store failed: {store_faults}");
    println!("jobs accepted: {}, uploads sent again: {again}", accepted.len());
    println!("last job ended after {:.0} s", took.as_secs_f64());
    for (name, number) in faults {
        println!("{name}: {number}");
    }
}
