//! Who may do what: keys, tenants, their limits, and uploads that are sent again.

use std::fmt::Write;

use jobs::{
    AccessStore, JobId, JobStore, KeyText, NewJob, NewKey, PageStore, Scope, StoreError, TenantName,
};
use reqwest::multipart::Form;
use reqwest::{Method, RequestBuilder, Response, StatusCode};
use serde_json::{Value, json};
use turnaround::http::openapi;
use turnaround::kinds::{DRAWING, RECONSTRUCTION};

use crate::api::harness::{Service, file, problem, views};
use crate::api::page_uploads::page;

fn tenant(name: &str) -> TenantName {
    name.parse().unwrap()
}

/// A new key of `scope` for the tenant.
async fn key(service: &Service, of: &TenantName, scope: Scope) -> KeyText {
    let text = KeyText::generate();
    let new = NewKey { tenant: of.clone(), label: "test".to_owned(), scope };
    service.store.add_key(&new, &text).await.unwrap();
    text
}

/// A service with a tenant `own` and one `other`, and a key of each kind.
async fn with_keys() -> (Service, Vec<(&'static str, Option<KeyText>)>) {
    let service = Service::start().await;
    let [own, other] = ["own", "other"].map(tenant);
    service.store.create_tenant(&own).await.unwrap();
    service.store.create_tenant(&other).await.unwrap();
    let revoked = key(&service, &own, Scope::Admin).await;
    service.store.revoke_key(revoked.id()).await.unwrap();
    let callers = vec![
        ("no key", None),
        ("revoked", Some(revoked)),
        ("other tenant", Some(key(&service, &other, Scope::Write).await)),
        ("read", Some(key(&service, &own, Scope::Read).await)),
        ("write", Some(key(&service, &own, Scope::Write).await)),
        ("admin", Some(key(&service, &own, Scope::Admin).await)),
    ];
    (service, callers)
}

fn with(request: RequestBuilder, key: &Option<KeyText>) -> RequestBuilder {
    match key {
        Some(key) => request.bearer_auth(key.reveal()),
        None => request,
    }
}

/// A succeeded job of the tenant `own`.
async fn job(service: &Service, kind: &str) -> JobId {
    let job = NewJob::new(JobId::new(), kind, json!(null), 1);
    let id = service.store.enqueue(NewJob { tenant: tenant("own"), ..job }).await.unwrap().id;
    // What others in the row have queued is claimed on the way.
    let attempt = loop {
        let (claimed, attempt) = service.claim().await;
        if claimed == id {
            break attempt;
        }
    };
    let files = ["metrics.json", "sheet.json"].map(|name| (name, "application/json", vec![b'1']));
    service.succeed(id, attempt, &files).await;
    id
}

/// One request to a described route, with what it needs filled in.
async fn ask(
    service: &Service,
    method: &Method,
    path: &str,
    id: JobId,
    key: &Option<KeyText>,
) -> Response {
    let name = if path.starts_with("/v1/sheets") { "sheet.json" } else { "metrics.json" };
    let filled = match path {
        "/problems/{name}" => "/problems/not-found".to_owned(),
        "/v1/admin/keys/{id}" => "/v1/admin/keys/ta_none".to_owned(),
        _ if path.starts_with("/v1/admin") => path.replace("{name}", "nobody"),
        _ => {
            let nothing = "00000000-0000-7000-8000-000000000000";
            let path = path.replace("{id}", &id.to_string()).replace("{name}", name);
            path.replace("{delivery}", nothing).replace("{collection}", "reconstructions")
        }
    };
    let request = service.client.request(method.clone(), format!("{}{filled}", service.url));
    let request = with(request, key);
    let request = match (method.as_str(), path) {
        ("POST", "/v1/reconstructions") => request.multipart(views(&["0", "45", "90"])),
        ("POST", "/v1/sheets") => request.multipart(Form::new().text("model", "builtin:teapot")),
        ("POST", "/v1/admin/tenants") => request.json(&json!({"name": "own"})),
        ("POST", "/v1/admin/keys") => {
            request.json(&json!({"tenant": "own", "label": "x", "scope": "read"}))
        }
        ("POST", _) if path.ends_with("/links") => request.json(&json!({"artifact": name})),
        ("PUT", "/v1/webhook") => request.json(&json!({"url": null})),
        ("PUT" | "PATCH", _) => request.json(&json!({})),
        _ => request,
    };
    request.send().await.unwrap()
}

/// Every described route by every kind of caller: the status of each cell.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_route_by_every_kind_of_caller() {
    let (service, callers) = with_keys().await;
    let description = openapi();
    let mut table = String::new();
    for (path, item) in description["paths"].as_object().unwrap() {
        for method in item.as_object().unwrap().keys() {
            let method: Method = method.to_uppercase().parse().unwrap();
            let is_open = item[method.as_str().to_lowercase()]["security"] == json!([]);
            let mut statuses = Vec::new();
            for (caller, key) in &callers {
                let kind = if path.starts_with("/v1/sheets") { DRAWING } else { RECONSTRUCTION };
                let id = job(&service, kind).await;
                let response = ask(&service, &method, path, id, key).await;
                let status = response.status().as_u16();
                let what = format!("{method} {path} by {caller}");
                assert!(status < 500, "{what}: {status}");
                if is_open {
                    assert!(status != 401 && status != 403, "{what}: {status}");
                } else if matches!(*caller, "no key" | "revoked") {
                    assert_eq!(response.headers()["www-authenticate"], "Bearer", "{what}");
                    assert_eq!(status, 401, "{what}");
                } else if *caller == "admin" {
                    assert!(status != 401 && status != 403, "{what}: {status}");
                }
                // Of another's job, word for word what is told of one that is not there.
                if *caller == "other tenant" && path.contains("{id}") && !path.contains("admin") {
                    let unknown = JobId::new();
                    let (theirs, none) = (
                        response.text().await.unwrap(),
                        ask(&service, &method, path, unknown, key).await.text().await.unwrap(),
                    );
                    assert_eq!(
                        theirs.replace(&id.to_string(), ""),
                        none.replace(&unknown.to_string(), ""),
                        "{what}"
                    );
                    assert_eq!(status, 404, "{what}");
                }
                statuses.push(status.to_string());
            }
            writeln!(table, "{:<55} {}", format!("{method} {path}"), statuses.join(" ")).unwrap();
        }
    }
    let names: Vec<_> = callers.iter().map(|(name, _)| *name).collect();
    insta::assert_snapshot!(format!("{}\n{table}", names.join(", ")));
}

#[tokio::test]
async fn lists_sources_and_streams_are_the_tenant_s_own() {
    let (service, callers) = with_keys().await;
    let key_of = |name: &str| callers.iter().find(|(caller, _)| *caller == name).unwrap().1.clone();
    let (own, other) = (key_of("write"), key_of("other tenant"));
    let upload = async |form: Form, key: &Option<KeyText>| {
        with(service.post("/v1/reconstructions"), key).multipart(form).send().await.unwrap()
    };
    let response = upload(views(&["0", "45", "90"]), &own).await;
    assert_eq!(response.status(), StatusCode::ACCEPTED);
    let queued: Value = response.json().await.unwrap();
    let id = queued["id"].as_str().unwrap().to_owned();
    for (key, count) in [(&own, 1), (&other, 0)] {
        let list = with(service.get("/v1/reconstructions"), key).send().await.unwrap();
        let list: Value = list.json().await.unwrap();
        assert_eq!(list["reconstructions"].as_array().unwrap().len(), count);
    }
    let stolen = upload(Form::new().text("source", id.clone()), &other).await;
    problem(stolen, 422, "unknown-source").await;
    let again = upload(Form::new().text("source", id), &own).await;
    assert_eq!(again.status(), StatusCode::ACCEPTED);
}

#[tokio::test]
async fn without_keys_it_is_open_and_with_the_first_it_is_closed() {
    let service = Service::start().await;
    let list = async || service.get("/v1/reconstructions").send().await.unwrap();
    assert_eq!(list().await.status(), StatusCode::OK);
    let new = json!({"tenant": "default", "label": "first", "scope": "admin"});
    let made = service.post("/v1/admin/keys").json(&new).send().await.unwrap();
    assert_eq!(made.status(), StatusCode::CREATED);
    let made: Value = made.json().await.unwrap();
    let text: KeyText = made["key"].as_str().unwrap().parse().unwrap();
    assert_eq!(made["id"], text.id());
    problem(list().await, 401, "unauthorized").await;
    let keys = service.get("/v1/admin/keys").bearer_auth(text.reveal()).send().await.unwrap();
    let keys = keys.text().await.unwrap();
    assert!(keys.contains(text.id()) && !keys.contains(text.reveal()), "{keys}");
    for wrong in
        ["Bearer ", "Bearer ta_0", "Basic dXNlcjpwYXNz", &format!("Bearer {}0", text.reveal())]
    {
        let request = service.get("/v1/reconstructions").header("authorization", wrong);
        problem(request.send().await.unwrap(), 401, "unauthorized").await;
    }
    // Revoked, it opens nothing at once.
    let path = format!("/v1/admin/keys/{}", text.id());
    let revoked = service.delete(&path).bearer_auth(text.reveal()).send().await.unwrap();
    assert_eq!(revoked.status(), StatusCode::OK);
    let after = service.get("/v1/admin/keys").bearer_auth(text.reveal()).send().await.unwrap();
    problem(after, 401, "unauthorized").await;
    // It was the last one: nobody is let in for that.
    problem(list().await, 401, "unauthorized").await;
}

#[tokio::test]
async fn tenants_are_made_limited_and_deleted() {
    let service = Service::start().await;
    let make = async |name: &str| {
        let request = service.post("/v1/admin/tenants").json(&json!({"name": name}));
        request.send().await.unwrap()
    };
    assert_eq!(make("show-7").await.status(), StatusCode::CREATED);
    problem(make("show-7").await, 409, "tenant-exists").await;
    problem(make("Show 7").await, 422, "invalid-body").await;
    let own = key(&service, &tenant("show-7"), Scope::Write).await;
    let admin = key(&service, &TenantName::default(), Scope::Admin).await;
    let limit = |limits: Value| {
        let url = format!("{}/v1/admin/tenants/show-7/limits", service.url);
        service.client.put(url).bearer_auth(admin.reveal()).json(&limits).send()
    };
    for wrong in [
        json!({"max_quued": 1}),
        // These would be no limit, and an end at once.
        json!({"requests_per_second": 0}),
        json!({"expires_in": 0}),
        json!({"max_queued": 1_u64 << 32}),
        json!({"max_bytes": 1_u64 << 63}),
    ] {
        problem(limit(wrong).await.unwrap(), 422, "invalid-body").await;
    }
    let none = json!({"max_queued": null});
    let unlimited: Value = limit(none).await.unwrap().json().await.unwrap();
    assert_eq!(unlimited["limits"], json!({}));
    let limits = json!({"requests_per_second": 5, "max_queued": 1, "max_streams": 1});
    let limited: Value = limit(limits.clone()).await.unwrap().json().await.unwrap();
    assert_eq!(limited["limits"], limits);

    let upload = || {
        let request = service.post("/v1/reconstructions").bearer_auth(own.reveal());
        request.multipart(views(&["0", "45", "90"])).send()
    };
    let first = upload().await.unwrap();
    assert_eq!(first.headers()["ratelimit-limit"], "5");
    assert_eq!(first.headers()["ratelimit-remaining"], "4");
    let first: Value = first.json().await.unwrap();
    let second = upload().await.unwrap();
    assert!(second.headers().contains_key("retry-after"));
    problem(second, 429, "too-many-jobs").await;
    let id = first["id"].as_str().unwrap();
    let events = format!("/v1/reconstructions/{id}/events");
    let open = || service.get(&events).bearer_auth(own.reveal()).send();
    let _stream = open().await.unwrap();
    problem(open().await.unwrap(), 429, "too-many-requests").await;
    let mut refused = None;
    for _ in 0..20 {
        let list = service.get("/v1/reconstructions").bearer_auth(own.reveal());
        let list = list.send().await.unwrap();
        if list.status() == 429 {
            refused = Some(list);
            break;
        }
    }
    let refused = refused.expect("no request was one too many");
    assert_eq!(refused.headers()["ratelimit-remaining"], "0");
    assert!(refused.headers().contains_key("retry-after"));
    problem(refused, 429, "too-many-requests").await;
    // Others are not held up by it.
    let tenants = service.get("/v1/admin/tenants").bearer_auth(admin.reveal());
    assert_eq!(tenants.send().await.unwrap().status(), StatusCode::OK);

    let delete = |name: &str| {
        let request = service.delete(&format!("/v1/admin/tenants/{name}"));
        request.bearer_auth(admin.reveal()).send()
    };
    problem(delete("default").await.unwrap(), 409, "tenant-in-use").await;
    assert_eq!(delete("show-7").await.unwrap().status(), StatusCode::NO_CONTENT);
    problem(delete("show-7").await.unwrap(), 404, "unknown-tenant").await;
    assert_eq!(service.bytes.jobs().await.unwrap(), [], "bytes of its jobs stayed");
    let gone = service.get("/v1/reconstructions").bearer_auth(own.reveal()).send().await.unwrap();
    problem(gone, 401, "unauthorized").await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn one_upload_sent_a_hundred_times_is_one_job() {
    let service = Service::start().await;
    let send = |key: &str, seed: u32| {
        let request = service.post("/v1/reconstructions").header("idempotency-key", key);
        let drawing = crate::api::harness::drawing(32, 24, seed);
        let part = crate::api::harness::file(drawing, "a.png");
        request.multipart(views(&["0", "45"]).part("view[90]", part)).send()
    };
    let posts: Vec<_> = (0..100).map(|_| tokio::spawn(send("\"one\"", 1))).collect();
    let mut answers = Vec::new();
    for post in posts {
        let answer = post.await.unwrap().unwrap();
        assert_eq!(answer.status(), StatusCode::ACCEPTED);
        answers.push((answer.headers()["location"].clone(), answer.json::<Value>().await.unwrap()));
    }
    answers.dedup();
    assert_eq!(answers.len(), 1, "the answers differ");
    assert_eq!(service.store.ids().await.unwrap().len(), 1);
    assert_eq!(service.bytes.jobs().await.unwrap().len(), 1, "inputs of others stayed");
    // As it was answered first, whatever became of the job.
    let (id, attempt) = service.claim().await;
    service.succeed(id, attempt, &[]).await;
    let again = send("one", 1).await.unwrap();
    assert_eq!(again.json::<Value>().await.unwrap(), answers[0].1);
    problem(send("one", 2).await.unwrap(), 422, "idempotency-key-reused").await;
    for wrong in ["", "a b", &"x".repeat(256)] {
        problem(send(wrong, 1).await.unwrap(), 400, "invalid-idempotency-key").await;
    }
    assert_eq!(send("two", 1).await.unwrap().status(), StatusCode::ACCEPTED);
    assert_eq!(service.store.ids().await.unwrap().len(), 2);
    service.delete(&format!("/v1/reconstructions/{id}")).send().await.unwrap();
    problem(send("one", 1).await.unwrap(), 409, "idempotent-job-gone").await;
}

#[tokio::test]
async fn important_jobs_run_first() {
    let service = Service::start().await;
    let send = |priority: &str| {
        let request = service.post(&format!("/v1/reconstructions?priority={priority}"));
        request.multipart(views(&["0", "45", "90"])).send()
    };
    let mut ids = Vec::new();
    for priority in ["-5", "0", "7"] {
        let queued: Value = send(priority).await.unwrap().json().await.unwrap();
        ids.push(queued["id"].as_str().unwrap().parse::<JobId>().unwrap());
    }
    for id in ids.iter().rev() {
        assert_eq!(service.claim().await.0, *id);
    }
    let body = problem(send("101").await.unwrap(), 400, "invalid-query").await;
    assert_eq!(body["parameter"], "priority");
    problem(send("soon").await.unwrap(), 400, "invalid-query").await;
}

#[tokio::test]
async fn pages_are_the_tenant_s_own_and_go_with_it() {
    let (service, callers) = with_keys().await;
    let key_of = |name| callers.iter().find(|(caller, _)| *caller == name).unwrap().1.clone();
    let (own, other) = (key_of("write"), key_of("other tenant"));
    let form = || Form::new().part("page", file(page(2), "sheet.png"));
    let response = with(service.post("/v1/pages"), &own).multipart(form()).send().await.unwrap();
    assert_eq!(response.status(), 201);
    let stored: Value = response.json().await.unwrap();
    let id = stored["id"].as_str().unwrap();
    let address = format!("/v1/pages/{id}");
    let preview = format!("{address}/preview.png");
    for path in [&address, &preview] {
        let theirs = with(service.get(path), &own).send().await.unwrap();
        assert_eq!(theirs.status(), 200);
        let refused = with(service.get(path), &other).send().await.unwrap();
        problem(refused, 404, "unknown-page").await;
    }
    let refused = with(service.put(&address), &other).json(&stored).send().await.unwrap();
    problem(refused, 404, "unknown-page").await;
    let refused = with(service.delete(&address), &other).send().await.unwrap();
    problem(refused, 404, "unknown-page").await;
    let from_page = Form::new().text("page", id.to_owned());
    let upload = with(service.post("/v1/reconstructions"), &other).multipart(from_page);
    problem(upload.send().await.unwrap(), 422, "unknown-source").await;
    service.store.delete_tenant(&tenant("own")).await.unwrap();
    let id: JobId = id.parse().unwrap();
    assert!(matches!(service.store.page(id).await, Err(StoreError::NotFound(_))));
    assert!(service.store.is_ownerless(id, std::time::Duration::ZERO).await.unwrap());
}
