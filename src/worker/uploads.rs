use std::collections::HashSet;
use std::io;
use std::sync::{Arc, Mutex};

use sha2::{Digest, Sha256};
use tokio::runtime::Handle;
use tokio::sync::Semaphore;
use tokio::task::JoinHandle;

use crate::artifacts::{ByteError, ByteStore, Key};
use crate::jobs::{ArtifactEntry, JobId};

/// Artifacts stored at once. Their syncs then share the disk's journal writes.
const MAX_IN_FLIGHT: usize = 16;
/// Bytes of artifacts on their way, KiB: what an attempt may hold in memory.
const MAX_IN_FLIGHT_KIB: usize = 128 << 10;

/// Stores the artifacts of one attempt while its work goes on.
pub(super) struct Uploads {
    job: JobId,
    attempt: u32,
    store: ByteStore,
    runtime: Handle,
    files: Arc<Semaphore>,
    kib: Arc<Semaphore>,
    started: Mutex<Started>,
}

#[derive(Default)]
struct Started {
    names: HashSet<String>,
    tasks: Vec<JoinHandle<Result<ArtifactEntry, ByteError>>>,
}

impl Uploads {
    pub fn new(job: JobId, attempt: u32, store: ByteStore, runtime: Handle) -> Self {
        Self {
            job,
            attempt,
            store,
            runtime,
            files: Arc::new(Semaphore::new(MAX_IN_FLIGHT)),
            kib: Arc::new(Semaphore::new(MAX_IN_FLIGHT_KIB)),
            started: Mutex::default(),
        }
    }

    /// Begins to store an artifact; waits only while too many bytes are on
    /// their way.
    pub fn add(&self, name: &str, media_type: &str, bytes: Vec<u8>) -> io::Result<()> {
        let key = Key::Artifact { job: self.job, attempt: self.attempt, name };
        key.path().map_err(|error| io::Error::new(io::ErrorKind::InvalidInput, error))?;
        let kib = bytes.len().div_ceil(1024).clamp(1, MAX_IN_FLIGHT_KIB);
        let room = Arc::clone(&self.kib).acquire_many_owned(kib as u32);
        let room = self.runtime.block_on(room).map_err(io::Error::other)?;
        let (job, attempt) = (self.job, self.attempt);
        let (store, files) = (self.store.clone(), Arc::clone(&self.files));
        let (name, media_type) = (name.to_owned(), media_type.to_owned());

        let mut started = self.started.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if !started.names.insert(name.clone()) {
            let message = format!("artifact {name} was emitted twice");
            return Err(io::Error::new(io::ErrorKind::AlreadyExists, message));
        }
        started.tasks.push(self.runtime.spawn(async move {
            let _room = room;
            let _file = files.acquire_owned().await.map_err(ByteError::other)?;
            let key = Key::Artifact { job, attempt, name: &name };
            let size = bytes.len() as u64;
            let (bytes, sha256) = hash(bytes).await?;
            store.put(&key, bytes.into()).await?;
            Ok(ArtifactEntry { media_type, bytes: size, sha256, name })
        }));
        Ok(())
    }

    /// Waits until all artifacts are durable. Entries are in order of emission.
    ///
    /// # Errors
    /// The first error of any of them.
    pub async fn finish(&self) -> Result<Vec<ArtifactEntry>, ByteError> {
        let tasks = {
            let mut started = self.started.lock().unwrap_or_else(|it| it.into_inner());
            std::mem::take(&mut started.tasks)
        };
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

/// Lower-case hexadecimal SHA-256, off the runtime's own threads.
async fn hash(bytes: Vec<u8>) -> Result<(Vec<u8>, String), ByteError> {
    tokio::task::spawn_blocking(move || {
        let digest = hex::encode(Sha256::digest(&bytes));
        (bytes, digest)
    })
    .await
    .map_err(ByteError::other)
}
