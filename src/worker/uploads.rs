//! Stores an attempt's artifacts while its work goes on.

use std::collections::HashSet;
use std::io::{self, Write};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use bytes::Bytes;
use sha2::{Digest, Sha256};
use tokio::runtime::Handle;
use tokio::sync::{Semaphore, mpsc};
use tokio::task::{AbortHandle, JoinHandle};

use super::metrics;
use artifacts::ArtifactWriter;
use jobs::bytes::{ByteError, ByteStore, ByteWriter, Key};
use jobs::{ArtifactEntry, JobId};

/// Artifacts stored at once. Their syncs then share the disk's journal writes.
const MAX_IN_FLIGHT: usize = 16;
/// Bytes of artifacts on their way, KiB: what an attempt may hold in memory.
const MAX_IN_FLIGHT_KIB: usize = 128 << 10;
/// What is passed on at once of an artifact that is written piece by piece.
const CHUNK_BYTES: usize = 4 << 20;
/// Chunks of it that may wait.
const CHUNKS_WAITING: usize = 2;

type Stored = JoinHandle<Result<ArtifactEntry, ByteError>>;

/// Stores the artifacts of one attempt while its work goes on.
pub(super) struct Uploads {
    job: JobId,
    attempt: u32,
    store: ByteStore,
    runtime: Handle,
    files: Arc<Semaphore>,
    kib: Arc<Semaphore>,
    started: Arc<Mutex<Started>>,
}

#[derive(Default)]
struct Started {
    names: HashSet<String>,
    tasks: Vec<Stored>,
    /// Of artifacts that are written piece by piece.
    pieces: Vec<AbortHandle>,
    is_closed: bool,
}

impl Uploads {
    pub(super) fn new(job: JobId, attempt: u32, store: ByteStore, runtime: Handle) -> Self {
        Self {
            job,
            attempt,
            store,
            runtime,
            files: Arc::new(Semaphore::new(MAX_IN_FLIGHT)),
            kib: Arc::new(Semaphore::new(MAX_IN_FLIGHT_KIB)),
            started: Arc::default(),
        }
    }

    /// Begins to store an artifact; waits only while too many bytes are on
    /// their way.
    pub(super) fn add(&self, name: &str, media_type: &str, bytes: Bytes) -> io::Result<()> {
        self.register(name)?;
        let kib = bytes.len().div_ceil(1024).clamp(1, MAX_IN_FLIGHT_KIB);
        // At most `MAX_IN_FLIGHT_KIB`.
        let room = Arc::clone(&self.kib).acquire_many_owned(kib as u32);
        let room = self.runtime.block_on(room).map_err(io::Error::other)?;
        let (job, attempt) = (self.job, self.attempt);
        let (store, files) = (self.store.clone(), Arc::clone(&self.files));
        let (name, media_type) = (name.to_owned(), media_type.to_owned());
        let task = self.runtime.spawn(async move {
            let _room = room;
            let _file = files.acquire_owned().await.map_err(ByteError::other)?;
            let key = Key::Artifact { job, attempt, name: &name };
            let (size, begun) = (bytes.len() as u64, Instant::now());
            let hashed = hash(Sha256::new(), bytes.clone());
            let (hasher, ()) = tokio::try_join!(hashed, store.put(&key, bytes))?;
            metrics::store("put", begun, size);
            Ok(ArtifactEntry { media_type, bytes: size, sha256: hex(hasher), name })
        });
        lock(&self.started).tasks.push(task);
        Ok(())
    }

    /// Begins an artifact that is stored while it is written.
    pub(super) fn create(&self, name: &str, media_type: &str) -> io::Result<Upload> {
        self.register(name)?;
        let (chunks, received) = mpsc::channel(CHUNKS_WAITING);
        let (job, attempt, store) = (self.job, self.attempt, self.store.clone());
        let (name, media_type) = (name.to_owned(), media_type.to_owned());
        let task = self.runtime.spawn(async move {
            let begun = Instant::now();
            let writer = store.writer(&Key::Artifact { job, attempt, name: &name }).await?;
            let (bytes, sha256) = receive(writer, received).await?;
            // With what the work takes to write it.
            metrics::store("put_in_pieces", begun, bytes);
            Ok(ArtifactEntry { media_type, bytes, sha256, name })
        });
        let started = Arc::clone(&self.started);
        {
            let mut started = lock(&started);
            started.pieces.push(task.abort_handle());
            if started.is_closed {
                task.abort();
            }
        }
        Ok(Upload { chunk: Vec::new(), chunks, task: Some(task), started })
    }

    /// Takes a name that can be stored and is not taken.
    fn register(&self, name: &str) -> io::Result<()> {
        let key = Key::Artifact { job: self.job, attempt: self.attempt, name };
        key.path().map_err(|error| io::Error::new(io::ErrorKind::InvalidInput, error))?;
        let mut started = lock(&self.started);
        if started.is_closed {
            return Err(io::Error::new(io::ErrorKind::BrokenPipe, "the attempt has ended"));
        }
        if started.names.insert(name.to_owned()) {
            return Ok(());
        }
        let message = format!("artifact {name} was emitted twice");
        Err(io::Error::new(io::ErrorKind::AlreadyExists, message))
    }

    /// Takes no artifacts any more, and lets go of those that are being written.
    pub(super) async fn close(&self) {
        let pieces = {
            let mut started = lock(&self.started);
            started.is_closed = true;
            std::mem::take(&mut started.pieces)
        };
        pieces.iter().for_each(AbortHandle::abort);
        while pieces.iter().any(|piece| !piece.is_finished()) {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    }

    /// Waits until all artifacts are durable. Entries are in the order in which
    /// they were complete.
    ///
    /// # Errors
    /// The first error of any of them.
    pub(super) async fn finish(&self) -> Result<Vec<ArtifactEntry>, ByteError> {
        let tasks = std::mem::take(&mut lock(&self.started).tasks);
        let mut entries = Vec::with_capacity(tasks.len());
        let mut first_error = None;
        // Waits for all even after an error: nothing may be written any more
        // when the attempt's bytes are deleted.
        for task in tasks {
            match task.await.map_err(ByteError::other).and_then(|stored| stored) {
                Ok(entry) => entries.push(entry),
                Err(error) => first_error = first_error.or(Some(error)),
            }
        }
        first_error.map_or(Ok(entries), Err)
    }
}

/// An artifact that is hashed and stored while it is written. Unless it is
/// finished, the attempt cannot succeed.
pub(super) struct Upload {
    chunk: Vec<u8>,
    /// `None` is the end.
    chunks: mpsc::Sender<Option<Bytes>>,
    /// Gone once it is waited for with the others.
    task: Option<Stored>,
    started: Arc<Mutex<Started>>,
}

impl Upload {
    fn send(&self, chunk: Option<Bytes>) -> io::Result<()> {
        let gone = |_| io::Error::new(io::ErrorKind::BrokenPipe, "the artifact can't be stored");
        self.chunks.blocking_send(chunk).map_err(gone)
    }
}

impl ArtifactWriter for Upload {
    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.flush()?;
        self.send(None)
    }
}

impl Write for Upload {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.chunk.extend_from_slice(bytes);
        if self.chunk.len() >= CHUNK_BYTES {
            self.flush()?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let chunk = std::mem::take(&mut self.chunk);
        self.send(Some(chunk.into()))
    }
}

impl Drop for Upload {
    fn drop(&mut self) {
        lock(&self.started).tasks.extend(self.task.take());
    }
}

/// Stores and hashes what comes until the end; returns its size and hash.
async fn receive(
    mut writer: ByteWriter,
    mut chunks: mpsc::Receiver<Option<Bytes>>,
) -> Result<(u64, String), ByteError> {
    let (mut hasher, mut size) = (Sha256::new(), 0);
    while let Some(chunk) = chunks.recv().await {
        let Some(chunk) = chunk else {
            writer.finish().await?;
            return Ok((size, hex(hasher)));
        };
        size += chunk.len() as u64;
        (hasher, _) = tokio::try_join!(hash(hasher, chunk.clone()), writer.write(chunk))?;
    }
    writer.abort().await?;
    Err(ByteError::other(io::Error::from(io::ErrorKind::UnexpectedEof)))
}

/// Hashes on, off the runtime's own threads.
async fn hash(mut hasher: Sha256, bytes: Bytes) -> Result<Sha256, ByteError> {
    let hashed = tokio::task::spawn_blocking(move || {
        hasher.update(&bytes);
        hasher
    });
    hashed.await.map_err(ByteError::other)
}

/// Lower-case hexadecimal.
fn hex(hasher: Sha256) -> String {
    hex::encode(hasher.finalize())
}

fn lock(started: &Mutex<Started>) -> MutexGuard<'_, Started> {
    started.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use object_store::memory::InMemory;

    fn uploads() -> Uploads {
        let store = ByteStore::remote(Arc::new(InMemory::new()));
        Uploads::new(JobId::new(), 1, store, Handle::current())
    }

    async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
        tokio::task::spawn_blocking(work).await.unwrap()
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn written_in_pieces_is_the_same_as_at_once() {
        let uploads = Arc::new(uploads());
        let bytes: Vec<u8> = (0..9_000_000u32).map(|i| (i % 241) as u8).collect();
        let writing = Arc::clone(&uploads);
        blocking(move || {
            let mut piecewise = writing.create("pieces", "text/plain").unwrap();
            writing.add("once", "text/plain", bytes.clone().into()).unwrap();
            assert!(writing.create("once", "text/plain").is_err());
            bytes.chunks(700_001).for_each(|piece| piecewise.write_all(piece).unwrap());
            Box::new(piecewise).finish().unwrap();
        })
        .await;
        let entries = uploads.finish().await.unwrap();
        let names: Vec<_> = entries.iter().map(|entry| entry.name.as_str()).collect();
        // In the order they were finished.
        assert_eq!(names, ["once", "pieces"]);
        assert_eq!(entries[0].sha256, entries[1].sha256);
        assert_eq!(entries[1].bytes, 9_000_000);
        let key = Key::Artifact { job: uploads.job, attempt: 1, name: "pieces" };
        assert_eq!(uploads.store.size(&key).await.unwrap(), 9_000_000);
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn an_abandoned_artifact_is_not_stored_and_no_success() {
        let uploads = Arc::new(uploads());
        let writing = Arc::clone(&uploads);
        blocking(move || {
            writing.create("half", "text/plain").unwrap().write_all(b"half").unwrap();
        })
        .await;
        assert!(uploads.finish().await.is_err());
        let key = Key::Artifact { job: uploads.job, attempt: 1, name: "half" };
        assert!(matches!(uploads.store.get(&key).await, Err(ByteError::NotFound(_))));
    }
}
