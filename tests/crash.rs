//! Kills a worker process at random moments and holds what the jobs end with
//! against a run that nobody disturbed.
//!
//! The process that gets killed is this program itself, started with `--worker`.
//! `CRASH_KILLS` sets how often it is killed, `CRASH_SEED` when.

use std::collections::BTreeMap;
use std::env;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use jobs::bytes::{ByteStore, Key};
use jobs::{
    ArtifactEntry, EventKind, Job, JobId, JobState, JobStore, NewJob, SqliteStore, SystemClock,
};
use rand::{Rng, RngCore, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::json;
use sha2::{Digest, Sha256};
use tokio::runtime::{Handle, Runtime};
use turnaround::worker::{Attempt, Pool, Work, WorkError, WorkerConfig, collect};

const JOBS: u64 = 10;
const STEPS: u32 = 10;
const STEP: Duration = Duration::from_millis(20);
const LEASE: Duration = Duration::from_secs(1);
const PATIENCE: Duration = Duration::from_secs(60);
const NAME: &str = "every_job_ends_once_however_often_its_worker_is_killed";

fn main() {
    let arguments: Vec<String> = env::args().skip(1).collect();
    match arguments.as_slice() {
        [flag, folder] if flag == "--worker" => work_for_ever(Path::new(folder)),
        _ if arguments.iter().any(|it| it == "--list") => println!("{NAME}: test"),
        _ => {
            let filters: Vec<_> = arguments.iter().filter(|it| !it.starts_with('-')).collect();
            if filters.is_empty() || filters.iter().any(|it| NAME.contains(it.as_str())) {
                every_job_ends_once_however_often_its_worker_is_killed();
            }
        }
    }
}

fn every_job_ends_once_however_often_its_worker_is_killed() {
    let kills = setting("CRASH_KILLS", 3);
    let mut rng = ChaCha8Rng::seed_from_u64(setting("CRASH_SEED", 1));
    let undisturbed = Scene::new(1);
    let calm = undisturbed.finish(Worker::start(undisturbed.folder()));

    let disturbed = Scene::new(u32::try_from(kills).unwrap() + 1);
    let mut worker = Worker::start(disturbed.folder());
    for _ in 0..kills {
        disturbed
            .wait("a running job", |jobs| jobs.iter().any(|job| job.state == JobState::Running));
        thread::sleep((STEP * STEPS).mul_f64(rng.random_range(0.0..1.2)));
        drop(worker);
        worker = Worker::start(disturbed.folder());
    }
    let results = disturbed.finish(worker);
    assert_eq!(results, calm);
    let attempts = disturbed.assert_ended_once();
    assert!(attempts > JOBS, "no kill hit a running job");
    disturbed.assert_nothing_is_left_over();
    println!("test {NAME} ... ok ({kills} kills, {attempts} attempts for {JOBS} jobs)");
}

fn setting(name: &str, default: u64) -> u64 {
    env::var(name).map_or(default, |text| text.parse().expect(name))
}

/// A worker process of ours; killed without warning when dropped.
struct Worker(Child);

impl Worker {
    fn start(folder: &Path) -> Self {
        let mut command = Command::new(env::current_exe().unwrap());
        let child = command.arg("--worker").arg(folder).stdin(Stdio::null()).spawn();
        Self(child.unwrap())
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // SIGKILL on Unix.
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }
}

/// What each job, by its seed, ended with.
type Results = BTreeMap<u64, Vec<ArtifactEntry>>;

/// Queued jobs in a folder of their own.
struct Scene {
    runtime: Runtime,
    folder: tempfile::TempDir,
    store: SqliteStore,
    bytes: ByteStore,
    ids: Vec<JobId>,
}

impl Scene {
    fn new(max_attempts: u32) -> Self {
        let runtime = Runtime::new().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let (store, bytes) = runtime.block_on(open(folder.path()));
        let ids = (0..JOBS).map(|seed| {
            let id = JobId::new();
            let payload = json!({ "seed": seed });
            let job = NewJob::new(id, "noise", payload, max_attempts);
            runtime.block_on(store.enqueue(job)).unwrap();
            id
        });
        let ids = ids.collect();
        Self { runtime, folder, store, bytes, ids }
    }

    fn folder(&self) -> &Path {
        self.folder.path()
    }

    fn jobs(&self) -> Vec<Job> {
        let get = |id| self.runtime.block_on(self.store.get(id)).unwrap();
        self.ids.iter().copied().map(get).collect()
    }

    fn wait(&self, what: &str, is_so: impl Fn(&[Job]) -> bool) {
        let begun = Instant::now();
        while !is_so(&self.jobs()) {
            assert!(begun.elapsed() < PATIENCE, "still no {what}: {:#?}", self.jobs());
            thread::sleep(Duration::from_millis(10));
        }
    }

    /// Lets `worker` end all jobs; checks that the bytes are those listed.
    fn finish(&self, worker: Worker) -> Results {
        self.wait("end of all jobs", |jobs| jobs.iter().all(|job| job.state.is_final()));
        drop(worker);
        self.jobs().into_iter().map(|job| (self.check_bytes(&job), job.artifacts)).collect()
    }

    fn check_bytes(&self, job: &Job) -> u64 {
        assert_eq!((job.state, &job.failure), (JobState::Succeeded, &None));
        assert_eq!(job.artifacts.len(), STEPS as usize);
        for entry in &job.artifacts {
            let key = Key::Artifact { job: job.id, attempt: job.attempt, name: &entry.name };
            let stored = self.runtime.block_on(self.bytes.get(&key)).unwrap();
            assert_eq!(hex::encode(Sha256::digest(&stored)), entry.sha256);
        }
        job.payload["seed"].as_u64().unwrap()
    }

    /// Checks that every job's log has one end, its last entry, and no gap.
    /// Returns the attempts of all jobs.
    fn assert_ended_once(&self) -> u64 {
        for id in &self.ids {
            let events = self.runtime.block_on(self.store.events(*id, 0)).unwrap();
            let ends = events.iter().filter(|event| event.kind == EventKind::Succeeded);
            assert_eq!(ends.count(), 1);
            assert_eq!(events.last().unwrap().kind, EventKind::Succeeded);
            assert!(events.iter().map(|event| event.number).eq(1..=events.len() as u64));
        }
        self.jobs().iter().map(|job| u64::from(job.attempt)).sum()
    }

    /// Checks that no byte of a killed attempt outlives a collection.
    fn assert_nothing_is_left_over(&self) {
        let config = WorkerConfig::default();
        let collecting = collect(&self.store, &self.bytes, &config);
        self.runtime.block_on(collecting).unwrap();
        for job in self.jobs() {
            let attempts = self.runtime.block_on(self.bytes.attempts(job.id)).unwrap();
            assert_eq!(attempts, [job.attempt]);
        }
    }
}

async fn open(folder: &Path) -> (SqliteStore, ByteStore) {
    let database: PathBuf = folder.join("jobs.sqlite");
    let store = SqliteStore::open(&database, Arc::new(SystemClock)).await.unwrap();
    (store, ByteStore::local(&folder.join("bytes")).unwrap())
}

/// The worker process: runs until it is killed.
fn work_for_ever(folder: &Path) {
    let runtime = Runtime::new().unwrap();
    runtime.block_on(async {
        let (store, bytes) = open(folder).await;
        let config = WorkerConfig {
            workers: 2,
            lease: LEASE,
            heartbeat: LEASE / 4,
            poll_interval: LEASE / 10,
            reap_interval: LEASE / 10,
            ..WorkerConfig::default()
        };
        let works: Vec<Arc<dyn Work>> = vec![Arc::new(Noise)];
        let _pool = Pool::start(config, Arc::new(store), bytes, works, &Handle::current()).unwrap();
        std::future::pending::<()>().await;
    });
}

/// Emits noise that depends on the job's seed alone, a piece after each step.
struct Noise;

impl Work for Noise {
    fn kind(&self) -> &'static str {
        "noise"
    }

    fn run(&self, attempt: &dyn Attempt) -> Result<(), WorkError> {
        let seed = attempt.task().payload["seed"].as_u64().unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        for step in 0..STEPS {
            thread::sleep(STEP);
            let mut noise = vec![0; rng.random_range(1_000..100_000)];
            rng.fill_bytes(&mut noise);
            let emitted = attempt.emit(&format!("steps/{step}.bin"), "a/b", noise.into());
            emitted.map_err(|error| WorkError::Broken(error.to_string()))?;
            attempt.report(f64::from(step + 1) / f64::from(STEPS), json!(step));
        }
        Ok(())
    }
}
