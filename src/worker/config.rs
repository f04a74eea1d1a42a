//! How a worker pool works: threads, leases, intervals.

use std::time::Duration;

/// How a worker pool works.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkerConfig {
    /// Jobs that run at once; each has a thread of its own.
    pub workers: usize,
    /// Threads that one job may compute with.
    pub threads_per_job: usize,
    /// How long a job stays with a worker that is silent.
    pub lease: Duration,
    /// How often a worker renews its lease; well below `lease`.
    pub heartbeat: Duration,
    /// How often an idle worker looks for jobs that other processes enqueued.
    pub poll_interval: Duration,
    /// How often running jobs are checked for cancellation by other processes.
    pub cancel_poll: Duration,
    /// How often jobs of silent workers are put back.
    pub reap_interval: Duration,
    /// How often bytes that belong to no job or attempt are looked for.
    pub collect_interval: Duration,
    /// Bytes of a job that is being uploaded are left alone for this long.
    pub collect_after: Duration,
    /// Bytes of jobs that the store never heard of are deleted once they are
    /// this old. `None` keeps them: a database that was lost or put back from a
    /// copy does not know all that it should.
    pub collect_unknown_after: Option<Duration>,
    /// Above as many stored bytes what ended longest ago is deleted. `None` keeps it.
    pub make_room: Option<u64>,
    /// The least time between two progress writes of a job.
    pub progress_interval: Duration,
    /// How long one attempt at a job may take.
    pub max_job_time: Duration,
    /// How long a job whose attempt broke waits for the next one.
    pub retry_pause: Duration,
}

impl Default for WorkerConfig {
    fn default() -> Self {
        Self {
            workers: 1,
            threads_per_job: std::thread::available_parallelism().map_or(1, usize::from),
            lease: Duration::from_secs(30),
            heartbeat: Duration::from_secs(10),
            poll_interval: Duration::from_secs(1),
            cancel_poll: Duration::from_millis(500),
            reap_interval: Duration::from_secs(1),
            collect_interval: Duration::from_secs(600),
            collect_after: Duration::from_secs(3600),
            collect_unknown_after: None,
            make_room: None,
            progress_interval: Duration::from_millis(100),
            max_job_time: Duration::from_secs(600),
            retry_pause: Duration::from_secs(2),
        }
    }
}
