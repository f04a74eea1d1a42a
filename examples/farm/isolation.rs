//! What a process of its own costs a job: the same small jobs with and without one.

use std::process::Command;
use std::time::Instant;

use reqwest::Client;
use serde_json::Value;

use crate::nodes::{Node, program};
use crate::{Result, upload};

/// Runs `jobs` jobs in turn on a service of each kind, both on this machine and idle otherwise.
pub(crate) async fn measure(jobs: u64) -> Result<()> {
    let client = Client::builder().no_proxy().build()?;
    let mut nodes = Vec::new();
    for isolation in ["none", "process"] {
        let folder = tempfile::tempdir()?;
        let mut command = Command::new(program()?);
        command.args(["serve", "--listen", "127.0.0.1:0", "--isolation", isolation, "--data-dir"]);
        command.arg(folder.path());
        nodes.push((isolation, Node::start(command)?, folder, Vec::new()));
    }
    // The first jobs of both load the network's weights.
    for seed in 0..jobs + 2 {
        for (_, node, _, times_ms) in &mut nodes {
            let url = node.url.as_deref().ok_or("the service does not listen")?;
            let time = one(&client, url, seed).await?;
            times_ms.extend((seed >= 2).then_some(time));
        }
    }
    println!("| isolation | jobs | p50 ms | p90 ms |\n|---|---|---|---|");
    for (isolation, .., times_ms) in &mut nodes {
        times_ms.sort_by(f64::total_cmp);
        let share = |of: usize| times_ms[(times_ms.len() - 1) * of / 10];
        println!("| {isolation} | {jobs} | {:.1} | {:.1} |", share(5), share(9));
    }
    Ok(())
}

/// From the answer to the upload to the job's end, ms.
async fn one(client: &Client, url: &str, seed: u64) -> Result<f64> {
    let form = upload::sheet(seed)?.text("turntable.solid.prior", "off");
    let request = client.post(format!("{url}/v1/reconstructions")).multipart(form);
    let begun = Instant::now();
    let job: Value = request.send().await?.error_for_status()?.json().await?;
    let path = format!("{url}/v1/reconstructions/{}", job["id"].as_str().ok_or("no id")?);
    let ended = client.get(&path).header("prefer", "wait=30").send().await?;
    let ended: Value = ended.error_for_status()?.json().await?;
    let time_ms = begun.elapsed().as_secs_f64() * 1000.0;
    if ended["state"] != "succeeded" {
        return Err(format!("{path}: {ended}").into());
    }
    Ok(time_ms)
}
