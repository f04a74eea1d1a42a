//! How much faster a batch is done by two workers on two cores than by one on one.

use std::process::Command;
use std::time::{Duration, Instant};

use reqwest::Client;
use serde_json::Value;
use testbed::{Durability, Farm};

use crate::nodes::{Node, program};
use crate::{Result, upload};

const PATIENCE: Duration = Duration::from_secs(600);

/// Where jobs and bytes are.
enum Stores {
    Folder(tempfile::TempDir),
    Farm(Box<Farm>),
}

impl Stores {
    fn name(&self) -> &'static str {
        match self {
            Self::Folder(_) => "SQLite, folder",
            Self::Farm(_) => "PostgreSQL, S3",
        }
    }

    /// A node that may use the cores `0..cores`, with as many workers or none.
    fn node(&self, cores: usize, workers: usize) -> Result<Node> {
        let mut command = match self {
            Self::Folder(folder) => {
                let mut command = Command::new("taskset");
                command.arg("--cpu-list").env("TURNAROUND_DATA_DIR", folder.path());
                command
            }
            Self::Farm(farm) => farm.command("taskset", "--cpu-list"),
        };
        command.arg(format!("0-{}", cores - 1)).arg(program()?).arg("serve");
        command.args(["--listen", "127.0.0.1:0", "--workers", &workers.to_string()]);
        Node::start(command)
    }
}

/// Does the batch in turn with both, `rounds` times, on stores of each kind.
pub(crate) async fn measure(jobs: u64, rounds: u64) -> Result<()> {
    println!("| stores | round | one on one core, s | two on two cores, s | ratio |");
    println!("|---|---|---|---|---|");
    let mut seed = 0;
    for is_farm in [false, true] {
        let mut ratios = Vec::new();
        let mut name = "";
        for round in 1..=rounds {
            let mut times_s = Vec::new();
            for cores in [1, 2] {
                let stores = match is_farm {
                    false => Stores::Folder(tempfile::tempdir()?),
                    true => Stores::Farm(Box::new(Farm::start(Durability::Full))),
                };
                name = stores.name();
                times_s.push(batch(&stores, cores, seed..seed + jobs).await?);
                seed += jobs;
            }
            let ratio = times_s[0] / times_s[1];
            println!("| {name} | {round} | {:.2} | {:.2} | {ratio:.2} |", times_s[0], times_s[1]);
            ratios.push(ratio);
        }
        ratios.sort_by(f64::total_cmp);
        println!("| {name} | median | | | {:.2} |", ratios[ratios.len() / 2]);
    }
    Ok(())
}

/// From the beginning of the first job to the end of the last, all of them waiting before, s.
async fn batch(stores: &Stores, cores: usize, seeds: std::ops::Range<u64>) -> Result<f64> {
    let client = Client::builder().no_proxy().build()?;
    let (reader, mut ids) = (stores.node(2, 0)?, Vec::new());
    let url = reader.url.clone().ok_or("the service does not listen")?;
    for seed in seeds {
        let request = client.post(format!("{url}/v1/reconstructions"));
        let sent = request.multipart(upload::larger_sheet(seed)?).send().await?;
        let job: Value = sent.error_for_status()?.json().await?;
        ids.push(job["id"].as_str().ok_or("no id")?.to_owned());
    }
    let _workers = stores.node(cores, cores)?;
    let (mut first, mut last) = (i64::MAX, 0);
    for id in ids {
        let path = format!("{url}/v1/reconstructions/{id}");
        let begun = Instant::now();
        let ended = loop {
            // Not often: asking takes time of the cores.
            let asked = client.get(&path).send().await?.error_for_status()?;
            let job: Value = asked.json().await?;
            if job["finished_at"].is_string() {
                break job;
            }
            if begun.elapsed() > PATIENCE {
                return Err(format!("{path} does not end").into());
            }
            tokio::time::sleep(Duration::from_millis(500)).await;
        };
        if ended["state"] != "succeeded" {
            return Err(format!("{path}: {ended}").into());
        }
        let at = |field: &str| -> Result<i64> {
            let time: jiff::Timestamp = ended[field].as_str().ok_or("no time")?.parse()?;
            Ok(time.as_millisecond())
        };
        (first, last) = (first.min(at("started_at")?), last.max(at("finished_at")?));
    }
    Ok((last - first) as f64 / 1000.0)
}
