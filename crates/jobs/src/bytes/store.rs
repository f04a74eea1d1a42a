//! Inputs and artifacts as bytes in an object store, read and written in parts.

use std::collections::{BTreeSet, HashSet};
use std::fs::{self, File};
use std::io;
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::path::{Path as FilePath, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use bytes::Bytes;
use futures::stream::BoxStream;
use futures::{StreamExt, TryStreamExt, stream};
use jiff::Timestamp;
use object_store::local::LocalFileSystem;
use object_store::path::Path;
use object_store::{
    GetOptions, GetRange, ObjectStore, ObjectStoreExt, PutMode, PutPayload, WriteMultipart,
};

use super::key::{self, BytesOf, Home, InvalidName, Key};
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

/// The first piece of a range that lies within the file.
fn read_piece(file: &File, range: Range<u64>) -> io::Result<Bytes> {
    let left = usize::try_from(range.end - range.start).unwrap_or(READ_BYTES);
    let mut bytes = vec![0; left.min(READ_BYTES)];
    file.read_exact_at(&mut bytes, range.start)?;
    Ok(bytes.into())
}

/// The pieces of a range that lies within the file.
fn pieces_of(
    file: File,
    range: Range<u64>,
) -> impl futures::Stream<Item = Result<Bytes, ByteError>> + Send {
    let next = move |(file, at): (File, u64)| async move {
        if at >= range.end {
            return Ok(None);
        }
        let reading = tokio::task::spawn_blocking(move || {
            io::Result::Ok((read_piece(&file, at..range.end)?, file))
        });
        let (bytes, file) = reading.await.map_err(backend)?.map_err(backend)?;
        let at = at + bytes.len() as u64;
        Ok(Some((bytes, (file, at))))
    };
    stream::try_unfold((file, range.start), next)
}

/// A range of a file, which is opened and its first piece read in one go on another thread: most
/// files are one piece.
///
/// * `name`: its path in the store.
async fn file_range(
    file: PathBuf,
    name: Path,
    wanted: Option<Range<u64>>,
) -> Result<ByteRange, ByteError> {
    let opening = tokio::task::spawn_blocking(move || {
        let file = File::open(file).map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => ByteError::NotFound(name.into()),
            _ => backend(error),
        })?;
        let size = file.metadata().map_err(backend)?.len();
        let range = within(wanted, size)?;
        let first = read_piece(&file, range.clone()).map_err(backend)?;
        Ok::<_, ByteError>((file, size, range, first))
    });
    let (file, size, range, first) = opening.await.map_err(backend)??;
    let rest = pieces_of(file, range.start + first.len() as u64..range.end);
    let chunks = stream::iter((!first.is_empty()).then_some(Ok(first))).chain(rest).boxed();
    Ok(ByteRange { size, range, chunks })
}

/// The part of what is wanted that there is.
fn within(wanted: Option<Range<u64>>, size: u64) -> Result<Range<u64>, ByteError> {
    match wanted {
        Some(wanted) if wanted.is_empty() || wanted.start >= size => {
            Err(ByteError::Range { wanted, size })
        }
        Some(wanted) => Ok(wanted.start..wanted.end.min(size)),
        None => Ok(0..size),
    }
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
pub(super) const PART_BYTES: usize = 8 << 20;
/// Parts on their way at once.
const PARTS_IN_FLIGHT: usize = 2;

/// Bytes on their way in.
pub struct ByteWriter {
    pub(super) parts: WriteMultipart,
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
    pub(super) store: Arc<dyn ObjectStore>,
    /// The folder, if it is one: whole trees are removed there at once, with
    /// the partly written files that listings leave out.
    root: Option<PathBuf>,
    /// What all paths are below.
    prefix: Path,
    /// Folders that were made and synced, of all homes.
    made: Arc<Mutex<HashSet<Path>>>,
}

impl ByteStore {
    /// Bytes in the folder `root`, which is made if need be. Files and the
    /// directories that name them are synced before a write returns.
    ///
    /// # Errors
    /// [`ByteError::Backend`] if the folder can't be made or written.
    pub fn local(root: &FilePath) -> Result<Self, ByteError> {
        make_folders(root).map_err(backend)?;
        let root = fs::canonicalize(root).map_err(backend)?;
        for directory in root.ancestors().take(2) {
            File::open(directory).and_then(|it| it.sync_all()).map_err(backend)?;
        }
        let store = LocalFileSystem::new_with_prefix(&root).map_err(backend)?.with_fsync(true);
        Ok(Self { root: Some(root), ..Self::remote(Arc::new(store)) })
    }

    /// Bytes in another object store; its writes must be durable.
    pub fn remote(store: Arc<dyn ObjectStore>) -> Self {
        Self { store, root: None, prefix: Path::default(), made: Arc::default() }
    }

    /// The same store, of those bytes that lie there. [`Self::remote`] and the like give
    /// that of [`Home::Shared`].
    pub fn of(&self, home: &Home) -> Self {
        Self { prefix: home.prefix(), ..self.clone() }
    }

    pub(super) fn path(&self, key: &Key<'_>) -> Result<Path, InvalidName> {
        Ok(self.below(&key.path()?))
    }

    pub(super) fn below(&self, folder: &Path) -> Path {
        self.prefix.parts().chain(folder.parts()).collect()
    }

    /// Makes a tenant's folders before the first write to them.
    pub(super) async fn make_folders(&self) -> Result<(), ByteError> {
        let made = || self.made.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(root) = &self.root else { return Ok(()) };
        if self.prefix.as_ref().is_empty() || made().contains(&self.prefix) {
            return Ok(());
        }
        let (root, own) = (root.clone(), root.join(self.prefix.as_ref()));
        let making = tokio::task::spawn_blocking(move || {
            make_folders(&own)?;
            let between = own.ancestors().take_while(|folder| folder.starts_with(&root));
            between.into_iter().try_for_each(|folder| File::open(folder)?.sync_all())
        });
        making.await.map_err(backend)?.map_err(backend)?;
        made().insert(self.prefix.clone());
        Ok(())
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
        self.make_folders().await?;
        let path = self.path(key)?;
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
        self.make_folders().await?;
        let upload = self.store.put_multipart(&self.path(key)?).await.map_err(from_store)?;
        Ok(ByteWriter { parts: WriteMultipart::new_with_chunk_size(upload, PART_BYTES) })
    }

    /// Everything stored under `key`.
    pub async fn get(&self, key: &Key<'_>) -> Result<Bytes, ByteError> {
        let found = self.store.get(&self.path(key)?).await.map_err(from_store)?;
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
        self.read(self.path(key)?, range).await
    }

    pub(super) async fn read(
        &self,
        path: Path,
        range: Option<Range<u64>>,
    ) -> Result<ByteRange, ByteError> {
        if let Some(root) = &self.root {
            return file_range(root.join(path.as_ref()), path, range).await;
        }
        if range.is_some() {
            let size = self.store.head(&path).await.map_err(from_store)?.size;
            within(range.clone(), size)?;
        }
        let options = GetOptions { range: range.map(GetRange::Bounded), ..GetOptions::default() };
        let found = self.store.get_opts(&path, options).await.map_err(from_store)?;
        let (size, range) = (found.meta.size, found.range.clone());
        Ok(ByteRange { size, range, chunks: found.into_stream().map_err(from_store).boxed() })
    }

    /// Size of what is stored under `key`.
    pub async fn size(&self, key: &Key<'_>) -> Result<u64, ByteError> {
        Ok(self.store.head(&self.path(key)?).await.map_err(from_store)?.size)
    }

    /// Stores the bytes of `from` under `to` as well; deleting one leaves the other.
    ///
    /// * `at`: this store, where `from` lies.
    pub async fn copy(&self, at: &Home, from: &Key<'_>, to: &Key<'_>) -> Result<(), ByteError> {
        self.make_folders().await?;
        let from = self.of(at).path(from)?;
        self.store.copy(&from, &self.path(to)?).await.map_err(from_store)
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

    /// As [`Self::jobs`], wherever their bytes lie.
    pub async fn all(&self) -> Result<Vec<BytesOf>, ByteError> {
        let shared = self.of(&Home::Shared);
        let tenants = shared.children(&Path::from(key::TENANTS)).await?;
        let mut found = Vec::new();
        for home in [Home::Shared].into_iter().chain(tenants.into_iter().map(Home::Tenant)) {
            let jobs = self.of(&home).jobs().await?;
            found.extend(jobs.into_iter().map(|id| BytesOf { id, home: home.clone() }));
        }
        Ok(found)
    }

    /// The attempts of a job that wrote anything.
    pub async fn attempts(&self, job: JobId) -> Result<Vec<u32>, ByteError> {
        self.children(&key::attempts_of(job)).await
    }

    /// When bytes of a job were last written; `None` if it has no whole object.
    pub async fn last_written(&self, job: JobId) -> Result<Option<Timestamp>, ByteError> {
        let mut latest = None;
        for folder in [key::inputs_of(job), key::attempts_of(job)] {
            let mut objects = self.store.list(Some(&self.below(&folder)));
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
            let mut objects = self.store.list(Some(&self.below(&folder)));
            while let Some(object) = objects.try_next().await.map_err(from_store)? {
                bytes += object.size;
            }
        }
        Ok(bytes)
    }

    /// The names directly below `folder` that read as a `T`; others are not ours.
    async fn children<T: std::str::FromStr>(&self, folder: &Path) -> Result<Vec<T>, ByteError> {
        let folder = self.below(folder);
        let listing = self.store.list_with_delimiter(Some(&folder)).await.map_err(from_store)?;
        let names = listing.common_prefixes.iter().filter_map(Path::filename);
        Ok(names.filter_map(|name| name.parse().ok()).collect())
    }

    async fn delete_all(&self, folder: Path) -> Result<(), ByteError> {
        let folder = self.below(&folder);
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

/// Made once, and then synced by who calls: of two first writes at the same time only the one
/// that makes a directory would sync its name.
fn make_folders(root: &FilePath) -> io::Result<()> {
    [key::INPUTS, key::ARTIFACTS]
        .iter()
        .try_for_each(|folder| fs::create_dir_all(root.join(folder)))
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
