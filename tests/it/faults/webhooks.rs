//! Messages about jobs of a service that is killed.

use std::collections::HashSet;
use std::time::Duration;

use serde_json::Value;

use super::process::{Process, sheet};
use crate::api::receiver::{Authority, Receiver};
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

/// Messages go over TLS, to receivers whose certificates an authority signed that is believed;
/// what another one signed is not, and the log of deliveries says so.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn messages_go_over_tls_to_whom_an_authority_vouches_for() {
    let folder = tempfile::tempdir().unwrap();
    let (known, unknown) = (Authority::new(), Authority::new());
    let file = folder.path().join("ca.pem");
    std::fs::write(&file, known.pem()).unwrap();
    let settings = [SETTINGS.as_slice(), &HEARTBEAT, &["--ca-file", file.to_str().unwrap()]];
    let service = Process::start(&folder.path().join("data"), &settings.concat());
    let made = service.post("/v1/webhook/secret").send().await.unwrap();
    let made: Value = made.json().await.unwrap();
    let [believed, doubted] =
        [Receiver::start_tls(&known).await, Receiver::start_tls(&unknown).await];

    let id = queue(&service, &format!("{}/ok", believed.url)).await;
    let told = believed.wait_for(1).await.remove(0).verified(made["secret"].as_str().unwrap());
    assert_eq!(told["type"], "reconstruction.succeeded");
    assert_eq!(told["data"]["href"], format!("/v1/reconstructions/{id}"));
    let path = format!("/v1/reconstructions/{id}/deliveries");
    service.until(&path, |_, list| list["deliveries"][0]["state"] == "delivered").await;

    let id = queue(&service, &format!("{}/ok", doubted.url)).await;
    let path = format!("/v1/reconstructions/{id}/deliveries");
    let is_tried = |list: &Value| list["deliveries"][0]["attempts"][0].is_object();
    let list = service.until(&path, |_, list| is_tried(list)).await;
    let attempt = &list["deliveries"][0]["attempts"][0];
    assert_eq!(attempt["status"], Value::Null, "{list}");
    let error = attempt["error"].as_str().unwrap();
    assert!(error.contains("certificate or TLS is not accepted"), "{list}");
    assert!(doubted.messages().await.is_empty(), "it was told all the same");
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
