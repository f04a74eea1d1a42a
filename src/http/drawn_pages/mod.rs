//! The resource `/v1/pages`: pictures with several views on them, the figures
//! found there, and what clients put right before they have them reconstructed.

mod create;
mod cut;
mod document;
mod edit;
mod list;
mod replace;

use std::sync::Arc;

use axum::body::Body;
use axum::extract::rejection::PathRejection;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use axum_extra::headers::{ETag, HeaderMapExt};
use bytes::Bytes;
use serde_json::Value;

pub(super) use self::create::*;
pub(super) use self::document::PageContent;
use self::document::{PageView, figure_file, picture_file};
pub(super) use self::list::*;
pub(super) use self::replace::*;
use super::Api;
use super::access::Caller;
use super::body::Body as JsonBody;
use super::conditional::is_known;
use super::openapi::problem_responses;
use super::problem::*;
use super::tags::Changes;
use jiff::Timestamp;
use jobs::bytes::{ByteError, Key};
use jobs::{JobId, StoreError, StoredPage};

problem_responses! { PatchProblems: UNKNOWN_PAGE, INVALID_BODY, UNAVAILABLE }
problem_responses! { PageProblems: UNKNOWN_PAGE, UNAVAILABLE }

/// The id in a path. What is no id names no page.
type PageId = Result<Path<String>, PathRejection>;

fn parse(text: &str) -> Result<JobId, Problem> {
    text.parse().map_err(|_| {
        Problem::new(UNKNOWN_PAGE, format!("there is no page `{text}`; ids are UUIDs"))
    })
}

fn id_of(path: PageId) -> Result<JobId, Problem> {
    let Path(text) = path.map_err(|error| Problem::new(UNKNOWN_PAGE, error.body_text()))?;
    parse(&text)
}

/// The page, if it is the caller's tenant's; others are told nothing.
async fn find(api: &Api, caller: &Caller, id: JobId) -> Result<StoredPage, Problem> {
    let page = api.state.store.page(id).await.map_err(store_problem)?;
    if page.tenant == caller.tenant {
        Ok(page)
    } else {
        Err(store_problem(StoreError::NotFound(id)))
    }
}

fn store_problem(error: StoreError) -> Problem {
    match error {
        StoreError::NotFound(id) => Problem::new(UNKNOWN_PAGE, format!("there is no page {id}")),
        other => other.into(),
    }
}

/// Get a page.
///
/// Its figures, what was left out, and the sheet that the kept figures make.
#[utoipa::path(
    get,
    path = "/v1/pages/{id}",
    operation_id = "get_page",
    tag = "pages",
    params(
        ("id" = String, Path, format = "uuid", description = "The page"),
        ("If-None-Match" = Option<String>, Header, description = "ETag of the version known"),
    ),
    responses(
        (status = 200, description = "As it is now", body = PageView, headers(("ETag" = String))),
        (status = 304, description = "As in If-None-Match"),
        PageProblems,
    )
)]
pub(super) async fn get(
    State(api): State<Arc<Api>>,
    Extension(caller): Extension<Arc<Caller>>,
    id: PageId,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let stored = find(&api, &caller, id_of(id)?).await?;
    let etag = version_of(&stored);
    let mut response = if is_known(&headers, &etag) {
        let mut response = StatusCode::NOT_MODIFIED.into_response();
        response.headers_mut().typed_insert(etag);
        response
    } else {
        answer(&stored)?
    };
    response.headers_mut().insert(header::CACHE_CONTROL, NO_CACHE);
    Ok(response)
}

/// Change the name, labels and time to stay of a page.
#[utoipa::path(
    patch,
    path = "/v1/pages/{id}",
    operation_id = "patch_page",
    tag = "pages",
    params(("id" = String, Path, format = "uuid", description = "The page")),
    request_body = Changes,
    responses(
        (status = 200, description = "As it is now", body = PageView, headers(("ETag" = String))),
        PatchProblems,
    )
)]
pub(super) async fn patch(
    State(api): State<Arc<Api>>,
    Extension(caller): Extension<Arc<Caller>>,
    id: PageId,
    JsonBody(changes): JsonBody<Changes>,
) -> Result<Response, Problem> {
    let stored = find(&api, &caller, id_of(id)?).await?;
    let tags = changes.over(stored.tags, Timestamp::now())?;
    answer(&api.state.store.tag_page(stored.id, &tags).await.map_err(store_problem)?)
}

/// Delete a page with its pictures.
///
/// Reconstructions that were made of it keep their own copies.
#[utoipa::path(
    delete,
    path = "/v1/pages/{id}",
    operation_id = "delete_page",
    tag = "pages",
    params(("id" = String, Path, format = "uuid", description = "The page")),
    responses((status = 204, description = "Deleted"), PageProblems)
)]
pub(super) async fn delete(
    State(api): State<Arc<Api>>,
    Extension(caller): Extension<Arc<Caller>>,
    id: PageId,
) -> Result<StatusCode, Problem> {
    let page = find(&api, &caller, id_of(id)?).await?;
    let id = page.id;
    api.state.store.delete_page(id).await.map_err(store_problem)?;
    if let Err(error) = api.state.bytes.of(&page.home()).delete_job(id).await {
        // The row is gone; the collector of ownerless bytes takes the rest.
        tracing::warn!(%id, %error, "files of a deleted page stay for now");
    }
    Ok(StatusCode::NO_CONTENT)
}

/// Get a picture of a page.
///
/// `preview.png` and `pictures/N/preview.png` show what was found, `pictures/N/picture.png` is the
/// picture alone, `figures/N/crop.png` a figure cut out and `figures/N/mask.png` its silhouette.
#[utoipa::path(
    method(get, head),
    path = "/v1/pages/{id}/{*name}",
    operation_id = "page_file",
    tag = "pages",
    params(
        ("id" = String, Path, format = "uuid", description = "The page"),
        ("name" = String, Path, description = "Which picture", example = "figures/0/mask.png"),
    ),
    responses(
        (status = 200, description = "A PNG", body = Vec<u8>, content_type = "image/png",
         headers(("ETag" = String))),
        (status = 304, description = "As in If-None-Match"),
        PageProblems,
    )
)]
pub(super) async fn file(
    State(api): State<Arc<Api>>,
    Extension(caller): Extension<Arc<Caller>>,
    path: Result<Path<(String, String)>, PathRejection>,
    method: Method,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let Path((id, name)) = path.map_err(|error| Problem::new(UNKNOWN_PAGE, error.body_text()))?;
    let stored = find(&api, &caller, parse(&id)?).await?;
    let content = PageContent::of(&stored)?;
    let Some(inner) = inner_name(&content, &name) else {
        let detail = format!("page {id} has no file `{name}`; its document names those there are");
        return Err(Problem::new(UNKNOWN_PAGE, detail));
    };
    let etag = version_of(&stored);
    let mut response = if is_known(&headers, &etag) {
        StatusCode::NOT_MODIFIED.into_response()
    } else {
        let key = Key::Input { job: stored.id, name: &format!("{}/{inner}", stored.version) };
        let bytes = api.state.bytes.of(&stored.home()).get(&key).await.map_err(missing)?;
        let length = bytes.len();
        let body = if method == Method::HEAD { Body::empty() } else { Body::from(bytes) };
        let mut response = Response::new(body);
        response.headers_mut().insert(header::CONTENT_TYPE, PNG);
        response.headers_mut().insert(header::CONTENT_LENGTH, length.into());
        response
    };
    response.headers_mut().typed_insert(etag);
    response.headers_mut().insert(header::CACHE_CONTROL, NO_CACHE);
    Ok(response)
}

const NO_CACHE: HeaderValue = HeaderValue::from_static("private, no-cache");
const PNG: HeaderValue = HeaderValue::from_static("image/png");

fn missing(error: ByteError) -> Problem {
    match error {
        ByteError::NotFound(_) => {
            Problem::new(UNKNOWN_PAGE, "the page was changed or deleted just now; get it again")
        }
        other => Problem::unavailable("byte store", &other),
    }
}

/// The stored name, below the page's version, of the file that clients call `name`.
fn inner_name(content: &PageContent, name: &str) -> Option<String> {
    if name == "preview.png" {
        return Some(picture_file(0, "preview"));
    }
    let pictures = (0..content.pictures.len())
        .flat_map(|k| ["picture", "preview"].map(|name| picture_file(k, name)));
    let figures =
        (0..content.figures.len()).flat_map(|k| ["crop", "mask"].map(|name| figure_file(k, name)));
    pictures.chain(figures).find(|known| known == name)
}

/// Where the page's picture `number` is stored as it came.
fn original(number: usize) -> String {
    format!("source/{number}")
}

fn versioned(version: u64, files: Vec<(String, Bytes)>) -> impl Iterator<Item = (String, Bytes)> {
    files.into_iter().map(move |(name, bytes)| (format!("{version}/{name}"), bytes))
}

fn stored_content(content: &PageContent) -> Result<Value, Problem> {
    serde_json::to_value(content).map_err(|error| Problem::internal("page", &error))
}

fn answer(page: &StoredPage) -> Result<Response, Problem> {
    let mut response = Json(PageView::of(page)?).into_response();
    response.headers_mut().typed_insert(version_of(page));
    Ok(response)
}

/// A strong tag, for edits must match it: pages are never compressed.
fn version_of(page: &StoredPage) -> ETag {
    let StoredPage { version, tags_version, .. } = page;
    let text = match tags_version {
        0 => format!("\"{version}\""),
        _ => format!("\"{version}.{tags_version}\""),
    };
    text.parse().expect("numbers in quotes are an ETag")
}
