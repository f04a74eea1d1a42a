//! Room on the disk that is kept for what must go on when the disk is full:
//! endings, cancellations and deletions, which make room themselves.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use rustix::fs::statvfs;

/// Enough for the log of many small transactions.
const RESERVE_BYTES: u64 = 4 << 20;
const BLOCK_BYTES: usize = 1 << 20;

/// A file that only takes room, beside the database.
pub(super) struct Reserve {
    path: PathBuf,
}

impl Reserve {
    pub(super) fn beside(database: &Path) -> Self {
        let mut path = database.as_os_str().to_owned();
        path.push(".reserve");
        Self { path: path.into() }
    }

    /// Gives the room up. `false` if there was none.
    pub(super) fn give_up(&self) -> bool {
        let held = std::fs::metadata(&self.path).map_or(0, |file| file.len());
        let given = held > 0 && File::create(&self.path).is_ok();
        if given {
            tracing::warn!(bytes = held, "the disk is full: the reserve is given up");
        }
        given
    }

    /// Takes the room (again) if there is twice as much, so that it is not what
    /// fills the disk.
    pub(super) fn take(&self) -> io::Result<()> {
        if std::fs::metadata(&self.path).is_ok_and(|file| file.len() >= RESERVE_BYTES) {
            return Ok(());
        }
        let folder = self.path.parent().filter(|parent| !parent.as_os_str().is_empty());
        let space = statvfs(folder.unwrap_or(Path::new(".")))?;
        if space.f_bavail.saturating_mul(space.f_frsize) < 2 * RESERVE_BYTES {
            return Ok(());
        }
        // Written, for a hole takes no room.
        let mut file = File::create(&self.path)?;
        for _ in 0..RESERVE_BYTES / BLOCK_BYTES as u64 {
            file.write_all(&[0; BLOCK_BYTES])?;
        }
        file.sync_all()
    }
}
