//! The service itself: its description, pages, health, counters and manners.

use std::time::Duration;

use crate::api::harness::{Service, problem, views};
use reqwest::{Method, Response, StatusCode};
use serde_json::Value;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use turnaround::draft;
use turnaround::http::{HttpLimits, ServerTimeouts, openapi};

const DESCRIPTION: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/api/openapi.json");

fn header<'r>(response: &'r Response, name: &str) -> Option<&'r str> {
    response.headers().get(name).map(|value| value.to_str().unwrap())
}

#[test]
fn the_committed_description_is_the_current_one() {
    let current = serde_json::to_string_pretty(&openapi()).unwrap() + "\n";
    if std::env::var_os("UPDATE_OPENAPI").is_some() {
        std::fs::write(DESCRIPTION, &current).unwrap();
    }
    let committed = std::fs::read_to_string(DESCRIPTION).unwrap_or_default();
    assert!(
        committed == current,
        "api/openapi.json is not what the code describes; run this test with UPDATE_OPENAPI=1"
    );
}

/// Every `$ref` of the description.
fn references(value: &Value, found: &mut Vec<String>) {
    match value {
        Value::Object(map) => {
            if let Some(reference) = map.get("$ref").and_then(Value::as_str) {
                found.push(reference.to_owned());
            }
            map.values().for_each(|value| references(value, found));
        }
        Value::Array(list) => list.iter().for_each(|value| references(value, found)),
        _ => {}
    }
}

#[test]
fn the_description_is_whole() {
    let description = openapi();
    assert!(description["openapi"].as_str().unwrap().starts_with("3.1"));
    let mut found = Vec::new();
    references(&description, &mut found);
    assert!(found.contains(&"#/components/schemas/Problem".to_owned()));
    for reference in found {
        let target = description.pointer(reference.strip_prefix('#').unwrap());
        assert!(target.is_some(), "{reference} leads nowhere");
    }
    let mut ids = Vec::new();
    for (path, item) in description["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            ids.push(operation["operationId"].as_str().unwrap().to_owned());
            let responses = operation["responses"].as_object().unwrap();
            assert!(responses.keys().any(|status| status.starts_with('2')));
            assert!(responses.contains_key("default"), "{method} {path}");
            for name in path.split('/').filter_map(|s| s.strip_prefix('{')?.strip_suffix('}')) {
                let parameters = operation["parameters"].as_array().unwrap();
                let declared = parameters.iter().any(|p| p["name"] == name && p["in"] == "path");
                assert!(declared, "{method} {path}: {name}");
            }
        }
    }
    let count = ids.len();
    ids.sort();
    ids.dedup();
    assert_eq!(ids.len(), count, "operation ids repeat: {ids:?}");
    let schemas = &description["components"]["schemas"];
    let options = options::with_enums(draft::options::schema());
    assert_eq!(schemas["Options"]["properties"], options["properties"]);
    // Which generators of clients cannot read.
    assert!(!description.to_string().contains("\"const\""));
    for name in ["Options", "SheetDocument", "Upload"] {
        jsonschema::draft202012::meta::validate(&schemas[name]).unwrap();
    }
}

#[tokio::test]
async fn answers_are_as_described() {
    let service = Service::start().await;
    let id = service.finished(&[("hull.glb", "model/gltf-binary", vec![7; 10])]).await;
    let description = openapi();
    let check = |schema: &str, body: &Value| {
        let mut root = description["components"].clone();
        root = serde_json::json!({"components": root, "$ref": format!("#/components/schemas/{schema}")});
        let validator = jsonschema::draft202012::new(&root).unwrap();
        let errors: Vec<_> = validator.iter_errors(body).map(|e| e.to_string()).collect();
        assert!(errors.is_empty(), "{schema}: {errors:?} in {body}");
    };
    let path = format!("/v1/reconstructions/{id}");
    for (path, schema) in [
        (path.clone(), "Reconstruction"),
        ("/v1/reconstructions".to_owned(), "ReconstructionList"),
        (format!("{path}/artifacts"), "ArtifactList"),
        ("/health/live".to_owned(), "Health"),
        ("/v1/nothing".to_owned(), "Problem"),
    ] {
        let body = service.get(&path).send().await.unwrap().json().await.unwrap();
        check(schema, &body);
    }
    let form = views(&["0", "45", "90"]).text("speed", "1");
    check("Problem", &service.upload(form).await.json().await.unwrap());
}

#[tokio::test]
async fn description_options_and_pages_are_served() {
    let service = Service::start().await;
    let served: Value = service.get("/openapi.json").send().await.unwrap().json().await.unwrap();
    assert_eq!(served, openapi());
    let served: Value = service.get("/v1/options").send().await.unwrap().json().await.unwrap();
    assert_eq!(&served, draft::options::schema());

    let docs = service.get("/docs").send().await.unwrap();
    assert_eq!(docs.status(), StatusCode::OK);
    let page = docs.text().await.unwrap();
    let scripts = page.matches("<script").count();
    assert!(scripts > 0);
    assert!(!page.contains("//cdn") && !page.contains("https://"), "{page}");
    for asset in ["swagger-ui.css", "swagger-ui-bundle.js", "swagger-initializer.js"] {
        let response = service.get(&format!("/docs/{asset}")).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::OK, "{asset}");
        let text = response.text().await.unwrap();
        if asset == "swagger-initializer.js" {
            assert!(text.contains("/openapi.json") && text.contains("none"), "{text}");
        }
    }

    let list = service.get("/problems").send().await.unwrap().text().await.unwrap();
    let links: Vec<_> =
        list.split("href=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    assert!(links.len() > 30);
    for link in links {
        let page = service.get(link).send().await.unwrap();
        assert_eq!(page.status(), StatusCode::OK, "{link}");
        assert_eq!(header(&page, "content-type"), Some("text/html; charset=utf-8"));
        assert!(page.text().await.unwrap().contains(link));
    }
    problem(service.get("/problems/none").send().await.unwrap(), 404, "not-found").await;
}

#[tokio::test]
async fn paths_and_methods_that_are_not_there() {
    let service = Service::start().await;
    for path in ["/v2", "/assets/none.js", "/v1/reconstructions/", "/docs/none.js"] {
        let response = service.get(path).send().await.unwrap();
        problem(response, 404, "not-found").await;
    }
    for (method, path, allowed) in [
        (Method::PUT, "/v1/reconstructions", ["GET", "POST"].as_slice()),
        (Method::POST, "/v1/options", &["GET"]),
        (Method::GET, "/v1/reconstructions/x/cancel", &["POST"]),
        (Method::DELETE, "/v1/reconstructions/x/artifacts/hull.glb", &["GET", "HEAD"]),
    ] {
        let request = service.client.request(method, format!("{}{path}", service.url));
        let response = request.send().await.unwrap();
        let allow = header(&response, "allow").unwrap_or_default().to_owned();
        for method in allowed {
            assert!(allow.contains(method), "{path}: {allow}");
        }
        problem(response, 405, "method-not-allowed").await;
    }
}

#[tokio::test]
async fn the_page_is_at_the_root_built_or_not() {
    let service = Service::start().await;
    let response = service.get("/").send().await.unwrap();
    assert_eq!(response.status(), 200);
    assert!(header(&response, "content-type").unwrap().starts_with("text/html"));
    assert!(header(&response, "content-security-policy").unwrap().contains("default-src 'none'"));
    assert!(header(&response, "set-cookie").is_none());
    let body = response.text().await.unwrap();
    assert!(body.contains("assets/") || body.contains("npm ci"), "{body}");
}

#[tokio::test]
async fn health_and_counters() {
    let service = Service::start().await;
    for path in ["/health/live", "/health/ready"] {
        let body: Value = service.get(path).send().await.unwrap().json().await.unwrap();
        assert_eq!(body["status"], "ok");
    }
    service.queue().await;
    service.queue().await;
    service.claim().await;
    let text = service.get("/metrics").send().await.unwrap().text().await.unwrap();
    for (state, count) in [("queued", 1), ("running", 1), ("succeeded", 0)] {
        let line = format!("turnaround_jobs{{state=\"{state}\"}} {count}");
        assert!(text.contains(&line), "{text}");
    }
    let counted = text.lines().any(|line| {
        line.starts_with("turnaround_http_requests_total")
            && ["method=\"POST\"", "route=\"/v1/reconstructions\"", "status=\"202\""]
                .iter()
                .all(|label| line.contains(label))
    });
    assert!(counted, "{text}");
    assert!(text.contains("turnaround_http_request_duration_seconds_bucket"), "{text}");
    service.store.close().await;
    let response = service.get("/health/ready").send().await.unwrap();
    problem(response, 503, "unavailable").await;
}

#[tokio::test]
async fn a_broken_store_is_a_503_without_its_insides() {
    let service = Service::start().await;
    let id = service.queue().await;
    service.store.close().await;
    let response = service.get(&format!("/v1/reconstructions/{id}")).send().await.unwrap();
    assert!(response.headers().contains_key("retry-after"));
    let body = problem(response, 503, "unavailable").await;
    assert!(!body.to_string().to_lowercase().contains("sql"), "{body}");
    let response = service.upload(views(&["0", "45", "90"])).await;
    problem(response, 503, "unavailable").await;
    assert_eq!(service.bytes.jobs().await.unwrap(), [id], "inputs of the refused job stayed");
}

#[tokio::test]
async fn answers_carry_request_ids_and_are_compressed() {
    let service = Service::start().await;
    let response = service.get("/v1/options").send().await.unwrap();
    assert_eq!(header(&response, "x-request-id").unwrap().len(), 36);
    let response = service.get("/nothing").header("x-request-id", "mine").send().await.unwrap();
    assert_eq!(header(&response, "x-request-id"), Some("mine"));
    let response =
        service.get("/v1/options").header("accept-encoding", "gzip").send().await.unwrap();
    assert_eq!(header(&response, "content-encoding"), Some("gzip"));
}

#[tokio::test]
async fn pages_of_allowed_origins_may_use_it() {
    let service = Service::start().await;
    let from = |origin: &'static str| service.get("/v1/options").header("origin", origin).send();
    let response = from("https://studio.example").await.unwrap();
    assert_eq!(header(&response, "access-control-allow-origin"), Some("https://studio.example"));
    let response = from("https://elsewhere.example").await.unwrap();
    assert_eq!(header(&response, "access-control-allow-origin"), None);
    let preflight = service
        .client
        .request(Method::OPTIONS, format!("{}/v1/reconstructions", service.url))
        .header("origin", "https://studio.example")
        .header("access-control-request-method", "POST")
        .send()
        .await
        .unwrap();
    assert_eq!(preflight.status(), StatusCode::OK);
    assert!(header(&preflight, "access-control-allow-methods").unwrap().contains("POST"));
}

#[tokio::test]
async fn slow_headers_close_the_connection() {
    let timeouts =
        ServerTimeouts { header_read: Duration::from_millis(200), ..ServerTimeouts::default() };
    let service = Service::start_with(HttpLimits::default(), timeouts).await;
    for sent in ["", "GET /health/live HTTP/1.1\r\nHost:"] {
        let address = service.url.strip_prefix("http://").unwrap();
        let mut connection = TcpStream::connect(address).await.unwrap();
        connection.write_all(sent.as_bytes()).await.unwrap();
        let mut answer = Vec::new();
        let closed = connection.read_to_end(&mut answer);
        let closed = tokio::time::timeout(Duration::from_secs(5), closed).await;
        closed.expect("the server closes the connection").unwrap();
    }
}
