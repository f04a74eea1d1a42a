//! Drawings and masks that a sheet document names by URL, fetched by the service
//! where who runs it allows that: under the same guard as all its calls.

use axum::http::{HeaderMap, Method, StatusCode};
use bytes::Bytes;
use futures::{StreamExt, TryStreamExt, stream};
use tokio::sync::OwnedSemaphorePermit;

use super::document::Document;
use super::intake::too_large;
use super::parts::{FilePart, Parts, expect_bytes};
use super::pictures::{check_start, image_problem};
use crate::http::Api;
use crate::http::problem::{INVALID_SHEET, NOT_FETCHED, PART_TOO_LARGE, Problem};
use sheet::SheetDocument;

/// Files fetched at a time for one upload.
const AT_A_TIME: usize = 4;

/// Whether a name in a sheet document is where a file is, not what it is called.
pub(super) fn is_url(name: &str) -> bool {
    name.starts_with("https://") || name.starts_with("http://")
}

/// Fetches what the sheet names by URL as if it had been sent. Returns the hold
/// on the budget, to be kept as long as the bytes.
pub(super) async fn fetch(
    api: &Api,
    parts: &mut Parts,
) -> Result<Option<OwnedSemaphorePermit>, Problem> {
    let Some(sheet) = parts.sheet.as_ref().filter(|_| api.limits.inputs_by_url) else {
        return Ok(None);
    };
    let mut document: SheetDocument = sheet.parse(INVALID_SHEET)?;
    // More are refused as soon as the parts are held against each other.
    if document.views.len() > api.limits.max_views {
        return Ok(None);
    }
    let mut wanted = Vec::new();
    for (index, view) in document.views.iter_mut().enumerate() {
        let names = [("image", Some(&mut view.image)), ("mask", view.mask.as_mut())];
        for (field, name) in names {
            let Some(name) = name.filter(|name| is_url(name)) else { continue };
            // Addresses may be longer than names.
            let part = format!("views[{index}].{field}");
            wanted.push((std::mem::replace(name, part.clone()), part));
        }
    }
    if wanted.is_empty() {
        return Ok(None);
    }
    let document = serde_json::to_vec(&document);
    let document = document.map_err(|error| Problem::internal("sheet", &error))?;
    parts.sheet = Some(Document::of(document.into(), "sheet")?);
    // Made before the stream, as futures that borrow nothing from it.
    let fetches: Vec<_> = wanted.into_iter().map(|(url, part)| get(api, url, part)).collect();
    let mut files = stream::iter(fetches).buffered(AT_A_TIME);
    let (mut hold, mut left) = (None::<OwnedSemaphorePermit>, api.limits.max_body_bytes);
    while let Some(file) = files.try_next().await? {
        let limit = api.limits.max_body_bytes;
        let bytes = file.bytes.len();
        left = left.checked_sub(bytes as u64).ok_or_else(|| too_large(limit))?;
        let permit = api.budget.hold(bytes)?;
        match &mut hold {
            Some(hold) => hold.merge(permit),
            none => *none = Some(permit),
        }
        parts.files.push(file);
    }
    Ok(hold)
}

async fn get(api: &Api, url: String, part: String) -> Result<FilePart, Problem> {
    let wrong = |detail: String| Problem::new(NOT_FETCHED, detail).part(&*part);
    let limits = &api.limits.image;
    let most = usize::try_from(limits.max_bytes).unwrap_or(usize::MAX);
    let (headers, nothing) = (HeaderMap::new(), Bytes::new());
    let answer = api.state.outbound.send(Method::GET, &url, headers, nothing, most).await;
    let answer =
        answer.map_err(|error| wrong(format!("`{part}` could not be fetched: {error}")))?;
    if answer.status != StatusCode::OK {
        let status = answer.status.as_u16();
        return Err(wrong(format!("`{part}` could not be fetched: its host answered {status}")));
    }
    let bytes = answer.body.ok_or_else(|| {
        let detail = format!("`{part}` has more than {most} bytes; compress it or scale it down");
        Problem::new(PART_TOO_LARGE, detail).part(&*part)
    })?;
    expect_bytes(&bytes, &part)?;
    check_start(&bytes, limits).map_err(|error| image_problem(&part, &error))?;
    Ok(FilePart { file: part, bytes })
}
