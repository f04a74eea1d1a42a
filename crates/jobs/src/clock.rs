//! Where the queue takes the time from, so that tests can move it.

use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

use jiff::{SignedDuration, Timestamp};
use rustix::time::{ClockId, clock_gettime};

/// Where the queue takes the time from.
pub trait Clock: Send + Sync {
    /// The present moment as people tell it: may be set forward and back.
    fn now(&self) -> Timestamp;

    /// The present moment of a clock that nobody sets, the same for all
    /// processes of a machine: what leases and pauses are measured by.
    fn uptime(&self) -> Uptime;
}

/// A moment since the machine started.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Uptime {
    /// Names the start; moments of different starts can't be compared.
    pub boot: Arc<str>,
    /// Milliseconds since.
    pub ms: i64,
}

impl Uptime {
    /// This moment and `by`, at the end of time at the latest.
    pub(crate) fn after(&self, by: Duration) -> Self {
        let by_ms = i64::try_from(by.as_millis()).unwrap_or(i64::MAX);
        Self { boot: Arc::clone(&self.boot), ms: self.ms.saturating_add(by_ms) }
    }

    /// Whether `self` is over at `now`: reached, or of an earlier start.
    pub fn is_over(&self, now: &Self) -> bool {
        self.boot != now.boot || self.ms <= now.ms
    }
}

/// The machine's clocks.
#[derive(Clone, Copy, Debug, Default)]
pub struct SystemClock;

impl Clock for SystemClock {
    /// Cut to milliseconds, as it is stored: what is told of a job at once is
    /// what is told of it later.
    fn now(&self) -> Timestamp {
        let now = Timestamp::now();
        Timestamp::from_millisecond(now.as_millisecond()).unwrap_or(now)
    }

    fn uptime(&self) -> Uptime {
        static BOOT: OnceLock<Arc<str>> = OnceLock::new();
        // Where the system does not tell, restarts of the machine are not
        // noticed, and leases end when their time has come.
        let read = || std::fs::read_to_string("/proc/sys/kernel/random/boot_id");
        let boot = BOOT.get_or_init(|| read().unwrap_or_default().trim().into());
        let time = clock_gettime(ClockId::Boottime);
        Uptime { boot: Arc::clone(boot), ms: time.tv_sec * 1000 + time.tv_nsec / 1_000_000 }
    }
}

/// A clock that only moves when told to, so that tests of leases need no sleep.
#[derive(Debug)]
pub struct ManualClock {
    now_ms: AtomicI64,
    up_ms: AtomicI64,
    boot: Mutex<Arc<str>>,
}

impl ManualClock {
    /// Starts at `now`, cut to milliseconds.
    pub fn new(now: Timestamp) -> Self {
        Self {
            now_ms: AtomicI64::new(now.as_millisecond()),
            up_ms: AtomicI64::new(0),
            boot: Mutex::new("first".into()),
        }
    }

    /// Lets time pass.
    pub fn advance(&self, by: Duration) {
        let by_ms = i64::try_from(by.as_millis()).unwrap_or(i64::MAX);
        self.now_ms.fetch_add(by_ms, Ordering::SeqCst);
        self.up_ms.fetch_add(by_ms, Ordering::SeqCst);
    }

    /// Sets the clock that people read, forward or back, while no time passes.
    pub fn set(&self, now: Timestamp) {
        self.now_ms.store(now.as_millisecond(), Ordering::SeqCst);
    }

    /// Starts the machine again.
    pub fn reboot(&self, boot: &str) {
        *self.boot.lock().unwrap_or_else(PoisonError::into_inner) = boot.into();
        self.up_ms.store(0, Ordering::SeqCst);
    }
}

impl Clock for ManualClock {
    fn now(&self) -> Timestamp {
        let now = SignedDuration::from_millis(self.now_ms.load(Ordering::SeqCst));
        Timestamp::from_duration(now).unwrap_or(Timestamp::MAX)
    }

    fn uptime(&self) -> Uptime {
        let boot = Arc::clone(&self.boot.lock().unwrap_or_else(PoisonError::into_inner));
        Uptime { boot, ms: self.up_ms.load(Ordering::SeqCst) }
    }
}
