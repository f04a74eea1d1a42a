//! Large artifacts that the bucket sends itself, by signed URLs.

use std::time::Duration;

use jobs::bytes::{ByteStore, UrlSigner};
use jobs::{AccessStore, JobId, KeyText, NewKey, Scope};
use reqwest::{Client, RequestBuilder, Response, StatusCode};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use testbed::{BUCKET, S3};
use turnaround::http::Redirects;

use crate::api::harness::{Service, problem};

const LARGE: &str = "views/22.5/cloud.ply";
const SMALL: &str = "solid.glb";
const MINUTE: Duration = Duration::from_secs(60);

fn content() -> Vec<u8> {
    (0..200_000u32).map(|i| (i * 7 % 251) as u8).collect()
}

fn address() -> String {
    format!("s3://{BUCKET}/farm")
}

async fn start(s3: &S3, lifetime: Duration, endpoint: Option<&str>, by_tenant: bool) -> Service {
    let bytes = ByteStore::s3(&address(), s3.environment()).unwrap();
    let signer = UrlSigner::s3(&address(), s3.environment(), endpoint).unwrap();
    Service::start_redirecting(bytes, Redirects::new(signer, lifetime), by_tenant).await
}

async fn finished(service: &Service) -> JobId {
    let artifacts =
        [(LARGE, "model/ply", content()), (SMALL, "model/gltf-binary", b"glTF".to_vec())];
    service.finished(&artifacts).await
}

fn path(id: JobId, name: &str) -> String {
    format!("/v1/reconstructions/{id}/artifacts/{name}")
}

/// A client that says where it is sent.
fn staying() -> Client {
    Client::builder().no_proxy().redirect(reqwest::redirect::Policy::none()).build().unwrap()
}

fn header<'r>(response: &'r Response, name: &str) -> &'r str {
    response.headers()[name].to_str().unwrap()
}

async fn location(request: RequestBuilder) -> String {
    let answer = request.send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::TEMPORARY_REDIRECT);
    assert_eq!(header(&answer, "cache-control"), "private, no-store");
    let location = header(&answer, "location").to_owned();
    assert!(answer.bytes().await.unwrap().is_empty());
    location
}

#[tokio::test]
async fn the_bucket_sends_what_the_service_would() {
    let s3 = S3::start();
    for by_tenant in [false, true] {
        let service = start(&s3, MINUTE, None, by_tenant).await;
        let id = finished(&service).await;
        let href = format!("{}{}", service.url, path(id, LARGE));
        let url = location(staying().get(&href)).await;
        assert!(url.starts_with(&format!("{}/{BUCKET}/farm/", s3.endpoint())), "{url}");
        assert_eq!(url.contains("/tenants/default/"), by_tenant, "{url}");
        assert!(url.contains("X-Amz-Expires=60&"), "{url}");

        let asked = staying().head(&href).send().await.unwrap();
        assert_eq!((asked.status(), header(&asked, "content-length")), (StatusCode::OK, "200000"));
        let sent = service.client.get(&url).send().await.unwrap();
        assert_eq!(sent.status(), StatusCode::OK);
        for name in ["content-type", "content-disposition", "cache-control", "content-length"] {
            assert_eq!(header(&sent, name), header(&asked, name), "{name}");
        }
        let bytes = sent.bytes().await.unwrap();
        let hash = format!("\"{}\"", hex::encode(Sha256::digest(&bytes)));
        assert_eq!(header(&asked, "etag"), hash);

        // Clients repeat their range.
        let part = service.get(&path(id, LARGE)).header("range", "bytes=1000-70000");
        let part = part.send().await.unwrap();
        assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT);
        assert!(part.url().as_str().starts_with(&s3.endpoint()));
        assert_eq!(header(&part, "content-range"), "bytes 1000-70000/200000");
        assert_eq!(part.bytes().await.unwrap(), content()[1000..=70_000]);
    }
}

#[tokio::test]
async fn what_the_bucket_could_not_answer_stays_here() {
    let s3 = S3::start();
    let service = start(&s3, MINUTE, None, false).await;
    let id = finished(&service).await;
    let etag = format!("\"{}\"", hex::encode(Sha256::digest(content())));
    let with = |name: &'static str, value: &str| {
        staying().get(format!("{}{}", service.url, path(id, LARGE))).header(name, value)
    };
    for (name, value) in [
        ("prefer", "wait=1, no-redirect"),
        ("origin", "https://studio.example"),
        ("if-match", etag.as_str()),
        ("if-range", etag.as_str()),
    ] {
        let answer = with(name, value).send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::OK, "{name}");
        assert_eq!(answer.bytes().await.unwrap(), content(), "{name}");
    }
    let resumed = with("if-range", &etag).header("range", "bytes=199990-").send().await.unwrap();
    assert_eq!(resumed.status(), StatusCode::PARTIAL_CONTENT);
    assert_eq!(resumed.bytes().await.unwrap(), content()[199_990..]);
    let known = with("if-none-match", &etag).send().await.unwrap();
    assert_eq!(known.status(), StatusCode::NOT_MODIFIED);
    location(with("if-none-match", "\"other\"")).await;
    let outside = with("range", "bytes=200000-").send().await.unwrap();
    problem(outside, 416, "range-not-satisfiable").await;
    let stale = with("if-match", "\"other\"").send().await.unwrap();
    problem(stale, 412, "precondition-failed").await;
    let small = staying().get(format!("{}{}", service.url, path(id, SMALL))).send().await.unwrap();
    assert_eq!((small.status(), header(&small, "content-length")), (StatusCode::OK, "4"));
}

#[tokio::test]
async fn only_who_may_read_is_sent_there() {
    let s3 = S3::start();
    let service = start(&s3, MINUTE, None, false).await;
    let id = finished(&service).await;
    let link = service.post(&format!("/v1/reconstructions/{id}/links"));
    let link = link.json(&json!({"artifact": LARGE, "expires_in": 30})).send().await.unwrap();
    let link = link.json::<Value>().await.unwrap()["url"].as_str().unwrap().to_owned();
    let other = "other".parse().unwrap();
    service.store.create_tenant(&other).await.unwrap();
    let (own, foreign) = (KeyText::generate(), KeyText::generate());
    for (tenant, key) in [(Default::default(), &own), (other, &foreign)] {
        let new = NewKey { tenant, label: "test".to_owned(), scope: Scope::Read };
        service.store.add_key(&new, key).await.unwrap();
    }
    // That there are none is remembered for a second.
    tokio::time::sleep(Duration::from_millis(1100)).await;
    let get = |path: &str| staying().get(format!("{}{path}", service.url));
    let nobody = get(&path(id, LARGE)).send().await.unwrap();
    problem(nobody, 401, "unauthorized").await;
    let foreign = get(&path(id, LARGE)).bearer_auth(foreign.reveal()).send().await.unwrap();
    problem(foreign, 404, "unknown-reconstruction").await;
    let missing = get(&path(id, "hull.glb")).bearer_auth(own.reveal()).send().await.unwrap();
    problem(missing, 404, "unknown-artifact").await;
    let url = location(get(&path(id, LARGE)).bearer_auth(own.reveal())).await;
    assert_eq!(service.client.get(url).send().await.unwrap().bytes().await.unwrap(), content());
    // Clients leave their key behind, which the bucket would refuse.
    let followed = service.get(&path(id, LARGE)).bearer_auth(own.reveal()).send().await.unwrap();
    assert!(followed.url().as_str().starts_with(&s3.endpoint()));
    assert_eq!(followed.bytes().await.unwrap(), content());

    // No longer than the link that it was got by.
    let url = location(get(&link)).await;
    let (_, expires) = url.split_once("X-Amz-Expires=").unwrap();
    let seconds: u64 = expires.split_once('&').unwrap().0.parse().unwrap();
    assert!((20..=30).contains(&seconds), "{seconds}");
    assert_eq!(service.client.get(url).send().await.unwrap().bytes().await.unwrap(), content());
}

#[tokio::test]
async fn urls_end_and_cannot_be_changed() {
    let s3 = S3::start();
    let service = start(&s3, Duration::from_secs(2), None, false).await;
    let (id, other) = (finished(&service).await, finished(&service).await);
    let fresh =
        async || location(staying().get(format!("{}{}", service.url, path(id, LARGE)))).await;
    let status = async |url: &str| service.client.get(url).send().await.unwrap().status().as_u16();
    for (from, to) in [
        (id.to_string(), other.to_string()),
        ("cloud.ply".to_owned(), "other.ply".to_owned()),
        ("X-Amz-Expires=2&".to_owned(), "X-Amz-Expires=3600&".to_owned()),
        ("model%2Fply".to_owned(), "text%2Fhtml".to_owned()),
    ] {
        let url = fresh().await;
        let changed = url.replacen(&from, &to, 1);
        assert_ne!(changed, url);
        assert_eq!(status(&changed).await, 403, "{changed}");
    }
    let url = fresh().await;
    assert_eq!(service.client.put(&url).body("mine").send().await.unwrap().status(), 403);
    assert_eq!(status(&url).await, 200);
    tokio::time::sleep(Duration::from_millis(3100)).await;
    assert_eq!(status(&url).await, 403);
}

#[tokio::test]
async fn who_downloads_may_reach_the_bucket_by_another_name() {
    let s3 = S3::start();
    let outside = s3.endpoint().replace("127.0.0.1", "localhost");
    let service = start(&s3, MINUTE, Some(&outside), false).await;
    let id = finished(&service).await;
    let url = location(staying().get(format!("{}{}", service.url, path(id, LARGE)))).await;
    assert!(url.starts_with(&outside), "{url}");
    let get = |url: &str| service.client.get(url).send();
    assert_eq!(get(&url).await.unwrap().bytes().await.unwrap(), content());
    // The name is signed.
    let inside = url.replacen("localhost", "127.0.0.1", 1);
    assert_eq!(get(&inside).await.unwrap().status(), 403);
}
