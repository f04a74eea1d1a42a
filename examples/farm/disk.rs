//! A small disk of its own, which can be filled.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;

use rustix::fs::{FallocateFlags, fallocate};
use rustix::io::Errno;
use tempfile::{NamedTempFile, TempDir};

use crate::Result;

/// Room for a database, its log and the bytes of some hundred small jobs.
const SIZE_BYTES: u64 = 2 << 30;

/// A file with a file system in it, mounted.
pub(crate) struct Disk {
    folder: TempDir,
    _image: NamedTempFile,
}

impl Disk {
    /// # Errors
    /// Unless the caller may mount (root) and the system has `mkfs.ext4` and loop devices.
    pub(crate) fn mount() -> Result<Self> {
        let (image, folder) = (NamedTempFile::new()?, tempfile::tempdir()?);
        image.as_file().set_len(SIZE_BYTES)?;
        // No room that only root may use: the database is not root.
        succeed(Command::new("mkfs.ext4").args(["-q", "-F", "-m", "0"]).arg(image.path()))?;
        succeed(Command::new("mount").args(["-o", "loop"]).arg(image.path()).arg(folder.path()))?;
        Ok(Self { folder, _image: image })
    }

    pub(crate) fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Takes all room that is left.
    pub(crate) fn fill(&self) -> Result<()> {
        let file = File::create(self.filler())?;
        let mut at = 0;
        for piece in [1 << 30, 64 << 20, 1 << 20, 4 << 10] {
            loop {
                match fallocate(&file, FallocateFlags::empty(), at, piece) {
                    Ok(()) => at += piece,
                    Err(Errno::NOSPC) => break,
                    Err(error) => return Err(error.into()),
                }
            }
        }
        Ok(())
    }

    /// Gives the room back.
    pub(crate) fn free(&self) -> Result<()> {
        Ok(fs::remove_file(self.filler())?)
    }

    fn filler(&self) -> PathBuf {
        self.path().join("filler")
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        // Also while a file of it is still open.
        let _ = succeed(Command::new("umount").arg("--lazy").arg(self.path()));
    }
}

fn succeed(command: &mut Command) -> Result<()> {
    let output = command.output()?;
    if output.status.success() {
        return Ok(());
    }
    let told = String::from_utf8_lossy(&output.stderr);
    Err(format!("{command:?}: {}", told.trim()).into())
}
