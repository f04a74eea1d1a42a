//! What people say of jobs: names, labels, and how long they stay.

use jobs::{JobStore, StorageStore};
use reqwest::{Response, StatusCode};
use serde_json::{Value, json};

use crate::api::harness::{Service, problem, views};

async fn upload(service: &Service, query: &str) -> Response {
    let request = service.post(&format!("/v1/reconstructions?{query}"));
    request.multipart(views(&["0", "45", "90"])).send().await.unwrap()
}

async fn ids(service: &Service, query: &str) -> Vec<Value> {
    let list = service.get(&format!("/v1/reconstructions?{query}")).send().await.unwrap();
    let list: Value = list.json().await.unwrap();
    list["reconstructions"].as_array().unwrap().iter().map(|job| job["id"].clone()).collect()
}

#[tokio::test]
async fn jobs_are_labelled_found_and_labelled_anew() {
    let service = Service::start().await;
    let first = upload(&service, "name=Ida&labels=show:7,shot:12&expires_in=3600").await;
    assert_eq!(first.status(), StatusCode::ACCEPTED);
    let first: Value = first.json().await.unwrap();
    assert_eq!((&first["name"], &first["labels"]["shot"]), (&json!("Ida"), &json!("12")));
    assert!(first["expires_at"].is_string() && first["pinned"] == false);
    let second: Value = upload(&service, "labels=show:7").await.json().await.unwrap();
    assert_eq!(ids(&service, "labels=shot:12").await, [first["id"].clone()]);
    assert_eq!(ids(&service, "labels=show:7&limit=1").await, [second["id"].clone()]);
    assert_eq!(ids(&service, "created_before=2020-01-01T00:00:00Z").await, [] as [Value; 0]);
    // The next part is of the same list.
    let list = service.get("/v1/reconstructions?labels=show:7&limit=1").send().await.unwrap();
    let next = list.json::<Value>().await.unwrap()["next"].as_str().unwrap().to_owned();
    let list: Value = service.get(&next).send().await.unwrap().json().await.unwrap();
    assert_eq!(list["reconstructions"][0]["id"], first["id"]);
    assert_eq!(list["next"], Value::Null);

    let path = first["links"]["self"].as_str().unwrap();
    let patch = |changes: Value| {
        service.client.patch(format!("{}{path}", service.url)).json(&changes).send()
    };
    // Characters are counted, as a schema counts them, not bytes.
    let long = "ä".repeat(200);
    let named: Value = patch(json!({"name": long})).await.unwrap().json().await.unwrap();
    assert_eq!(named["name"], long);
    let changes = json!({"labels": {"take": "ä"}, "name": null, "pinned": true});
    let changed: Value = patch(changes).await.unwrap().json().await.unwrap();
    assert_eq!(changed["labels"], json!({"take": "ä"}));
    assert_eq!((&changed["pinned"], changed.get("name")), (&json!(true), None));
    assert_eq!(changed["expires_at"], first["expires_at"], "what was not given has changed");
    let kept: Value = patch(json!({"expires_in": null})).await.unwrap().json().await.unwrap();
    assert_eq!(kept["expires_at"], Value::Null);
    for wrong in [
        json!({"labels": {"a b": "x"}}),
        json!({"labels": {"a": "ä".repeat(201)}}),
        json!({"expires_in": -1}),
        json!({"colour": "red"}),
    ] {
        problem(patch(wrong).await.unwrap(), 422, "invalid-body").await;
    }
    for wrong in ["labels=show", "expires_in=-1", "name=%00", "lable=show:7"] {
        problem(upload(&service, wrong).await, 400, "invalid-query").await;
    }
}

#[tokio::test]
async fn one_that_runs_is_deleted_when_it_has_stopped() {
    let service = Service::start().await;
    service.queue().await;
    let (id, attempt) = service.claim().await;
    let path = format!("/v1/reconstructions/{id}");
    let deleted = service.delete(&path).send().await.unwrap();
    assert_eq!(deleted.status(), StatusCode::ACCEPTED);
    let job: Value = service.get(&path).send().await.unwrap().json().await.unwrap();
    assert_eq!((&job["state"], &job["cancel_requested"]), (&json!("running"), &json!(true)));
    service.store.cancelled(id, attempt).await.unwrap();
    let gone = service.store.expire().await.unwrap();
    assert_eq!(gone.iter().map(|of| of.id).collect::<Vec<_>>(), [id]);
    problem(service.get(&path).send().await.unwrap(), 404, "unknown-reconstruction").await;
}

/// A change after the end is told to who asks for it, and keeps nobody waiting.
#[tokio::test]
async fn streams_of_jobs_that_ended_end_though_they_were_labelled_since() {
    let service = Service::start().await;
    let id = service.finished(&[]).await;
    let path = format!("{}/v1/reconstructions/{id}", service.url);
    let patched = service.client.patch(&path).json(&json!({"pinned": true})).send().await.unwrap();
    assert_eq!(patched.status(), StatusCode::OK);
    let stream = service.client.get(format!("{path}/events")).header("last-event-id", "3").send();
    let told = stream.await.unwrap().text();
    let told = tokio::time::timeout(std::time::Duration::from_secs(5), told).await;
    assert!(told.expect("the stream ends").unwrap().contains("event: tagged"));
}
