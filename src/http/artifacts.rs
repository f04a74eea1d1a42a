//! Lists a job's artifacts and serves their bytes, whole or by range.

use std::ops::Range;
use std::sync::Arc;

use axum::body::Body;
use axum::extract::rejection::PathRejection;
use axum::extract::{FromRequestParts, Path};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum_extra::headers::{ETag, HeaderMapExt, IfRange};
use bytes::Bytes;
use futures::TryStreamExt;
use jiff::Timestamp;

use super::Api;
use super::access::Caller;
use super::conditional::{is_known, is_unwanted};
use super::files::MAX_FILE_BYTES;
use super::problem::{PRECONDITION_FAILED, Problem, RANGE_NOT_SATISFIABLE, UNKNOWN_ARTIFACT};
use super::range::{Selection, select};
use super::redirects::stays_here;
use super::representation::{ArtifactList, ArtifactSummary};
use super::resource::{Id, OwnedId, Resource, find, noun_of, status, unless_known};
use jobs::bytes::{ByteError, ByteStore, Home, Key, ResponseHeaders};
use jobs::{ArtifactEntry, Job, JobId};

/// Of all artifacts: they never change.
const CACHE_CONTROL: &str = "private, max-age=31536000, immutable";

/// What downloads need of a job.
#[derive(Clone)]
pub(super) struct Published {
    pub id: JobId,
    /// What jobs of its kind are called.
    pub noun: &'static str,
    pub is_final: bool,
    pub attempt: u32,
    /// Where its bytes lie.
    pub home: Home,
    /// What people call it.
    pub name: Option<String>,
    pub artifacts: Vec<ArtifactEntry>,
}

impl Published {
    pub(super) fn of(job: &Job) -> Self {
        Self {
            id: job.id,
            noun: noun_of(&job.kind).unwrap_or("job"),
            is_final: job.state.is_final(),
            attempt: job.attempt,
            home: job.home(),
            name: job.tags.name.clone(),
            artifacts: job.artifacts.clone(),
        }
    }

    /// About what it takes in memory, bytes.
    pub(super) fn size(&self) -> usize {
        let of = |entry: &ArtifactEntry| {
            size_of_val(entry) + entry.name.len() + entry.media_type.len() + entry.sha256.len()
        };
        let name = self.name.as_ref().map_or(0, String::len);
        size_of_val(self) + name + self.artifacts.iter().map(of).sum::<usize>()
    }
}

/// Id and artifact name in a path.
pub(super) struct IdAndName {
    path: Result<Path<(String, String)>, PathRejection>,
    caller: Arc<Caller>,
}

impl<S: Send + Sync> FromRequestParts<S> for IdAndName {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let caller = Caller::of(parts)?;
        let path = Result::<Path<_>, _>::from_request_parts(parts, state).await;
        Ok(Self { path: path.unwrap_or_else(|never| match never {}), caller })
    }
}

/// Answers what there is of a job.
pub(super) async fn list<R: Resource>(
    api: &Api,
    asked: OwnedId,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let job = find::<R>(api, &asked).await?;
    let summary = |entry| ArtifactSummary::of::<R>(job.id, entry);
    let artifacts = || ArtifactList { artifacts: job.artifacts.iter().map(summary).collect() };
    Ok(unless_known(headers, &job, artifacts))
}

/// Answers the bytes of the artifact that the path names.
pub(super) async fn named<R: Resource>(
    api: &Api,
    path: IdAndName,
    method: &Method,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let IdAndName { path, caller } = path;
    let Path((id, name)) =
        path.map_err(|error| Problem::new(UNKNOWN_ARTIFACT, error.body_text()))?;
    let asked = OwnedId { id: Id::<R>::parse(&id)?, caller };
    let status = status::<R>(api, &asked).await?;
    serve(api, &status.published, &name, method, headers, None).await
}

/// Answers an artifact's bytes, or the range of them that the client asks for; or where
/// the bucket has them.
///
/// * `ends`: when what the client came with ends, if it does.
pub(super) async fn serve(
    api: &Api,
    job: &Published,
    name: &str,
    method: &Method,
    headers: &HeaderMap,
    ends: Option<Timestamp>,
) -> Result<Response, Problem> {
    let entry = entry(job, name).map_err(|detail| Problem::new(UNKNOWN_ARTIFACT, detail))?;
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
        content_response(job, entry, 0..entry.bytes, Body::empty())
    } else {
        let range = requested(entry, &etag, headers)?;
        if let Some(redirects) = &api.state.redirects
            && entry.bytes > MAX_FILE_BYTES
            && !stays_here(headers)
        {
            let told = ResponseHeaders {
                media_type: &entry.media_type,
                disposition: &disposition(job, entry),
                cache_control: CACHE_CONTROL,
            };
            return redirects.to(&job.home, &key_of(job, entry), ends, &told).await;
        }
        content(api, job, entry, range).await?
    };
    let headers = response.headers_mut();
    headers.typed_insert(etag);
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static(CACHE_CONTROL));
    Ok(response)
}

fn key_of<'e>(job: &Published, entry: &'e ArtifactEntry) -> Key<'e> {
    Key::Artifact { job: job.id, attempt: job.attempt, name: &entry.name }
}

/// The job's artifact of this name, or why there is none.
pub(super) fn entry<'j>(job: &'j Published, name: &str) -> Result<&'j ArtifactEntry, String> {
    job.artifacts.iter().find(|entry| entry.name == name).ok_or_else(|| {
        let (noun, id) = (job.noun, job.id);
        if job.is_final {
            format!("{noun} {id} has no artifact `{name}`; see its list")
        } else {
            format!("{noun} {id} is not finished, so it has no `{name}` yet")
        }
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
    job: &Published,
    entry: &ArtifactEntry,
    range: Range<u64>,
) -> Result<Response, Problem> {
    if range.is_empty() {
        return Ok(content_response(job, entry, range, Body::empty()));
    }
    let key = key_of(job, entry);
    let store = api.state.bytes.of(&job.home);
    let gone = |error| missing(job.id, &entry.name, &error);
    if entry.bytes <= MAX_FILE_BYTES {
        let name = (job.id, job.attempt, entry.name.clone());
        let bytes = match api.files.get(&name) {
            Some(bytes) => bytes,
            None => {
                let bytes = whole(&store, &key).await.map_err(gone)?;
                api.files.keep(name, bytes.clone());
                bytes
            }
        };
        // As long as it is listed to be, unless somebody wrote over it.
        if let (Ok(start), Ok(end)) = (usize::try_from(range.start), usize::try_from(range.end))
            && end <= bytes.len()
        {
            return Ok(content_response(job, entry, range, Body::from(bytes.slice(start..end))));
        }
    }
    let part = (range != (0..entry.bytes)).then(|| range.clone());
    let found = store.stream(&key, part).await.map_err(gone)?;
    Ok(content_response(job, entry, range, Body::from_stream(found.chunks)))
}

/// All of a small artifact: a file is opened and read in one go.
async fn whole(store: &ByteStore, key: &Key<'_>) -> Result<Bytes, ByteError> {
    let mut chunks: Vec<Bytes> = store.stream(key, None).await?.chunks.try_collect().await?;
    if chunks.len() == 1 { Ok(chunks.remove(0)) } else { Ok(chunks.concat().into()) }
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

fn content_response(
    job: &Published,
    entry: &ArtifactEntry,
    range: Range<u64>,
    body: Body,
) -> Response {
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
    set(header::CONTENT_DISPOSITION, &disposition(job, entry));
    if is_part {
        let last = range.end - 1;
        set(header::CONTENT_RANGE, &format!("bytes {}-{last}/{}", range.start, entry.bytes));
        *response.status_mut() = StatusCode::PARTIAL_CONTENT;
    }
    response
}

/// Pictures and JSON are shown, the rest is saved. The name on disk says whose it
/// is: the job's name, or what it is and the end of its id; then the artifact's
/// with its folders joined by dashes.
fn disposition(job: &Published, entry: &ArtifactEntry) -> String {
    let is_shown =
        entry.media_type.starts_with("image/png") || entry.media_type == "application/json";
    let kind = if is_shown { "inline" } else { "attachment" };
    let id = job.id.to_string();
    let own = || format!("{}-{}", job.noun, &id[id.len() - 8..]);
    let whose = job.name.clone().filter(|name| !name.trim().is_empty()).unwrap_or_else(own);
    let name = format!("{}-{}", whose.trim(), entry.name);
    // What file systems and the header take.
    let plain = |c: char| if c.is_alphanumeric() || ".-_".contains(c) { c } else { '-' };
    let name: String = name.chars().map(plain).collect();
    let ascii: String = name.chars().map(|c| if c.is_ascii() { c } else { '-' }).collect();
    if ascii == name {
        return format!("{kind}; filename=\"{name}\"");
    }
    // RFC 6266: the second is for those who understand it.
    let encoded: String = name
        .bytes()
        .map(|byte| match byte {
            b'.' | b'-' | b'_' => char::from(byte).to_string(),
            _ if byte.is_ascii_alphanumeric() => char::from(byte).to_string(),
            _ => format!("%{byte:02X}"),
        })
        .collect();
    format!("{kind}; filename=\"{ascii}\"; filename*=UTF-8''{encoded}")
}
