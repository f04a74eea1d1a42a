//! Artifacts: lists, versions and byte ranges.

use crate::api::harness::{Service, problem};
use reqwest::{Method, Response, StatusCode};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

const DISPARITY: &str = "views/22.5/disparity.png";

fn content() -> Vec<u8> {
    (0..200_000u32).map(|i| (i * 7 % 251) as u8).collect()
}

async fn finished(service: &Service) -> String {
    let artifacts = [
        (DISPARITY, "image/png", content()),
        ("cloud.ply", "model/ply", Vec::new()),
        ("metrics.json", "application/json", b"{\"pairs\":[]}".to_vec()),
    ];
    let id = service.finished(&artifacts).await;
    format!("/v1/reconstructions/{id}")
}

fn header<'r>(response: &'r Response, name: &str) -> Option<&'r str> {
    response.headers().get(name).map(|value| value.to_str().unwrap())
}

#[tokio::test]
async fn the_list_says_what_there_is_and_where() {
    let service = Service::start().await;
    let path = finished(&service).await;
    let response = service.get(&format!("{path}/artifacts")).send().await.unwrap();
    let etag = header(&response, "etag").unwrap().to_owned();
    let list: Value = response.json().await.unwrap();
    assert_eq!(
        list["artifacts"][0],
        json!({
            "name": DISPARITY,
            "media_type": "image/png",
            "bytes": 200_000,
            "sha256": hex::encode(Sha256::digest(content())),
            "href": format!("{path}/artifacts/{DISPARITY}"),
        })
    );
    assert_eq!(list["artifacts"].as_array().unwrap().len(), 3);
    let again = service.get(&format!("{path}/artifacts")).header("if-none-match", etag);
    assert_eq!(again.send().await.unwrap().status(), StatusCode::NOT_MODIFIED);

    let unfinished = service.queue().await;
    let path = format!("/v1/reconstructions/{unfinished}");
    let empty = service.get(&format!("{path}/artifacts")).send().await.unwrap();
    assert_eq!(empty.json::<Value>().await.unwrap(), json!({"artifacts": []}));
    for below in ["metrics", "artifacts/hull.glb"] {
        let response = service.get(&format!("{path}/{below}")).send().await.unwrap();
        let body = problem(response, 404, "unknown-artifact").await;
        assert!(body["detail"].as_str().unwrap().contains("not finished"), "{body}");
    }
}

#[tokio::test]
async fn bytes_come_with_their_type_version_and_name() {
    let service = Service::start().await;
    let path = finished(&service).await;
    let href = format!("{path}/artifacts/{DISPARITY}");
    let end = &path[path.len() - 8..];
    let whole = |method: Method| {
        // A client that takes compressed answers still gets the bytes as they are.
        let request = service.client.request(method, format!("{}{href}", service.url));
        request.header("accept-encoding", "gzip").send()
    };
    let etag = format!("\"{}\"", hex::encode(Sha256::digest(content())));
    for method in [Method::GET, Method::HEAD] {
        let response = whole(method.clone()).await.unwrap();
        assert_eq!(response.status(), StatusCode::OK);
        for (name, value) in [
            ("content-type", "image/png"),
            ("content-length", "200000"),
            ("accept-ranges", "bytes"),
            ("etag", &etag),
            (
                "content-disposition",
                &format!("inline; filename=\"reconstruction-{}-views-22.5-disparity.png\"", end),
            ),
            ("cache-control", "private, max-age=31536000, immutable"),
            ("x-content-type-options", "nosniff"),
        ] {
            assert_eq!(header(&response, name), Some(value), "{method} {name}");
        }
        assert_eq!(header(&response, "content-encoding"), None);
        let expected = if method == Method::GET { content() } else { Vec::new() };
        assert_eq!(response.bytes().await.unwrap(), expected);
    }
    let metrics = service.get(&format!("{path}/metrics")).send().await.unwrap();
    assert_eq!(header(&metrics, "content-type"), Some("application/json"));
    assert_eq!(metrics.text().await.unwrap(), "{\"pairs\":[]}");
    let empty = service.get(&format!("{path}/artifacts/cloud.ply")).send().await.unwrap();
    assert_eq!(header(&empty, "content-length"), Some("0"));
    let saved = format!("attachment; filename=\"reconstruction-{end}-cloud.ply\"");
    assert_eq!(header(&empty, "content-disposition"), Some(&*saved));
    let named = async |name: &str| {
        let changed = service.client.patch(format!("{}{path}", service.url));
        changed.json(&serde_json::json!({"name": name})).send().await.unwrap();
        let cloud = service.get(&format!("{path}/artifacts/cloud.ply")).send().await.unwrap();
        header(&cloud, "content-disposition").unwrap().to_owned()
    };
    assert_eq!(named("Ida 7\"").await, "attachment; filename=\"Ida-7--cloud.ply\"");
    assert_eq!(
        named("Bär/../é").await,
        "attachment; filename=\"B-r-..---cloud.ply\"; filename*=UTF-8''B%C3%A4r-..-%C3%A9-cloud.ply"
    );
    named(" ").await;
    for name in ["solid.glb", "../jobs.sqlite", "%2e%2e/jobs.sqlite", "views", "%ff"] {
        let href = format!("{path}/artifacts/{name}");
        let status = service.get(&href).send().await.unwrap().status();
        assert_eq!(status, StatusCode::NOT_FOUND, "{name}");
    }
}

#[tokio::test]
async fn versions_decide_what_is_sent() {
    let service = Service::start().await;
    let path = finished(&service).await;
    let href = format!("{path}/artifacts/{DISPARITY}");
    let etag = format!("\"{}\"", hex::encode(Sha256::digest(content())));
    let status = |name: &'static str, value: String| {
        let request = service.get(&href).header(name, value);
        async { request.send().await.unwrap().status().as_u16() }
    };
    assert_eq!(status("if-none-match", etag.clone()).await, 304);
    assert_eq!(status("if-none-match", format!("\"other\", W/{etag}")).await, 304);
    assert_eq!(status("if-none-match", "\"other\"".into()).await, 200);
    assert_eq!(status("if-match", etag.clone()).await, 200);
    let stale = service.get(&href).header("if-match", "\"other\"").send().await.unwrap();
    problem(stale, 412, "precondition-failed").await;
    let resumed = |have: String| {
        let request = service.get(&href).header("range", "bytes=100-").header("if-range", have);
        async { request.send().await.unwrap().status().as_u16() }
    };
    assert_eq!(resumed(etag.clone()).await, 206);
    assert_eq!(resumed("\"other\"".into()).await, 200);
    assert_eq!(resumed(format!("W/{etag}")).await, 200);
    assert_eq!(resumed("Wed, 21 Oct 2015 07:28:00 GMT".into()).await, 200);
}

#[tokio::test]
async fn ranges_of_bytes() {
    let service = Service::start().await;
    let path = finished(&service).await;
    let href = format!("{path}/artifacts/{DISPARITY}");
    let get = |range: &'static str| service.get(&href).header("range", range).send();
    for (range, expected, part) in [
        ("bytes=0-0", "bytes 0-0/200000", 0..1),
        ("bytes=1000-70000", "bytes 1000-70000/200000", 1000..70_001),
        ("bytes=199990-", "bytes 199990-199999/200000", 199_990..200_000),
        ("bytes=-10", "bytes 199990-199999/200000", 199_990..200_000),
        ("bytes=199999-900000", "bytes 199999-199999/200000", 199_999..200_000),
    ] {
        let response = get(range).await.unwrap();
        assert_eq!(response.status(), StatusCode::PARTIAL_CONTENT, "{range}");
        assert_eq!(header(&response, "content-range"), Some(expected));
        let length = part.len().to_string();
        assert_eq!(header(&response, "content-length"), Some(length.as_str()));
        assert_eq!(response.bytes().await.unwrap(), content()[part]);
    }
    for ignored in ["bytes=5-2", "bytes=0-1,4-5", "rows=1-2", "bytes=x"] {
        let response = get(ignored).await.unwrap();
        assert_eq!(response.status(), StatusCode::OK, "{ignored}");
        assert_eq!(response.bytes().await.unwrap().len(), 200_000);
    }
    for outside in ["bytes=200000-", "bytes=-0"] {
        let response = get(outside).await.unwrap();
        assert_eq!(header(&response, "content-range"), Some("bytes */200000"));
        problem(response, 416, "range-not-satisfiable").await;
    }
}

/// Those are kept in memory once they were asked for.
#[tokio::test]
async fn small_ones_are_as_stored_and_go_with_their_job() {
    let service = Service::start().await;
    let png = |seed: u8| (0..60_000u32).map(|i| (i % 251) as u8 ^ seed).collect::<Vec<u8>>();
    let mut jobs = Vec::new();
    for seed in [1, 2] {
        jobs.push((service.finished(&[("page.png", "image/png", png(seed))]).await, png(seed)));
    }
    let path = |id| format!("/v1/reconstructions/{id}/artifacts/page.png");
    for _ in 0..2 {
        for (id, content) in &jobs {
            let whole = service.get(&path(id)).send().await.unwrap();
            assert_eq!(header(&whole, "content-length"), Some("60000"));
            assert_eq!(whole.bytes().await.unwrap(), content);
            let part = service.get(&path(id)).header("range", "bytes=59000-70000");
            let part = part.send().await.unwrap();
            assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT);
            assert_eq!(header(&part, "content-range"), Some("bytes 59000-59999/60000"));
            assert_eq!(part.bytes().await.unwrap(), content[59_000..]);
        }
    }
    let (first, _) = &jobs[0];
    let deleted = service.delete(&format!("/v1/reconstructions/{first}")).send().await.unwrap();
    assert_eq!(deleted.status(), StatusCode::NO_CONTENT);
    let gone = service.get(&path(first)).send().await.unwrap();
    problem(gone, 404, "unknown-reconstruction").await;
}
