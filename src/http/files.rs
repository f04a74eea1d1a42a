//! The bytes of small artifacts, kept in memory: to open a file, or to ask a bucket, takes longer
//! than to send it.
//!
//! What an attempt published is never written again, so that what is kept is right for as long as
//! the job is there; whoever asks finds the job first.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use bytes::Bytes;

use jobs::JobId;

/// The largest one that is kept, bytes.
pub(super) const MAX_FILE_BYTES: u64 = 128 << 10;
/// What is kept at a time, bytes.
const MAX_BYTES: usize = 32 << 20;

/// Job, attempt and name.
type Name = (JobId, u32, String);

/// Small artifacts that were asked for.
#[derive(Default)]
pub(super) struct Files(Mutex<Kept>);

#[derive(Default)]
struct Kept {
    bytes: usize,
    files: HashMap<Name, Bytes>,
}

impl Files {
    pub(super) fn get(&self, name: &Name) -> Option<Bytes> {
        self.lock().files.get(name).cloned()
    }

    /// Keeps a small artifact; others go when there is no room for it.
    pub(super) fn keep(&self, name: Name, file: Bytes) {
        let mut kept = self.lock();
        let size = file.len() + name.2.len() + size_of::<(Name, Bytes)>();
        if kept.bytes + size > MAX_BYTES {
            *kept = Kept::default();
        }
        // Two requests may have read the same one at once.
        if kept.files.insert(name, file).is_none() {
            kept.bytes += size;
        }
    }

    fn lock(&self) -> MutexGuard<'_, Kept> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_bounded() {
        let files = Files::default();
        let job = JobId::new();
        let file = Bytes::from(vec![7; 128 << 10]);
        for attempt in 0..1000 {
            files.keep((job, attempt, "a".to_owned()), file.clone());
            files.keep((job, attempt, "a".to_owned()), file.clone());
            assert_eq!(files.get(&(job, attempt, "a".to_owned())), Some(file.clone()));
            let kept = files.lock();
            assert_eq!(kept.files.len() * file.len(), kept.bytes / file.len() * file.len());
            assert!(kept.bytes <= MAX_BYTES, "{}", kept.bytes);
        }
        assert_eq!(files.get(&(job, 0, "a".to_owned())), None, "it made room");
    }
}
