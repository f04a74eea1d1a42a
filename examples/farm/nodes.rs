//! The processes of a farm and the services that they share.

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use jobs::bytes::ByteStore;
use jobs::{PostgresOptions, PostgresStore};
use tempfile::TempDir;
use testbed::{BUCKET, Durability, Postgres, S3};

use crate::Result;

pub(crate) struct Farm {
    pub(crate) postgres: Postgres,
    pub(crate) s3: S3,
    database: String,
    pub(crate) folder: TempDir,
}

impl Farm {
    pub(crate) fn start() -> Result<Self> {
        let (postgres, s3) = (Postgres::start(Durability::Full), S3::start());
        let database = postgres.database();
        Ok(Self { postgres, s3, database, folder: tempfile::tempdir()? })
    }

    /// A node that answers requests and runs nothing.
    pub(crate) fn api(&self) -> Result<Node> {
        let mut command = self.command("serve")?;
        command.args(["--listen", "127.0.0.1:0", "--workers", "0", "--max-attempts", "50"]);
        Node::start(command)
    }

    /// A node that runs a job at a time.
    pub(crate) fn worker(&self) -> Result<Node> {
        let mut command = self.command("worker")?;
        command.args(["--threads-per-job", "1", "--lease", "6", "--heartbeat", "2"]);
        Node::start(command)
    }

    fn command(&self, name: &str) -> Result<Command> {
        let mut command = Command::new(program()?);
        command.arg(name).current_dir(self.folder.path()).envs(self.s3.environment());
        command.env("TURNAROUND_DATABASE_URL", &self.database);
        command.env("TURNAROUND_STORE", address());
        Ok(command)
    }

    pub(crate) async fn store(&self) -> Result<PostgresStore> {
        Ok(PostgresStore::open(&self.database, &PostgresOptions::default()).await?)
    }

    pub(crate) fn bytes(&self) -> Result<ByteStore> {
        Ok(ByteStore::s3(&address(), self.s3.environment())?)
    }
}

fn address() -> String {
    format!("s3://{BUCKET}/farm")
}

/// The program that was built with this one.
pub(crate) fn program() -> Result<PathBuf> {
    let own = std::env::current_exe()?;
    let folder = own.ancestors().nth(2).ok_or("no folder of programs")?;
    Ok(folder.join("turnaround"))
}

/// A process; killed without warning when dropped.
pub(crate) struct Node {
    process: Child,
    /// Where it answers, if it does.
    pub(crate) url: Option<String>,
}

impl Node {
    pub(crate) fn start(mut command: Command) -> Result<Self> {
        let is_api = command.get_args().any(|argument| argument == "serve");
        let mut process = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn()?;
        let output = process.stdout.take().ok_or("no output")?;
        let mut node = Self { process, url: None };
        if is_api {
            let mut lines = BufReader::new(output).lines().map_while(std::result::Result::ok);
            node.url = lines.find_map(|line| line.strip_prefix("listening on ").map(str::to_owned));
        }
        Ok(node)
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
