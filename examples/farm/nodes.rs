//! The processes of a farm.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use rustix::process::{Pid, Signal, kill_process};
use testbed::Farm;

use crate::Result;

/// A node that answers requests and runs nothing.
pub(crate) fn api(farm: &Farm) -> Result<Node> {
    api_of(&program()?, farm)
}

/// As [`api`], of another program.
pub(crate) fn api_of(program: &Path, farm: &Farm) -> Result<Node> {
    Node::start(api_command(program, farm))
}

pub(crate) fn api_command(program: &Path, farm: &Farm) -> Command {
    let mut command = farm.command(program, "serve");
    command.args(["--listen", "127.0.0.1:0", "--workers", "0", "--max-attempts", "50"]);
    command
}

/// A node that runs a job at a time.
pub(crate) fn worker(farm: &Farm) -> Result<Node> {
    worker_of(&program()?, farm)
}

/// As [`worker`], of another program.
pub(crate) fn worker_of(program: &Path, farm: &Farm) -> Result<Node> {
    Node::start(worker_command(program, farm))
}

pub(crate) fn worker_command(program: &Path, farm: &Farm) -> Command {
    let mut command = farm.command(program, "worker");
    command.args(["--threads-per-job", "1", "--lease", "6", "--heartbeat", "2"]);
    command
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

impl Node {
    /// Tells it to stop (SIGTERM), and does not wait.
    pub(crate) fn stop(&self) -> Result<()> {
        Ok(kill_process(Pid::from_child(&self.process), Signal::TERM)?)
    }

    /// The processes that it started and that still run.
    pub(crate) fn children(&self) -> Vec<Pid> {
        let threads = fs::read_dir(format!("/proc/{}/task", self.process.id()));
        let threads = threads.into_iter().flatten().filter_map(std::result::Result::ok);
        let told =
            threads.filter_map(|thread| fs::read_to_string(thread.path().join("children")).ok());
        let told: Vec<String> = told.collect();
        let numbers = told.iter().flat_map(|text| text.split_whitespace());
        numbers.filter_map(|number| Pid::from_raw(number.parse().ok()?)).collect()
    }

    /// Whether it has ended.
    pub(crate) fn has_ended(&mut self) -> Result<bool> {
        Ok(self.process.try_wait()?.is_some())
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
