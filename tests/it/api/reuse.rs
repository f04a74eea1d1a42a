//! Uploads that are answered with the result of an earlier job.

use jobs::bytes::Key;
use jobs::{JobId, JobStore};
use reqwest::StatusCode;
use serde_json::Value;

use super::harness::{Service, file, problem, reusable_views, views};

const ANGLES: [&str; 3] = ["0", "45", "90"];

async fn upload(service: &Service, form: reqwest::multipart::Form) -> Value {
    let response = service.upload(form).await;
    assert_eq!(response.status(), StatusCode::ACCEPTED);
    response.json().await.unwrap()
}

fn id(job: &Value) -> JobId {
    job["id"].as_str().unwrap().parse().unwrap()
}

#[tokio::test]
async fn the_same_again_is_answered_at_once_and_stands_on_its_own() {
    let service = Service::start().await;
    let hull = ("solid.glb", "model/gltf-binary", b"a mesh".to_vec());
    let first = service.finished(&[hull]).await;
    let again = upload(&service, reusable_views(&ANGLES)).await;
    assert_eq!(
        (&again["state"], &again["reused_from"]),
        (&"succeeded".into(), &first.0.to_string().into())
    );
    let path = format!("/v1/reconstructions/{}/artifacts/solid.glb", id(&again));
    assert_eq!(service.get(&path).send().await.unwrap().bytes().await.unwrap(), "a mesh");
    // One file under two names, until one is deleted.
    let number = |job| service.file_number(&Key::Artifact { job, attempt: 1, name: "solid.glb" });
    assert_eq!(number(first), number(id(&again)));
    let gone = service.delete(&format!("/v1/reconstructions/{first}")).send().await.unwrap();
    assert_eq!(gone.status(), StatusCode::NO_CONTENT);
    assert_eq!(service.get(&path).send().await.unwrap().bytes().await.unwrap(), "a mesh");
    // And it is a source of others' in its turn.
    let third = upload(&service, reusable_views(&ANGLES)).await;
    assert_eq!(third["reused_from"], again["id"]);
    assert!(service.store.claim("test", super::harness::LEASE).await.unwrap().is_none());
}

#[tokio::test]
async fn whatever_differs_is_made_anew() {
    let service = Service::start().await;
    service.finished(&[("solid.glb", "model/gltf-binary", b"a mesh".to_vec())]).await;
    let masked = file(super::harness::drawing(32, 24, 9), "mask.png");
    for (form, why) in [
        (views(&ANGLES), "it is asked for"),
        (reusable_views(&ANGLES).text("seed", "1"), "another option"),
        (reusable_views(&["0", "45", "91"]), "another angle"),
        (reusable_views(&ANGLES).part("mask[45]", masked), "another input"),
    ] {
        let job = upload(&service, form).await;
        assert_eq!((&job["state"], &job["reused_from"]), (&"queued".into(), &Value::Null), "{why}");
    }
    // An option that is given as it would be anyway makes no difference.
    let same = upload(&service, reusable_views(&ANGLES).text("seed", "0")).await;
    assert_eq!(same["state"], "succeeded");
    let anew = upload(&service, reusable_views(&ANGLES).text("reuse", "False")).await;
    assert_eq!(anew["state"], "queued");
    let wrong = service.upload(reusable_views(&ANGLES).text("reuse", "perhaps")).await;
    let told = problem(wrong, 422, "invalid-option").await;
    assert!(told["detail"].as_str().unwrap().contains("give true or false"), "{told}");
}

#[tokio::test]
async fn the_same_model_is_drawn_once() {
    let service = Service::start().await;
    let draw = async |reuse: &str| -> Value {
        let form = reqwest::multipart::Form::new().text("model", "builtin:teapot");
        let form = form.text("azimuths", "0,90").text("reuse", reuse.to_owned());
        service.post("/v1/sheets").multipart(form).send().await.unwrap().json().await.unwrap()
    };
    let first = draw("true").await;
    let (claimed, attempt) = service.claim().await;
    assert_eq!(claimed, id(&first));
    service.succeed(claimed, attempt, &[("page.png", "image/png", b"a page".to_vec())]).await;
    let again = draw("true").await;
    assert_eq!((&again["state"], &again["reused_from"]), (&"succeeded".into(), &first["id"]));
    assert_eq!(draw("false").await["state"], "queued");
}

#[tokio::test]
async fn a_result_whose_bytes_are_gone_is_made_anew() {
    let service = Service::start().await;
    let first = service.finished(&[("solid.glb", "model/gltf-binary", b"a mesh".to_vec())]).await;
    service.bytes.delete_attempt(first, 1).await.unwrap();
    let again = upload(&service, reusable_views(&ANGLES)).await;
    assert_eq!(again["state"], "queued");
}
