//! Messages that tell other services how jobs ended.

use std::sync::Arc;
use std::time::{Duration, Instant};

use jobs::{JobId, JobStore, WebhookStore};
use reqwest::multipart::Form;
use serde_json::{Value, json};
use tokio::task::AbortHandle;
use turnaround::webhooks::{Sender, SenderConfig};

use crate::api::harness::{Service, problem, views};
use crate::api::receiver::Receiver;

const PATIENCE: Duration = Duration::from_secs(60);

/// Where an upload goes whose job's end is told at `url`.
pub(crate) fn told_at(url: &str) -> String {
    let query =
        form_urlencoded::Serializer::new(String::new()).append_pair("webhook", url).finish();
    format!("/v1/reconstructions?{query}")
}

impl Service {
    /// Sends messages as the service does, with short pauses.
    fn send_messages(&self) -> AbortHandle {
        let config = SenderConfig {
            pauses: vec![Duration::from_millis(50); 2],
            poll_interval: Duration::from_millis(20),
            ..SenderConfig::default()
        };
        let store = Arc::clone(&self.store) as Arc<dyn JobStore>;
        let outbound = Arc::clone(&self.outbound);
        tokio::spawn(Sender { config, store, outbound }.run()).abort_handle()
    }

    async fn secret(&self) -> String {
        let made = self.post("/v1/webhook/secret").send().await.unwrap();
        assert_eq!(made.status(), 201);
        let made: Value = made.json().await.unwrap();
        made["secret"].as_str().unwrap().to_owned()
    }

    /// Queues a job that is told of at `url`.
    async fn queue_told(&self, url: &str) -> JobId {
        let request = self.post(&told_at(url));
        let sent = request.multipart(views(&["0", "45", "90"])).send().await.unwrap();
        assert_eq!(sent.status(), 202);
        let queued: Value = sent.json().await.unwrap();
        queued["id"].as_str().unwrap().parse().unwrap()
    }

    /// Waits until the first message about the job is in this state.
    async fn delivery(&self, id: JobId, state: &str) -> Value {
        let begun = Instant::now();
        loop {
            let list = self.get(&format!("/v1/reconstructions/{id}/deliveries")).send().await;
            let list: Value = list.unwrap().json().await.unwrap();
            let delivery = &list["deliveries"][0];
            if delivery["state"] == state {
                return delivery.clone();
            }
            assert!(begun.elapsed() < PATIENCE, "still waiting for {state}: {list}");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }
}

/// Every kind of job and every end, at the tenant's address and the job's own,
/// signed with both secrets of a change.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn ends_are_told_where_the_tenant_and_the_job_say() {
    let service = Service::start().await;
    let receiver = Receiver::start().await;
    let all = format!("{}/all", receiver.url);
    let set = |url: &str| service.put("/v1/webhook").json(&json!({"url": url})).send();
    problem(set(&all).await.unwrap(), 409, "no-webhook-secret").await;
    let secrets = [service.secret().await, service.secret().await];
    assert_eq!(set(&all).await.unwrap().status(), 200);
    let known: Value = service.get("/v1/webhook").send().await.unwrap().json().await.unwrap();
    assert_eq!(known, json!({"url": all}));
    let _sender = service.send_messages();

    let done = service.finished(&[]).await;
    let message = receiver.wait_for(1).await.remove(0);
    assert_eq!(message.path, "/all");
    let told = message.verified(&secrets[0]);
    assert_eq!(told, message.verified(&secrets[1]));
    assert_eq!(told["type"], "reconstruction.succeeded");
    assert_eq!(told["data"]["href"], format!("/v1/reconstructions/{done}"));
    let status = service.get(&format!("/v1/reconstructions/{done}")).send().await.unwrap();
    let status: Value = status.json().await.unwrap();
    assert_eq!(told["timestamp"], status["finished_at"]);

    let own = service.queue_told(&format!("{}/own", receiver.url)).await;
    service.post(&format!("/v1/reconstructions/{own}/cancel")).send().await.unwrap();
    let message = receiver.wait_for(2).await.remove(1);
    assert_eq!(message.path, "/own");
    assert_eq!(message.verified(&secrets[1])["type"], "reconstruction.cancelled");

    let form = Form::new().text("model", "builtin:teapot").text("azimuths", "0,90");
    let request = service.post("/v1/sheets?name=teapot&labels=show:7").multipart(form);
    assert_eq!(request.send().await.unwrap().status(), 202);
    let (sheet, attempt) = service.claim().await;
    let failure = jobs::Failure { code: "bad".to_owned(), detail: "it is bad".to_owned() };
    service.store.fail(sheet, attempt, failure).await.unwrap();
    let told = receiver.wait_for(3).await.remove(2).verified(&secrets[1]);
    assert_eq!(told["type"], "sheet.failed");
    assert_eq!(told["data"]["failure"]["code"], "bad");
    assert_eq!(
        (&told["data"]["name"], &told["data"]["labels"]),
        (&json!("teapot"), &json!({"show": "7"}))
    );
    let log = service.get(&format!("/v1/sheets/{sheet}/deliveries")).send().await.unwrap();
    let log: Value = log.json().await.unwrap();
    assert_eq!(log["deliveries"].as_array().unwrap().len(), 1);
    // Nobody is told any more.
    let none = service.put("/v1/webhook").json(&json!({"url": null})).send().await.unwrap();
    assert_eq!(none.status(), 200);
    let quiet = service.finished(&[]).await;
    assert_eq!(service.store.deliveries(quiet).await.unwrap(), []);
}

/// What becomes of messages to receivers that are down, fail, redirect, answer
/// too much or not at all.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn receivers_that_do_not_take_messages_are_tried_again_and_given_up() {
    let service = Service::start().await;
    let receiver = Receiver::start().await;
    let secret = service.secret().await;
    let _sender = service.send_messages();
    // A port that nobody listens at any more.
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let down = format!("http://{}/", listener.local_addr().unwrap());
    drop(listener);
    for (url, status, why) in [
        (format!("{}/fail", receiver.url), json!(500), "the receiver answered 500"),
        (
            format!("{}/redirect", receiver.url),
            json!(307),
            "the receiver answered 307; redirects are not followed",
        ),
        (down, json!(null), "no answer came: nothing takes connections there"),
    ] {
        let id = service.queue_told(&url).await;
        service.post(&format!("/v1/reconstructions/{id}/cancel")).send().await.unwrap();
        let delivery = service.delivery(id, "given_up").await;
        let attempts = delivery["attempts"].as_array().unwrap();
        assert_eq!(attempts.len(), 3, "{delivery}");
        for attempt in attempts {
            assert_eq!((&attempt["status"], attempt["error"].as_str()), (&status, Some(why)));
        }
    }
    let sent = receiver.messages().await;
    assert_eq!(sent.len(), 6, "the redirect was followed");
    // The same message each time, with a signature of its time.
    assert_eq!(sent[0].headers["webhook-id"], sent[1].headers["webhook-id"]);
    assert_ne!(sent[0].headers["webhook-id"], sent[3].headers["webhook-id"]);
    assert_eq!(sent[0].body, sent[2].body);
    sent[2].verified(&secret);

    let id = service.queue_told(&format!("{}/long", receiver.url)).await;
    service.post(&format!("/v1/reconstructions/{id}/cancel")).send().await.unwrap();
    service.delivery(id, "delivered").await;

    let id = service.queue_told(&format!("{}/slow", receiver.url)).await;
    service.post(&format!("/v1/reconstructions/{id}/cancel")).send().await.unwrap();
    let begun = Instant::now();
    let first = async || {
        let list = service.store.deliveries(id).await.unwrap();
        list[0].1.first().cloned()
    };
    let attempt = loop {
        if let Some(attempt) = first().await {
            break attempt;
        }
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(50)).await;
    };
    assert_eq!(attempt.error.as_deref(), Some("no whole answer came within 10 s"));
    assert!(attempt.duration < Duration::from_secs(12), "{attempt:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_message_is_sent_anew_when_asked_for() {
    let service = Service::start().await;
    let receiver = Receiver::start().await;
    service.secret().await;
    let _sender = service.send_messages();
    let id = service.queue_told(&format!("{}/ok", receiver.url)).await;
    let deliveries = format!("/v1/reconstructions/{id}/deliveries");
    let none: Value = service.get(&deliveries).send().await.unwrap().json().await.unwrap();
    assert_eq!(none, json!({"deliveries": []}));
    service.post(&format!("/v1/reconstructions/{id}/cancel")).send().await.unwrap();
    let delivery = service.delivery(id, "delivered").await;
    assert_eq!(delivery["receiver"], receiver.url);
    let message = delivery["id"].as_str().unwrap();
    let redeliver = |id: &str| service.post(&format!("{deliveries}/{id}/redeliver")).send();
    assert_eq!(redeliver(message).await.unwrap().status(), 202);
    let sent = receiver.wait_for(2).await;
    assert_eq!(sent[0].headers["webhook-id"], sent[1].headers["webhook-id"]);
    for unknown in [JobId::new().to_string(), "none".to_owned()] {
        problem(redeliver(&unknown).await.unwrap(), 404, "unknown-delivery").await;
    }
}

/// Whoever reads the answers sees what is wrong, not what was sent.
#[tokio::test]
async fn what_is_no_url_is_not_sent_back() {
    let service = Service::start().await;
    service.secret().await;
    let long = "x".repeat(5000);
    for (body, kind, told) in [
        (json!({"url": format!("{long}:<script>")}), "invalid-webhook", "no absolute URL"),
        (
            json!({"url": format!("{}://h/", &long[..1900])}),
            "invalid-webhook",
            "its scheme is none",
        ),
        (json!({"url": "javascript:alert(1)//<script>"}), "invalid-webhook", "its scheme is none"),
        (json!({"url": "https://8.8.8.8/ä"}), "invalid-webhook", "percent-encode them"),
        (json!({"url": {"x": long}}), "invalid-body", "at `url`: invalid type: map"),
        (json!({"url": null, "\u{1b}[2J": 1}), "invalid-body", "unknown field `\\u{1b}[2J`"),
        (json!({"url": null, &long: 1}), "invalid-body", "expected `url`"),
    ] {
        let set = service.put("/v1/webhook").json(&body).send().await.unwrap();
        let refused = problem(set, 422, kind).await;
        let detail = refused["detail"].as_str().unwrap();
        assert!(detail.contains(told) && detail.len() < 700, "{told}: {detail}");
        assert!(!refused.to_string().contains("script"), "{refused}");
        if kind == "invalid-webhook" {
            assert!(detail.len() < 120 && detail.contains("give an https URL"), "{detail}");
        }
    }
}

/// Refused when they are named; what can be told by looking up alone is refused
/// when it is called.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn addresses_that_are_not_public_are_never_called() {
    let service = Service::start().await;
    service.secret().await;
    for url in [
        "http://studio.example/",
        "https://127.0.0.2/",
        "https://[::1]/",
        "https://169.254.169.254/latest/meta-data",
        "https://[::ffff:10.0.0.1]/",
        "https://0x7f000002/",
        "ftp://studio.example/",
        "https://me:secret@studio.example/",
        "nonsense",
    ] {
        let set = service.put("/v1/webhook").json(&json!({"url": url})).send().await.unwrap();
        let refused = problem(set, 422, "invalid-webhook").await;
        assert_eq!(refused["part"], "url", "{refused}");
        let request = service.post(&told_at(url));
        let sent = request.multipart(views(&["0", "45", "90"])).send().await.unwrap();
        let refused = problem(sent, 422, "invalid-webhook").await;
        assert_eq!(refused["parameter"], "webhook");
    }
    service.assert_nothing_stored().await;
    let id = service.queue_told("https://localhost:1/").await;
    let _sender = service.send_messages();
    service.post(&format!("/v1/reconstructions/{id}/cancel")).send().await.unwrap();
    let delivery = service.delivery(id, "given_up").await;
    assert_eq!(delivery["attempts"][0]["error"], "`localhost` is at an address that is not public");
}
