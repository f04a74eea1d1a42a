//! A service process of ours on a port of its own.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use reqwest::multipart::{Form, Part};
use reqwest::{Client, RequestBuilder};
use serde_json::Value;

use crate::api::harness::drawing;

/// Long enough for a busy machine; nothing waits for it to pass.
pub(crate) const PATIENCE: Duration = Duration::from_secs(120);

/// A service process; killed without warning when dropped.
pub(crate) struct Process {
    pub child: Child,
    pub url: String,
    pub client: Client,
}

impl Process {
    pub(crate) fn start(folder: &Path, settings: &[&str]) -> Self {
        Self::spawn(command(folder, settings))
    }

    /// Starts what becomes a service, and waits until it listens.
    pub(crate) fn spawn(mut command: Command) -> Self {
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let url = lines
            .map_while(Result::ok)
            .find_map(|line| line.strip_prefix("listening on ").map(str::to_owned))
            .expect("the service says where it listens");
        Self { child, url, client: crate::client() }
    }

    pub(crate) fn get(&self, path: &str) -> RequestBuilder {
        self.client.get(format!("{}{path}", self.url))
    }

    pub(crate) fn post(&self, path: &str) -> RequestBuilder {
        self.client.post(format!("{}{path}", self.url))
    }

    pub(crate) fn signal(&self, name: &str) {
        let pid = self.child.id().to_string();
        assert!(Command::new("kill").args(["-s", name, &pid]).status().unwrap().success());
    }

    /// Uploads a small sheet. Returns the status and the answer.
    pub(crate) async fn upload(&self) -> (u16, Value) {
        let response = self.post("/v1/reconstructions").multipart(sheet()).send().await.unwrap();
        (response.status().as_u16(), response.json().await.unwrap())
    }

    /// Asks until `what` holds of the answer.
    pub(crate) async fn until(&self, path: &str, what: impl Fn(u16, &Value) -> bool) -> Value {
        let begun = Instant::now();
        loop {
            let response = self.get(path).send().await.unwrap();
            let status = response.status().as_u16();
            let body = response.json().await.unwrap_or_default();
            if what(status, &body) {
                return body;
            }
            assert!(begun.elapsed() < PATIENCE, "still waiting for {path}: {status} {body}");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        self.child.wait().unwrap();
    }
}

/// The command that serves from `folder`.
pub(crate) fn command(folder: &Path, settings: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_turnaround"));
    command
        .args(["serve", "--listen", "127.0.0.1:0", "--threads-per-job", "1", "--data-dir"])
        .arg(folder)
        .args(settings);
    command
}

/// Three small views, cheap to reconstruct, each time anew.
pub(crate) fn sheet() -> Form {
    reusable_sheet().text("reuse", "false")
}

/// As [`sheet`]; an earlier result will do.
pub(crate) fn reusable_sheet() -> Form {
    ["0", "45", "90"].iter().fold(
        Form::new().text("turntable.solid.resolution", "32"),
        |form, angle| {
            let part = Part::bytes(drawing(32, 24, 1)).file_name(format!("{angle}.png"));
            form.part(format!("view[{angle}]"), part)
        },
    )
}
