//! How much may be stored, and for how long.

use std::time::Duration;

use jobs::{AccessStore, JobStore, PageQuery, PageStore, StoreError, TenantLimits, TenantName};
use reqwest::multipart::Form;
use serde_json::Value;
use tokio::runtime::Handle;
use turnaround::http::{HttpLimits, ServerTimeouts};
use turnaround::worker::{Pool, WorkerConfig};

use crate::api::harness::{Service, file, problem, views};
use crate::api::page_uploads::page;

const ANGLES: [&str; 3] = ["0", "45", "90"];

impl Service {
    async fn limit(&self, limits: TenantLimits) {
        self.store.limit_tenant(&TenantName::default(), &limits).await.unwrap();
        // Limits that were looked up hold for a second.
        tokio::time::sleep(Duration::from_millis(1100)).await;
    }

    async fn page(&self) -> reqwest::Response {
        let form = Form::new().part("page", file(page(2), "sheet.png"));
        self.post("/v1/pages").multipart(form).send().await.unwrap()
    }

    async fn metric(&self, name: &str) -> f64 {
        let text = self.get("/metrics").send().await.unwrap().text().await.unwrap();
        let line = text.lines().find_map(|line| line.strip_prefix(name)).expect("no such metric");
        line.trim().parse().unwrap()
    }
}

#[tokio::test]
async fn a_tenant_stores_no_more_than_it_may() {
    let service = Service::start().await;
    let first = service.queue().await;
    let stored = service.bytes.stored(first).await.unwrap();
    assert!(stored > 0);
    // Less than twice, and more than a body has besides its files.
    let max_bytes = Some(stored + stored / 2);
    service.limit(TenantLimits { max_bytes, ..TenantLimits::default() }).await;
    let refused = service.upload(views(&ANGLES)).await;
    assert!(refused.headers().contains_key("retry-after"));
    problem(refused, 507, "tenant-full").await;
    problem(service.page().await, 507, "tenant-full").await;
    assert_eq!(service.bytes.jobs().await.unwrap(), [first], "bytes of refused uploads stayed");
    service.store.delete(first).await.unwrap();
    service.queue().await;
}

#[tokio::test]
async fn uploads_are_refused_over_the_disk_budget() {
    let limits = HttpLimits { disk_budget_bytes: Some(20_000), ..HttpLimits::default() };
    let service = Service::start_with(limits, ServerTimeouts::default()).await;
    let id = service.finished(&[("a.bin", "application/octet-stream", vec![0; 19_000])]).await;
    let refused = service.upload(views(&ANGLES)).await;
    let refused = problem(refused, 507, "insufficient-storage").await;
    assert!(refused["detail"].as_str().unwrap().contains("delete jobs"), "{refused}");
    assert!(service.metric("turnaround_stored_bytes").await > 19_000.0);
    assert!(service.metric("turnaround_disk_free_bytes").await > 0.0);
    service.store.delete(id).await.unwrap();
    service.queue().await;
}

#[tokio::test]
async fn what_says_nothing_else_stays_as_long_as_the_tenant_says() {
    let service = Service::start().await;
    service.limit(TenantLimits { expires_in: Some(3600), ..TenantLimits::default() }).await;
    let sent: Value = service.upload(views(&ANGLES)).await.json().await.unwrap();
    assert!(sent["expires_at"].is_string(), "{sent}");
    let longer = service.post("/v1/reconstructions?expires_in=7200").multipart(views(&ANGLES));
    let longer: Value = longer.send().await.unwrap().json().await.unwrap();
    assert!(longer["expires_at"].as_str().unwrap() > sent["expires_at"].as_str().unwrap());
    assert_eq!(service.page().await.status(), 201);
    let pages: Value = service.get("/v1/pages").send().await.unwrap().json().await.unwrap();
    assert!(pages["pages"][0]["expires_at"].is_string(), "{pages}");
}

#[tokio::test]
async fn pages_are_listed_in_parts() {
    let service = Service::start().await;
    let mut made = Vec::new();
    for _ in 0..3 {
        let page: Value = service.page().await.json().await.unwrap();
        made.insert(0, page["id"].as_str().unwrap().to_owned());
    }
    let (mut listed, mut next) = (Vec::new(), Some("/v1/pages?limit=2".to_owned()));
    while let Some(part) = next {
        let answer = service.get(&part).send().await.unwrap();
        let has_link = answer.headers().contains_key("link");
        let answer: Value = answer.json().await.unwrap();
        for page in answer["pages"].as_array().unwrap() {
            listed.push(page["id"].as_str().unwrap().to_owned());
            let whole = service.get(page["href"].as_str().unwrap()).send().await.unwrap();
            assert_eq!(whole.status(), 200);
        }
        next = answer["next"].as_str().map(str::to_owned);
        assert_eq!(has_link, next.is_some());
    }
    assert_eq!(listed, made);
    let wrong = service.get("/v1/pages?limit=0").send().await.unwrap();
    problem(wrong, 400, "invalid-query").await;
}

/// The oldest goes first, with its bytes; what is pinned stays.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn room_is_made_where_that_is_set() {
    let service = Service::start().await;
    let one = |service: &Service| {
        let url = format!("{}/v1/reconstructions?pinned=true", service.url);
        service.client.post(url).multipart(views(&ANGLES)).send()
    };
    assert_eq!(one(&service).await.unwrap().status(), 202);
    let (pinned, attempt) = service.claim().await;
    service.succeed(pinned, attempt, &[]).await;
    let old = service.finished(&[("a.bin", "application/octet-stream", vec![0; 50_000])]).await;
    let new = service.finished(&[("a.bin", "application/octet-stream", vec![0; 50_000])]).await;
    let config = WorkerConfig {
        make_room: Some(90_000),
        reap_interval: Duration::from_millis(20),
        ..WorkerConfig::default()
    };
    let store = service.store.clone();
    let _pool =
        Pool::start(config, store, service.bytes.clone(), Vec::new(), &Handle::current()).unwrap();
    let gone = async {
        while !matches!(service.store.get(old).await, Err(StoreError::NotFound(_)))
            || service.bytes.jobs().await.unwrap().contains(&old)
        {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    tokio::time::timeout(Duration::from_secs(60), gone).await.expect("no room was made");
    service.store.get(pinned).await.unwrap();
    service.store.get(new).await.unwrap();
    assert_eq!(
        service.store.pages(&PageQuery::newest(TenantName::default(), 9)).await.unwrap(),
        []
    );
}
