//! Nodes of a farm: processes of their own on one PostgreSQL database and one
//! bucket.

use std::collections::HashSet;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use futures::future::join_all;
use jobs::bytes::{ByteStore, Key};
use jobs::{ArtifactEntry, EventKind, JobId, JobState, JobStore, PostgresOptions, PostgresStore};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use testbed::{Durability, Farm};

use crate::faults::process::{PATIENCE, Process, reusable_sheet, sheet};
use crate::service_crash::form;

fn farm() -> Farm {
    Farm::start(Durability::None)
}

fn command(farm: &Farm, name: &str) -> Command {
    farm.command(env!("CARGO_BIN_EXE_turnaround"), name)
}

/// A node that answers requests and runs nothing.
fn api(farm: &Farm) -> Process {
    let mut command = command(farm, "serve");
    command.args(["--listen", "127.0.0.1:0", "--workers", "0"]);
    Process::spawn(command)
}

fn worker(farm: &Farm) -> Worker {
    let mut command = command(farm, "worker");
    command.args(["--threads-per-job", "1", "--lease", "2", "--heartbeat", "1"]);
    Worker(command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap())
}

async fn store(farm: &Farm) -> PostgresStore {
    PostgresStore::open(&farm.database, &PostgresOptions::default()).await.unwrap()
}

/// A node that runs jobs; killed without warning when dropped.
struct Worker(Child);

impl Worker {
    fn signal(&self, name: &str) {
        let pid = self.0.id().to_string();
        assert!(Command::new("kill").args(["-s", name, &pid]).status().unwrap().success());
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        let _ = self.0.kill();
        self.0.wait().unwrap();
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_result_made_by_one_node_is_another_one_s_answer() {
    let farm = farm();
    let (nodes, _worker) = ([api(&farm), api(&farm)], worker(&farm));
    let post = async |node: &Process| -> Value {
        let request = node.post("/v1/reconstructions").multipart(reusable_sheet());
        request.send().await.unwrap().json().await.unwrap()
    };
    let path = |job: &Value| format!("/v1/reconstructions/{}", job["id"].as_str().unwrap());
    let first = post(&nodes[0]).await;
    nodes[0].until(&path(&first), |_, job| job["state"] == "succeeded").await;
    let again = post(&nodes[1]).await;
    assert_eq!((&again["state"], &again["reused_from"]), (&"succeeded".into(), &first["id"]));
    let listed = async |job: &Value| -> Vec<(Value, Value)> {
        let list = nodes[1].get(&format!("{}/artifacts", path(job))).send().await.unwrap();
        let list: Value = list.json().await.unwrap();
        let entries = list["artifacts"].as_array().unwrap().iter();
        entries.map(|entry| (entry["name"].clone(), entry["sha256"].clone())).collect()
    };
    let made = listed(&first).await;
    assert_eq!(listed(&again).await, made);
    let url = format!("{}{}", nodes[0].url, path(&first));
    assert_eq!(nodes[0].client.delete(url).send().await.unwrap().status(), 204);
    for (name, sha256) in made {
        let file = format!("{}/artifacts/{}", path(&again), name.as_str().unwrap());
        let bytes = nodes[0].get(&file).send().await.unwrap().bytes().await.unwrap();
        assert_eq!(hex::encode(Sha256::digest(&bytes)), sha256, "{name}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nodes_are_one_service() {
    let farm = farm();
    let nodes = [api(&farm), api(&farm)];
    let posts = (0..100).map(|number| {
        let node = &nodes[number % 2];
        let request = node.post("/v1/reconstructions").header("idempotency-key", "once");
        async move {
            let response = request.multipart(sheet()).send().await.unwrap();
            let (status, body) = (response.status(), response.json::<Value>().await.unwrap());
            assert_eq!(status, 202, "{body}");
            body["id"].as_str().unwrap().to_owned()
        }
    });
    let ids: HashSet<String> = join_all(posts).await.into_iter().collect();
    assert_eq!(ids.len(), 1, "one key became several jobs");
    let id = ids.into_iter().next().unwrap();
    let store = store(&farm).await;
    assert_eq!(store.ids().await.unwrap().len(), 1);
    let path = format!("/v1/reconstructions/{id}");

    // Followed through one node, run by another, fetched through a third.
    let following = nodes[0].get(&format!("{path}/events")).send();
    let _worker = worker(&farm);
    let events = following.await.unwrap().text().await.unwrap();
    assert!(events.contains("event: started") && events.contains("event: progress"), "{events}");
    assert_eq!(events.matches("event: succeeded").count(), 1, "{events}");
    let job = store.get(id.parse().unwrap()).await.unwrap();
    let solid = job.artifacts.iter().find(|it| it.name == "solid.glb").unwrap();
    let artifact = format!("{path}/artifacts/solid.glb");
    let whole = nodes[1].get(&artifact).send().await.unwrap().bytes().await.unwrap();
    assert_eq!(hex::encode(Sha256::digest(&whole)), solid.sha256);
    let part = nodes[1].get(&artifact).header("range", "bytes=10-99").send().await.unwrap();
    assert_eq!(part.status(), 206);
    assert_eq!(part.bytes().await.unwrap(), whole[10..100]);
    assert_eq!(std::fs::read_dir(farm.folder.path()).unwrap().count(), 0, "a file was left");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn downloads_are_redirected_to_the_bucket_when_it_is_told_so() {
    let farm = farm();
    let plain = api(&farm);
    let mut command = command(&farm, "serve");
    command.args(["--listen", "127.0.0.1:0", "--workers", "0", "--download-redirects", "60"]);
    command.args(["--download-endpoint", &farm.s3.endpoint().replace("127.0.0.1", "localhost")]);
    let redirecting = Process::spawn(command);
    let (_, job) = plain.upload().await;
    // Played by the test, for artifacts of a known size.
    let (store, name) = (store(&farm).await, "solid.glb");
    let claim = store.claim("test", PATIENCE).await.unwrap().unwrap();
    let (id, attempt) = (claim.job.id, claim.attempt);
    assert_eq!(id.to_string(), job["id"]);
    let content: Vec<u8> = (0..300_000u32).map(|i| (i % 251) as u8).collect();
    let bytes = ByteStore::s3(&farm.store(), farm.s3.environment()).unwrap();
    let key = Key::Artifact { job: id, attempt, name };
    bytes.put(&key, content.clone().into()).await.unwrap();
    let sha256 = hex::encode(Sha256::digest(&content));
    let (name, media_type) = (name.to_owned(), "model/gltf-binary".to_owned());
    let entry = ArtifactEntry { name, media_type, bytes: 300_000, sha256 };
    store.succeed(id, attempt, vec![entry], None).await.unwrap();
    let path = format!("/v1/reconstructions/{id}/artifacts/solid.glb");
    for (node, from) in [(&plain, "127.0.0.1"), (&redirecting, "localhost")] {
        let sent = node.get(&path).send().await.unwrap();
        assert_eq!((sent.status().as_u16(), sent.url().host_str()), (200, Some(from)));
        assert_eq!(sent.headers()["content-type"], "model/gltf-binary");
        assert_eq!(sent.bytes().await.unwrap(), content);
    }
}

/// A service on one machine becomes a farm: its keys, jobs and links go on.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_service_of_one_machine_is_imported() {
    let (farm, folder) = (farm(), tempfile::tempdir().unwrap());
    let old = Process::start(folder.path(), &[]);
    let (status, job) = old.upload().await;
    assert_eq!(status, 202, "{job}");
    let path = format!("/v1/reconstructions/{}", job["id"].as_str().unwrap());
    let before = old.until(&path, |_, job| job["state"] == "succeeded").await;
    let link = old.post(&format!("{path}/links"));
    let link = link.json(&json!({ "artifact": "solid.glb" })).send().await.unwrap();
    let link = link.json::<Value>().await.unwrap()["url"].as_str().unwrap().to_owned();
    let made = Command::new(env!("CARGO_BIN_EXE_turnaround"))
        .args(["keys", "create", "--scope", "write", "--data-dir"])
        .arg(folder.path())
        .output()
        .unwrap();
    let key = String::from_utf8(made.stdout).unwrap().trim().to_owned();
    let import = || {
        let output = command(&farm, "import").arg("--from").arg(folder.path()).output().unwrap();
        let said = [output.stdout, output.stderr].concat();
        (output.status.code(), String::from_utf8(said).unwrap())
    };
    let (status, said) = import();
    assert!(status == Some(1) && said.contains("is in use"), "{status:?} {said}");
    drop(old);
    let (status, said) = import();
    assert!(status == Some(0) && said.contains("imported 1 jobs and pages"), "{status:?} {said}");
    let (status, said) = import();
    assert!(status == Some(1) && said.contains("give an empty one"), "{status:?} {said}");

    let node = api(&farm);
    let get = |path: &str| node.get(path).bearer_auth(&key).send();
    assert_eq!(node.get(&path).send().await.unwrap().status(), 401);
    let after: Value = get(&path).await.unwrap().json().await.unwrap();
    assert_eq!(after, before);
    let listed: Value = get("/v1/reconstructions").await.unwrap().json().await.unwrap();
    assert_eq!(listed["reconstructions"][0]["id"], job["id"]);
    let files: Value = get(&format!("{path}/artifacts")).await.unwrap().json().await.unwrap();
    let files = files["artifacts"].as_array().unwrap();
    assert!(files.len() > 5, "{files:?}");
    for file in files {
        let bytes = get(file["href"].as_str().unwrap()).await.unwrap().bytes().await.unwrap();
        assert_eq!(hex::encode(Sha256::digest(&bytes)), file["sha256"], "{}", file["name"]);
    }
    let linked = node.get(&link).send().await.unwrap();
    assert_eq!(linked.status(), 200);
    let again = node.post("/v1/reconstructions").bearer_auth(&key);
    let source =
        reqwest::multipart::Form::new().text("source", job["id"].as_str().unwrap().to_owned());
    let again = again.multipart(source.text("reuse", "false")).send().await.unwrap();
    assert_eq!(again.status(), 202, "its drawings are not there");
}

/// A worker that the system stopped loses its job to another; when it goes on, its
/// late result is refused and its bytes are deleted.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_that_stood_still_changes_nothing() {
    let farm = farm();
    let node = api(&farm);
    let store = store(&farm).await;
    let still = worker(&farm);
    let answer = node.post("/v1/reconstructions").multipart(form(1)).send().await.unwrap();
    let answer: Value = answer.json().await.unwrap();
    let id: JobId = answer["id"].as_str().unwrap().parse().unwrap();
    until(async || store.get(id).await.unwrap().progress.is_some()).await;
    still.signal("STOP");
    let other = worker(&farm);
    until(async || store.get(id).await.unwrap().state == JobState::Succeeded).await;
    drop(other);
    let ended = store.get(id).await.unwrap();
    assert!(ended.attempt > 1, "{ended:?}");

    still.signal("CONT");
    let bytes = ByteStore::s3(&farm.store(), farm.s3.environment()).unwrap();
    until(async || bytes.attempts(id).await.unwrap() == [ended.attempt]).await;
    // It would have come to its end by now.
    tokio::time::sleep(Duration::from_secs(3)).await;
    assert_eq!(store.get(id).await.unwrap(), ended);
    assert_eq!(bytes.attempts(id).await.unwrap(), [ended.attempt]);
    let events = store.events(id, 0).await.unwrap();
    let ends: Vec<_> = events.iter().filter(|event| event.kind.is_final()).collect();
    assert_eq!(ends.len(), 1);
    assert_eq!(ends[0].kind, EventKind::Succeeded);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_cancellation_is_seen_on_another_node_within_a_second() {
    let farm = farm();
    let node = api(&farm);
    let store = store(&farm).await;
    let _worker = worker(&farm);
    let answer = node.post("/v1/reconstructions").multipart(form(2)).send().await.unwrap();
    let answer: Value = answer.json().await.unwrap();
    let id: JobId = answer["id"].as_str().unwrap().parse().unwrap();
    until(async || store.get(id).await.unwrap().progress.is_some()).await;
    let asked = Instant::now();
    let cancelled = node.post(&format!("/v1/reconstructions/{id}/cancel")).send().await.unwrap();
    assert!(cancelled.status().is_success(), "{}", cancelled.status());
    until(async || store.get(id).await.unwrap().state == JobState::Cancelled).await;
    assert!(asked.elapsed() < Duration::from_secs(1), "{:?}", asked.elapsed());
}

/// Requests are refused as such while there is no database, and all is well when
/// it is back.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_outlives_its_database() {
    let mut farm = farm();
    let node = api(&farm);
    let (status, body) = node.upload().await;
    assert_eq!(status, 202, "{body}");
    farm.postgres.stop();
    let ready = node.get("/health/ready").send().await.unwrap();
    assert_eq!(ready.status(), 503);
    let (status, problem) = node.upload().await;
    assert_eq!(status, 503, "{problem}");
    farm.postgres.resume();
    node.until("/health/ready", |status, _| status == 200).await;
    let _worker = worker(&farm);
    let path = format!("/v1/reconstructions/{}", body["id"].as_str().unwrap());
    node.until(&path, |_, job| job["state"] == "succeeded").await;
}

#[test]
fn keys_are_made_in_the_database_of_a_farm() {
    let farm = farm();
    let keys = |arguments: &[&str]| {
        let output = command(&farm, "keys").args(arguments).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let key = keys(&["create", "--scope", "read", "--label", "farm"]);
    let listed = keys(&["list"]);
    assert!(listed.contains(&key.trim()[..15]) && listed.contains("farm"), "{listed}");
}

async fn until(is_so: impl AsyncFn() -> bool) {
    let begun = Instant::now();
    while !is_so().await {
        assert!(begun.elapsed() < PATIENCE, "it does not come to it");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}
