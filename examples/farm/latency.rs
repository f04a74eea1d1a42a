//! From an upload's row to the start of its work, with an idle worker.

use std::process::Command;
use std::time::{Duration, Instant};

use reqwest::Client;
use serde_json::Value;
use testbed::{Durability, Farm};

use crate::nodes::{Node, api, program, worker};
use crate::{Result, upload};

const PATIENCE: Duration = Duration::from_secs(60);

pub(crate) async fn measure(jobs: u64) -> Result<()> {
    println!("| stores | jobs | queued to started p50 ms | p99 ms | post to answer p50 ms |");
    println!("|---|---|---|---|---|");
    let folder = tempfile::tempdir()?;
    let mut command = Command::new(program()?);
    command.args(["serve", "--listen", "127.0.0.1:0", "--data-dir"]).arg(folder.path());
    one("SQLite, folder", Node::start(command)?, jobs).await?;
    let farm = Farm::start(Durability::Full);
    let node = api(&farm)?;
    let _worker = worker(&farm)?;
    one("PostgreSQL, S3", node, jobs).await
}

async fn one(stores: &str, node: Node, jobs: u64) -> Result<()> {
    let url = node.url.as_deref().ok_or("the service does not listen")?;
    let client = Client::builder().no_proxy().build()?;
    let (mut starts_ms, mut posts_ms) = (Vec::new(), Vec::new());
    for seed in 0..jobs {
        let asked = Instant::now();
        let request = client.post(format!("{url}/v1/reconstructions"));
        let response = request.multipart(upload::sheet(seed)?).send().await?;
        posts_ms.push(asked.elapsed().as_secs_f64() * 1000.0);
        let job: Value = response.error_for_status()?.json().await?;
        let path = format!("{url}/v1/reconstructions/{}", job["id"].as_str().ok_or("no id")?);
        let begun = Instant::now();
        let ended = loop {
            let asked = client.get(&path).header("prefer", "wait=10").send().await?;
            let job: Value = asked.error_for_status()?.json().await?;
            if job["finished_at"].is_string() {
                break job;
            }
            if begun.elapsed() > PATIENCE {
                return Err(format!("{path} does not end").into());
            }
        };
        let at = |field: &str| -> Result<f64> {
            let time: jiff::Timestamp = ended[field].as_str().ok_or("no time")?.parse()?;
            Ok(time.as_millisecond() as f64)
        };
        starts_ms.push(at("started_at")? - at("created_at")?);
    }
    let share = |times: &mut Vec<f64>, share: f64| {
        times.sort_by(f64::total_cmp);
        times[(share * (times.len() - 1) as f64).round() as usize]
    };
    let (p50, p99) = (share(&mut starts_ms, 0.5), share(&mut starts_ms, 0.99));
    let post = share(&mut posts_ms, 0.5);
    println!("| {stores} | {jobs} | {p50:.0} | {p99:.0} | {post:.0} |");
    Ok(())
}
