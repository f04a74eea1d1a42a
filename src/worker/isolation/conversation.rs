//! One job with a child: what it needs and makes, and how it is stopped.

use std::collections::HashMap;
use std::io::{self, Write};
use std::os::unix::net::UnixStream;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::thread::{self, Scope};
use std::time::{Duration, Instant};

use serde_json::Value;

use super::children::Child;
use super::wire::{FromChild, ReadError, ToChild, receive, send};
use crate::worker::{Attempt, WorkError};
use artifacts::ArtifactWriter;

/// How often it is looked whether the work should stop.
const TICK: Duration = Duration::from_millis(20);
/// How long a child has to stop by itself before it is killed.
const GRACE: Duration = Duration::from_millis(200);

/// How a conversation ended.
enum End {
    /// The child said so.
    Done(Result<Option<Value>, WorkError>),
    /// The child is gone, or talks nonsense.
    Lost(io::Error),
}

impl Child {
    /// Lets the child work on an attempt. One that should stop and does not is
    /// killed.
    ///
    /// # Errors
    /// What the work says; [`WorkError::Crashed`] if its process died.
    pub(super) fn work(&mut self, attempt: &dyn Attempt) -> Result<(), WorkError> {
        self.jobs += 1;
        let line = Mutex::new(self.socket.try_clone()?);
        let end = thread::scope(|scope| {
            let (over, is_over) = channel::<()>();
            let (child, telling) = (&*self, &line);
            scope.spawn(move || watch(child, attempt, telling, &is_over));
            let end = match tell(telling, &ToChild::Run(attempt.task().clone()), b"") {
                Ok(()) => converse(&self.socket, attempt, telling, scope),
                Err(error) => End::Lost(error),
            };
            drop(over);
            end
        });
        match end {
            End::Done(Ok(summary)) => {
                summary.into_iter().for_each(|summary| attempt.summarise(summary));
                Ok(())
            }
            End::Done(Err(error)) => Err(error),
            End::Lost(_) if attempt.is_cancelled() => {
                self.kill();
                Err(WorkError::Cancelled)
            }
            End::Lost(error) => {
                if error.kind() == io::ErrorKind::InvalidData {
                    self.kill();
                }
                Err(WorkError::Crashed(self.verdict()))
            }
        }
    }
}

fn tell(line: &Mutex<UnixStream>, message: &ToChild, bytes: &[u8]) -> io::Result<()> {
    send(&mut *line.lock().unwrap_or_else(PoisonError::into_inner), message, bytes)
}

/// Tells the child to stop when it should, and kills it if it goes on.
fn watch(child: &Child, attempt: &dyn Attempt, line: &Mutex<UnixStream>, is_over: &Receiver<()>) {
    while is_over.recv_timeout(TICK) == Err(RecvTimeoutError::Timeout) {
        if !attempt.is_cancelled() {
            continue;
        }
        let told = Instant::now();
        // One that takes nothing any more would keep the telling waiting.
        if let Ok(mut line) = line.try_lock() {
            let _ = line.set_write_timeout(Some(GRACE));
            let _ = send(&mut *line, &ToChild::Cancel, b"");
        }
        let rest = GRACE.saturating_sub(told.elapsed());
        if is_over.recv_timeout(rest) == Err(RecvTimeoutError::Timeout) {
            child.kill();
        }
        return;
    }
}

/// Gives what is asked for and takes what comes until the work is done.
fn converse<'scope, 'env>(
    mut socket: &'env UnixStream,
    attempt: &'env dyn Attempt,
    line: &'env Mutex<UnixStream>,
    scope: &'scope Scope<'scope, 'env>,
) -> End {
    let mut files = Files { attempt, growing: HashMap::new(), refused: None };
    loop {
        let (message, bytes) = match receive(&mut socket) {
            Ok(received) => received,
            Err(error) => return End::Lost(error),
        };
        match message {
            FromChild::Read { request, name } => {
                // Beside the conversation: inputs of a remote store come together.
                scope.spawn(move || {
                    let (error, bytes) = match attempt.read(&name) {
                        Ok(bytes) => (None, bytes),
                        Err(error) => (Some(ReadError::from(error)), Vec::new()),
                    };
                    let _ = tell(line, &ToChild::Input { request, error }, &bytes);
                });
            }
            FromChild::Progress { fraction, progress } => attempt.report(fraction, progress),
            FromChild::Done(result) => {
                return End::Done(files.refused.map_or(result, |error| Err(error.into())));
            }
            FromChild::Ready(_) => {}
            other => {
                if let Err(error) = files.take(other, bytes)
                    && files.refused.replace(error).is_none()
                {
                    let _ = tell(line, &ToChild::Cancel, b"");
                }
            }
        }
    }
}

/// The artifacts that come.
struct Files<'a> {
    attempt: &'a dyn Attempt,
    growing: HashMap<u64, Box<dyn ArtifactWriter>>,
    /// Why one was not taken.
    refused: Option<io::Error>,
}

impl Files<'_> {
    fn take(&mut self, message: FromChild, bytes: Vec<u8>) -> io::Result<()> {
        if self.refused.is_some() {
            return Ok(());
        }
        let unknown = || io::Error::new(io::ErrorKind::InvalidData, "no such artifact was begun");
        match message {
            FromChild::Artifact { name, media_type } => {
                self.attempt.emit(&name, &media_type, bytes.into())
            }
            FromChild::Create { writer, name, media_type } => {
                self.growing.insert(writer, self.attempt.create(&name, &media_type)?);
                Ok(())
            }
            FromChild::Piece { writer } => {
                self.growing.get_mut(&writer).ok_or_else(unknown)?.write_all(&bytes)
            }
            FromChild::Finish { writer } => {
                self.growing.remove(&writer).ok_or_else(unknown)?.finish()
            }
            _ => Ok(()),
        }
    }
}
