//! The processes of a farm.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use testbed::Farm;

use crate::Result;

/// A node that answers requests and runs nothing.
pub(crate) fn api(farm: &Farm) -> Result<Node> {
    api_of(&program()?, farm)
}

/// As [`api`], of another program.
pub(crate) fn api_of(program: &Path, farm: &Farm) -> Result<Node> {
    let mut command = farm.command(program, "serve");
    command.args(["--listen", "127.0.0.1:0", "--workers", "0", "--max-attempts", "50"]);
    Node::start(command)
}

/// A node that runs a job at a time.
pub(crate) fn worker(farm: &Farm) -> Result<Node> {
    worker_of(&program()?, farm)
}

/// As [`worker`], of another program.
pub(crate) fn worker_of(program: &Path, farm: &Farm) -> Result<Node> {
    let mut command = farm.command(program, "worker");
    command.args(["--threads-per-job", "1", "--lease", "6", "--heartbeat", "2"]);
    Node::start(command)
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
        let pid = rustix::process::Pid::from_child(&self.process);
        Ok(rustix::process::kill_process(pid, rustix::process::Signal::TERM)?)
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
