//! The resource `/v1/pages`: pictures with several views on them, the figures
//! found there, and what clients put right before they have them reconstructed.

mod cut;
mod document;
mod list;

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::body::{Body, to_bytes};
use axum::extract::rejection::PathRejection;
use axum::extract::{Path, Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use axum_extra::headers::{ETag, HeaderMapExt};
use bytes::Bytes;
use image::GrayImage;
use serde_json::Value;

use self::cut::{Cut, Searched};
pub(super) use self::document::PageContent;
use self::document::{PageEdit, PageView, figure_file, picture_file};
pub(super) use self::list::*;
use super::Api;
use super::access::Caller;
use super::conditional::{is_known, is_unwanted};
use super::openapi::problem_responses;
use super::problem::*;
use super::upload::{self, Document, EditForm, FilePart, PageForm, image_problem};
use jiff::{SignedDuration, Timestamp};
use jobs::bytes::{ByteError, Key};
use jobs::{JobId, NewPage, StoreError, StoredPage};

problem_responses! {
    CreateProblems: UNSUPPORTED_MEDIA_TYPE, MALFORMED_MULTIPART, INVALID_PART_NAME, INVALID_JSON,
        BODY_TOO_LARGE, PART_TOO_LARGE, TOO_MANY_PIXELS, TOO_MANY_VIEWS, MISSING_PART, UNKNOWN_PART,
        DUPLICATE_PART, DUPLICATE_AZIMUTH, INVALID_ANGLE, EMPTY_FILE, NO_FIGURE,
        WRONG_NUMBER_OF_FIGURES, NOT_AN_IMAGE, DAMAGED_IMAGE, REQUEST_TIMEOUT, BUSY, UNAVAILABLE,
        INSUFFICIENT_STORAGE, TENANT_FULL
}
problem_responses! {
    ReplaceProblems: UNSUPPORTED_MEDIA_TYPE, MALFORMED_MULTIPART, INVALID_PART_NAME, INVALID_JSON,
        INVALID_PAGE, BODY_TOO_LARGE, PART_TOO_LARGE, TOO_MANY_PIXELS, TOO_MANY_VIEWS,
        MISSING_PART, UNKNOWN_PART, DUPLICATE_PART, DUPLICATE_AZIMUTH, INVALID_ANGLE,
        DIFFERING_SIZES, EMPTY_FILE, NO_FIGURE, NOT_AN_IMAGE, DAMAGED_IMAGE, UNKNOWN_PAGE,
        PRECONDITION_FAILED, REQUEST_TIMEOUT, BUSY, UNAVAILABLE, INSUFFICIENT_STORAGE, TENANT_FULL
}
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

/// Upload a page and have its figures found.
///
/// Answers at once with boxes, outlines, masks and guessed azimuths of the figures, and with what
/// was left out. Put right what is wrong, then have it reconstructed by naming the page in the part
/// `page` of a reconstruction.
#[utoipa::path(
    post,
    path = "/v1/pages",
    operation_id = "create_page",
    tag = "pages",
    request_body(content = ref("#/components/schemas/PageUpload"), content_type = "multipart/form-data"),
    responses(
        (status = 201, description = "Stored", body = PageView,
         headers(("Location" = String), ("ETag" = String))),
        CreateProblems,
    )
)]
pub(super) async fn create(
    State(api): State<Arc<Api>>,
    Extension(caller): Extension<Arc<Caller>>,
    request: Request,
) -> Result<Response, Problem> {
    let ((sources, cut), _hold) =
        upload::read_and(&api, &caller, request, async |form: PageForm| {
            let (files, azimuths) = form.into_parts();
            if files.is_empty() {
                let detail = "no page was sent; add -F page=@sheet.png";
                return Err(Problem::new(MISSING_PART, detail).part("page"));
            }
            let azimuths = upload::azimuth_part(azimuths.as_deref())?;
            let limits = api.limits;
            let cut = api.decoders.run(move || {
                let (pictures, proposals) = upload::search(&files, azimuths.as_deref(), &limits)?;
                let cut = Searched { pictures, proposals }.as_proposed()?;
                Ok((files, cut))
            });
            cut.await?
        })
        .await?;
    let id = JobId::new();
    let originals = sources.into_iter().enumerate().map(|(k, bytes)| (original(k), bytes));
    let stored = async {
        let Cut { content, files } = cut;
        let files = originals.chain(versioned(1, files)).collect();
        api.state.store.expect_bytes(id).await?;
        upload::write_inputs(&api.state.bytes, id, files).await?;
        let stays =
            caller.limits.expires_in.map(|seconds| SignedDuration::from_secs(seconds.into()));
        let page = NewPage {
            id,
            tenant: caller.tenant.clone(),
            content: stored_content(&content)?,
            bytes: api.state.bytes.stored(id).await?,
            max_bytes: caller.limits.max_bytes,
            expires_at: stays.map(|stays| Timestamp::now() + stays),
        };
        Ok(api.state.store.add_page(page).await?)
    };
    let stored: Result<StoredPage, Problem> = stored.await;
    if stored.is_err()
        && let Err(error) = api.state.bytes.delete_job(id).await
    {
        // The collector of ownerless bytes finds them later.
        tracing::warn!(%id, %error, "files of a refused page stay for now");
    }
    let stored = stored?;
    tracing::info!(%id, "page stored");
    let mut response = (StatusCode::CREATED, answer(&stored)?).into_response();
    let location = HeaderValue::from_str(&format!("/v1/pages/{id}"))
        .map_err(|error| Problem::internal("location", &error))?;
    response.headers_mut().insert(header::LOCATION, location);
    Ok(response)
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

/// Put a page right.
///
/// Takes the page's document with other boxes, azimuths, outlines, points or figures, as JSON or
/// as the part `document` beside masks as parts `mask[N]`. Masks and previews are made anew. With
/// `If-Match` only if nobody else changed it meanwhile.
#[utoipa::path(
    put,
    path = "/v1/pages/{id}",
    operation_id = "replace_page",
    tag = "pages",
    params(
        ("id" = String, Path, format = "uuid", description = "The page"),
        ("If-Match" = Option<String>, Header, description = "ETag of the version that was edited"),
    ),
    request_body(content = PageEdit, content_type = "application/json"),
    responses(
        (status = 200, description = "As it is now", body = PageView, headers(("ETag" = String))),
        ReplaceProblems,
    )
)]
pub(super) async fn replace(
    State(api): State<Arc<Api>>,
    Extension(caller): Extension<Arc<Caller>>,
    id: PageId,
    request: Request,
) -> Result<Response, Problem> {
    let id = id_of(id)?;
    let stored = find(&api, &caller, id).await?;
    let etag = version_of(&stored);
    if is_unwanted(request.headers(), &etag) {
        let detail = format!("the page is at version {}; get it again", stored.version);
        return Err(Problem::new(PRECONDITION_FAILED, detail));
    }
    let (edit, masks, _hold) = read_edit(&api, &caller, request).await?;
    let mut kept = Vec::new();
    for (number, figure) in edit.figures.iter().enumerate() {
        if figure.mask_given && !masks.contains_key(&number) {
            kept.push((number, mask_of_version(&api, &stored, number).await?));
        }
    }
    let mut files = Vec::new();
    for number in 0.. {
        match api.state.bytes.get(&Key::Input { job: id, name: &original(number) }).await {
            Ok(bytes) => files.push(bytes),
            Err(ByteError::NotFound(_)) => break,
            Err(error) => return Err(Problem::unavailable("byte store", &error)),
        }
    }
    let limits = api.limits;
    let source_bytes: u64 = files.iter().map(|file| file.len() as u64).sum();
    let cut = api.decoders.run(move || {
        let given = decoded_masks(masks, kept, &limits.image)?;
        let (pictures, proposals) = upload::search(&files, None, &limits)?;
        Searched { pictures, proposals }.as_edited(edit.figures, given)
    });
    let Cut { content, files } = cut.await??;
    let bytes = source_bytes + files.iter().map(|(_, file)| file.len() as u64).sum::<u64>();
    let version = stored.version + 1;
    let files = versioned(version, files).collect();
    upload::write_inputs(&api.state.bytes, id, files).await?;
    let content = stored_content(&content)?;
    let replaced = api.state.store.replace_page(id, stored.version, content, bytes);
    let stored = replaced.await.map_err(store_problem)?;
    if let Err(error) = api.state.bytes.delete_inputs(id, &(version - 1).to_string()).await {
        tracing::warn!(%id, %error, "files of a page's earlier version stay until it is deleted");
    }
    answer(&stored)
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
    let id = find(&api, &caller, id_of(id)?).await?.id;
    api.state.store.delete_page(id).await.map_err(store_problem)?;
    if let Err(error) = api.state.bytes.delete_job(id).await {
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
        let bytes = api.state.bytes.get(&key).await.map_err(missing)?;
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

async fn read_edit(
    api: &Api,
    caller: &Caller,
    request: Request,
) -> Result<(PageEdit, BTreeMap<usize, FilePart>, Option<tokio::sync::OwnedSemaphorePermit>), Problem>
{
    let media_type = request.headers().get(header::CONTENT_TYPE);
    let is_json = media_type
        .and_then(|value| value.to_str().ok())
        .is_some_and(|value| value.trim_start().starts_with("application/json"));
    if is_json {
        let limit = api.limits.max_document_bytes;
        let body = to_bytes(request.into_body(), limit).await.map_err(|_| {
            let detail = format!("the document is over the limit of {limit} bytes, or ended early");
            Problem::new(BODY_TOO_LARGE, detail)
        })?;
        return Ok((parse_edit(&Document::of(body, "document")?)?, BTreeMap::new(), None));
    }
    let read = upload::read_and(api, caller, request, async |form: EditForm| {
        let Some(document) = form.document else {
            let detail = "no document was sent; add it as the part `document`";
            return Err(Problem::new(MISSING_PART, detail).part("document"));
        };
        Ok((parse_edit(&document)?, form.masks))
    });
    let ((edit, masks), hold) = read.await?;
    Ok((edit, masks, hold))
}

fn parse_edit(document: &Document) -> Result<PageEdit, Problem> {
    let edit: PageEdit = document.parse(INVALID_PAGE)?;
    let most = ::page::PageOptions::default().max_figures;
    if edit.figures.len() > most {
        let detail = format!("the page has more than {most} figures; leave some out");
        return Err(Problem::new(TOO_MANY_VIEWS, detail).part("document"));
    }
    Ok(edit)
}

/// The mask that was sent for the figure `number` of the version stored.
async fn mask_of_version(api: &Api, page: &StoredPage, number: usize) -> Result<Bytes, Problem> {
    let content = PageContent::of(page)?;
    if !content.figures.get(number).is_some_and(|figure| figure.mask_given) {
        let detail = format!(
            "figures[{number}].mask_given is true, but no mask was sent for it; send it as the part `mask[{number}]`"
        );
        return Err(Problem::new(INVALID_PAGE, detail).part(format!("mask[{number}]")));
    }
    let name = format!("{}/{}", page.version, figure_file(number, "mask"));
    api.state.bytes.get(&Key::Input { job: page.id, name: &name }).await.map_err(missing)
}

fn decoded_masks(
    sent: BTreeMap<usize, FilePart>,
    kept: Vec<(usize, Bytes)>,
    limits: &picture::ImageLimits,
) -> Result<BTreeMap<usize, GrayImage>, Problem> {
    let sent = sent.into_iter().map(|(number, file)| (number, file.bytes));
    let decode = |(number, bytes): (usize, Bytes)| {
        let decoded = picture::decode(&bytes, limits)
            .map_err(|error| image_problem(&format!("mask[{number}]"), &error))?;
        Ok((number, cut::mask_of(decoded)))
    };
    sent.chain(kept).map(decode).collect()
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
    format!("\"{}\"", page.version).parse().expect("a number in quotes is an ETag")
}
