//! The process that works: its end of the socket.

use std::any::Any;
use std::collections::HashMap;
use std::io::{self, Write};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread;

use bytes::Bytes;
use serde_json::Value;

use super::ChildSettings;
use super::confine::{confine, die_with_parent};
use super::wire::{FromChild, ToChild, receive, send};
use crate::worker::{Attempt, Task, Work, WorkError};
use artifacts::ArtifactWriter;

/// What is sent at once of an artifact.
const PIECE_BYTES: usize = 4 << 20;

/// Works for the process at the other end of standard input, a socket, until it
/// closes it.
///
/// * `works`: makes the kinds of work; called before this process is confined.
///
/// # Errors
/// If standard input is no such socket, or the process can't be confined.
pub fn serve(works: impl FnOnce(&ChildSettings) -> Vec<Arc<dyn Work>>) -> io::Result<()> {
    die_with_parent()?;
    let mut input = UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
    let (ToChild::Begin(settings), _) = receive(&mut input)? else {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "no settings came first"));
    };
    let works = works(&settings);
    let held = confine(settings.memory_bytes)?;
    let line = Arc::new(Line::new(input.try_clone()?));
    line.send(&FromChild::Ready(held), b"")?;
    let (tasks, next) = sync_channel(1);
    let listening = Arc::clone(&line);
    thread::spawn(move || {
        // Whatever it says, there is nobody left to work for.
        let _ = listen(&mut input, &listening, &tasks);
        process::exit(0);
    });
    for task in next {
        let outcome = work(&works, task, &line);
        line.send(&FromChild::Done(outcome), b"")?;
    }
    Ok(())
}

/// Takes what comes until the end.
fn listen(input: &mut UnixStream, line: &Line, tasks: &SyncSender<Task>) -> io::Result<()> {
    loop {
        match receive(input)? {
            (ToChild::Run(task), _) => {
                line.is_cancelled.store(false, Ordering::SeqCst);
                tasks.send(task).map_err(io::Error::other)?;
            }
            (ToChild::Input { request, error }, bytes) => {
                let reader = lock(&line.readers).remove(&request);
                let found = error.map_or(Ok(bytes), |error| Err(error.into()));
                if let Some(reader) = reader {
                    let _ = reader.send(found);
                }
            }
            (ToChild::Cancel, _) => line.is_cancelled.store(true, Ordering::SeqCst),
            (ToChild::Begin(_), _) => {}
        }
    }
}

fn work(works: &[Arc<dyn Work>], task: Task, line: &Arc<Line>) -> Result<Option<Value>, WorkError> {
    #[cfg(debug_assertions)]
    super::faults::strike(&task);
    let Some(work) = works.iter().find(|work| work.kind() == task.kind) else {
        return Err(WorkError::Broken(format!("no work for jobs of kind {}", task.kind)));
    };
    let attempt = ChildAttempt { task, line: Arc::clone(line), summary: OnceLock::new() };
    let result = catch_unwind(AssertUnwindSafe(|| work.run(&attempt)));
    let panicked =
        |panic: Box<dyn Any + Send>| Err(WorkError::Broken(crate::worker::panic_message(&*panic)));
    result.unwrap_or_else(panicked)?;
    Ok(attempt.summary.into_inner())
}

/// This end of the socket.
struct Line {
    out: Mutex<UnixStream>,
    is_cancelled: AtomicBool,
    /// Those who wait for inputs, by the number of their request.
    readers: Mutex<HashMap<u64, SyncSender<io::Result<Vec<u8>>>>>,
    /// The next number of a request or a writer.
    number: AtomicU64,
}

impl Line {
    fn new(out: UnixStream) -> Self {
        let (is_cancelled, number) = (AtomicBool::new(false), AtomicU64::new(0));
        Self { out: Mutex::new(out), is_cancelled, readers: Mutex::default(), number }
    }

    fn send(&self, message: &FromChild, bytes: &[u8]) -> io::Result<()> {
        send(&mut *lock(&self.out), message, bytes)
    }

    fn number(&self) -> u64 {
        self.number.fetch_add(1, Ordering::Relaxed)
    }
}

/// An attempt whose stores are at the other end.
struct ChildAttempt {
    task: Task,
    line: Arc<Line>,
    summary: OnceLock<Value>,
}

impl Attempt for ChildAttempt {
    fn task(&self) -> &Task {
        &self.task
    }

    fn is_cancelled(&self) -> bool {
        self.line.is_cancelled.load(Ordering::SeqCst)
    }

    fn summarise(&self, summary: Value) {
        let _ = self.summary.set(summary);
    }

    fn read(&self, name: &str) -> io::Result<Vec<u8>> {
        let request = self.line.number();
        let (reader, found) = sync_channel(1);
        lock(&self.line.readers).insert(request, reader);
        self.line.send(&FromChild::Read { request, name: name.to_owned() }, b"")?;
        found.recv().map_err(io::Error::other)?
    }

    fn emit(&self, name: &str, media_type: &str, bytes: Bytes) -> io::Result<()> {
        if bytes.len() > PIECE_BYTES {
            let mut writer = self.create(name, media_type)?;
            writer.write_all(&bytes)?;
            return writer.finish();
        }
        let (name, media_type) = (name.to_owned(), media_type.to_owned());
        self.line.send(&FromChild::Artifact { name, media_type }, &bytes)
    }

    fn create(&self, name: &str, media_type: &str) -> io::Result<Box<dyn ArtifactWriter>> {
        let (name, media_type) = (name.to_owned(), media_type.to_owned());
        let writer = self.line.number();
        self.line.send(&FromChild::Create { writer, name, media_type }, b"")?;
        Ok(Box::new(Writer { line: Arc::clone(&self.line), number: writer, piece: Vec::new() }))
    }

    fn report(&self, fraction: f64, progress: Value) {
        // JSON has no other numbers.
        if fraction.is_finite() {
            // Who can't be told any more sees the end of the socket.
            let _ = self.line.send(&FromChild::Progress { fraction, progress }, b"");
        }
    }
}

/// An artifact that is sent as it grows.
struct Writer {
    line: Arc<Line>,
    number: u64,
    piece: Vec<u8>,
}

impl Write for Writer {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let room = PIECE_BYTES - self.piece.len();
        let taken = &bytes[..bytes.len().min(room)];
        self.piece.extend_from_slice(taken);
        if self.piece.len() == PIECE_BYTES {
            self.flush()?;
        }
        Ok(taken.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.line.send(&FromChild::Piece { writer: self.number }, &self.piece)?;
        self.piece.clear();
        Ok(())
    }
}

impl ArtifactWriter for Writer {
    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.flush()?;
        self.line.send(&FromChild::Finish { writer: self.number }, b"")
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
