//! Copying what a job or page has from one store to another.

use std::collections::HashMap;

use bytes::Bytes;
use futures::TryStreamExt;
use object_store::path::Path;
use object_store::{ObjectStoreExt, PutPayload, WriteMultipart};
use sha2::{Digest, Sha256};

use super::key::{self, Key};
use super::store::{ByteError, ByteStore, ByteWriter, PART_BYTES, from_store};
use crate::JobId;

/// An object that was copied from another store.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Copied {
    /// Its size.
    pub bytes: u64,
    /// Of its bytes, lower-case hexadecimal.
    pub sha256: String,
    /// It was the same already.
    pub was_there: bool,
}

impl ByteStore {
    /// Where the bytes of `key` are, as [`Self::copy_job`] tells it.
    pub(crate) fn location(&self, key: &Key<'_>) -> Result<String, ByteError> {
        Ok(self.path(key)?.into())
    }

    /// Stores all that `from` has of a job or page under the same names, and tells by
    /// location what that was. What is here already and the same stays.
    ///
    /// * `from`: another store, of the same home.
    pub(crate) async fn copy_job(
        &self,
        from: &Self,
        job: JobId,
    ) -> Result<HashMap<String, Copied>, ByteError> {
        self.make_folders().await?;
        let mut copied = HashMap::new();
        for folder in [key::inputs_of(job), key::attempts_of(job)] {
            let folder = self.below(&folder);
            let here =
                self.store.list(Some(&folder)).map_ok(|object| (object.location, object.size));
            let here: HashMap<_, _> = here.try_collect().await.map_err(from_store)?;
            let mut there = from.store.list(Some(&folder));
            while let Some(object) = there.try_next().await.map_err(from_store)? {
                let path = object.location;
                let is_here = here.get(&path) == Some(&object.size);
                let (was_there, sha256) = match is_here {
                    true => self.copy_changed(from, &path, object.size).await?,
                    false => (false, self.copy_object(from, &path, object.size).await?),
                };
                copied.insert(path.into(), Copied { bytes: object.size, sha256, was_there });
            }
        }
        Ok(copied)
    }

    /// As [`Self::copy_object`], unless both stores have the same bytes.
    async fn copy_changed(
        &self,
        from: &Self,
        path: &Path,
        size: u64,
    ) -> Result<(bool, String), ByteError> {
        let there = from.sha256(path).await?;
        if self.sha256(path).await? == there {
            return Ok((true, there));
        }
        Ok((false, self.copy_object(from, path, size).await?))
    }

    /// Stores an object of another store here. Returns its SHA-256.
    async fn copy_object(&self, from: &Self, path: &Path, size: u64) -> Result<String, ByteError> {
        let mut chunks = from.read(path.clone(), None).await?.chunks;
        let mut hash = Sha256::new();
        if size <= PART_BYTES as u64 {
            let chunks: Vec<Bytes> = chunks.try_collect().await?;
            chunks.iter().for_each(|chunk| hash.update(chunk));
            let payload = PutPayload::from_iter(chunks);
            self.store.put(path, payload).await.map_err(from_store)?;
            return Ok(hex::encode(hash.finalize()));
        }
        let upload = self.store.put_multipart(path).await.map_err(from_store)?;
        let parts = WriteMultipart::new_with_chunk_size(upload, PART_BYTES);
        let mut writer = ByteWriter { parts };
        let written = async {
            while let Some(chunk) = chunks.try_next().await? {
                hash.update(&chunk);
                writer.write(chunk).await?;
            }
            Ok(())
        };
        if let Err(error) = written.await {
            // What was sent of it; the error that counts is the first.
            let _ = writer.abort().await;
            return Err(error);
        }
        writer.finish().await?;
        Ok(hex::encode(hash.finalize()))
    }

    /// Of the bytes of an object, lower-case hexadecimal.
    async fn sha256(&self, path: &Path) -> Result<String, ByteError> {
        let mut chunks = self.read(path.clone(), None).await?.chunks;
        let mut hash = Sha256::new();
        while let Some(chunk) = chunks.try_next().await? {
            hash.update(&chunk);
        }
        Ok(hex::encode(hash.finalize()))
    }
}
