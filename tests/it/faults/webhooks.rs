//! Messages about jobs of a service that is killed.

use std::collections::HashSet;
use std::time::Duration;

use serde_json::Value;

use super::process::{Process, sheet};
use crate::api::receiver::Receiver;
use crate::api::webhooks::told_at;

const SETTINGS: [&str; 4] = ["--trusted-host", "127.0.0.1", "--lease", "2"];
const HEARTBEAT: [&str; 2] = ["--heartbeat", "1"];

fn start(folder: &std::path::Path) -> Process {
    Process::start(folder, &[SETTINGS.as_slice(), &HEARTBEAT].concat())
}

async fn queue(service: &Process, url: &str) -> String {
    let request = service.post(&told_at(url));
    let sent = request.multipart(sheet()).send().await.unwrap();
    assert_eq!(sent.status(), 202);
    sent.json::<Value>().await.unwrap()["id"].as_str().unwrap().to_owned()
}

/// Killed while a message is under way: it is sent again by the next process.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_message_under_way_at_a_kill_is_sent_again() {
    let folder = tempfile::tempdir().unwrap();
    let receiver = Receiver::start().await;
    let service = start(folder.path());
    service.post("/v1/webhook/secret").send().await.unwrap();
    let id = queue(&service, &format!("{}/slow-once", receiver.url)).await;
    receiver.wait_for(1).await;
    drop(service);
    let service = start(folder.path());
    let sent = receiver.wait_for(2).await;
    assert_eq!(sent[0].headers["webhook-id"], sent[1].headers["webhook-id"]);
    assert_eq!(sent[0].body, sent[1].body);
    let path = format!("/v1/reconstructions/{id}/deliveries");
    service.until(&path, |_, list| list["deliveries"][0]["state"] == "delivered").await;
}

/// Killed again and again while jobs end: each end is told.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn no_end_of_a_job_is_lost_by_kills() {
    let folder = tempfile::tempdir().unwrap();
    let receiver = Receiver::start().await;
    let url = format!("{}/ok", receiver.url);
    let mut service = start(folder.path());
    service.post("/v1/webhook/secret").send().await.unwrap();
    let mut queued = HashSet::new();
    for round in 0..5 {
        for _ in 0..2 {
            queued.insert(queue(&service, &url).await);
        }
        tokio::time::sleep(Duration::from_millis(150 * round)).await;
        drop(service);
        service = start(folder.path());
    }
    for id in &queued {
        let path = format!("/v1/reconstructions/{id}/deliveries");
        service.until(&path, |_, list| list["deliveries"][0]["state"] == "delivered").await;
    }
    let sent = receiver.messages().await;
    let told: HashSet<String> = sent
        .iter()
        .map(|message| {
            let told: Value = serde_json::from_slice(&message.body).unwrap();
            told["data"]["id"].as_str().unwrap().to_owned()
        })
        .collect();
    assert_eq!(told, queued);
}
