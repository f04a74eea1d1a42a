//! Links to single artifacts that work without a key, for a time.
//!
//! A link says when it ends; its signature covers that and the artifact, so that
//! nothing of it can be changed. It names a job that may be gone.

use std::sync::Arc;

use axum::Json;
use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, Method, StatusCode};
use axum::response::Response;
use hmac::{Hmac, KeyInit, Mac};
use jiff::{SignedDuration, Timestamp};
use serde::{Deserialize, Serialize};
use sha2::Sha256;
use utoipa::ToSchema;

use super::Api;
use super::artifacts::{self, Published};
use super::openapi::problem_responses;
use super::problem::{
    INVALID_BODY, INVALID_LINK, PRECONDITION_FAILED, Problem, RANGE_NOT_SATISFIABLE, UNAVAILABLE,
    UNKNOWN_ARTIFACT,
};
use super::resource::{OwnedId, Resource, find, path_of};
use jobs::{Job, JobId, StoreError};

const DEFAULT_SECONDS: u32 = 3600;
/// A month.
const MAX_SECONDS: u32 = 31 * 24 * 3600;

problem_responses! {
    LinkProblems: INVALID_LINK, UNKNOWN_ARTIFACT, PRECONDITION_FAILED, RANGE_NOT_SATISFIABLE,
        UNAVAILABLE
}

/// What links are signed with.
#[derive(Clone)]
pub struct LinkKey(Vec<u8>);

impl LinkKey {
    /// * `secret`: long and random; all links end when it changes.
    pub fn new(secret: &str) -> Self {
        Self(secret.trim().as_bytes().to_vec())
    }

    fn mac(&self, collection: &str, job: JobId, name: &str, expires: i64) -> Hmac<Sha256> {
        let mac = Hmac::<Sha256>::new_from_slice(&self.0);
        let mut mac = mac.expect("HMAC takes keys of any length");
        // Names have no line breaks, so that no two links run together.
        mac.update(format!("{collection}\n{job}\n{expires}\n{name}").as_bytes());
        mac
    }
}

/// A link to be made.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"artifact": "solid.glb", "expires_in": 86400}))]
pub(super) struct NewLink {
    /// Name of the artifact, as in the list.
    artifact: String,
    /// Seconds until the link ends, up to 31 days.
    #[schema(minimum = 1, maximum = 2_678_400, default = 3600)]
    #[serde(default = "default_seconds")]
    expires_in: u32,
}

fn default_seconds() -> u32 {
    DEFAULT_SECONDS
}

/// A link to one artifact that needs no key.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Link {
    /// Path and query, below the address of the service.
    #[schema(format = "uri-reference")]
    url: String,
    #[schema(value_type = String, format = DateTime)]
    expires_at: Timestamp,
}

/// What a link says beside its artifact.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Signed {
    expires: i64,
    signature: String,
}

/// Makes a link to an artifact of the job.
pub(super) async fn create<R: Resource>(
    api: &Api,
    asked: OwnedId,
    NewLink { artifact, expires_in }: NewLink,
) -> Result<(StatusCode, Json<Link>), Problem> {
    if !(1..=MAX_SECONDS).contains(&expires_in) {
        let detail = format!("`expires_in` is {expires_in}; give 1 to {MAX_SECONDS} seconds");
        return Err(Problem::new(INVALID_BODY, detail));
    }
    let job = find::<R>(api, &asked).await?;
    let published = Published::of(&job);
    let name = &artifacts::entry(&published, &artifact)
        .map_err(|detail| Problem::new(UNKNOWN_ARTIFACT, detail))?
        .name;
    let expires = (Timestamp::now() + SignedDuration::from_secs(expires_in.into())).as_second();
    let collection = R::PATH.trim_start_matches("/v1/");
    let mac = api.state.link_key.mac(collection, job.id, name, expires);
    let signature = hex::encode(mac.finalize().into_bytes());
    let url =
        format!("/links/{collection}/{}/{name}?expires={expires}&signature={signature}", job.id);
    let expires_at =
        Timestamp::from_second(expires).map_err(|error| Problem::internal("link", &error))?;
    Ok((StatusCode::CREATED, Json(Link { url, expires_at })))
}

/// Get the bytes of the artifact that a link is to.
///
/// Needs no key. Takes what the artifact itself takes.
#[utoipa::path(
    method(get, head),
    path = "/links/{collection}/{id}/{*name}",
    operation_id = "linked_artifact",
    tag = "artifacts",
    params(
        ("collection" = String, Path, description = "Kind of job", example = "reconstructions"),
        ("id" = String, Path, format = "uuid", description = "The job"),
        ("name" = String, Path, description = "Name of the artifact", example = "solid.glb"),
        ("expires" = i64, Query, description = "When the link ends, seconds since 1970"),
        ("signature" = String, Query, description = "Of the link as a whole"),
        ("Range" = Option<String>, Header, description = "One byte range", example = "bytes=0-1023"),
    ),
    responses(
        (status = 200, description = "The bytes", body = Vec<u8>,
         content_type = "application/octet-stream",
         headers(("ETag" = String), ("Accept-Ranges" = String), ("Content-Disposition" = String))),
        (status = 206, description = "The bytes of the range", body = Vec<u8>,
         content_type = "application/octet-stream", headers(("Content-Range" = String))),
        (status = 307, description = "Large ones, where the service lets its bucket send them (`download_redirects`): fetch `Location` without the key, soon; with `Prefer: no-redirect` the bytes come from here",
         headers(("Location" = String))),
        (status = 304, description = "As in If-None-Match"),
        LinkProblems,
    )
)]
pub(super) async fn follow(
    State(api): State<Arc<Api>>,
    path: Result<Path<(String, JobId, String)>, PathRejection>,
    signed: Result<Query<Signed>, QueryRejection>,
    method: Method,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let wrong =
        || Problem::new(INVALID_LINK, "the link has ended or is not whole; have a new one made");
    let Path((collection, id, name)) = path.map_err(|_| wrong())?;
    let Query(Signed { expires, signature }) = signed.map_err(|_| wrong())?;
    let mac = api.state.link_key.mac(&collection, id, &name, expires);
    let signature = hex::decode(signature).map_err(|_| wrong())?;
    // Compared in constant time.
    mac.verify_slice(&signature).map_err(|_| wrong())?;
    let ends = Timestamp::from_second(expires).map_err(|_| wrong())?;
    if ends <= Timestamp::now() {
        return Err(wrong());
    }
    let job = linked(&api, &collection, id).await?;
    artifacts::serve(&api, &Published::of(&job), &name, &method, &headers, Some(ends)).await
}

/// The job of a link, whosever it is: who made the link could read it.
async fn linked(api: &Api, collection: &str, id: JobId) -> Result<Job, Problem> {
    let gone = || {
        let detail = format!("what the link is to was deleted with its job {id}");
        Problem::new(UNKNOWN_ARTIFACT, detail)
    };
    let job = match api.state.store.get(id).await {
        Err(StoreError::NotFound(_)) => return Err(gone()),
        found => found?,
    };
    let is_of = path_of(&job.kind, id).is_some_and(|path| path == format!("/v1/{collection}/{id}"));
    if is_of { Ok(job) } else { Err(gone()) }
}
