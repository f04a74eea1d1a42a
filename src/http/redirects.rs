//! Large artifacts that the bucket sends itself: the service checks the request and answers
//! with a signed URL, so that no byte of them goes through a node.

use std::time::Duration;

use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use jiff::Timestamp;

use super::conditional::prefers_no_redirect;
use super::problem::Problem;
use jobs::bytes::{ByteError, Home, Key, ResponseHeaders, UrlSigner};

/// How downloads are redirected to the bucket.
#[derive(Clone, Debug)]
pub struct Redirects {
    signer: UrlSigner,
    lifetime: Duration,
}

impl Redirects {
    /// * `lifetime`: for how long each URL works, whole seconds.
    pub fn new(signer: UrlSigner, lifetime: Duration) -> Self {
        Self { signer, lifetime }
    }

    /// Sends the client to what is stored under `key`.
    ///
    /// * `ends`: when what the client came with ends; the URL does not outlive it.
    pub(super) async fn to(
        &self,
        home: &Home,
        key: &Key<'_>,
        ends: Option<Timestamp>,
        headers: &ResponseHeaders<'_>,
    ) -> Result<Response, Problem> {
        let left = ends.map(|ends| ends.duration_since(Timestamp::now()).as_secs());
        let left = left.map(|seconds| Duration::from_secs(seconds.max(1).unsigned_abs()));
        let lifetime = left.map_or(self.lifetime, |left| left.min(self.lifetime));
        let failed = |error: ByteError| Problem::unavailable("byte store", &error);
        let url = self.signer.url(home, key, lifetime, headers).await.map_err(failed)?;
        let location =
            HeaderValue::from_str(&url).map_err(|error| Problem::internal("signed URL", &error))?;
        // Each request is checked anew: a key may be revoked while a URL works.
        let cache = HeaderValue::from_static("private, no-store");
        let headers = [(header::LOCATION, location), (header::CACHE_CONTROL, cache)];
        Ok((StatusCode::TEMPORARY_REDIRECT, headers).into_response())
    }
}

/// Whether the bucket could not answer as the service would, or not to this client:
///
/// * scripts of web pages, for which the bucket had to allow their origin;
/// * `If-Match` and `If-Range`: the bucket has other ETags than the service;
/// * those who say so.
pub(super) fn stays_here(headers: &HeaderMap) -> bool {
    [header::ORIGIN, header::IF_MATCH, header::IF_RANGE]
        .iter()
        .any(|name| headers.contains_key(name))
        || prefers_no_redirect(headers)
}
