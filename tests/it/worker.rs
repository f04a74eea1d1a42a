//! The worker pool, with work made for the purpose and real stores.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use bytes::Bytes;
use jiff::Timestamp;
use jobs::bytes::{ByteStore, Home, Key};
use jobs::{
    Clock, EventKind, Failure, Job, JobId, JobState, JobStore, ManualClock, NewJob, SqliteStore,
    SystemClock, TenantName,
};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use tokio::runtime::Handle;
use turnaround::worker::{Attempt, Collected, Pool, Work, WorkError, WorkerConfig, collect};

/// Long enough for a busy machine; nothing here waits for it to pass.
const PATIENCE: Duration = Duration::from_secs(20);

type Body = dyn Fn(&dyn Attempt) -> Result<(), WorkError> + Send + Sync;

/// Work given as a closure.
struct Test(Box<Body>);

impl Work for Test {
    fn kind(&self) -> &'static str {
        "test"
    }

    fn run(&self, attempt: &dyn Attempt) -> Result<(), WorkError> {
        (self.0)(attempt)
    }
}

fn work(body: impl Fn(&dyn Attempt) -> Result<(), WorkError> + Send + Sync + 'static) -> Test {
    Test(Box::new(body))
}

/// Stores in a folder of their own.
struct World {
    folder: tempfile::TempDir,
    store: Arc<SqliteStore>,
    bytes: ByteStore,
}

impl World {
    async fn new() -> Self {
        Self::with_clock(Arc::new(SystemClock)).await
    }

    async fn with_clock(clock: Arc<dyn Clock>) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let store = SqliteStore::open(&folder.path().join("jobs.sqlite"), clock).await.unwrap();
        let bytes = ByteStore::local(&folder.path().join("bytes")).unwrap();
        Self { store: Arc::new(store), bytes, folder }
    }

    /// What another process sees: its writes are not announced in this one.
    async fn other_process(&self) -> SqliteStore {
        let path = self.folder.path().join("jobs.sqlite");
        SqliteStore::open(&path, Arc::new(SystemClock)).await.unwrap()
    }

    /// A pool that is told of everything and finds nothing by polling.
    fn pool(&self, work: Test) -> Pool {
        self.pool_with(config(), work)
    }

    fn pool_with(&self, config: WorkerConfig, work: Test) -> Pool {
        let store = Arc::clone(&self.store) as Arc<dyn JobStore>;
        let works: Vec<Arc<dyn Work>> = vec![Arc::new(work)];
        Pool::start(config, store, self.bytes.clone(), works, &Handle::current()).unwrap()
    }

    async fn enqueue(&self, max_attempts: u32) -> JobId {
        let id = JobId::new();
        self.store.enqueue(new_job(id, max_attempts)).await.unwrap();
        id
    }

    async fn wait(&self, id: JobId, what: impl Fn(&Job) -> bool) -> Job {
        let begun = Instant::now();
        loop {
            let job = self.store.get(id).await.unwrap();
            if what(&job) {
                return job;
            }
            assert!(begun.elapsed() < PATIENCE, "still waiting: {job:?}");
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    }

    async fn finished(&self, id: JobId) -> Job {
        self.wait(id, |job| job.state.is_final()).await
    }

    async fn running(&self, id: JobId) -> Job {
        self.wait(id, |job| job.state == JobState::Running).await
    }

    async fn kinds(&self, id: JobId) -> Vec<EventKind> {
        let events = self.store.events(id, 0).await.unwrap();
        events.into_iter().map(|event| event.kind).collect()
    }
}

fn new_job(id: JobId, max_attempts: u32) -> NewJob {
    NewJob::new(id, "test", Value::Null, max_attempts)
}

fn config() -> WorkerConfig {
    let never = Duration::from_secs(3600);
    WorkerConfig {
        workers: 1,
        threads_per_job: 3,
        poll_interval: never,
        cancel_poll: never,
        retry_pause: Duration::ZERO,
        ..WorkerConfig::default()
    }
}

/// Works until told to stop.
fn until_stopped(attempt: &dyn Attempt) -> Result<(), WorkError> {
    let begun = Instant::now();
    while begun.elapsed() < PATIENCE {
        if attempt.is_cancelled() {
            return Err(WorkError::Cancelled);
        }
        thread::sleep(Duration::from_millis(2));
    }
    Err(WorkError::Broken("nobody stopped it".to_owned()))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_job_is_read_computed_and_published() {
    let world = World::new().await;
    let pool = world.pool(work(|attempt| {
        let input = attempt.read("front.png").unwrap();
        assert_eq!((input.as_slice(), attempt.task().threads), (b"drawing".as_slice(), 3));
        let missing = attempt.read("back.png").unwrap_err();
        assert_eq!(missing.kind(), std::io::ErrorKind::NotFound);
        attempt.report(0.5, json!({ "fraction": 0.5 }));
        for index in 0..40u8 {
            attempt
                .emit(&format!("views/{index}/depth.pfm"), "a/b", vec![index; 70_000].into())
                .unwrap();
        }
        let twice = attempt.emit("views/7/depth.pfm", "a/b", Bytes::new()).unwrap_err();
        assert_eq!(twice.kind(), std::io::ErrorKind::AlreadyExists);
        let outside = attempt.emit("../../jobs.sqlite", "a/b", Bytes::new()).unwrap_err();
        assert_eq!(outside.kind(), std::io::ErrorKind::InvalidInput);
        attempt.report(1.0, json!({ "fraction": 1.0 }));
        Ok(())
    }));
    let id = JobId::new();
    let input = Key::Input { job: id, name: "front.png" };
    world.bytes.put(&input, b"drawing".as_slice().into()).await.unwrap();
    world.store.enqueue(new_job(id, 1)).await.unwrap();
    let job = world.finished(id).await;
    assert_eq!((job.state, job.failure), (JobState::Succeeded, None));
    assert_eq!(job.progress, Some(json!({ "fraction": 1.0 })));
    assert_eq!(job.artifacts.len(), 40);
    for (index, entry) in (0..40u8).zip(&job.artifacts) {
        assert_eq!(entry.name, format!("views/{index}/depth.pfm"));
        assert_eq!((entry.media_type.as_str(), entry.bytes), ("a/b", 70_000));
        let key = Key::Artifact { job: id, attempt: 1, name: &entry.name };
        let stored = world.bytes.get(&key).await.unwrap();
        assert_eq!(stored, vec![index; 70_000]);
        assert_eq!(entry.sha256, hex::encode(Sha256::digest(&stored)));
    }
    pool.shutdown(PATIENCE).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn as_many_jobs_run_at_once_as_there_are_workers() {
    let world = World::new().await;
    let (now, most) = (Arc::new(AtomicU32::new(0)), Arc::new(AtomicU32::new(0)));
    let counters = (Arc::clone(&now), Arc::clone(&most));
    let config = WorkerConfig { workers: 3, ..config() };
    let pool = world.pool_with(
        config,
        work(move |_| {
            let running = counters.0.fetch_add(1, Ordering::SeqCst) + 1;
            counters.1.fetch_max(running, Ordering::SeqCst);
            thread::sleep(Duration::from_millis(100));
            counters.0.fetch_sub(1, Ordering::SeqCst);
            Ok(())
        }),
    );
    let mut ids = Vec::new();
    for _ in 0..9 {
        ids.push(world.enqueue(1).await);
    }
    for id in ids {
        assert_eq!(world.finished(id).await.state, JobState::Succeeded);
    }
    assert_eq!(most.load(Ordering::SeqCst), 3);
    pool.shutdown(PATIENCE).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn polling_finds_jobs_of_other_processes() {
    let world = World::new().await;
    let config = WorkerConfig { poll_interval: Duration::from_millis(20), ..config() };
    let pool = world.pool_with(config, work(|_| Ok(())));
    let id = JobId::new();
    world.other_process().await.enqueue(new_job(id, 1)).await.unwrap();
    assert_eq!(world.finished(id).await.state, JobState::Succeeded);
    pool.shutdown(PATIENCE).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn cancelling_reaches_running_work_at_once() {
    let world = World::new().await;
    let pool = world.pool(work(|attempt| {
        attempt.emit("hull.glb", "a/b", vec![0; 100].into()).unwrap();
        until_stopped(attempt)
    }));
    let id = world.enqueue(1).await;
    world.running(id).await;
    world.store.request_cancel(id).await.unwrap();
    let job = world.finished(id).await;
    assert_eq!((job.state, job.artifacts), (JobState::Cancelled, vec![]));
    pool.shutdown(PATIENCE).await;
    assert!(world.bytes.attempts(id).await.unwrap().is_empty());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn cancelling_by_another_process_is_seen_by_polling() {
    let world = World::new().await;
    let config = WorkerConfig { cancel_poll: Duration::from_millis(20), ..config() };
    let pool = world.pool_with(config, work(until_stopped));
    let id = world.enqueue(1).await;
    world.running(id).await;
    world.other_process().await.request_cancel(id).await.unwrap();
    assert_eq!(world.finished(id).await.state, JobState::Cancelled);
    pool.shutdown(PATIENCE).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn panics_and_breakage_are_tried_again() {
    let world = World::new().await;
    let pool = world.pool(work(|attempt| match attempt.task().attempt {
        1 => panic!("out of luck"),
        2 => Err(WorkError::Broken("disk full".to_owned())),
        _ => Ok(()),
    }));
    let id = world.enqueue(3).await;
    let job = world.finished(id).await;
    assert_eq!((job.state, job.attempt), (JobState::Succeeded, 3));
    let events = world.store.events(id, 0).await.unwrap();
    let details: Vec<_> = events
        .iter()
        .filter(|event| event.kind == EventKind::Requeued)
        .map(|event| event.data["detail"].as_str().unwrap())
        .collect();
    assert_eq!(details, ["the work panicked: out of luck", "disk full"]);

    let id = world.enqueue(2).await;
    let job = world.finished(id).await;
    assert_eq!((job.state, job.attempt), (JobState::Failed, 2));
    assert_eq!(job.failure.unwrap().code, "attempts_exhausted");
    pool.shutdown(PATIENCE).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_the_last_crash_left_behind_is_kept_with_its_job() {
    let world = World::new().await;
    let id = world.enqueue(2).await;
    let _pool = world.pool(work(|attempt| {
        attempt.emit("hull.glb", "a/b", vec![0; 10].into()).unwrap();
        Err(WorkError::Crashed("died of signal 6".to_owned()))
    }));
    let job = world.finished(id).await;
    let failure = job.failure.unwrap();
    assert_eq!((job.attempt, failure.code.as_str()), (2, "crashed"));
    let told = "crashed 2 times; the last time its process died of signal 6; ";
    assert!(failure.detail.starts_with(told), "{failure:?}");
    assert!(job.artifacts.is_empty());
    collect(world.store.as_ref(), &world.bytes, &config()).await.unwrap();
    let left = |attempt| Key::Artifact { job: id, attempt, name: "hull.glb" };
    assert_eq!(world.bytes.size(&left(2)).await.unwrap(), 10);
    assert!(world.bytes.size(&left(1)).await.is_err());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn bad_input_is_not_tried_again() {
    let world = World::new().await;
    let failure = Failure { code: "no_usable_pair".to_owned(), detail: "0 of 18".to_owned() };
    let given = failure.clone();
    let pool = world.pool(work(move |_| Err(WorkError::Input(given.clone()))));
    let id = world.enqueue(3).await;
    let job = world.finished(id).await;
    assert_eq!((job.state, job.attempt, job.failure), (JobState::Failed, 1, Some(failure)));
    pool.shutdown(PATIENCE).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn work_longer_than_its_lease_keeps_it() {
    let world = World::new().await;
    let config = WorkerConfig {
        lease: Duration::from_secs(2),
        heartbeat: Duration::from_millis(200),
        reap_interval: Duration::from_millis(50),
        ..config()
    };
    let pool = world.pool_with(
        config,
        work(|_| {
            thread::sleep(Duration::from_secs(4));
            Ok(())
        }),
    );
    let id = world.enqueue(3).await;
    let job = world.finished(id).await;
    assert_eq!((job.state, job.attempt), (JobState::Succeeded, 1));
    use EventKind::{Queued, Started, Succeeded};
    assert_eq!(world.kinds(id).await, [Queued, Started, Succeeded]);
    pool.shutdown(PATIENCE).await;
}

/// The store's clock jumps over the lease, as if the worker had been frozen.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_frozen_worker_learns_that_it_lost_its_lease() {
    let clock = Arc::new(ManualClock::new(Timestamp::now()));
    let world = World::with_clock(Arc::clone(&clock) as Arc<dyn Clock>).await;
    let config = WorkerConfig {
        workers: 2,
        cancel_poll: Duration::from_millis(20),
        reap_interval: Duration::from_millis(20),
        ..config()
    };
    let thrown_away = Arc::new(Mutex::new(None));
    let seen = Arc::clone(&thrown_away);
    let pool = world.pool_with(
        config,
        work(move |attempt| {
            let number = attempt.task().attempt;
            attempt.emit("hull.glb", "a/b", vec![number as u8; 10].into()).unwrap();
            if number == 1 {
                let stopped = until_stopped(attempt);
                *seen.lock().unwrap() = Some(matches!(stopped, Err(WorkError::Cancelled)));
                // It comes back with a result all the same.
            }
            Ok(())
        }),
    );
    let id = world.enqueue(3).await;
    world.running(id).await;
    clock.advance(Duration::from_secs(31));
    let job = world.finished(id).await;
    assert_eq!((job.state, job.attempt), (JobState::Succeeded, 2));
    let key = Key::Artifact { job: id, attempt: 2, name: "hull.glb" };
    assert_eq!(world.bytes.get(&key).await.unwrap(), [2u8; 10].as_slice());
    pool.shutdown(PATIENCE).await;
    assert_eq!(*thrown_away.lock().unwrap(), Some(true));
    assert_eq!(world.store.get(id).await.unwrap(), job);
    assert_eq!(world.bytes.attempts(id).await.unwrap(), [2]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn progress_is_thinned_out_and_never_goes_back() {
    let world = World::new().await;
    let pool = world.pool(work(|attempt| {
        for step in 0..5_000 {
            // Every tenth report is one that comes late.
            let step = if step % 10 == 9 { step - 5 } else { step };
            attempt.report(f64::from(step) / 5_000.0, json!(step));
            if step % 10 == 0 {
                thread::sleep(Duration::from_millis(1));
            }
        }
        attempt.report(1.0, json!(5_000));
        Ok(())
    }));
    let id = world.enqueue(1).await;
    let job = world.finished(id).await;
    let events = world.store.events(id, 0).await.unwrap();
    let steps: Vec<u64> = events
        .iter()
        .filter(|event| event.kind == EventKind::Progress)
        .map(|event| event.data["progress"].as_u64().unwrap())
        .collect();
    assert!(steps.is_sorted(), "{steps:?}");
    assert_eq!(steps.last(), Some(&5_000));
    let ran = job.finished_at.unwrap().duration_since(job.started_at.unwrap());
    let seconds = ran.as_secs_f64();
    assert!((steps.len() as f64) <= seconds * 10.0 + 2.0, "{} in {seconds} s", steps.len());
    pool.shutdown(PATIENCE).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn shutdown_lets_jobs_finish_and_claims_no_more() {
    let world = World::new().await;
    let pool = world.pool(work(|_| {
        thread::sleep(Duration::from_millis(300));
        Ok(())
    }));
    let [first, second] = [world.enqueue(1).await, world.enqueue(1).await];
    world.running(first).await;
    pool.shutdown(PATIENCE).await;
    assert_eq!(world.store.get(first).await.unwrap().state, JobState::Succeeded);
    let waiting = world.store.get(second).await.unwrap();
    assert_eq!((waiting.state, waiting.attempt), (JobState::Queued, 0));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn shutdown_puts_back_what_does_not_finish_in_time() {
    let world = World::new().await;
    let pool = world.pool(work(|attempt| {
        attempt.emit("hull.glb", "a/b", vec![0; 10].into()).unwrap();
        until_stopped(attempt)
    }));
    let id = world.enqueue(1).await;
    world.running(id).await;
    pool.shutdown(Duration::from_millis(50)).await;
    let job = world.store.get(id).await.unwrap();
    assert_eq!((job.state, job.attempt, job.attempts_used), (JobState::Queued, 1, 0));
    assert!(world.bytes.attempts(id).await.unwrap().is_empty());
    // The only attempt it may use is still there for the next pool.
    let pool = world.pool(work(|_| Ok(())));
    assert_eq!(world.finished(id).await.state, JobState::Succeeded);
    pool.shutdown(PATIENCE).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn shutdown_leaves_behind_work_that_does_not_listen() {
    let world = World::new().await;
    let (release, released) = std::sync::mpsc::channel::<()>();
    let released = Mutex::new(released);
    let pool = world.pool(work(move |_| {
        // Ends when the test is over.
        let _ = released.lock().unwrap().recv();
        Ok(())
    }));
    let id = world.enqueue(1).await;
    world.running(id).await;
    pool.shutdown(Duration::from_millis(50)).await;
    let job = world.store.get(id).await.unwrap();
    assert_eq!((job.state, job.attempts_used), (JobState::Queued, 0));
    drop(release);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn jobs_of_workers_that_died_run_again_at_the_next_start() {
    let world = World::new().await;
    let id = world.enqueue(2).await;
    world.store.claim("dead", Duration::ZERO).await.unwrap().unwrap();
    let pool = world.pool(work(|_| Ok(())));
    let job = world.finished(id).await;
    assert_eq!((job.state, job.attempt), (JobState::Succeeded, 2));
    pool.shutdown(PATIENCE).await;
}

#[tokio::test]
async fn only_bytes_that_belong_to_nothing_are_collected() {
    for home in [Home::Shared, Home::Tenant(TenantName::default())] {
        collect_at(&home).await;
    }
}

async fn collect_at(home: &Home) {
    let world = World::new().await;
    let bytes = world.bytes.of(home);
    let lease = Duration::from_secs(30);
    let put = async |job, attempt| {
        let key = Key::Artifact { job, attempt, name: "hull.glb" };
        bytes.put(&key, b"x".as_slice().into()).await.unwrap();
    };
    let mut jobs = Vec::new();
    for _ in 0..3 {
        let id = world.enqueue(9).await;
        let input = Key::Input { job: id, name: "front.png" };
        bytes.put(&input, b"x".as_slice().into()).await.unwrap();
        for attempt in 1..=2 {
            world.store.claim("tester", lease).await.unwrap().unwrap();
            put(id, attempt).await;
            if attempt == 1 {
                world.store.release(id, 1).await.unwrap();
            }
        }
        jobs.push(id);
    }
    let [queued, running, succeeded] = jobs.try_into().unwrap();
    world.store.succeed(succeeded, 2, Vec::new(), None).await.unwrap();
    world.store.release(queued, 2).await.unwrap();
    // A job that is uploading, or was when its process died.
    let uploading = JobId::new();
    let input = Key::Input { job: uploading, name: "front.png" };
    bytes.put(&input, b"x".as_slice().into()).await.unwrap();

    world.store.expect_bytes(uploading).await.unwrap();
    // What a database that was put back from a copy does not know (any more).
    let strange = Key::Input { job: JobId::new(), name: "front.png" };
    bytes.put(&strange, b"x".as_slice().into()).await.unwrap();
    put(queued, 7).await;

    let hour = Duration::from_secs(3600);
    let store = world.store.as_ref();
    let after = |collect_after, collect_unknown_after| WorkerConfig {
        collect_after,
        collect_unknown_after,
        ..config()
    };
    let done = collect(store, &world.bytes, &after(hour, None)).await.unwrap();
    assert_eq!(done, Collected { jobs: 0, attempts: 4, unknown: 1 });
    for (id, left) in [(queued, vec![7]), (running, vec![2]), (succeeded, vec![2])] {
        assert_eq!(bytes.attempts(id).await.unwrap(), left);
        let input = Key::Input { job: id, name: "front.png" };
        assert_eq!(bytes.get(&input).await.unwrap(), "x");
    }
    assert_eq!(bytes.get(&input).await.unwrap(), "x");

    let done = collect(store, &world.bytes, &after(Duration::ZERO, None)).await.unwrap();
    assert_eq!(done, Collected { jobs: 1, attempts: 0, unknown: 1 });
    assert_eq!(bytes.get(&strange).await.unwrap(), "x");
    assert_eq!(bytes.attempts(queued).await.unwrap(), [7]);
    let at_once = after(Duration::ZERO, Some(Duration::ZERO));
    let done = collect(store, &world.bytes, &at_once).await.unwrap();
    assert_eq!(done, Collected { jobs: 1, attempts: 0, unknown: 0 });
    assert_eq!(bytes.jobs().await.unwrap(), [queued, running, succeeded]);
}

/// Work that looks at nothing, like a long call into a library.
fn deaf(
    released: &Mutex<std::sync::mpsc::Receiver<()>>,
    attempt: &dyn Attempt,
) -> Result<(), WorkError> {
    attempt.emit("hull.glb", "a/b", vec![0; 100].into()).unwrap();
    let mut piecewise = attempt.create("points.ply", "a/b").unwrap();
    std::io::Write::write_all(&mut piecewise, b"half").unwrap();
    // Ends when the test is over.
    let _ = released.lock().unwrap().recv();
    let _ = piecewise.finish();
    let _ = attempt.emit("late.glb", "a/b", vec![0; 100].into());
    Ok(())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn work_that_does_not_listen_is_cancelled_within_a_second() {
    let world = World::new().await;
    let (release, released) = std::sync::mpsc::channel::<()>();
    let released = Mutex::new(released);
    let pool = world.pool(work(move |attempt| match attempt.task().job {
        _ if attempt.read("quick").is_ok() => Ok(()),
        _ => deaf(&released, attempt),
    }));
    let id = world.enqueue(1).await;
    world.running(id).await;
    let asked = Instant::now();
    world.store.request_cancel(id).await.unwrap();
    assert_eq!(world.finished(id).await.state, JobState::Cancelled);
    assert!(asked.elapsed() < Duration::from_secs(1), "{:?}", asked.elapsed());
    // Its worker goes on with others meanwhile.
    let quick = JobId::new();
    let input = Key::Input { job: quick, name: "quick" };
    world.bytes.put(&input, b"x".as_slice().into()).await.unwrap();
    world.store.enqueue(new_job(quick, 1)).await.unwrap();
    assert_eq!(world.finished(quick).await.state, JobState::Succeeded);
    drop(release);
    thread::sleep(Duration::from_millis(100));
    assert!(world.bytes.attempts(id).await.unwrap().is_empty(), "it wrote after its end");
    pool.shutdown(PATIENCE).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_job_that_takes_too_long_fails_for_good() {
    let world = World::new().await;
    let config = WorkerConfig {
        max_job_time: Duration::from_millis(200),
        cancel_poll: Duration::from_millis(20),
        ..config()
    };
    let pool = world.pool_with(config, work(until_stopped));
    let id = world.enqueue(3).await;
    let job = world.finished(id).await;
    assert_eq!((job.state, job.attempt), (JobState::Failed, 1));
    assert_eq!(job.failure.unwrap().code, "time_limit");
    pool.shutdown(PATIENCE).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn trouble_of_the_machine_is_waited_out_and_not_told() {
    let world = World::new().await;
    let config = WorkerConfig { poll_interval: Duration::from_millis(50), ..config() };
    let pool = world.pool_with(
        config,
        work(|attempt| match attempt.task().attempt {
            1 => {
                let os = std::io::Error::from_raw_os_error(24);
                Err(std::io::Error::other(format!("/srv/data/bytes/inputs: {os}")).into())
            }
            2 => Err(std::io::Error::from(std::io::ErrorKind::StorageFull).into()),
            _ => Ok(()),
        }),
    );
    let id = world.enqueue(1).await;
    let job = world.finished(id).await;
    assert_eq!((job.state, job.attempt, job.attempts_used), (JobState::Succeeded, 3, 1));
    for event in world.store.events(id, 0).await.unwrap() {
        assert!(!event.data.to_string().contains("/srv"), "{event:?}");
    }
    pool.shutdown(PATIENCE).await;
}
