//! What the nodes of a farm share.

use std::env;
use std::ffi::OsStr;
use std::path::Path;
use std::process::Command;

use tempfile::TempDir;

use crate::{BUCKET, Durability, Postgres, S3};

/// A database and a bucket for nodes, which are processes of a program.
pub struct Farm {
    /// The database server.
    pub postgres: Postgres,
    /// The server with the bucket.
    pub s3: S3,
    /// Address of the database.
    pub database: String,
    /// Where nodes run: they have no file in common, and leave none behind.
    pub folder: TempDir,
}

impl Farm {
    /// Starts both servers.
    ///
    /// # Panics
    /// If one does not come up, or there is no temporary folder.
    pub fn start(durability: Durability) -> Self {
        Self::start_in(durability, &env::temp_dir())
    }

    /// As [`Self::start`], with the files of both servers below `place`.
    ///
    /// # Panics
    /// As [`Self::start`].
    pub fn start_in(durability: Durability, place: &Path) -> Self {
        let (postgres, s3) = (Postgres::start_in(durability, place), S3::start_in(place));
        let database = postgres.database();
        Self { postgres, s3, database, folder: tempfile::tempdir().expect("a temporary folder") }
    }

    /// A command of `program` that works with the farm.
    pub fn command(&self, program: impl AsRef<OsStr>, name: &str) -> Command {
        let mut command = Command::new(program);
        command.arg(name).current_dir(self.folder.path()).envs(self.s3.environment());
        command.env("TURNAROUND_DATABASE_URL", &self.database);
        command.env("TURNAROUND_STORE", self.store());
        command
    }

    /// Address of the bytes' store.
    pub fn store(&self) -> String {
        format!("s3://{BUCKET}/farm")
    }
}
