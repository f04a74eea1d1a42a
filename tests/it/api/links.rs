//! Links to single artifacts that need no key, for a time.

use jobs::{JobId, JobStore};
use reqwest::StatusCode;
use serde_json::{Value, json};

use crate::api::harness::{Service, problem};

const SOLID: &str = "solid.glb";
const MAP: &str = "views/45/depth.png";

async fn finished(service: &Service) -> JobId {
    let artifacts =
        [(SOLID, "model/gltf-binary", b"glTF".to_vec()), (MAP, "image/png", b"png".to_vec())];
    service.finished(&artifacts).await
}

async fn link(service: &Service, id: JobId, body: Value) -> reqwest::Response {
    let path = format!("/v1/reconstructions/{id}/links");
    service.post(&path).json(&body).send().await.unwrap()
}

async fn url(service: &Service, id: JobId, body: Value) -> String {
    let made = link(service, id, body).await;
    assert_eq!(made.status(), StatusCode::CREATED);
    made.json::<Value>().await.unwrap()["url"].as_str().unwrap().to_owned()
}

#[tokio::test]
async fn a_link_opens_its_artifact_and_nothing_else() {
    let service = Service::start().await;
    let (id, other) = (finished(&service).await, finished(&service).await);
    let solid = url(&service, id, json!({"artifact": SOLID})).await;
    let map = url(&service, id, json!({"artifact": MAP, "expires_in": 60})).await;
    // From here on nobody comes in without a key.
    service.close().await;
    let get = |url: &str| service.get(url).send();
    let bytes = get(&solid).await.unwrap();
    assert_eq!(bytes.status(), StatusCode::OK);
    assert_eq!(bytes.headers()["content-type"], "model/gltf-binary");
    assert_eq!(bytes.bytes().await.unwrap(), "glTF");
    let part = service.get(&map).header("range", "bytes=1-").send().await.unwrap();
    assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT);
    assert_eq!(part.bytes().await.unwrap(), "ng");
    let path = format!("/v1/reconstructions/{id}/artifacts/{SOLID}");
    let query = solid.split_once('?').unwrap().1;
    problem(get(&format!("{path}?{query}")).await.unwrap(), 401, "unauthorized").await;
    let expires = query.split_once('&').unwrap().0.split_once('=').unwrap().1;
    let later = (expires.parse::<i64>().unwrap() + 1).to_string();
    for wrong in [
        solid.split_once('?').unwrap().0.to_owned(),
        solid.replace(expires, &later),
        solid.replace(SOLID, MAP),
        solid.replace(&id.to_string(), &other.to_string()),
        solid.replace("/reconstructions/", "/sheets/"),
        solid[..solid.len() - 2].to_owned(),
        solid.replace("signature=", "signature=zz"),
        format!("{solid}&more=1"),
    ] {
        problem(get(&wrong).await.unwrap(), 404, "invalid-link").await;
    }
    service.store.delete(id).await.unwrap();
    problem(get(&solid).await.unwrap(), 404, "unknown-artifact").await;
}

#[tokio::test]
async fn a_link_ends() {
    let service = Service::start().await;
    let id = finished(&service).await;
    let short = url(&service, id, json!({"artifact": SOLID, "expires_in": 1})).await;
    tokio::time::sleep(std::time::Duration::from_millis(1100)).await;
    problem(service.get(&short).send().await.unwrap(), 404, "invalid-link").await;
    for expires_in in [0, 2_678_401] {
        let body = json!({"artifact": SOLID, "expires_in": expires_in});
        problem(link(&service, id, body).await, 422, "invalid-body").await;
    }
    problem(link(&service, id, json!({"artifact": "x"})).await, 404, "unknown-artifact").await;
    let nobody = JobId::new();
    let unknown = link(&service, nobody, json!({"artifact": SOLID})).await;
    problem(unknown, 404, "unknown-reconstruction").await;
}
