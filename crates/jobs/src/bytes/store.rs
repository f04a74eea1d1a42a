//! Inputs and artifacts as bytes in an object store, read and written in parts.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io;
use std::ops::Range;
use std::path::{Path as FilePath, PathBuf};
use std::sync::Arc;

use bytes::Bytes;
use futures::stream::BoxStream;
use futures::{StreamExt, TryStreamExt};
use jiff::Timestamp;
use object_store::local::LocalFileSystem;
use object_store::path::Path;
use object_store::{GetOptions, GetRange, ObjectStore, ObjectStoreExt, PutPayload, WriteMultipart};

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

    /// Stores `bytes`, replacing what was there; they are durable on return.
    pub async fn put(&self, key: &Key<'_>, bytes: Bytes) -> Result<(), ByteError> {
        let payload = PutPayload::from_bytes(bytes);
        self.store.put(&key.path()?, payload).await.map_err(from_store)?;
        Ok(())
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
        let (size, range) = (found.meta.size, found.range.clone());
        Ok(ByteRange { size, range, chunks: found.into_stream().map_err(from_store).boxed() })
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

fn from_store(error: object_store::Error) -> ByteError {
    match error {
        object_store::Error::NotFound { path, .. } => ByteError::NotFound(path),
        other => backend(other),
    }
}

fn backend<E: std::error::Error + Send + Sync + 'static>(error: E) -> ByteError {
    let mut causes =
        std::iter::successors(Some(&error as &(dyn std::error::Error + 'static)), |e| e.source());
    let is_full = causes.any(|cause| {
        let kind = cause.downcast_ref::<io::Error>().map(io::Error::kind);
        matches!(kind, Some(io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded))
    });
    if is_full { ByteError::Full } else { ByteError::Backend(Box::new(error)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use object_store::memory::InMemory;

    fn stores() -> (tempfile::TempDir, [ByteStore; 2]) {
        let folder = tempfile::tempdir().unwrap();
        let local = ByteStore::local(&folder.path().join("bytes")).unwrap();
        (folder, [local, ByteStore::remote(Arc::new(InMemory::new()))])
    }

    fn artifact(job: JobId, attempt: u32) -> Key<'static> {
        Key::Artifact { job, attempt, name: "views/22.5/disparity.png" }
    }

    async fn collect(part: ByteRange) -> Vec<u8> {
        let chunks: Vec<Bytes> = part.chunks.try_collect().await.unwrap();
        chunks.concat()
    }

    #[tokio::test]
    async fn what_is_put_comes_back_whole_or_in_part() {
        let (_folder, stores) = stores();
        let content: Vec<u8> = (0..100_000u32).map(|i| (i % 251) as u8).collect();
        for store in stores {
            let key = artifact(JobId::new(), 1);
            store.put(&key, content.clone().into()).await.unwrap();
            assert_eq!(store.get(&key).await.unwrap(), content);
            assert_eq!(store.size(&key).await.unwrap(), 100_000);
            let part = store.stream(&key, Some(9_000..20_001)).await.unwrap();
            assert_eq!((part.size, part.range.clone()), (100_000, 9_000..20_001));
            assert_eq!(collect(part).await, content[9_000..20_001]);
            let tail = store.stream(&key, Some(99_990..200_000)).await.unwrap();
            assert_eq!(tail.range, 99_990..100_000);
            assert_eq!(collect(tail).await, content[99_990..]);
            assert_eq!(collect(store.stream(&key, None).await.unwrap()).await, content);
            let outside = store.stream(&key, Some(100_000..100_001)).await;
            assert!(matches!(outside, Err(ByteError::Range { size: 100_000, .. })));
        }
    }

    #[tokio::test]
    async fn what_is_written_in_pieces_is_there_once_finished() {
        let (_folder, stores) = stores();
        let piece: Bytes = (0..3_000_000u32).map(|i| (i % 253) as u8).collect();
        for store in stores {
            let [kept, dropped] = [JobId::new(), JobId::new()].map(|job| artifact(job, 1));
            let mut writer = store.writer(&kept).await.unwrap();
            for _ in 0..5 {
                writer.write(piece.clone()).await.unwrap();
            }
            assert!(matches!(store.get(&kept).await, Err(ByteError::NotFound(_))));
            writer.finish().await.unwrap();
            assert_eq!(store.get(&kept).await.unwrap(), piece.repeat(5));
            let mut writer = store.writer(&dropped).await.unwrap();
            writer.write(piece.clone()).await.unwrap();
            writer.abort().await.unwrap();
            assert!(matches!(store.get(&dropped).await, Err(ByteError::NotFound(_))));
        }
    }

    #[tokio::test]
    async fn deleting_a_job_takes_all_its_bytes_and_no_others() {
        let (_folder, stores) = stores();
        for store in stores {
            let [gone, kept] = [JobId::new(), JobId::new()];
            for job in [gone, kept] {
                let input = Key::Input { job, name: "front.png" };
                store.put(&input, Bytes::from_static(b"drawing")).await.unwrap();
                store.put(&artifact(job, 1), Bytes::from_static(b"one")).await.unwrap();
                store.put(&artifact(job, 2), Bytes::from_static(b"two")).await.unwrap();
            }
            assert_eq!(store.jobs().await.unwrap(), [gone, kept]);
            store.delete_attempt(gone, 1).await.unwrap();
            assert_eq!(store.attempts(gone).await.unwrap(), [2]);
            assert!(store.last_written(gone).await.unwrap().is_some());
            store.delete_job(gone).await.unwrap();
            store.delete_job(gone).await.unwrap();
            assert_eq!(store.jobs().await.unwrap(), [kept]);
            assert_eq!(store.attempts(kept).await.unwrap(), [1, 2]);
            assert_eq!(store.last_written(gone).await.unwrap(), None);
            let missing = store.get(&artifact(gone, 2)).await;
            assert!(matches!(missing, Err(ByteError::NotFound(_))));
        }
    }

    #[tokio::test]
    async fn a_copy_outlives_its_source() {
        let (_folder, stores) = stores();
        for store in stores {
            let [old, new] = [JobId::new(), JobId::new()];
            let from = Key::Input { job: old, name: "front.png" };
            let to = Key::Input { job: new, name: "front.png" };
            store.put(&from, Bytes::from_static(b"drawing")).await.unwrap();
            store.copy(&from, &to).await.unwrap();
            store.delete_job(old).await.unwrap();
            assert_eq!(store.get(&to).await.unwrap(), "drawing");
        }
    }

    #[tokio::test]
    async fn partly_written_files_go_with_their_job() {
        let folder = tempfile::tempdir().unwrap();
        let store = ByteStore::local(folder.path()).unwrap();
        let job = JobId::new();
        let directory = folder.path().join("inputs").join(job.to_string());
        fs::create_dir_all(&directory).unwrap();
        fs::write(directory.join("front.png#1"), b"half").unwrap();
        assert_eq!(store.jobs().await.unwrap(), [job]);
        assert_eq!(store.last_written(job).await.unwrap(), None);
        store.delete_job(job).await.unwrap();
        assert!(!directory.exists());
    }
}
