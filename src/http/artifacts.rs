use std::ops::Range;
use std::sync::Arc;

use axum::body::Body;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::{Json, extract::rejection::PathRejection};
use axum_extra::headers::{ETag, HeaderMapExt, IfRange};

use super::Api;
use super::conditional::{is_known, is_unwanted};
use super::openapi::problem_responses;
use super::problem::{
    PRECONDITION_FAILED, Problem, RANGE_NOT_SATISFIABLE, UNAVAILABLE, UNKNOWN_ARTIFACT,
    UNKNOWN_RECONSTRUCTION,
};
use super::range::{Selection, select};
use super::reconstructions::{Id, JobProblems, version_of};
use super::representation::{ArtifactList, ArtifactSummary};
use crate::artifacts::{ByteError, Key};
use crate::jobs::{ArtifactEntry, Job, JobId};

problem_responses! {
    ArtifactProblems: UNKNOWN_RECONSTRUCTION, UNKNOWN_ARTIFACT, PRECONDITION_FAILED,
        RANGE_NOT_SATISFIABLE, UNAVAILABLE
}

/// List the results of a reconstruction.
#[utoipa::path(
    get,
    path = "/v1/reconstructions/{id}/artifacts",
    operation_id = "artifacts",
    tag = "artifacts",
    params(("id" = String, Path, format = "uuid", description = "The reconstruction")),
    responses(
        (status = 200, description = "In order of publication; empty until it has succeeded",
         body = ArtifactList, headers(("ETag" = String))),
        (status = 304, description = "As in If-None-Match"),
        JobProblems,
    )
)]
pub async fn list(
    State(api): State<Arc<Api>>,
    Id(id): Id,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let job = api.state.store.get(id).await?;
    let etag = version_of(&job);
    let mut response = if is_known(&headers, &etag) {
        StatusCode::NOT_MODIFIED.into_response()
    } else {
        let artifacts = job.artifacts.iter().map(|entry| ArtifactSummary::of(id, entry)).collect();
        Json(ArtifactList { artifacts }).into_response()
    };
    response.headers_mut().typed_insert(etag);
    Ok(response)
}

/// Get a result's bytes.
///
/// They never change: the ETag is the content's SHA-256. Takes byte ranges, If-Match,
/// If-None-Match and If-Range.
#[utoipa::path(
    method(get, head),
    path = "/v1/reconstructions/{id}/artifacts/{*name}",
    operation_id = "artifact",
    tag = "artifacts",
    params(
        ("id" = String, Path, format = "uuid", description = "The reconstruction"),
        ("name" = String, Path, description = "Name from the list; may have slashes",
         example = "views/45/disparity.png"),
        ("Range" = Option<String>, Header, description = "One byte range", example = "bytes=0-1023"),
    ),
    responses(
        (status = 200, description = "The bytes, in the media type of the list", body = Vec<u8>,
         content_type = "application/octet-stream",
         headers(("ETag" = String), ("Accept-Ranges" = String), ("Content-Disposition" = String))),
        (status = 206, description = "The bytes of the range", body = Vec<u8>,
         content_type = "application/octet-stream", headers(("Content-Range" = String))),
        (status = 304, description = "As in If-None-Match"),
        ArtifactProblems,
    )
)]
pub async fn artifact(
    State(api): State<Arc<Api>>,
    path: Result<Path<(String, String)>, PathRejection>,
    method: Method,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let Path((id, name)) =
        path.map_err(|error| Problem::new(UNKNOWN_ARTIFACT, error.body_text()))?;
    let id = Id::parse(&id)?;
    let job = api.state.store.get(id).await?;
    serve(&api, &job, &name, &method, &headers).await
}

/// Get the quality metrics.
///
/// The artifact `metrics.json`.
#[utoipa::path(
    method(get, head),
    path = "/v1/reconstructions/{id}/metrics",
    operation_id = "metrics",
    tag = "artifacts",
    params(("id" = String, Path, format = "uuid", description = "The reconstruction")),
    responses(
        (status = 200, description = "The metrics", body = Object, headers(("ETag" = String))),
        (status = 304, description = "As in If-None-Match"),
        ArtifactProblems,
    )
)]
pub async fn metrics(
    State(api): State<Arc<Api>>,
    Id(id): Id,
    method: Method,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let job = api.state.store.get(id).await?;
    serve(&api, &job, "metrics.json", &method, &headers).await
}

async fn serve(
    api: &Api,
    job: &Job,
    name: &str,
    method: &Method,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let entry = find(job, name)?;
    let etag: ETag = format!("\"{}\"", entry.sha256)
        .parse()
        .map_err(|_| Problem::internal("artifact", &"stored hash makes no ETag"))?;
    if is_unwanted(headers, &etag) {
        let detail = format!("`{name}` has the ETag {}", entry.sha256);
        return Err(Problem::new(PRECONDITION_FAILED, detail));
    }
    let mut response = if is_known(headers, &etag) {
        StatusCode::NOT_MODIFIED.into_response()
    } else if method == Method::HEAD {
        content_response(entry, 0..entry.bytes, Body::empty())
    } else {
        content(api, job, entry, requested(entry, &etag, headers)?).await?
    };
    let headers = response.headers_mut();
    headers.typed_insert(etag);
    let cache = HeaderValue::from_static("private, max-age=31536000, immutable");
    headers.insert(header::CACHE_CONTROL, cache);
    Ok(response)
}

fn find<'j>(job: &'j Job, name: &str) -> Result<&'j ArtifactEntry, Problem> {
    job.artifacts.iter().find(|entry| entry.name == name).ok_or_else(|| {
        let detail = if job.state.is_final() {
            format!("reconstruction {} has no artifact `{name}`; see its list", job.id)
        } else {
            format!("reconstruction {} is not finished, so it has no `{name}` yet", job.id)
        };
        Problem::new(UNKNOWN_ARTIFACT, detail)
    })
}

/// The bytes that the client asks for.
fn requested(
    entry: &ArtifactEntry,
    etag: &ETag,
    headers: &HeaderMap,
) -> Result<Range<u64>, Problem> {
    let whole = 0..entry.bytes;
    let outdated = headers.contains_key(header::IF_RANGE)
        && headers.typed_get::<IfRange>().is_none_or(|have| have.is_modified(Some(etag), None));
    let range = headers.get(header::RANGE).and_then(|value| value.to_str().ok());
    match range.filter(|_| !outdated).map(|range| select(range, entry.bytes)) {
        None | Some(Selection::Whole) => Ok(whole),
        Some(Selection::Part(part)) => Ok(part),
        Some(Selection::Unsatisfiable) => {
            let detail =
                format!("`{}` has {} bytes; ask for some of them", entry.name, entry.bytes);
            let content_range = HeaderValue::from_str(&format!("bytes */{}", entry.bytes));
            let content_range = content_range.unwrap_or(HeaderValue::from_static("bytes */*"));
            Err(Problem::new(RANGE_NOT_SATISFIABLE, detail)
                .header(header::CONTENT_RANGE, content_range))
        }
    }
}

async fn content(
    api: &Api,
    job: &Job,
    entry: &ArtifactEntry,
    range: Range<u64>,
) -> Result<Response, Problem> {
    if range.is_empty() {
        return Ok(content_response(entry, range, Body::empty()));
    }
    let key = Key::Artifact { job: job.id, attempt: job.attempt, name: &entry.name };
    let found = api.state.bytes.stream(&key, Some(range.clone())).await;
    let found = found.map_err(|error| missing(job.id, &entry.name, &error))?;
    Ok(content_response(entry, range, Body::from_stream(found.chunks)))
}

fn missing(id: JobId, name: &str, error: &ByteError) -> Problem {
    match error {
        ByteError::NotFound(_) => {
            tracing::error!(%id, name, "bytes of a published artifact are missing");
            let detail = format!("the bytes of `{name}` are gone; was {id} deleted just now?");
            Problem::new(UNKNOWN_ARTIFACT, detail)
        }
        other => Problem::unavailable("byte store", other),
    }
}

fn content_response(entry: &ArtifactEntry, range: Range<u64>, body: Body) -> Response {
    let is_part = range != (0..entry.bytes);
    let mut response = Response::new(body);
    let headers = response.headers_mut();
    let mut set = |name: HeaderName, value: &str| {
        if let Ok(value) = HeaderValue::from_str(value) {
            headers.insert(name, value);
        }
    };
    set(header::CONTENT_TYPE, &entry.media_type);
    set(header::CONTENT_LENGTH, &(range.end - range.start).to_string());
    set(header::ACCEPT_RANGES, "bytes");
    set(header::CONTENT_DISPOSITION, &disposition(entry));
    if is_part {
        let last = range.end - 1;
        set(header::CONTENT_RANGE, &format!("bytes {}-{last}/{}", range.start, entry.bytes));
        *response.status_mut() = StatusCode::PARTIAL_CONTENT;
    }
    response
}

/// Pictures and JSON are shown, the rest is saved; the name on disk is the
/// artifact's with its folders joined by dashes.
fn disposition(entry: &ArtifactEntry) -> String {
    let is_shown =
        entry.media_type.starts_with("image/png") || entry.media_type == "application/json";
    let kind = if is_shown { "inline" } else { "attachment" };
    let name: String = entry
        .name
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() || ".-_".contains(c) { c } else { '-' })
        .collect();
    format!("{kind}; filename=\"{name}\"")
}
