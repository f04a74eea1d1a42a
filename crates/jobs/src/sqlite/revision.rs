//! Tells whether anything was committed.

use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

use rusqlite::OpenFlags;

use crate::Revision;

/// A connection that does nothing but ask whether others have committed, this process's or
/// another's. It is asked on the calling thread: the answer is in memory that all connections
/// share, so that no lock is waited for, and a hop to another thread would cost several times
/// as much.
pub(super) struct Revisions {
    /// `None` once it is closed.
    connection: Mutex<Option<rusqlite::Connection>>,
}

impl Revisions {
    /// Opens the file, which must be there.
    pub(super) fn open(path: &Path) -> rusqlite::Result<Self> {
        let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let connection = rusqlite::Connection::open_with_flags(path, flags)?;
        // Its data version tells of the commits of others, so it must have none of its own.
        connection.pragma_update(None, "query_only", true)?;
        connection.busy_timeout(std::time::Duration::ZERO)?;
        Ok(Self { connection: Mutex::new(Some(connection)) })
    }

    /// What is stored now; `None` if it can't be told at once.
    pub(super) fn current(&self) -> Option<Revision> {
        let connection = self.lock();
        let mut asking = connection.as_ref()?.prepare_cached("PRAGMA data_version").ok()?;
        asking.query_row([], |row| row.get(0)).map(Revision).ok()
    }

    pub(super) fn close(&self) {
        self.lock().take();
    }

    fn lock(&self) -> MutexGuard<'_, Option<rusqlite::Connection>> {
        self.connection.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
