//! New pages: their pictures searched and stored with what was found.

use std::sync::Arc;

use axum::Extension;
use axum::extract::{Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};

use super::cut::{Cut, Searched};
use super::document::PageView;
use super::{answer, original, stored_content, versioned};
use crate::http::Api;
use crate::http::access::Caller;
use crate::http::openapi::problem_responses;
use crate::http::problem::*;
use crate::http::upload::{self, PageForm, PageTerms};
use jobs::{Idempotency, NewPage, StoredPage};

problem_responses! {
    CreateProblems: UNSUPPORTED_MEDIA_TYPE, MALFORMED_MULTIPART, INVALID_PART_NAME, INVALID_JSON,
        BODY_TOO_LARGE, PART_TOO_LARGE, TOO_MANY_PIXELS, TOO_MANY_VIEWS, MISSING_PART, UNKNOWN_PART,
        DUPLICATE_PART, DUPLICATE_AZIMUTH, INVALID_ANGLE, EMPTY_FILE, NO_FIGURE,
        WRONG_NUMBER_OF_FIGURES, NOT_AN_IMAGE, DAMAGED_IMAGE, REQUEST_TIMEOUT, BUSY, UNAVAILABLE,
        INSUFFICIENT_STORAGE, TENANT_FULL, INVALID_QUERY, INVALID_IDEMPOTENCY_KEY,
        IDEMPOTENCY_KEY_REUSED, IDEMPOTENT_JOB_GONE
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
    params(
        ("name" = Option<String>, Query, max_length = 200, description = "What people call it"),
        ("labels" = Option<String>, Query, example = "show:7,shot:12",
         description = "What it is found by: NAME:TEXT pairs, 16 at most"),
        ("expires_in" = Option<i64>, Query, minimum = 0, maximum = 316_224_000,
         description = "Seconds until it is deleted by itself"),
        ("pinned" = Option<bool>, Query, description = "Whether it stays although its time is over"),
        ("Idempotency-Key" = Option<String>, Header, max_length = 255, pattern = "^(\\x22[\\x21\\x23-\\x7E]+\\x22|[\\x21\\x23-\\x7E]+)$",
         example = "8e03978e-40d5",
         description = "A name for this upload: sent again within a day with the same key, it becomes no second page, and is answered with the first as it is now"),
    ),
    request_body(content = ref("#/components/schemas/PageUpload"), content_type = "multipart/form-data"),
    responses(
        (status = 201, description = "Stored", body = PageView,
         headers(("Location" = String), ("ETag" = String))),
        CreateProblems,
    )
)]
pub(in crate::http) async fn create(
    State(api): State<Arc<Api>>,
    Extension(caller): Extension<Arc<Caller>>,
    request: Request,
) -> Result<Response, Problem> {
    let (head, body) = request.into_parts();
    let PageTerms { key, tags } = PageTerms::of(&head)?;
    let request = Request::from_parts(head, body);
    let ((sources, cut, given), _hold) =
        upload::read_and(&api, &caller, request, async |form: PageForm| {
            let (files, azimuths) = form.into_parts();
            if files.is_empty() {
                let detail = "no page was sent; add -F page=@sheet.png";
                return Err(Problem::new(MISSING_PART, detail).part("page"));
            }
            let order = upload::azimuth_part(azimuths.as_deref())?;
            let (files, given) = match key {
                None => (files, None),
                Some(key) => {
                    let named = move || {
                        let fingerprint = upload::page_fingerprint(&files, azimuths.as_deref());
                        (files, Some(Idempotency { key, fingerprint }))
                    };
                    api.decoders.run(named).await?
                }
            };
            // One that was sent before is not searched again.
            if let Some(given) = &given
                && let Some(page) = (api.state.store.page_of_key(&caller.tenant, given).await)
                    .map_err(upload::idempotency_problem)?
            {
                return Ok((files, Err(page), None));
            }
            let limits = api.limits;
            let cut = api.decoders.run(move || {
                let (pictures, proposals) = upload::search(&files, order.as_deref(), &limits)?;
                let cut = Searched { pictures, proposals }.as_proposed()?;
                Ok((files, Ok(cut), given))
            });
            cut.await?
        })
        .await?;
    let cut = match cut {
        Ok(cut) => cut,
        Err(page) => return created(&page),
    };
    let (id, bytes) = api.state.new_name(&caller.tenant);
    let originals = sources.into_iter().enumerate().map(|(k, bytes)| (original(k), bytes));
    let stored = async {
        let Cut { content, files } = cut;
        let files = originals.chain(versioned(1, files)).collect();
        api.state.store.expect_bytes(id).await?;
        upload::write_inputs(&bytes, id, files).await?;
        let page = NewPage {
            id,
            tenant: caller.tenant.clone(),
            content: stored_content(&content)?,
            bytes: bytes.stored(id).await?,
            max_bytes: caller.limits.max_bytes,
            tags,
            idempotency: given,
        };
        api.state.store.add_page(page).await.map_err(upload::idempotency_problem)
    };
    let stored: Result<StoredPage, Problem> = stored.await;
    // Refused, or the same as one that was faster.
    if stored.as_ref().map_or(true, |page| page.id != id)
        && let Err(error) = bytes.delete_job(id).await
    {
        // The collector of ownerless bytes finds them later.
        tracing::warn!(%id, %error, "files of a refused page stay for now");
    }
    created(&stored?)
}

/// The answer to an upload that has become a page.
fn created(stored: &StoredPage) -> Result<Response, Problem> {
    tracing::info!(id = %stored.id, "page stored");
    let mut response = (StatusCode::CREATED, answer(stored)?).into_response();
    let location = HeaderValue::from_str(&format!("/v1/pages/{}", stored.id))
        .map_err(|error| Problem::internal("location", &error))?;
    response.headers_mut().insert(header::LOCATION, location);
    Ok(response)
}
