//! Nodes of an older program are replaced one by one by those of this one, while uploads come.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use jobs::{JobId, JobState, JobStore, PostgresOptions, PostgresStore};
use reqwest::{Client, StatusCode};
use serde_json::Value;
use testbed::{Durability, Farm};
use tokio::sync::RwLock;

use crate::nodes::{Node, api, api_of, worker, worker_of};
use crate::{Result, upload};

const NODES: usize = 2;
/// Between two steps: as a proxy needs to see a node that is not ready.
const STEP: Duration = Duration::from_secs(3);
const PATIENCE: Duration = Duration::from_secs(300);

/// Fails if a request failed or a job was lost.
pub(crate) async fn run(old: &Path) -> Result<()> {
    let farm = Farm::start(Durability::Full);
    let mut apis = (0..NODES).map(|_| api_of(old, &farm)).collect::<Result<Vec<_>>>()?;
    let mut workers = (0..NODES).map(|_| worker_of(old, &farm)).collect::<Result<Vec<_>>>()?;
    let urls = Arc::new(RwLock::new(apis.iter().filter_map(|node| node.url.clone()).collect()));
    let is_over = Arc::new(AtomicBool::new(false));
    let sending = tokio::spawn(send(Arc::clone(&urls), Arc::clone(&is_over)));
    tokio::time::sleep(STEP).await;
    for worker_node in &mut workers {
        let next = worker(&farm)?;
        replace(worker_node, next).await?;
        tokio::time::sleep(STEP).await;
    }
    for (number, node) in apis.iter_mut().enumerate() {
        let next = api(&farm)?;
        // The proxy's part: a node that stops gets no more requests.
        urls.write().await[number] = next.url.clone().ok_or("the new node does not listen")?;
        replace(node, next).await?;
        tokio::time::sleep(STEP).await;
    }
    is_over.store(true, Ordering::SeqCst);
    let (accepted, failed) = sending.await??;
    let store = PostgresStore::open(&farm.database, &PostgresOptions::default()).await?;
    let (mut succeeded, mut attempts, begun) = (0, 0, Instant::now());
    for id in &accepted {
        let job = loop {
            let job = store.get(*id).await?;
            if job.state.is_final() || begun.elapsed() > PATIENCE {
                break job;
            }
            tokio::time::sleep(Duration::from_millis(100)).await;
        };
        succeeded += usize::from(job.state == JobState::Succeeded);
        attempts += job.attempts_used;
    }
    let (accepted, failed) = (accepted.len(), failed.len());
    println!(
        "{accepted} jobs, {succeeded} succeeded, {attempts} attempts, {failed} requests failed"
    );
    if succeeded < accepted || failed > 0 { Err("the upgrade was seen".into()) } else { Ok(()) }
}

/// Tells the old node to stop and waits until it has.
async fn replace(node: &mut Node, next: Node) -> Result<()> {
    node.stop()?;
    let begun = Instant::now();
    while !node.has_ended()? {
        if begun.elapsed() > PATIENCE {
            return Err("a node does not stop".into());
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    *node = next;
    Ok(())
}

type Sent = (Vec<JobId>, Vec<String>);

/// Uploads in turn until it is over; returns what was taken and what failed.
async fn send(
    urls: Arc<RwLock<Vec<String>>>,
    is_over: Arc<AtomicBool>,
) -> std::result::Result<Sent, String> {
    let client = Client::builder().no_proxy().build().map_err(|error| error.to_string())?;
    let (mut taken, mut failed) = (Vec::new(), Vec::new());
    for number in 0.. {
        if is_over.load(Ordering::SeqCst) {
            break;
        }
        // Held while the request is under way: no node stops under it.
        let urls = urls.read().await;
        let url = format!("{}/v1/reconstructions", urls[number as usize % urls.len()]);
        let form = upload::plain_sheet(number).map_err(|error| error.to_string())?;
        match client.post(url).multipart(form).send().await {
            Ok(response) if response.status() == StatusCode::ACCEPTED => {
                let job: Value = response.json().await.map_err(|error| error.to_string())?;
                let id = job["id"].as_str().and_then(|id| id.parse().ok());
                taken.push(id.ok_or("an answer without an id")?);
            }
            Ok(response) => failed.push(response.status().to_string()),
            Err(error) => failed.push(error.to_string()),
        }
        drop(urls);
        tokio::time::sleep(Duration::from_millis(400)).await;
    }
    Ok((taken, failed))
}
