use std::sync::Arc;

use axum::Json;
use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::extract::{FromRequestParts, Path, Query, Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum_extra::headers::{ETag, HeaderMapExt};
use serde::Deserialize;
use utoipa::IntoParams;

use super::Api;
use super::conditional::{PREFERENCE_APPLIED, is_known, preferred_wait};
use super::openapi::problem_responses;
use super::problem::*;
use super::representation::{Reconstruction, ReconstructionList, State as JobStateName, path_of};
use super::upload;
use super::wait::wait_until;
use crate::jobs::{Job, JobId, ListQuery};
use crate::sheet::RECONSTRUCTION;

const DEFAULT_LIMIT: u32 = 20;
const MAX_LIMIT: u32 = 100;
/// After how many seconds a client that polls should look again.
const RETRY_AFTER: HeaderValue = HeaderValue::from_static("1");

problem_responses! {
    UploadProblems: UNSUPPORTED_MEDIA_TYPE, MALFORMED_MULTIPART, INVALID_PART_NAME, INVALID_JSON,
        BODY_TOO_LARGE, PART_TOO_LARGE, TOO_MANY_PIXELS, TOO_MANY_VIEWS, TOO_FEW_VIEWS,
        MISSING_PART, UNKNOWN_PART, DUPLICATE_PART, CONFLICTING_PARTS, MISSING_FILE,
        DUPLICATE_AZIMUTH, INVALID_ANGLE, DIFFERING_SIZES, EMPTY_FILE, NOT_AN_IMAGE, DAMAGED_IMAGE,
        INVALID_SHEET, INVALID_TRUTH, UNKNOWN_OPTION, INVALID_OPTION, UNKNOWN_SOURCE, REQUEST_TIMEOUT,
        BUSY, UNAVAILABLE
}
problem_responses! { pub JobProblems: UNKNOWN_RECONSTRUCTION, UNAVAILABLE }
problem_responses! { ListProblems: INVALID_QUERY, UNAVAILABLE }
problem_responses! { CancelProblems: UNKNOWN_RECONSTRUCTION, ALREADY_FINISHED, UNAVAILABLE }
problem_responses! { DeleteProblems: UNKNOWN_RECONSTRUCTION, STILL_RUNNING, UNAVAILABLE }

/// A reconstruction's id in the path. What is no id names no reconstruction.
pub struct Id(pub JobId);

impl Id {
    pub fn parse(text: &str) -> Result<JobId, Problem> {
        text.parse().map_err(|_| {
            let detail = format!("there is no reconstruction `{text}`; ids are UUIDs");
            Problem::new(UNKNOWN_RECONSTRUCTION, detail)
        })
    }
}

impl<S: Send + Sync> FromRequestParts<S> for Id {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let id: Result<Path<String>, PathRejection> = Path::from_request_parts(parts, state).await;
        let Path(id) =
            id.map_err(|error| Problem::new(UNKNOWN_RECONSTRUCTION, error.body_text()))?;
        Self::parse(&id).map(Self)
    }
}

/// Which reconstructions to list.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct ListParameters {
    /// Only those in this state.
    state: Option<JobStateName>,
    /// At most this many.
    #[param(minimum = 1, maximum = 100, default = 20)]
    limit: Option<u32>,
    /// Where to go on: from the last answer's `next`.
    cursor: Option<String>,
}

/// Upload a sheet and have it reconstructed.
///
/// Answers once the job and its drawings are durable. Follow `Location`.
#[utoipa::path(
    post,
    path = "/v1/reconstructions",
    operation_id = "create",
    tag = "reconstructions",
    request_body(content = ref("#/components/schemas/Upload"), content_type = "multipart/form-data"),
    responses(
        (status = 202, description = "Queued", body = Reconstruction,
         headers(("Location" = String), ("Retry-After" = u32))),
        UploadProblems,
    )
)]
pub async fn create(State(api): State<Arc<Api>>, request: Request) -> Result<Response, Problem> {
    let job = upload::receive(&api, request).await?;
    tracing::info!(id = %job.id, "reconstruction queued");
    let mut response = (StatusCode::ACCEPTED, Json(Reconstruction::from(&job))).into_response();
    let location = HeaderValue::from_str(&path_of(job.id))
        .map_err(|error| Problem::internal("location", &error))?;
    response.headers_mut().insert(header::LOCATION, location);
    response.headers_mut().insert(header::RETRY_AFTER, RETRY_AFTER);
    Ok(response)
}

/// List reconstructions, newest first.
#[utoipa::path(
    get,
    path = "/v1/reconstructions",
    operation_id = "list",
    tag = "reconstructions",
    params(ListParameters),
    responses(
        (status = 200, description = "Part of the list", body = ReconstructionList,
         headers(("Link" = String, description = "The next part, as rel=next"))),
        ListProblems,
    )
)]
pub async fn list(
    State(api): State<Arc<Api>>,
    query: Result<Query<ListParameters>, QueryRejection>,
) -> Result<Response, Problem> {
    let Query(parameters) =
        query.map_err(|error| Problem::new(INVALID_QUERY, error.body_text()))?;
    let limit = parameters.limit.unwrap_or(DEFAULT_LIMIT);
    if !(1..=MAX_LIMIT).contains(&limit) {
        let detail = format!("`limit` is {limit}; give 1 to {MAX_LIMIT}");
        return Err(Problem::new(INVALID_QUERY, detail).parameter("limit"));
    }
    let before = parameters.cursor.as_deref().map(cursor).transpose()?;
    let state = parameters.state.map(Into::into);
    let query = ListQuery { kind: Some(RECONSTRUCTION.to_owned()), state, before, limit };
    let page = api.state.store.list(&query).await?;
    let next = page.next.map(|id| next_uri(parameters.state, limit, id));
    let link = next
        .as_ref()
        .and_then(|next| HeaderValue::from_str(&format!("<{next}>; rel=\"next\"")).ok());
    let reconstructions = page.jobs.iter().map(Reconstruction::from).collect();
    let mut response = Json(ReconstructionList { reconstructions, next }).into_response();
    if let Some(link) = link {
        response.headers_mut().insert(header::LINK, link);
    }
    Ok(response)
}

fn cursor(text: &str) -> Result<JobId, Problem> {
    text.parse().map_err(|_| {
        let detail = "`cursor` must come from the `next` of an earlier answer";
        Problem::new(INVALID_QUERY, detail).parameter("cursor")
    })
}

fn next_uri(state: Option<JobStateName>, limit: u32, cursor: JobId) -> String {
    let state = state.and_then(|state| serde_json::to_value(state).ok());
    let state = state.as_ref().and_then(|state| state.as_str());
    let state = state.map(|state| format!("state={state}&")).unwrap_or_default();
    format!("/v1/reconstructions?{state}limit={limit}&cursor={cursor}")
}

/// Get a reconstruction.
///
/// With `Prefer: wait=N` the answer comes when it has finished or, beside
/// `If-None-Match`, when it has changed; at the latest after N seconds.
#[utoipa::path(
    get,
    path = "/v1/reconstructions/{id}",
    operation_id = "get",
    tag = "reconstructions",
    params(
        ("id" = String, Path, format = "uuid", description = "The reconstruction"),
        ("If-None-Match" = Option<String>, Header, description = "ETag of the version known"),
        ("Prefer" = Option<String>, Header, description = "How many seconds to wait, up to 60",
         example = "wait=10"),
    ),
    responses(
        (status = 200, description = "As it is now", body = Reconstruction,
         headers(("ETag" = String), ("Retry-After" = u32), ("Preference-Applied" = String))),
        (status = 304, description = "As in If-None-Match"),
        JobProblems,
    )
)]
pub async fn get(
    State(api): State<Arc<Api>>,
    Id(id): Id,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let wait = preferred_wait(&headers);
    let is_conditional = headers.contains_key(header::IF_NONE_MATCH);
    let is_reached = |job: &Job| {
        job.state.is_final() || (is_conditional && !is_known(&headers, &version_of(job)))
    };
    let job = match wait {
        Some(wait) => wait_until(&api, id, wait, is_reached).await?,
        None => api.state.store.get(id).await?,
    };
    let etag = version_of(&job);
    let mut response = if is_known(&headers, &etag) {
        StatusCode::NOT_MODIFIED.into_response()
    } else {
        Json(Reconstruction::from(&job)).into_response()
    };
    let answer = response.headers_mut();
    answer.typed_insert(etag);
    answer.insert(header::CACHE_CONTROL, HeaderValue::from_static("private, no-cache"));
    if !job.state.is_final() {
        answer.insert(header::RETRY_AFTER, RETRY_AFTER);
    }
    if let Some(applied) = wait.and_then(|wait| applied(wait.as_secs())) {
        answer.insert(PREFERENCE_APPLIED, applied);
    }
    Ok(response)
}

fn applied(seconds: u64) -> Option<HeaderValue> {
    HeaderValue::from_str(&format!("wait={seconds}")).ok()
}

/// The ETag of a job's representation; weak, because it may be compressed.
pub fn version_of(job: &Job) -> ETag {
    let etag = format!("W/\"{}\"", job.version).parse();
    etag.expect("a number in quotes is an ETag")
}

/// Cancel a reconstruction.
///
/// One that is queued is cancelled at once; one that runs stops within a second.
#[utoipa::path(
    post,
    path = "/v1/reconstructions/{id}/cancel",
    operation_id = "cancel",
    tag = "reconstructions",
    params(("id" = String, Path, format = "uuid", description = "The reconstruction")),
    responses(
        (status = 200, description = "Cancelled", body = Reconstruction),
        (status = 202, description = "Will stop soon", body = Reconstruction),
        CancelProblems,
    )
)]
pub async fn cancel(State(api): State<Arc<Api>>, Id(id): Id) -> Result<Response, Problem> {
    let job = api.state.store.request_cancel(id).await?;
    let status = if job.state.is_final() { StatusCode::OK } else { StatusCode::ACCEPTED };
    Ok((status, Json(Reconstruction::from(&job))).into_response())
}

/// Delete a reconstruction with its drawings and results.
#[utoipa::path(
    delete,
    path = "/v1/reconstructions/{id}",
    operation_id = "delete",
    tag = "reconstructions",
    params(("id" = String, Path, format = "uuid", description = "The reconstruction")),
    responses((status = 204, description = "Deleted"), DeleteProblems)
)]
pub async fn delete(State(api): State<Arc<Api>>, Id(id): Id) -> Result<StatusCode, Problem> {
    api.state.store.delete(id).await?;
    if let Err(error) = api.state.bytes.delete_job(id).await {
        // The row is gone; the collector of ownerless bytes takes the rest.
        tracing::warn!(%id, %error, "bytes of a deleted reconstruction stay for now");
    }
    Ok(StatusCode::NO_CONTENT)
}
