//! Inputs and artifacts as bytes in an object store, read and written in parts.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io;
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::path::{Path as FilePath, PathBuf};
use std::sync::Arc;

use bytes::Bytes;
use futures::stream::BoxStream;
use futures::{StreamExt, TryStreamExt, stream};
use jiff::Timestamp;
use object_store::local::LocalFileSystem;
use object_store::path::Path;
use object_store::{
    GetOptions, GetRange, GetResultPayload, ObjectStore, ObjectStoreExt, PutMode, PutPayload,
    WriteMultipart,
};

use super::key::{self, InvalidName, Key};
use crate::JobId;

/// Why bytes could not be stored or fetched.
#[derive(Debug, thiserror::Error)]
pub enum ByteError {
    /// The name cannot be stored.
    #[error(transparent)]
    Name(#[from] InvalidName),
    /// Nothing is stored under this path.
    #[error("nothing is stored as {0}")]
    NotFound(String),
    /// The range lies outside of the object.
    #[error("bytes {}..{} lie outside of the stored {size}", .wanted.start, .wanted.end)]
    Range {
        /// The bytes asked for, the end left out.
        wanted: Range<u64>,
        /// Size of the stored object, bytes.
        size: u64,
    },
    /// No room is left on the disk.
    #[error("the disk of the byte store is full")]
    Full,
    /// The storage behind it failed.
    #[error("byte store: {0}")]
    Backend(#[source] Box<dyn std::error::Error + Send + Sync>),
}

impl ByteError {
    /// Wraps an error of what carries the bytes.
    pub fn other(error: impl std::error::Error + Send + Sync + 'static) -> Self {
        backend(error)
    }
}

impl From<ByteError> for io::Error {
    fn from(error: ByteError) -> Self {
        let kind = match &error {
            ByteError::Name(_) | ByteError::Range { .. } => io::ErrorKind::InvalidInput,
            ByteError::NotFound(_) => io::ErrorKind::NotFound,
            ByteError::Full => io::ErrorKind::StorageFull,
            ByteError::Backend(_) => io::ErrorKind::Other,
        };
        Self::new(kind, error)
    }
}

/// What is read at once of a file: each piece waits for another thread.
const READ_BYTES: usize = 256 << 10;

/// The bytes of a range that lies within the file.
fn chunks_of(file: File, range: Range<u64>) -> BoxStream<'static, Result<Bytes, ByteError>> {
    let next = move |(file, at): (File, u64)| async move {
        if at >= range.end {
            return Ok(None);
        }
        let left = usize::try_from(range.end - at).unwrap_or(READ_BYTES);
        let reading = tokio::task::spawn_blocking(move || {
            let mut bytes = vec![0; left.min(READ_BYTES)];
            file.read_exact_at(&mut bytes, at)?;
            io::Result::Ok((Bytes::from(bytes), file))
        });
        let (bytes, file) = reading.await.map_err(backend)?.map_err(backend)?;
        let at = at + bytes.len() as u64;
        Ok(Some((bytes, (file, at))))
    };
    stream::try_unfold((file, range.start), next).boxed()
}

/// Bytes on their way out.
pub struct ByteRange {
    /// Size of the whole object.
    pub size: u64,
    /// The part of it that `chunks` delivers.
    pub range: Range<u64>,
    /// The bytes in order, piece by piece.
    pub chunks: BoxStream<'static, Result<Bytes, ByteError>>,
}

/// What is sent at once of bytes that are stored piece by piece; object stores
/// want 5 MiB or more.
const PART_BYTES: usize = 8 << 20;
/// Parts on their way at once.
const PARTS_IN_FLIGHT: usize = 2;

/// Bytes on their way in.
pub struct ByteWriter {
    parts: WriteMultipart,
}

impl ByteWriter {
    /// Adds bytes at the end; waits while too many are on their way.
    pub async fn write(&mut self, bytes: Bytes) -> Result<(), ByteError> {
        self.parts.wait_for_capacity(PARTS_IN_FLIGHT).await.map_err(from_store)?;
        self.parts.put(bytes);
        Ok(())
    }

    /// Stores all that was written; it is durable on return.
    pub async fn finish(self) -> Result<(), ByteError> {
        self.parts.finish().await.map_err(from_store)?;
        Ok(())
    }

    /// Forgets what was written.
    pub async fn abort(self) -> Result<(), ByteError> {
        self.parts.abort().await.map_err(from_store)
    }
}

/// Inputs and artifacts by [`Key`], in a folder or an object store.
#[derive(Clone)]
pub struct ByteStore {
    store: Arc<dyn ObjectStore>,
    /// The folder, if it is one: whole trees are removed there at once, with
    /// the partly written files that listings leave out.
    root: Option<PathBuf>,
}

impl ByteStore {
    /// Bytes in the folder `root`, which is made if need be. Files and the
    /// directories that name them are synced before a write returns.
    ///
    /// # Errors
    /// [`ByteError::Backend`] if the folder can't be made or written.
    pub fn local(root: &FilePath) -> Result<Self, ByteError> {
        // Made and synced here, once: of two first writes at the same time only
        // the one that makes a directory would sync its name.
        for folder in [key::INPUTS, key::ARTIFACTS] {
            fs::create_dir_all(root.join(folder)).map_err(backend)?;
        }
        let root = fs::canonicalize(root).map_err(backend)?;
        for directory in root.ancestors().take(2) {
            File::open(directory).and_then(|it| it.sync_all()).map_err(backend)?;
        }
        let store = LocalFileSystem::new_with_prefix(&root).map_err(backend)?.with_fsync(true);
        Ok(Self { store: Arc::new(store), root: Some(root) })
    }

    /// Bytes in another object store; its writes must be durable.
    pub fn remote(store: Arc<dyn ObjectStore>) -> Self {
        Self { store, root: None }
    }

    /// Bytes that may still be stored; `None` if the storage has no such limit.
    ///
    /// # Errors
    /// [`ByteError::Backend`] if the system does not tell.
    pub fn free_bytes(&self) -> Result<Option<u64>, ByteError> {
        let Some(root) = &self.root else { return Ok(None) };
        let space = rustix::fs::statvfs(root).map_err(io::Error::from).map_err(backend)?;
        Ok(Some(space.f_bavail.saturating_mul(space.f_frsize)))
    }

    /// Stores `bytes`; they are durable on return. They replace an input, but in an
    /// object store not an artifact, which an attempt writes once.
    ///
    /// # Errors
    /// [`ByteError::Backend`] if there is another artifact under this key.
    pub async fn put(&self, key: &Key<'_>, bytes: Bytes) -> Result<(), ByteError> {
        let path = key.path()?;
        let is_new = matches!(key, Key::Artifact { .. }) && self.root.is_none();
        let mode = if is_new { PutMode::Create } else { PutMode::Overwrite };
        let payload = PutPayload::from_bytes(bytes.clone());
        match self.store.put_opts(&path, payload, mode.into()).await {
            // An earlier try may have stored it, and only its answer been lost.
            Err(error @ object_store::Error::AlreadyExists { .. }) => {
                let found = self.store.get(&path).await.map_err(from_store)?;
                let is_same = found.bytes().await.map_err(from_store)? == bytes;
                if is_same { Ok(()) } else { Err(from_store(error)) }
            }
            stored => stored.map(drop).map_err(from_store),
        }
    }

    /// Begins to store bytes piece by piece; nothing is stored before
    /// [`ByteWriter::finish`].
    pub async fn writer(&self, key: &Key<'_>) -> Result<ByteWriter, ByteError> {
        let upload = self.store.put_multipart(&key.path()?).await.map_err(from_store)?;
        Ok(ByteWriter { parts: WriteMultipart::new_with_chunk_size(upload, PART_BYTES) })
    }

    /// Everything stored under `key`.
    pub async fn get(&self, key: &Key<'_>) -> Result<Bytes, ByteError> {
        let found = self.store.get(&key.path()?).await.map_err(from_store)?;
        found.bytes().await.map_err(from_store)
    }

    /// A part of what is stored under `key`, or all of it, in chunks.
    ///
    /// # Errors
    /// [`ByteError::Range`] if `range` is empty or begins behind the end; one
    /// that only ends behind it is cut.
    pub async fn stream(
        &self,
        key: &Key<'_>,
        range: Option<Range<u64>>,
    ) -> Result<ByteRange, ByteError> {
        let path = key.path()?;
        if let Some(wanted) = &range {
            let size = self.store.head(&path).await.map_err(from_store)?.size;
            if wanted.is_empty() || wanted.start >= size {
                return Err(ByteError::Range { wanted: wanted.clone(), size });
            }
        }
        let options = GetOptions { range: range.map(GetRange::Bounded), ..GetOptions::default() };
        let found = self.store.get_opts(&path, options).await.map_err(from_store)?;
        let (size, range) = (found.meta.size, found.range);
        let chunks = match found.payload {
            GetResultPayload::File(file, _) => chunks_of(file, range.clone()),
            GetResultPayload::Stream(chunks) => chunks.map_err(from_store).boxed(),
        };
        Ok(ByteRange { size, range, chunks })
    }

    /// Size of what is stored under `key`.
    pub async fn size(&self, key: &Key<'_>) -> Result<u64, ByteError> {
        Ok(self.store.head(&key.path()?).await.map_err(from_store)?.size)
    }

    /// Stores the bytes of `from` under `to` as well; deleting one leaves the other.
    pub async fn copy(&self, from: &Key<'_>, to: &Key<'_>) -> Result<(), ByteError> {
        self.store.copy(&from.path()?, &to.path()?).await.map_err(from_store)
    }

    /// Deletes inputs and artifacts of a job. Nothing stored is no error.
    pub async fn delete_job(&self, job: JobId) -> Result<(), ByteError> {
        self.delete_all(key::attempts_of(job)).await?;
        self.delete_all(key::inputs_of(job)).await
    }

    /// Deletes a job's inputs whose names begin with `folder` and a slash.
    /// Nothing stored is no error.
    pub async fn delete_inputs(&self, job: JobId, folder: &str) -> Result<(), ByteError> {
        self.delete_all(Key::Input { job, name: folder }.path()?).await
    }

    /// Deletes what one attempt wrote. Nothing stored is no error.
    pub async fn delete_attempt(&self, job: JobId, attempt: u32) -> Result<(), ByteError> {
        self.delete_all(key::attempt_of(job, attempt)).await
    }

    /// Every job that has bytes, finished or not, by age.
    pub async fn jobs(&self) -> Result<Vec<JobId>, ByteError> {
        let mut jobs = BTreeSet::new();
        for folder in [key::INPUTS, key::ARTIFACTS] {
            jobs.extend(self.children::<JobId>(&Path::from(folder)).await?);
        }
        Ok(jobs.into_iter().collect())
    }

    /// The attempts of a job that wrote anything.
    pub async fn attempts(&self, job: JobId) -> Result<Vec<u32>, ByteError> {
        self.children(&key::attempts_of(job)).await
    }

    /// When bytes of a job were last written; `None` if it has no whole object.
    pub async fn last_written(&self, job: JobId) -> Result<Option<Timestamp>, ByteError> {
        let mut latest = None;
        for folder in [key::inputs_of(job), key::attempts_of(job)] {
            let mut objects = self.store.list(Some(&folder));
            while let Some(object) = objects.try_next().await.map_err(from_store)? {
                let written_ms = object.last_modified.timestamp_millis();
                latest = latest.max(Timestamp::from_millisecond(written_ms).ok());
            }
        }
        Ok(latest)
    }

    /// Bytes of all whole objects of a job: inputs, and artifacts of all attempts.
    pub async fn stored(&self, job: JobId) -> Result<u64, ByteError> {
        let mut bytes = 0;
        for folder in [key::inputs_of(job), key::attempts_of(job)] {
            let mut objects = self.store.list(Some(&folder));
            while let Some(object) = objects.try_next().await.map_err(from_store)? {
                bytes += object.size;
            }
        }
        Ok(bytes)
    }

    /// The names directly below `folder` that read as a `T`; others are not ours.
    async fn children<T: std::str::FromStr>(&self, folder: &Path) -> Result<Vec<T>, ByteError> {
        let listing = self.store.list_with_delimiter(Some(folder)).await.map_err(from_store)?;
        let names = listing.common_prefixes.iter().filter_map(Path::filename);
        Ok(names.filter_map(|name| name.parse().ok()).collect())
    }

    async fn delete_all(&self, folder: Path) -> Result<(), ByteError> {
        let Some(root) = &self.root else {
            let listed = self.store.list(Some(&folder)).map_ok(|object| object.location).boxed();
            let deleted = self.store.delete_stream(listed);
            return deleted.try_for_each(|_| async { Ok(()) }).await.map_err(from_store);
        };
        let directory = root.join(folder.as_ref());
        let removal = tokio::task::spawn_blocking(move || fs::remove_dir_all(directory));
        match removal.await.map_err(backend)? {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(backend(error)),
            _ => Ok(()),
        }
    }
}

pub(super) fn from_store(error: object_store::Error) -> ByteError {
    match error {
        object_store::Error::NotFound { path, .. } => ByteError::NotFound(path),
        other => backend(other),
    }
}

pub(super) fn backend<E: std::error::Error + Send + Sync + 'static>(error: E) -> ByteError {
    let mut causes =
        std::iter::successors(Some(&error as &(dyn std::error::Error + 'static)), |e| e.source());
    let is_full = causes.any(|cause| {
        let kind = cause.downcast_ref::<io::Error>().map(io::Error::kind);
        matches!(kind, Some(io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded))
    });
    if is_full { ByteError::Full } else { ByteError::Backend(Box::new(error)) }
}
