//! The threads that claim and run jobs.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use tokio::runtime::Handle;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{broadcast, watch};
use tokio::task::AbortHandle;

use super::lease::Heart;
use super::run::Outcome;
use super::{Work, WorkerConfig, collector, metrics, run};
use jobs::bytes::ByteStore;
use jobs::{EventKind, JobChange, JobStore};

/// How long work may take to notice that it should stop, after the grace.
const STOP_TIMEOUT: Duration = Duration::from_secs(2);

/// What the pool's threads share.
pub(super) struct Shared {
    pub config: WorkerConfig,
    pub store: Arc<dyn JobStore>,
    pub bytes: ByteStore,
    pub works: Vec<Arc<dyn Work>>,
    pub runtime: Handle,
    pub heart: Heart,
    is_stopping: AtomicBool,
    /// Counts the calls that woke idle workers.
    wakes: Mutex<u64>,
    woken: Condvar,
    live: watch::Sender<usize>,
    /// Work that should have stopped and goes on.
    left_behind: Mutex<Vec<Receiver<Outcome>>>,
}

/// Runs jobs on a bounded number of threads, apart from the async runtime.
pub struct Pool {
    shared: Arc<Shared>,
    tasks: Vec<AbortHandle>,
}

impl Pool {
    /// Starts the workers, the keeper of their leases and the housekeeping.
    /// `runtime` serves the stores; it must outlive the pool.
    ///
    /// # Errors
    /// If the system gives no thread.
    pub fn start(
        config: WorkerConfig,
        store: Arc<dyn JobStore>,
        bytes: ByteStore,
        works: Vec<Arc<dyn Work>>,
        runtime: &Handle,
    ) -> io::Result<Self> {
        let shared = Arc::new(Shared {
            heart: Heart::new(Arc::clone(&store), runtime.clone(), &config),
            config,
            store,
            bytes,
            works,
            runtime: runtime.clone(),
            is_stopping: AtomicBool::new(false),
            wakes: Mutex::new(0),
            woken: Condvar::new(),
            live: watch::Sender::new(0),
            left_behind: Mutex::default(),
        });
        let listener = runtime.spawn(listen(Arc::clone(&shared), shared.store.changes()));
        let housekeeping = runtime.spawn(collector::keep(
            shared.config.clone(),
            Arc::clone(&shared.store),
            shared.bytes.clone(),
        ));
        let tasks = vec![listener.abort_handle(), housekeeping.abort_handle()];
        let pool = Self { shared, tasks };
        pool.spawn_threads()?;
        Ok(pool)
    }

    fn spawn_threads(&self) -> io::Result<()> {
        let shared = Arc::clone(&self.shared);
        thread::Builder::new().name("heart".to_owned()).spawn(move || shared.heart.run())?;
        for number in 0..self.shared.config.workers {
            let shared = Arc::clone(&self.shared);
            let live = Live::new(&shared);
            let thread = thread::Builder::new().name(format!("worker-{number}"));
            thread.spawn(move || {
                let _live = live;
                serve(&shared, &format!("{}-{number}", process_name()));
            })?;
        }
        Ok(())
    }

    /// Stops claiming, waits up to `grace` for running jobs, tells the rest to
    /// stop and puts them back. Work that does not stop is left behind: its
    /// job is put back too, and whatever it still writes is refused.
    pub async fn shutdown(mut self, grace: Duration) {
        self.shared.stop_claiming();
        if !self.are_idle_within(grace).await {
            self.shared.heart.shut_down();
            if !self.are_idle_within(STOP_TIMEOUT).await {
                self.abandon().await;
            }
        }
        self.stop();
    }

    async fn are_idle_within(&self, limit: Duration) -> bool {
        let mut live = self.shared.live.subscribe();
        let idle = live.wait_for(|count| *count == 0);
        tokio::time::timeout(limit, idle).await.is_ok()
    }

    async fn abandon(&self) {
        for (job, attempt) in self.shared.heart.running() {
            match self.shared.store.release(job, attempt).await {
                Ok(state) => tracing::warn!(%job, attempt, ?state, "left behind and put back"),
                Err(error) => tracing::warn!(%job, attempt, %error, "could not be put back"),
            }
        }
    }

    fn stop(&mut self) {
        self.shared.stop_claiming();
        self.shared.heart.stop();
        for task in &self.tasks {
            task.abort();
        }
    }
}

/// A pool that is dropped claims nothing more; its running jobs lose their
/// leases and are run again elsewhere.
impl Drop for Pool {
    fn drop(&mut self) {
        self.shared.heart.shut_down();
        self.stop();
    }
}

impl Shared {
    fn is_stopping(&self) -> bool {
        self.is_stopping.load(Ordering::SeqCst)
    }

    fn stop_claiming(&self) {
        self.is_stopping.store(true, Ordering::SeqCst);
        self.wake();
    }

    /// Lets work that does not stop go on beside the next jobs, but no more of it
    /// than there are workers: then its worker waits for it.
    pub(super) fn leave_behind(&self, outcome: Receiver<Outcome>) {
        let mut others = self.left_behind.lock().unwrap_or_else(PoisonError::into_inner);
        others.retain(|other| matches!(other.try_recv(), Err(TryRecvError::Empty)));
        if others.len() < self.config.workers {
            others.push(outcome);
            return;
        }
        drop(others);
        let _ = outcome.recv();
    }

    fn wake(&self) {
        *self.wakes() += 1;
        self.woken.notify_all();
    }

    /// Wakes an idle worker for one more job: all of them would ask the database
    /// for it, those of every node. Who is busy looks again when it has done.
    fn wake_one(&self) {
        *self.wakes() += 1;
        self.woken.notify_one();
    }

    fn wakes(&self) -> MutexGuard<'_, u64> {
        self.wakes.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    /// Waits until something may be queued: told so since `seen`, or by chance.
    fn wait(&self, seen: u64) {
        let poll = self.config.poll_interval;
        let waiting = self.woken.wait_timeout_while(self.wakes(), poll, |wakes| *wakes == seen);
        drop(waiting);
    }
}

/// Counts a worker thread as live until it ends, be it by a panic.
struct Live(Arc<Shared>);

impl Live {
    fn new(shared: &Arc<Shared>) -> Self {
        shared.live.send_modify(|count| *count += 1);
        Self(Arc::clone(shared))
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.0.live.send_modify(|count| *count -= 1);
    }
}

/// Tells the processes of all nodes apart, for people who read the database.
fn process_name() -> String {
    let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    format!("{}-{}", host.trim(), std::process::id())
}

/// A worker thread's life.
fn serve(shared: &Arc<Shared>, name: &str) {
    loop {
        let seen = *shared.wakes();
        if shared.is_stopping() {
            return;
        }
        let asked = Instant::now();
        let claim = shared.store.claim(name, shared.config.lease);
        let claimed = shared.runtime.block_on(claim);
        metrics::database("claim", asked);
        match claimed {
            Ok(Some(claim)) => run::run(shared, claim, asked),
            Ok(None) => shared.wait(seen),
            Err(error) => {
                tracing::error!(worker = name, %error, "could not claim a job");
                shared.wait(seen);
            }
        }
    }
}

/// Passes on what the store tells of changes in this process.
async fn listen(shared: Arc<Shared>, mut changes: broadcast::Receiver<JobChange>) {
    loop {
        match changes.recv().await {
            Ok(JobChange { kind: EventKind::Queued | EventKind::Requeued, .. }) => {
                shared.wake_one();
            }
            Ok(JobChange { kind: EventKind::CancelRequested, id, .. }) => shared.heart.cancel(id),
            Ok(_) => {}
            // What was missed is found by polling; a job may be waiting now.
            Err(RecvError::Lagged(_)) => shared.wake(),
            Err(RecvError::Closed) => return,
        }
    }
}
