//! The children that wait for work.

use std::ffi::OsString;
use std::io::{self, BufRead, BufReader, Read};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child as Process, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, Once, PoisonError, Weak};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

use super::ChildSettings;
use super::wire::{FromChild, ToChild, receive, send};
use jobs::TenantName;

/// How long a child may take to start on a busy machine.
const START_PATIENCE: Duration = Duration::from_secs(30);
/// How long one that closed its socket may take to die.
const END_PATIENCE: Duration = Duration::from_secs(2);
/// Jobs of one child: what it leaves unused in its memory is given back then.
const MAX_JOBS: u32 = 100;
/// What is kept of what a child said last, bytes.
const LAST_WORDS: usize = 600;
/// The longest line of a child's log, bytes.
const MAX_LINE: u64 = 16 << 10;

/// Settings that a child inherits. Others may be secrets.
const INHERITED: &[&str] = &["LD_LIBRARY_PATH", "MALLOC_ARENA_MAX"];

/// Asks for a child: for somebody who waits, or to wait itself.
type Request = Option<SyncSender<io::Result<Child>>>;

/// Children that wait for work.
pub(super) struct Children {
    idle: Mutex<Vec<Child>>,
    warm: usize,
    requests: Mutex<Sender<Request>>,
}

impl Children {
    /// Starts a thread that starts children, and `warm` of them.
    ///
    /// # Errors
    /// If the system gives no thread.
    pub(super) fn start(
        program: &Path,
        settings: ChildSettings,
        warm: usize,
    ) -> io::Result<Arc<Self>> {
        let (requests, asked) = channel();
        let requests = Mutex::new(requests);
        let children = Arc::new(Self { idle: Mutex::default(), warm, requests });
        let (owner, program) = (Arc::downgrade(&children), program.to_owned());
        // One thread that lasts: children die with the thread that started them.
        thread::Builder::new()
            .name("children".to_owned())
            .spawn(move || start_children(&program, &settings, &asked, &owner))?;
        (0..warm).for_each(|_| children.warm_up());
        Ok(children)
    }

    /// A child for a job of `tenant`: none that has worked for another one.
    ///
    /// # Errors
    /// If none can be started.
    pub(super) fn take(&self, tenant: &TenantName) -> io::Result<Child> {
        let (found, has_fresh) = {
            let mut idle = lock(&self.idle);
            idle.retain_mut(|child| !child.has_ended());
            let of_tenant = idle.iter().position(|child| child.tenant.as_ref() == Some(tenant));
            let fresh = || idle.iter().position(|child| child.tenant.is_none());
            let found = of_tenant.or_else(fresh).map(|at| idle.swap_remove(at));
            (found, idle.iter().any(|child| child.tenant.is_none()))
        };
        if !has_fresh {
            self.warm_up();
        }
        let mut child = found.map_or_else(|| self.ask(), Ok)?;
        child.tenant = Some(tenant.clone());
        Ok(child)
    }

    /// Lets a child wait for its tenant's next job, instead of the one that has
    /// waited longest if there are enough.
    pub(super) fn give_back(&self, child: Child) {
        if child.jobs >= MAX_JOBS {
            return;
        }
        let mut idle = lock(&self.idle);
        idle.push(child);
        let used = idle.iter().filter(|child| child.tenant.is_some()).count();
        let oldest = idle.iter().position(|child| child.tenant.is_some());
        let ended = oldest.filter(|_| used > self.warm).map(|at| idle.remove(at));
        drop(idle);
        drop(ended);
    }

    /// Starts a child that waits, soon.
    pub(super) fn warm_up(&self) {
        let _ = lock(&self.requests).send(None);
    }

    fn ask(&self) -> io::Result<Child> {
        let (answer, child) = sync_channel(1);
        lock(&self.requests).send(Some(answer)).map_err(io::Error::other)?;
        child.recv().map_err(io::Error::other)?
    }
}

/// Starts children as they are asked for, until nobody can ask.
fn start_children(
    program: &Path,
    settings: &ChildSettings,
    asked: &Receiver<Request>,
    owner: &Weak<Children>,
) {
    for request in asked {
        let Some(answer) = request else {
            let Some(children) = owner.upgrade() else { return };
            let fresh = lock(&children.idle).iter().filter(|it| it.tenant.is_none()).count();
            if fresh >= children.warm.max(1) {
                continue;
            }
            match Child::start(program, settings) {
                Ok(child) => lock(&children.idle).push(child),
                Err(error) => tracing::error!(%error, "could not start a process for work"),
            }
            continue;
        };
        let _ = answer.send(Child::start(program, settings));
    }
}

/// A process that works; killed when dropped.
pub(super) struct Child {
    process: Process,
    pub(super) pid: Pid,
    pub(super) socket: UnixStream,
    /// Whose jobs it has worked on.
    tenant: Option<TenantName>,
    pub(super) jobs: u32,
    words: Option<JoinHandle<String>>,
}

impl Child {
    fn start(program: &Path, settings: &ChildSettings) -> io::Result<Self> {
        let (socket, its_end) = UnixStream::pair()?;
        let mut command = Command::new(PathBuf::from(program));
        command.arg("child").env_clear().envs(inherited());
        command.stdin(OwnedFd::from(its_end)).stdout(Stdio::null()).stderr(Stdio::piped());
        let mut process = command.spawn()?;
        // Its end must be closed here, or its death would not be noticed.
        drop(command);
        let pid = Pid::from_child(&process);
        let said = process.stderr.take();
        let name = format!("child-{}", process.id());
        let words = said.map(|said| {
            thread::Builder::new().name(name).spawn(move || listen(said, pid.as_raw_pid()))
        });
        let mut child =
            Self { process, pid, socket, tenant: None, jobs: 0, words: words.transpose()? };
        child.greet(settings).map_err(|error| {
            let how = child.verdict();
            io::Error::new(error.kind(), format!("{error}; the process {how}"))
        })?;
        Ok(child)
    }

    fn greet(&mut self, settings: &ChildSettings) -> io::Result<()> {
        send(&mut self.socket, &ToChild::Begin(settings.clone()), b"")?;
        self.socket.set_read_timeout(Some(START_PATIENCE))?;
        let (FromChild::Ready(held), _) = receive(&mut self.socket)? else {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "it is not ready"));
        };
        self.socket.set_read_timeout(None)?;
        static TOLD: Once = Once::new();
        TOLD.call_once(|| {
            let memory_mib = settings.memory_bytes >> 20;
            let (namespace, filter) = (held.network_namespace, held.filter);
            tracing::info!(memory_mib, namespace, filter, "jobs run in processes of their own");
            if !namespace && !filter {
                tracing::warn!("this system holds them back from neither files nor network");
            }
        });
        Ok(())
    }

    fn has_ended(&mut self) -> bool {
        !matches!(self.process.try_wait(), Ok(None))
    }

    /// Ends the process at once.
    pub(super) fn kill(&self) {
        // It is not waited for before it is dropped, so that the number is still its.
        let _ = kill_process(self.pid, Signal::KILL);
    }

    /// How it died, and its last words; kills it if it does not.
    pub(super) fn verdict(&mut self) -> String {
        let begun = Instant::now();
        while !self.has_ended() && begun.elapsed() < END_PATIENCE {
            thread::sleep(Duration::from_millis(5));
        }
        let _ = self.process.kill();
        let how = match self.process.wait() {
            Ok(status) => ending(status),
            Err(error) => format!("ended: {error}"),
        };
        let words = self.words.take().and_then(|words| words.join().ok()).unwrap_or_default();
        match words.trim() {
            "" => how,
            words => format!("{how}; it said: {words}"),
        }
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn inherited() -> Vec<(&'static str, OsString)> {
    let mut names = INHERITED.to_vec();
    #[cfg(debug_assertions)]
    names.push(super::faults::VARIABLE);
    names.retain(|name| std::env::var_os(name).is_some());
    names.into_iter().map(|name| (name, std::env::var_os(name).unwrap_or_default())).collect()
}

fn ending(status: ExitStatus) -> String {
    use std::os::unix::process::ExitStatusExt;
    match (status.signal(), status.code()) {
        (Some(9), _) => "was killed (signal 9), as the system does when memory runs out".to_owned(),
        (Some(signal), _) => format!("died of signal {signal}"),
        (_, Some(code)) => format!("ended with status {code}"),
        _ => "ended".to_owned(),
    }
}

/// Passes a child's log on and returns its last words, those that are no log lines.
fn listen(said: impl Read, pid: i32) -> String {
    let (mut said, mut words) = (BufReader::new(said), String::new());
    loop {
        let mut line = Vec::new();
        match (&mut said).take(MAX_LINE).read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => return words,
            Ok(_) => {}
        }
        let line = String::from_utf8_lossy(&line);
        let line = line.trim();
        match line.split_once(' ') {
            Some(("TRACE", line)) => tracing::trace!(pid, "{line}"),
            Some(("DEBUG", line)) => tracing::debug!(pid, "{line}"),
            Some(("INFO", line)) => tracing::info!(pid, "{line}"),
            Some(("WARN", line)) => tracing::warn!(pid, "{line}"),
            Some(("ERROR", line)) => tracing::error!(pid, "{line}"),
            _ if line.is_empty() => {}
            _ => {
                tracing::warn!(pid, "{line}");
                words = format!("{words} {line}");
                let cut = words.len().saturating_sub(LAST_WORDS);
                words.drain(..words.ceil_char_boundary(cut));
            }
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
