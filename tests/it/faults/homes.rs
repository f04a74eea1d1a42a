//! A service whose bytes begin to lie below prefixes of tenants, and that goes back.

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::process::{Process, reusable_sheet, sheet};

/// The folders of jobs below a folder of stored bytes.
fn jobs(folder: &Path, kind: &str) -> Vec<String> {
    let found = fs::read_dir(folder.join(kind)).into_iter().flatten();
    let mut names: Vec<_> =
        found.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    // That of the readiness probe apart.
    names.retain(|name| !name.starts_with("00000000"));
    names.sort();
    names
}

async fn send(service: &Process, form: reqwest::multipart::Form) -> Value {
    let sent = service.post("/v1/reconstructions").multipart(form).send().await.unwrap();
    assert_eq!(sent.status(), 202);
    let path = path(&sent.json().await.unwrap());
    let ended = service.until(&path, |_, job| job["finished_at"].is_string()).await;
    assert_eq!(ended["state"], "succeeded", "{ended}");
    ended
}

fn id(job: &Value) -> String {
    job["id"].as_str().unwrap().to_owned()
}

fn path(job: &Value) -> String {
    format!("/v1/reconstructions/{}", id(job))
}

async fn solid(service: &Process, job: &Value) -> Vec<u8> {
    let asked = service.get(&format!("{}/artifacts/solid.glb", path(job))).send().await.unwrap();
    assert_eq!(asked.status(), 200);
    asked.bytes().await.unwrap().to_vec()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn old_and_new_bytes_are_served_copied_and_deleted() {
    let folder = tempfile::tempdir().unwrap();
    let (all, own) = (folder.path().join("bytes"), folder.path().join("bytes/tenants/default"));
    let service = Process::start(folder.path(), &[]);
    let old = send(&service, reusable_sheet()).await;
    drop(service);

    let service = Process::start(folder.path(), &["--bytes-by-tenant"]);
    // Made anew, answered with the old one's files, run again on its drawings.
    let new = send(&service, sheet()).await;
    let reused = send(&service, reusable_sheet()).await;
    assert_ne!(reused["reused_from"], Value::Null);
    let again = reqwest::multipart::Form::new().text("source", id(&old)).text("reuse", "false");
    let again = send(&service, again).await;
    let mut expected = [&new, &reused, &again].map(id);
    expected.sort();
    for kind in ["inputs", "artifacts"] {
        assert_eq!(jobs(&all, kind), [id(&old)]);
        assert_eq!(jobs(&own, kind), expected);
    }
    let bytes = solid(&service, &old).await;
    for job in [&new, &reused, &again] {
        assert_eq!(solid(&service, job).await, bytes);
    }
    drop(service);

    // The setting is of new jobs alone.
    let service = Process::start(folder.path(), &[]);
    let last = send(&service, sheet()).await;
    assert_eq!(solid(&service, &new).await, bytes);
    for job in [&old, &new, &reused, &again, &last] {
        let deleted = service.client.delete(format!("{}{}", service.url, path(job))).send().await;
        assert_eq!(deleted.unwrap().status(), 204);
    }
    for (of, kind) in [(&all, "inputs"), (&all, "artifacts"), (&own, "inputs"), (&own, "artifacts")]
    {
        assert_eq!(jobs(of, kind), Vec::<String>::new(), "{kind}");
    }
}
