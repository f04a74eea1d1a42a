//! Statuses that are kept ready show what is stored, to whom it belongs.

use jobs::{AccessStore, JobId, JobStore, KeyText, NewJob, NewKey, Scope, TenantName};
use reqwest::StatusCode;
use serde_json::{Value, json};
use turnaround::kinds::RECONSTRUCTION;

use crate::api::harness::{LEASE, Service, problem};

async fn status(service: &Service, id: JobId) -> Value {
    // Asked for twice, so that the second one is kept.
    let path = format!("/v1/reconstructions/{id}");
    let mut answers = Vec::new();
    for _ in 0..2 {
        let answer = service.get(&path).send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::OK);
        let etag = answer.headers()["etag"].to_str().unwrap().to_owned();
        let body: Value = answer.json().await.unwrap();
        answers.push((etag, body));
    }
    assert_eq!(answers[0], answers[1]);
    answers.remove(1).1
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn changes_of_another_process_are_seen_at_once() {
    let service = Service::start().await;
    let other = service.other_store().await;
    let id = service.queue().await;
    assert_eq!(status(&service, id).await["state"], "queued");
    let claim = other.claim("another process", LEASE).await.unwrap().unwrap();
    assert_eq!(status(&service, id).await["state"], "running");
    for done in 0..50 {
        let progress = json!({"stage": "solid", "done": done, "total": 50, "fraction": f64::from(done) / 50.0});
        other.progress(id, claim.attempt, progress.clone()).await.unwrap();
        assert_eq!(status(&service, id).await["progress"], progress);
    }
    other.succeed(id, claim.attempt, Vec::new(), None).await.unwrap();
    assert_eq!(status(&service, id).await["state"], "succeeded");
    other.delete(id).await.unwrap();
    let gone = service.get(&format!("/v1/reconstructions/{id}")).send().await.unwrap();
    problem(gone, 404, "unknown-reconstruction").await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn own_changes_are_seen_at_once() {
    let service = Service::start().await;
    let id = service.queue().await;
    assert_eq!(status(&service, id).await["pinned"], false);
    let path = format!("/v1/reconstructions/{id}");
    for pinned in [true, false, true] {
        let change = service.client.patch(format!("{}{path}", service.url));
        let changed = change.json(&json!({"pinned": pinned})).send().await.unwrap();
        assert_eq!(changed.status(), StatusCode::OK);
        assert_eq!(status(&service, id).await["pinned"], pinned);
    }
    service.post(&format!("{path}/cancel")).send().await.unwrap();
    assert_eq!(status(&service, id).await["state"], "cancelled");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_is_kept_is_told_to_its_tenant_and_by_its_kind_alone() {
    let service = Service::start().await;
    let mut keys = Vec::new();
    for name in ["own", "other"] {
        let tenant: TenantName = name.parse().unwrap();
        service.store.create_tenant(&tenant).await.unwrap();
        let text = KeyText::generate();
        let key = NewKey { tenant, label: "test".to_owned(), scope: Scope::Read };
        service.store.add_key(&key, &text).await.unwrap();
        keys.push(text);
    }
    let job = NewJob::new(JobId::new(), RECONSTRUCTION, json!(null), 1);
    let job = NewJob { tenant: "own".parse().unwrap(), ..job };
    let id = service.store.enqueue(job).await.unwrap().id;
    let ask = |key: &KeyText, path: &str| {
        service.get(&format!("{path}/{id}")).bearer_auth(key.reveal()).send()
    };
    for _ in 0..3 {
        let own = ask(&keys[0], "/v1/reconstructions").await.unwrap();
        assert_eq!(own.status(), StatusCode::OK);
        let other = ask(&keys[1], "/v1/reconstructions").await.unwrap();
        problem(other, 404, "unknown-reconstruction").await;
        problem(ask(&keys[0], "/v1/sheets").await.unwrap(), 404, "unknown-sheet").await;
    }
}
