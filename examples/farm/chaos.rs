//! Breaks a farm for a while, and counts what became of its jobs.

use std::collections::{BTreeMap, BTreeSet, HashMap, VecDeque};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use jobs::bytes::{ByteStore, Key};
use jobs::{Job, JobId, JobState, JobStore, PostgresOptions, PostgresStore};
use rand::seq::{IndexedMutRandom, IndexedRandom};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use reqwest::Client;
use rustix::process::{Signal, kill_process};
use serde_json::Value;
use sha2::{Digest, Sha256};
use testbed::{Durability, Farm, Fault};
use tokio::sync::{RwLock, mpsc};
use turnaround::worker::{WorkerConfig, collect};

use crate::clock::{self, NodeClock};
use crate::disk::Disk;
use crate::nodes::{Node, api_command, program, worker_command};
use crate::{Result, upload};

/// Different drawings; jobs of the same ones must come to the same bytes.
const SHEETS: u64 = 20;
const API_NODES: usize = 2;
const WORKERS: usize = 3;
/// From the end of the trouble to the end of the last job.
const PATIENCE: Duration = Duration::from_secs(900);
/// What a database gets to start by itself when there is room again.
const RECOVERY: Duration = Duration::from_secs(10);
/// How far a clock is set wrong: S3 services refuse requests from 15 minutes on.
const WRONG_BY_S: i32 = 600;

/// What is done once, or as often as it is in the plan.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Step {
    RestartDatabase,
    /// That of an API node goes fast.
    ApiClock,
    /// That of a worker goes slow, all others right.
    WorkerClock,
    FillDisk,
    FreeDisk,
    /// The store answers 500.
    StoreFails,
    /// It does not answer.
    StoreHangs,
    StoreIsBack,
}

/// What is done when, in parts of the time; in between nodes are killed and the
/// store fails for moments.
const PLAN: [(f64, Step); 12] = [
    (0.08, Step::RestartDatabase),
    (0.15, Step::ApiClock),
    (0.22, Step::RestartDatabase),
    (0.30, Step::FillDisk),
    (0.35, Step::FreeDisk),
    (0.45, Step::RestartDatabase),
    (0.50, Step::WorkerClock),
    (0.55, Step::StoreFails),
    (0.60, Step::StoreHangs),
    (0.65, Step::StoreIsBack),
    (0.75, Step::RestartDatabase),
    (0.88, Step::RestartDatabase),
];

/// What was done to the farm.
#[derive(Default)]
struct Trouble {
    api_kills: u32,
    worker_kills: u32,
    job_kills: u32,
    /// Nodes that gave up, and were started again as a supervisor does.
    ended: u32,
    database_restarts: u32,
    /// Of the database, when there was room again.
    recoveries: u32,
    store_faults: u32,
    /// That the store did not do its work without a pause, s.
    outage_s: f64,
    /// That the disk was full, s.
    full_s: f64,
}

/// A farm whose disk, clocks and processes can be broken.
struct Broken {
    farm: Farm,
    program: PathBuf,
    apis: Vec<Option<Node>>,
    workers: Vec<Option<Node>>,
    clocks: Vec<NodeClock>,
    addresses: Arc<RwLock<Vec<String>>>,
    /// Since when the store does not do its work.
    outage: Option<Instant>,
    /// Since when the disk is full.
    full: Option<Instant>,
    trouble: Trouble,
    /// The last to go: the others' files are on it.
    disk: Disk,
}

pub(crate) async fn run(seconds: u64, jobs: u64, seed: u64) -> Result<()> {
    let mut broken = Broken::start()?;
    let (tell, mut told) = mpsc::unbounded_channel();
    let span = Duration::from_secs(seconds);
    broken.keep_up().await?;
    let client = tokio::spawn(send(Arc::clone(&broken.addresses), jobs, span, tell));

    let (begun, mut rng) = (Instant::now(), ChaCha8Rng::seed_from_u64(seed));
    let mut plan = VecDeque::from(PLAN);
    while begun.elapsed() < span || !plan.is_empty() {
        let part = begun.elapsed().as_secs_f64() / span.as_secs_f64();
        if let Some((_, step)) = plan.pop_front_if(|(at, _)| *at <= part) {
            broken.do_step(step, &mut rng).await?;
        } else {
            broken.do_something(&mut rng).await?;
        }
        broken.keep_up().await?;
        let next = plan.front().map_or(1.0, |(at, _)| *at);
        let pause = Duration::from_millis(rng.random_range(500..3000));
        let left = span.mul_f64(next).saturating_sub(begun.elapsed());
        tokio::time::sleep(pause.min(left)).await;
    }
    while !client.is_finished() {
        broken.keep_up().await?;
        tokio::time::sleep(Duration::from_millis(500)).await;
    }
    let again = client.await??;
    let mut accepted = BTreeMap::new();
    while let Some((number, id)) = told.recv().await {
        accepted.insert(number, id);
    }
    let store = PostgresStore::open(&broken.farm.database, &PostgresOptions::default()).await?;
    broken.wait(&store, &accepted).await?;
    let took = begun.elapsed();
    broken.apis.clear();
    broken.workers.clear();
    let bytes = ByteStore::s3(&broken.farm.store(), broken.farm.s3.environment())?;
    let (faults, misnamed) = check(&store, &bytes, &accepted).await?;
    print(&broken.trouble, &accepted, (again, misnamed), took, &faults);
    if misnamed == 0 {
        Err("no job was named by the wrong clock: it was not tried".into())
    } else if faults.values().sum::<u64>() > 0 {
        Err("something was lost".into())
    } else {
        Ok(())
    }
}

impl Broken {
    fn start() -> Result<Self> {
        clock::check()?;
        let disk = Disk::mount()?;
        let farm = Farm::start_in(Durability::Full, disk.path());
        let names = (0..API_NODES + WORKERS).map(|number| number.to_string());
        let clocks = names.map(|name| NodeClock::new(farm.folder.path(), &name));
        let clocks = clocks.collect::<Result<_>>()?;
        Ok(Self {
            farm,
            program: program()?,
            apis: (0..API_NODES).map(|_| None).collect(),
            workers: (0..WORKERS).map(|_| None).collect(),
            clocks,
            addresses: Arc::default(),
            outage: None,
            full: None,
            trouble: Trouble::default(),
            disk,
        })
    }

    /// Starts what does not run, as a supervisor does.
    async fn keep_up(&mut self) -> Result<()> {
        let mut is_changed = false;
        for (number, slot) in self.apis.iter_mut().chain(&mut self.workers).enumerate() {
            if let Some(node) = slot {
                if !node.has_ended()? {
                    continue;
                }
                self.trouble.ended += 1;
            }
            let make = if number < API_NODES { api_command } else { worker_command };
            let mut command = make(&self.program, &self.farm);
            self.clocks[number].rule(&mut command);
            *slot = Some(Node::start(command)?);
            is_changed = true;
        }
        if is_changed {
            let urls = self.apis.iter().flatten().filter_map(|node| node.url.clone());
            *self.addresses.write().await = urls.collect();
        }
        Ok(())
    }

    async fn do_step(&mut self, step: Step, rng: &mut ChaCha8Rng) -> Result<()> {
        match step {
            Step::RestartDatabase => {
                self.farm.postgres.stop();
                tokio::time::sleep(Duration::from_millis(rng.random_range(0..4000))).await;
                self.farm.postgres.resume();
                self.trouble.database_restarts += 1;
            }
            Step::ApiClock => self.clocks[0].set(WRONG_BY_S)?,
            Step::WorkerClock => {
                self.clocks[0].set(0)?;
                self.clocks[API_NODES].set(-WRONG_BY_S)?;
            }
            Step::FillDisk => {
                self.disk.fill()?;
                self.full = Some(Instant::now());
            }
            Step::FreeDisk => self.free_disk().await?,
            Step::StoreFails => {
                self.farm.s3.set_fault(Fault::Error);
                self.outage = Some(Instant::now());
            }
            Step::StoreHangs => self.farm.s3.set_fault(Fault::Hang),
            Step::StoreIsBack => {
                self.farm.s3.set_fault(Fault::None);
                let outage = self.outage.take().map_or(0.0, |since| since.elapsed().as_secs_f64());
                self.trouble.outage_s += outage;
            }
        }
        Ok(())
    }

    /// Gives the room back; a database that gave up is started again.
    async fn free_disk(&mut self) -> Result<()> {
        self.disk.free()?;
        self.trouble.full_s += self.full.take().map_or(0.0, |since| since.elapsed().as_secs_f64());
        let begun = Instant::now();
        while !self.farm.postgres.answers() {
            if begun.elapsed() > RECOVERY {
                self.farm.postgres.stop();
                self.farm.postgres.resume();
                self.trouble.recoveries += 1;
            }
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
        Ok(())
    }

    /// Kills something, or lets the store fail for a moment.
    async fn do_something(&mut self, rng: &mut ChaCha8Rng) -> Result<()> {
        match rng.random_range(0..7) {
            0 => {
                *self.apis.choose_mut(rng).ok_or("no node")? = None;
                self.trouble.api_kills += 1;
            }
            1 | 2 => {
                *self.workers.choose_mut(rng).ok_or("no node")? = None;
                self.trouble.worker_kills += 1;
            }
            3 | 4 => {
                let of_jobs = self.workers.iter().flatten().flat_map(Node::children);
                if let Some(process) = of_jobs.collect::<Vec<_>>().choose(rng) {
                    kill_process(*process, Signal::KILL)?;
                    self.trouble.job_kills += 1;
                }
            }
            _ if self.outage.is_none() => {
                let faults = [Fault::Error, Fault::LateError, Fault::Hang];
                self.farm.s3.set_fault(*faults.choose(rng).ok_or("no fault")?);
                tokio::time::sleep(Duration::from_millis(rng.random_range(500..8000))).await;
                self.farm.s3.set_fault(Fault::None);
                self.trouble.store_faults += 1;
            }
            _ => {}
        }
        Ok(())
    }

    async fn wait(&mut self, store: &PostgresStore, jobs: &BTreeMap<u64, JobId>) -> Result<()> {
        let begun = Instant::now();
        for id in jobs.values() {
            while !store.get(*id).await?.state.is_final() {
                if begun.elapsed() > PATIENCE {
                    return Err(format!("job {id} does not end").into());
                }
                self.keep_up().await?;
                tokio::time::sleep(Duration::from_millis(100)).await;
            }
        }
        Ok(())
    }
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
            let Some(node) = nodes.get((number + tried) as usize % API_NODES) else {
                tokio::time::sleep(Duration::from_millis(500)).await;
                continue;
            };
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

/// Counts, by its name, whatever must not be; and the jobs whose names have a wrong time.
async fn check(
    store: &PostgresStore,
    bytes: &ByteStore,
    accepted: &BTreeMap<u64, JobId>,
) -> Result<(BTreeMap<&'static str, u64>, u64)> {
    let mut misnamed = 0;
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
        misnamed += u64::from(is_misnamed(&job));
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
    Ok((faults, misnamed))
}

/// Whether the node that named it had another time than the database.
fn is_misnamed(job: &Job) -> bool {
    let named_s = job.id.0.get_timestamp().map(|named| named.to_unix().0.cast_signed());
    named_s.is_some_and(|named_s| {
        (named_s - job.created_at.as_second()).abs() > i64::from(WRONG_BY_S / 2)
    })
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
    (again, misnamed): (u64, u64),
    took: Duration,
    faults: &BTreeMap<&'static str, u64>,
) {
    let Trouble { api_kills, worker_kills, job_kills, ended, .. } = trouble;
    println!(
        "killed: {api_kills} API nodes, {worker_kills} workers, {job_kills} processes of jobs"
    );
    println!("nodes that ended by themselves and were started again: {ended}");
    let Trouble { database_restarts, recoveries, store_faults, .. } = trouble;
    println!("database restarts: {database_restarts}, and {recoveries} after the full disk");
    let Trouble { outage_s, full_s, .. } = trouble;
    println!("times the store failed: {store_faults}, and {outage_s:.0} s without a pause");
    println!("disk full: {full_s:.0} s; jobs named by a node whose clock was wrong: {misnamed}");
    println!("jobs accepted: {}, uploads sent again: {again}", accepted.len());
    println!("last job ended after {:.0} s", took.as_secs_f64());
    for (name, number) in faults {
        println!("{name}: {number}");
    }
}
