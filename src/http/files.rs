//! The bytes of small artifacts, kept in memory: to open a file, or to ask a bucket, takes longer
//! than to send it.
//!
//! What an attempt published is never written again, so that what is kept is right for as long as
//! the job is there; whoever asks finds the job first.

use std::sync::{Mutex, MutexGuard, PoisonError};

use bytes::Bytes;

use super::bounded::Bounded;
use jobs::JobId;

/// The largest one that is kept, bytes.
pub(super) const MAX_FILE_BYTES: u64 = 128 << 10;
/// What is kept at a time, bytes.
const MAX_BYTES: usize = 32 << 20;

/// Job, attempt and name.
type Name = (JobId, u32, String);

/// Small artifacts that were asked for.
pub(super) struct Files(Mutex<Bounded<Name, Bytes>>);

impl Default for Files {
    fn default() -> Self {
        Self(Mutex::new(Bounded::new(MAX_BYTES)))
    }
}

impl Files {
    pub(super) fn get(&self, name: &Name) -> Option<Bytes> {
        self.lock().get(name).cloned()
    }

    /// Keeps a small artifact; others go when there is no room for it.
    pub(super) fn keep(&self, name: Name, file: Bytes) {
        let size = file.len() + name.2.len() + size_of::<(Name, Bytes)>();
        self.lock().keep(name, file, size);
    }

    fn lock(&self) -> MutexGuard<'_, Bounded<Name, Bytes>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
