//! What is left of a request's body when its answer is ready.
//!
//! A server that answers and closes while the client still sends resets the
//! connection, and the answer is lost; and a client that was not told sends its
//! next request on a connection that is about to close.

use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

use axum::body::{Body, HttpBody};
use axum::extract::Request;
use axum::http::{HeaderValue, header};
use axum::response::Response;
use bytes::Bytes;
use futures::StreamExt;
use hyper::body::{Frame, SizeHint};

/// How long the body of an answered request is read on.
const DRAIN_TIME: Duration = Duration::from_secs(5);

/// A request's body, lent to who answers it.
pub(super) struct Lending {
    /// `None` if there is no body.
    back: Option<Unread>,
    /// A client that waits for 100 Continue sends nothing after an answer.
    waits: bool,
}

impl Lending {
    /// Has the body of a request come back when its reader lets go of it.
    pub(super) fn of(request: Request) -> (Self, Request) {
        if request.body().is_end_stream() {
            return (Self { back: None, waits: false }, request);
        }
        let waits = request.headers().contains_key(header::EXPECT);
        let back = Unread::default();
        let lent = back.clone();
        let request = request.map(|body| Body::new(Lent { body, ended: false, back: lent }));
        (Self { back: Some(back), waits }, request)
    }

    /// Reads on, and throws away, what was left of the body, at most `most` bytes,
    /// before the answer goes out. Where that does not reach the body's end, the
    /// answer says `Connection: close`.
    pub(super) async fn settle(self, mut response: Response, most: u64) -> Response {
        let left = self.back.and_then(|back| back.lock().take());
        let ended = match left {
            None => true,
            Some(_) if self.waits => false,
            Some(body) => reaches_end(body, most).await,
        };
        if !ended {
            response.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
        }
        response
    }
}

async fn reaches_end(body: Body, most: u64) -> bool {
    let mut chunks = body.into_data_stream();
    let mut left = most;
    let reading = async {
        while let Some(chunk) = chunks.next().await {
            let Ok(chunk) = chunk else { return false };
            left = left.saturating_sub(chunk.len() as u64);
            if left == 0 {
                return false;
            }
        }
        true
    };
    tokio::time::timeout(DRAIN_TIME, reading).await.unwrap_or(false)
}

/// Where a lent body comes back to.
#[derive(Clone, Debug, Default)]
struct Unread(Arc<Mutex<Option<Body>>>);

impl Unread {
    fn lock(&self) -> MutexGuard<'_, Option<Body>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A body that goes back when its reader lets go of it before its end.
#[derive(Debug)]
struct Lent {
    body: Body,
    ended: bool,
    back: Unread,
}

impl HttpBody for Lent {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let polled = Pin::new(&mut self.body).poll_frame(cx);
        self.ended = !matches!(&polled, Poll::Pending | Poll::Ready(Some(Ok(_))));
        polled
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        if !self.ended && !self.body.is_end_stream() {
            *self.back.lock() = Some(std::mem::take(&mut self.body));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::Router;
    use axum::middleware::{Next, from_fn};
    use axum::routing::post;
    use futures::stream;
    use tower::ServiceExt;

    /// What is said of the connection after 8 bytes in two parts, or a part and
    /// silence, of which the handler reads the first part or nothing.
    async fn said(reads: bool, silence: bool, most: u64, expects: bool) -> Option<HeaderValue> {
        let handler = move |body: Body| async move {
            if reads {
                body.into_data_stream().next().await.unwrap().unwrap();
            }
        };
        let lend = from_fn(move |request: Request, next: Next| async move {
            let (lending, request) = Lending::of(request);
            lending.settle(next.run(request).await, most).await
        });
        let router = Router::new().route("/", post(handler)).layer(lend);
        let first = stream::iter([Ok::<_, axum::Error>(Bytes::from_static(b"four"))]);
        let rest = if silence {
            stream::pending().boxed()
        } else {
            stream::iter([Ok(Bytes::from_static(b"more"))]).boxed()
        };
        let mut request = Request::post("/").body(Body::from_stream(first.chain(rest))).unwrap();
        if expects {
            request.headers_mut().insert(header::EXPECT, HeaderValue::from_static("100-continue"));
        }
        let response = router.oneshot(request).await.unwrap();
        response.headers().get(header::CONNECTION).cloned()
    }

    #[tokio::test(start_paused = true)]
    async fn a_body_is_read_to_its_end_or_the_connection_said_to_close() {
        for reads in [false, true] {
            assert_eq!(said(reads, false, 100, false).await, None);
            assert!(said(reads, false, 3, false).await.is_some(), "too much");
            assert!(said(reads, true, 100, false).await.is_some(), "too late");
            assert!(said(reads, false, 100, true).await.is_some(), "not awaited");
        }
    }
}
