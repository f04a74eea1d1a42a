//! A job's events as server-sent events.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::http::{HeaderMap, StatusCode};
use axum::response::sse::{Event as ServerSentEvent, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures::Stream;
use serde_json::{Value, json};
use tokio::time::Instant;

use super::Api;
use super::problem::Problem;
use super::resource::{OwnedId, Resource, find};
use super::streams::OpenStream;
use super::wait::Watch;
use jobs::{Event, EventKind, JobId, StoreError};

const KEEP_ALIVE: Duration = Duration::from_secs(15);

/// Answers the events of a job from the one after `Last-Event-ID` to the final one.
pub(super) async fn stream<R: Resource>(
    api: Arc<Api>,
    job: OwnedId,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let OwnedId { id, caller } = &job;
    let id = *id;
    let last = headers.get("last-event-id").and_then(|value| value.to_str().ok()?.parse().ok());
    let last: u64 = last.unwrap_or(0);
    let found = find::<R>(&api, &job).await?;
    if found.state.is_final() && last >= found.version {
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    let has_ended = found.state.is_final();
    let slot = api.streams.open(caller)?;
    let keep_alive = KeepAlive::new().interval(KEEP_ALIVE).text("still here");
    Ok(Sse::new(follow(api, id, last, has_ended, slot)).keep_alive(keep_alive).into_response())
}

fn follow(
    api: Arc<Api>,
    id: JobId,
    mut last: u64,
    has_ended: bool,
    slot: OpenStream,
) -> impl Stream<Item = Result<ServerSentEvent, Infallible>> {
    async_stream::stream! {
        let _slot = slot;
        let mut watch = Watch::new(&api, id);
        loop {
            match api.state.store.events(id, last).await {
                Ok(events) => for event in events {
                    last = event.number;
                    let is_final = event.kind.is_final();
                    yield Ok(message(&event));
                    if is_final {
                        return;
                    }
                },
                Err(StoreError::NotFound(_)) => return,
                // The client comes back with the number of its last event.
                Err(error) => {
                    tracing::warn!(%id, %error, "event stream ends early");
                    return;
                }
            }
            // What comes after the final event is no part of the job's life.
            if has_ended {
                return;
            }
            tokio::select! {
                () = watch.changed(Instant::now() + KEEP_ALIVE) => {}
                () = api.state.shutdown.cancelled() => return,
            }
        }
    }
}

fn message(event: &Event) -> ServerSentEvent {
    let kind = kind(event.kind);
    let data = json!({
        "number": event.number,
        "at": event.at,
        "kind": kind,
        "data": event.data,
    });
    // JSON text has no line breaks, which is all that could go wrong here.
    let kind = kind.as_str().unwrap_or("message").to_owned();
    ServerSentEvent::default().id(event.number.to_string()).event(kind).data(data.to_string())
}

fn kind(kind: EventKind) -> Value {
    serde_json::to_value(kind).unwrap_or_default()
}
