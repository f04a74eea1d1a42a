//! Somebody on the loopback who takes messages, or does not.

use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use serde_json::Value;
use standardwebhooks::Webhook;
use tokio::net::TcpListener;
use tokio::sync::Mutex;

const PATIENCE: Duration = Duration::from_secs(60);

/// A message as it came.
#[derive(Clone, Debug)]
pub(crate) struct Message {
    pub path: String,
    pub headers: HeaderMap,
    pub body: Bytes,
}

impl Message {
    /// What it says, after its signature was found to be right.
    pub(crate) fn verified(&self, secret: &str) -> Value {
        Webhook::new(secret).unwrap().verify(&self.body, &self.headers).unwrap();
        serde_json::from_slice(&self.body).unwrap()
    }
}

type Messages = Arc<Mutex<Vec<Message>>>;

/// A receiver: `/ok` takes messages, `/fail` answers 500, `/redirect` sends on to
/// `/ok`, `/slow` never answers, `/slow-once` only later, `/long` answers more than is read.
pub(crate) struct Receiver {
    pub url: String,
    messages: Messages,
}

impl Receiver {
    pub(crate) async fn start() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let messages = Messages::default();
        let router = Router::new().fallback(take).with_state(messages.clone());
        tokio::spawn(async move { axum::serve(listener, router).await.unwrap() });
        Self { url, messages }
    }

    /// The messages so far.
    pub(crate) async fn messages(&self) -> Vec<Message> {
        self.messages.lock().await.clone()
    }

    /// Waits until there are at least so many.
    pub(crate) async fn wait_for(&self, many: usize) -> Vec<Message> {
        let come = async {
            loop {
                let messages = self.messages().await;
                if messages.len() >= many {
                    return messages;
                }
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
        };
        tokio::time::timeout(PATIENCE, come).await.expect("the messages did not come")
    }
}

async fn take(
    State(messages): State<Messages>,
    uri: Uri,
    headers: HeaderMap,
    body: Bytes,
) -> Response {
    let path = uri.path().to_owned();
    let mut all = messages.lock().await;
    let is_first = all.iter().all(|message| message.path != path);
    all.push(Message { path: path.clone(), headers, body });
    drop(all);
    match path.as_str() {
        "/slow-once" if is_first => std::future::pending().await,
        "/fail" => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
        "/redirect" => (StatusCode::TEMPORARY_REDIRECT, [("location", "/ok")]).into_response(),
        "/slow" => std::future::pending().await,
        "/long" => vec![b'x'; 1 << 20].into_response(),
        _ => StatusCode::NO_CONTENT.into_response(),
    }
}
