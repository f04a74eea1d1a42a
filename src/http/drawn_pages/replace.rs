//! A page that is put right.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::Extension;
use axum::body::to_bytes;
use axum::extract::{Request, State};
use axum::http::header;
use axum::response::Response;
use bytes::Bytes;
use image::GrayImage;

use super::cut::{self, Cut, Searched};
use super::document::{PageContent, PageView, figure_file};
use super::edit::PageEdit;
use super::{
    PageId, answer, find, id_of, missing, original, store_problem, stored_content, version_of,
    versioned,
};
use crate::http::Api;
use crate::http::access::Caller;
use crate::http::conditional::is_unwanted;
use crate::http::openapi::problem_responses;
use crate::http::problem::*;
use crate::http::upload::{self, Document, EditForm, FilePart, image_problem};
use jobs::StoredPage;
use jobs::bytes::{ByteError, Key};

problem_responses! {
    ReplaceProblems: UNSUPPORTED_MEDIA_TYPE, MALFORMED_MULTIPART, INVALID_PART_NAME, INVALID_JSON,
        INVALID_PAGE, BODY_TOO_LARGE, PART_TOO_LARGE, TOO_MANY_PIXELS, TOO_MANY_VIEWS,
        MISSING_PART, UNKNOWN_PART, DUPLICATE_PART, DUPLICATE_AZIMUTH, INVALID_ANGLE,
        DIFFERING_SIZES, EMPTY_FILE, NO_FIGURE, NOT_AN_IMAGE, DAMAGED_IMAGE, UNKNOWN_PAGE,
        PRECONDITION_FAILED, REQUEST_TIMEOUT, BUSY, UNAVAILABLE, INSUFFICIENT_STORAGE, TENANT_FULL
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
pub(in crate::http) async fn replace(
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
    let (mut files, store) = (Vec::new(), api.state.bytes.of(&stored.home()));
    for number in 0.. {
        match store.get(&Key::Input { job: id, name: &original(number) }).await {
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
    upload::write_inputs(&store, id, files).await?;
    let content = stored_content(&content)?;
    let replaced = api.state.store.replace_page(id, stored.version, content, bytes);
    let stored = replaced.await.map_err(store_problem)?;
    if let Err(error) = store.delete_inputs(id, &(version - 1).to_string()).await {
        tracing::warn!(%id, %error, "files of a page's earlier version stay until it is deleted");
    }
    answer(&stored)
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
    let bytes = api.state.bytes.of(&page.home());
    bytes.get(&Key::Input { job: page.id, name: &name }).await.map_err(missing)
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
