//! Keys of a service as a process: made on the command line, given at the start,
//! and what an upload with a key of its own is after the process was killed.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

use super::process::{Process, sheet};

fn run(arguments: &[&str], folder: &Path) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_turnaround"));
    let done = command.args(arguments).arg("--data-dir").arg(folder).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    String::from_utf8(done.stdout).unwrap().trim().to_owned()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn keys_are_made_listed_and_revoked_on_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    run(&["tenants", "create", "show-7"], folder.path());
    let key = run(&["keys", "create", "--tenant", "show-7", "--scope", "write"], folder.path());
    let listed = run(&["keys", "list"], folder.path());
    assert!(listed.contains(&key[..15]) && !listed.contains(&key), "{listed}");
    let service = Process::start(folder.path(), &[]);
    let status = async |key: &str| {
        let request = service.get("/v1/reconstructions").bearer_auth(key);
        request.send().await.unwrap().status().as_u16()
    };
    assert_eq!(service.get("/v1/reconstructions").send().await.unwrap().status(), 401);
    assert_eq!(status(&key).await, 200);
    run(&["keys", "revoke", &key[..15]], folder.path());
    tokio::time::sleep(std::time::Duration::from_millis(1100)).await;
    assert_eq!(status(&key).await, 401);
    // The last one: closed to all, also after a restart, until it is said to be open.
    let anybody = async |service: &Process| {
        service.get("/v1/reconstructions").send().await.unwrap().status().as_u16()
    };
    assert_eq!(anybody(&service).await, 401);
    drop(service);
    let service = Process::start(folder.path(), &[]);
    assert_eq!(anybody(&service).await, 401);
    run(&["keys", "open"], folder.path());
    tokio::time::sleep(std::time::Duration::from_millis(1100)).await;
    assert_eq!(anybody(&service).await, 200);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn one_that_others_can_reach_starts_with_a_key_alone() {
    let folder = tempfile::tempdir().unwrap();
    // Refused before any address is bound.
    let mut open = Command::new(env!("CARGO_BIN_EXE_turnaround"));
    open.args(["serve", "--listen", "0.0.0.0:0", "--data-dir"]).arg(folder.path());
    let refused = open.output().unwrap();
    assert!(!refused.status.success());
    let told = String::from_utf8(refused.stderr).unwrap();
    assert!(told.contains("there is no key"), "{told}");

    let generate =
        Command::new(env!("CARGO_BIN_EXE_turnaround")).args(["keys", "generate"]).output();
    let key = String::from_utf8(generate.unwrap().stdout).unwrap().trim().to_owned();
    let file = folder.path().join("first.key");
    std::fs::write(&file, format!("{key}\n")).unwrap();
    for _ in 0..2 {
        let service = Process::start(folder.path(), &["--first-key-file", file.to_str().unwrap()]);
        assert_eq!(service.get("/v1/admin/keys").send().await.unwrap().status(), 401);
        let keys = service.get("/v1/admin/keys").bearer_auth(&key).send().await.unwrap();
        let keys: Value = keys.json().await.unwrap();
        assert_eq!(keys["keys"].as_array().unwrap().len(), 1);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_upload_that_is_sent_again_after_a_kill_is_one_job() {
    let folder = tempfile::tempdir().unwrap();
    let send = async |service: &Process| {
        let request = service.post("/v1/reconstructions").header("idempotency-key", "shot-12");
        request.multipart(sheet()).send().await
    };
    let mut first = None;
    for round in 0..4 {
        let service = Process::start(folder.path(), &[]);
        let sent = send(&service);
        if round < 3 {
            // Killed while it arrives, is stored, or has been answered.
            let kill = async {
                tokio::time::sleep(std::time::Duration::from_millis(2 + 12 * round)).await;
                service.signal("KILL");
            };
            let _ = tokio::join!(sent, kill);
            continue;
        }
        let answer: Value = sent.await.unwrap().json().await.unwrap();
        first = Some(answer.clone());
        let again: Value = send(&service).await.unwrap().json().await.unwrap();
        assert_eq!(again, answer);
        let list = service.get("/v1/reconstructions").send().await.unwrap();
        let list: Value = list.json().await.unwrap();
        assert_eq!(list["reconstructions"].as_array().unwrap().len(), 1, "{list}");
    }
    assert!(first.unwrap()["id"].is_string());
}
