//! What the kinds of jobs have in common as resources of the interface.

use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::sync::Arc;

use axum::Json;
use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::extract::{FromRequestParts, Path, Query};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum_extra::headers::{ETag, HeaderMapExt};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use utoipa::IntoParams;

use super::Api;
use super::access::Caller;
use super::conditional::{PREFERENCE_APPLIED, is_known, preferred_wait};
use super::problem::{INVALID_QUERY, Problem, ProblemType};
use super::reconstructions::Reconstructions;
use super::representation::State as JobStateName;
use super::sheets::Sheets;
use super::statuses::Status;
use super::tags::{Changes, pairs};
use super::wait::wait_until;
use jobs::{Job, JobId, ListQuery, StoreError};

const DEFAULT_LIMIT: u32 = 20;
const MAX_LIMIT: u32 = 100;
/// After how many seconds a client that polls should look again.
const RETRY_AFTER: HeaderValue = HeaderValue::from_static("1");
const JSON: HeaderValue = HeaderValue::from_static("application/json");

/// A kind of job, as clients see it.
pub(super) trait Resource: Send + Sync + 'static {
    /// The kind in the job store.
    const KIND: &'static str;
    /// Where the collection is.
    const PATH: &'static str;
    /// What messages call one of them.
    const NOUN: &'static str;
    /// The problem of an id that is of none of them.
    const UNKNOWN: ProblemType;
    /// How one of them is answered.
    type View: for<'j> From<&'j Job> + Serialize;

    /// The path of one of them.
    fn path(id: JobId) -> String {
        format!("{}/{id}", Self::PATH)
    }
}

/// What messages call jobs of this kind; `None` of a kind that is none of ours.
pub(crate) fn noun_of(kind: &str) -> Option<&'static str> {
    known(kind).map(|(noun, _)| noun)
}

/// The path of a job of this kind.
pub(crate) fn path_of(kind: &str, id: JobId) -> Option<String> {
    known(kind).map(|(_, path)| format!("{path}/{id}"))
}

fn known(kind: &str) -> Option<(&'static str, &'static str)> {
    match kind {
        Reconstructions::KIND => Some((Reconstructions::NOUN, Reconstructions::PATH)),
        Sheets::KIND => Some((Sheets::NOUN, Sheets::PATH)),
        _ => None,
    }
}

/// The id of an `R` in the path, and who asks for it. What is no id names none.
pub(super) struct Id<R>(pub OwnedId, PhantomData<R>);

/// A job that somebody asks for: only [`find`] tells whether it is theirs.
#[derive(Clone, Debug)]
pub(super) struct OwnedId {
    pub id: JobId,
    pub caller: Arc<Caller>,
}

impl<R: Resource> Id<R> {
    pub(super) fn parse(text: &str) -> Result<JobId, Problem> {
        text.parse().map_err(|_| {
            let detail = format!("there is no {} `{text}`; ids are UUIDs", R::NOUN);
            Problem::new(R::UNKNOWN, detail)
        })
    }
}

impl<R: Resource, S: Send + Sync> FromRequestParts<S> for Id<R> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let id: Result<Path<String>, PathRejection> = Path::from_request_parts(parts, state).await;
        let Path(id) = id.map_err(|error| Problem::new(R::UNKNOWN, error.body_text()))?;
        Ok(Self(OwnedId { id: Self::parse(&id)?, caller: Caller::of(parts)? }, PhantomData))
    }
}

/// Which jobs to list.
#[derive(Clone, Debug, Default, Deserialize, Serialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct ListParameters {
    /// Only those in this state.
    state: Option<JobStateName>,
    /// Only those that have all of these labels: `show:7,shot:12`.
    labels: Option<String>,
    /// Only those sent at this time or later (RFC 3339).
    #[param(value_type = Option<String>, format = DateTime)]
    created_from: Option<Timestamp>,
    /// Only those sent before this time.
    #[param(value_type = Option<String>, format = DateTime)]
    created_before: Option<Timestamp>,
    /// At most this many.
    #[param(minimum = 1, maximum = 100, default = 20)]
    limit: Option<u32>,
    /// Where to go on: from the last answer's `next`.
    #[param(value_type = Option<String>, format = Uuid)]
    cursor: Option<String>,
}

/// Which jobs to list, and whose.
pub(super) struct Listing {
    parameters: ListParameters,
    caller: Arc<Caller>,
}

impl<S: Send + Sync> FromRequestParts<S> for Listing {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        let query: Result<Query<ListParameters>, QueryRejection> = Query::try_from_uri(&parts.uri);
        let Query(parameters) =
            query.map_err(|error| Problem::new(INVALID_QUERY, error.body_text()))?;
        Ok(Self { parameters, caller: Caller::of(parts)? })
    }
}

/// The job that is asked for, if it is an `R` of the tenant that asks. Others
/// are told nothing, not even that it is there.
pub(super) async fn find<R: Resource>(api: &Api, asked: &OwnedId) -> Result<Job, Problem> {
    let job = api.state.store.get(asked.id).await.map_err(store_problem::<R>)?;
    let is_theirs = job.kind == R::KIND && job.tenant == asked.caller.tenant;
    if is_theirs { Ok(job) } else { Err(unknown::<R>(asked.id)) }
}

/// As [`find`], as it is answered.
pub(super) async fn status<R: Resource>(
    api: &Api,
    asked: &OwnedId,
) -> Result<Arc<Status>, Problem> {
    let status = api.statuses.get::<R>(&*api.state.store, asked.id).await?;
    if status.tenant == asked.caller.tenant { Ok(status) } else { Err(unknown::<R>(asked.id)) }
}

/// What is answered of a job that is not there, or not for who asks.
pub(super) fn unknown<R: Resource>(id: JobId) -> Problem {
    Problem::new(R::UNKNOWN, format!("there is no {} {id}", R::NOUN))
}

pub(super) fn store_problem<R: Resource>(error: StoreError) -> Problem {
    match error {
        StoreError::NotFound(id) => unknown::<R>(id),
        other => other.into(),
    }
}

/// The answer to an upload that has become a job.
pub(super) fn accepted<R: Resource>(job: &Job) -> Result<Response, Problem> {
    tracing::info!(id = %job.id, kind = job.kind, "queued");
    // One that was sent before is answered as it was then.
    let mut response =
        (StatusCode::ACCEPTED, Json(R::View::from(&job.as_enqueued()))).into_response();
    let location = HeaderValue::from_str(&R::path(job.id))
        .map_err(|error| Problem::internal("location", &error))?;
    response.headers_mut().insert(header::LOCATION, location);
    response.headers_mut().insert(header::RETRY_AFTER, RETRY_AFTER);
    Ok(response)
}

/// Answers part of the list, newest first.
///
/// * `body`: makes the document of the jobs and the URI of the next part.
pub(super) async fn list<R: Resource, B: Serialize>(
    api: &Api,
    Listing { parameters, caller }: Listing,
    body: impl FnOnce(Vec<R::View>, Option<String>) -> B,
) -> Result<Response, Problem> {
    let limit = limit_of(parameters.limit)?;
    let before = parameters.cursor.as_deref().map(cursor).transpose()?;
    let state = parameters.state.map(Into::into);
    let tenant = Some(caller.tenant.clone());
    let labels = parameters.labels.as_deref();
    let labels = labels.map_or_else(|| Ok(BTreeMap::new()), |it| pairs(it, INVALID_QUERY))?;
    let query = ListQuery {
        tenant,
        kind: Some(R::KIND.to_owned()),
        state,
        labels,
        created_from: parameters.created_from,
        created_before: parameters.created_before,
        before,
        limit,
    };
    let page = api.state.store.list(&query).await?;
    let next = page.next.map(|id| next_uri(R::PATH, &parameters, limit, id));
    let views = page.jobs.iter().map(R::View::from).collect();
    Ok(part_of_list(next, |next| body(views, next)))
}

/// Answers a part of a list, with a `Link` to the next one.
///
/// * `body`: makes the document with the URI of the next part.
pub(super) fn part_of_list<B: Serialize>(
    next: Option<String>,
    body: impl FnOnce(Option<String>) -> B,
) -> Response {
    let link = next
        .as_ref()
        .and_then(|next| HeaderValue::from_str(&format!("<{next}>; rel=\"next\"")).ok());
    let mut response = Json(body(next)).into_response();
    if let Some(link) = link {
        response.headers_mut().insert(header::LINK, link);
    }
    response
}

/// How many entries a part of a list has at most.
pub(super) fn limit_of(given: Option<u32>) -> Result<u32, Problem> {
    let limit = given.unwrap_or(DEFAULT_LIMIT);
    if (1..=MAX_LIMIT).contains(&limit) {
        return Ok(limit);
    }
    let detail = format!("`limit` is {limit}; give 1 to {MAX_LIMIT}");
    Err(Problem::new(INVALID_QUERY, detail).parameter("limit"))
}

/// Where a part of a list begins.
pub(super) fn cursor(text: &str) -> Result<JobId, Problem> {
    text.parse().map_err(|_| {
        let detail = "`cursor` must come from the `next` of an earlier answer";
        Problem::new(INVALID_QUERY, detail).parameter("cursor")
    })
}

/// The same list from `cursor` on.
///
/// * `parameters`: those that it was asked for with.
pub(super) fn next_uri(
    path: &str,
    parameters: &impl Serialize,
    limit: u32,
    cursor: JobId,
) -> String {
    let mut query = form_urlencoded::Serializer::new(String::new());
    let given = serde_json::to_value(parameters).unwrap_or_default();
    for (name, value) in given.as_object().into_iter().flatten() {
        if let Some(text) = value.as_str().filter(|_| name != "cursor") {
            query.append_pair(name, text);
        }
    }
    query.append_pair("limit", &limit.to_string()).append_pair("cursor", &cursor.to_string());
    format!("{path}?{}", query.finish())
}

/// Answers one job, at once or when it has changed or finished.
pub(super) async fn get<R: Resource>(
    api: &Api,
    asked: OwnedId,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let wait = preferred_wait(headers);
    let is_conditional = headers.contains_key(header::IF_NONE_MATCH);
    let is_reached =
        |status: &Status| status.is_final || (is_conditional && !is_known(headers, &status.etag));
    let status = match wait {
        Some(wait) => wait_until::<R>(api, &asked, wait, is_reached).await?,
        None => status::<R>(api, &asked).await?,
    };
    let mut response = if is_known(headers, &status.etag) {
        StatusCode::NOT_MODIFIED.into_response()
    } else {
        ([(header::CONTENT_TYPE, JSON)], status.body.clone()).into_response()
    };
    let answer = response.headers_mut();
    answer.typed_insert(status.etag.clone());
    answer.insert(header::CACHE_CONTROL, HeaderValue::from_static("private, no-cache"));
    if !status.is_final {
        answer.insert(header::RETRY_AFTER, RETRY_AFTER);
    }
    if let Some(applied) = wait.and_then(|wait| applied(wait.as_secs())) {
        answer.insert(PREFERENCE_APPLIED, applied);
    }
    Ok(response)
}

/// Answers what belongs to the job's version, unless the client has that version already.
pub(super) fn unless_known<B: Serialize>(
    headers: &HeaderMap,
    job: &Job,
    body: impl FnOnce() -> B,
) -> Response {
    let etag = version_of(job);
    let mut response = if is_known(headers, &etag) {
        StatusCode::NOT_MODIFIED.into_response()
    } else {
        Json(body()).into_response()
    };
    response.headers_mut().typed_insert(etag);
    response
}

fn applied(seconds: u64) -> Option<HeaderValue> {
    HeaderValue::from_str(&format!("wait={seconds}")).ok()
}

/// The ETag of a job's representation; weak, because it may be compressed.
pub(super) fn version_of(job: &Job) -> ETag {
    let etag = format!("W/\"{}\"", job.version).parse();
    etag.expect("a number in quotes is an ETag")
}

/// Asks for cancellation.
pub(super) async fn cancel<R: Resource>(api: &Api, asked: OwnedId) -> Result<Response, Problem> {
    let id = find::<R>(api, &asked).await?.id;
    let job = api.state.store.request_cancel(id).await.map_err(store_problem::<R>)?;
    let status = if job.state.is_final() { StatusCode::OK } else { StatusCode::ACCEPTED };
    Ok((status, Json(R::View::from(&job))).into_response())
}

/// Changes what people say of a job.
pub(super) async fn patch<R: Resource>(
    api: &Api,
    asked: OwnedId,
    changes: Changes,
) -> Result<Response, Problem> {
    let job = find::<R>(api, &asked).await?;
    let tags = changes.over(job.tags, Timestamp::now())?;
    let job = api.state.store.tag(job.id, &tags).await.map_err(store_problem::<R>)?;
    let mut response = Json(R::View::from(&job)).into_response();
    response.headers_mut().typed_insert(version_of(&job));
    Ok(response)
}

/// Deletes a job with its bytes; one that runs is cancelled, and goes when its
/// attempt has ended.
pub(super) async fn delete<R: Resource>(api: &Api, asked: OwnedId) -> Result<StatusCode, Problem> {
    let job = find::<R>(api, &asked).await?;
    let id = job.id;
    match api.state.store.delete(id).await {
        Err(StoreError::Running { .. }) => {
            if api.state.store.delete_when_ended(id).await.map_err(store_problem::<R>)? {
                return Ok(StatusCode::ACCEPTED);
            }
            // It ended meanwhile.
            api.state.store.delete(id).await.map_err(store_problem::<R>)?;
        }
        deleted => deleted.map_err(store_problem::<R>)?,
    }
    if let Err(error) = api.state.bytes.of(&job.home()).delete_job(id).await {
        // The row is gone; the collector of ownerless bytes takes the rest.
        tracing::warn!(%id, %error, "bytes of a deleted job stay for now");
    }
    Ok(StatusCode::NO_CONTENT)
}
