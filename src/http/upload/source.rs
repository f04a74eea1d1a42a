//! A job that runs again on the views of an earlier one, or on those of a page.

use std::collections::BTreeSet;

use bytes::Bytes;
use serde_json::Value;

use super::assemble::{check, check_memory, parse_options};
use super::matches;
use super::page::azimuth_part;
use super::parts::Parts;
use crate::http::Api;
use crate::http::access::Caller;
use crate::http::drawn_pages::PageContent;
use crate::http::problem::{DIFFERING_SIZES, Problem, UNKNOWN_SOURCE, WRONG_NUMBER_OF_FIGURES};
use crate::kinds::{MATCHES_INPUT, RECONSTRUCTION, ReconstructionPayload};
use frames::{Azimuth, Elevation, Viewpoint};
use jobs::bytes::{ByteError, BytesOf, Key};
use jobs::{JobId, StoreError};
use sheet::{PictureSize, SheetDocument, ViewDocument};

/// The document of a job that runs again on the views of `source`: its options
/// with the given ones laid over them.
pub(super) async fn rerun(
    api: &Api,
    caller: &Caller,
    source: &str,
    parts: Parts,
) -> Result<(BytesOf, SheetDocument), Problem> {
    let sheet = parts.sheet.is_some().then(|| "sheet".to_owned());
    let view = parts.any_of_views_form();
    let file = parts.files.first().or(parts.truth_model.as_ref()).map(|file| &file.file);
    parts.expect_only("source", [sheet.as_ref(), view.as_ref(), file])?;
    let id: JobId = source.trim().parse().map_err(|_| unknown(source))?;
    let job = api.state.store.get(id).await.map_err(|error| match error {
        StoreError::NotFound(_) => unknown(source),
        other => other.into(),
    })?;
    if job.kind != RECONSTRUCTION || job.tenant != caller.tenant {
        return Err(unknown(source));
    }
    let from = BytesOf { id, home: job.home() };
    let payload: ReconstructionPayload = serde_json::from_value(job.payload)
        .map_err(|error| Problem::internal("stored sheet document", &error))?;
    let stored = match payload.has_matches {
        true => {
            let bytes = api.state.bytes.of(&from.home);
            Some(bytes.get(&Key::Input { job: id, name: MATCHES_INPUT }).await)
        }
        false => None,
    };
    let stored = stored.transpose().map_err(|error| match error {
        ByteError::NotFound(_) => gone(id),
        other => other.into(),
    })?;
    let document = completed(api, payload.document, parts, stored, "source").await?;
    Ok((from, document))
}

/// The document of a job whose views are the kept figures of the page `page`.
pub(super) async fn of_page(
    api: &Api,
    caller: &Caller,
    page: &str,
    mut parts: Parts,
) -> Result<(BytesOf, SheetDocument), Problem> {
    let azimuths = azimuth_part(parts.page.azimuths.take().as_deref())?;
    let source = parts.source.as_ref().map(|_| "source".to_owned());
    parts.expect_only("page", [source.as_ref(), parts.any_of_others().as_ref(), None])?;
    let none = || {
        let detail = format!("there is no page `{page}` to take the views from");
        Problem::new(UNKNOWN_SOURCE, detail).part("page")
    };
    let id: JobId = page.trim().parse().map_err(|_| none())?;
    let stored = api.state.store.page(id).await.map_err(|error| match error {
        StoreError::NotFound(_) => none(),
        other => other.into(),
    })?;
    if stored.tenant != caller.tenant {
        return Err(none());
    }
    let mut content = PageContent::of(&stored)?;
    if let Some(azimuths) = azimuths {
        place(&mut content, &azimuths, id)?;
    }
    let mut document = content.sheet(&format!("{}/", stored.version));
    let sizes = content.kept().map(|(_, figure)| figure.crop_size());
    let sizes: BTreeSet<(u32, u32)> = sizes.collect();
    if let (Some((width, height)), 1) = (sizes.first(), sizes.len()) {
        (document.width, document.height) = (Some(*width), Some(*height));
    }
    let angles = |view: &ViewDocument| (view.azimuth_deg, view.elevation_deg.unwrap_or(0.0));
    document.views.sort_by(|a, b| {
        let ((a, a_raised), (b, b_raised)) = (angles(a), angles(b));
        a.total_cmp(&b).then(a_raised.total_cmp(&b_raised))
    });
    let document = completed(api, document, parts, None, "page").await?;
    Ok((BytesOf { id, home: stored.home() }, document))
}

/// Gives the kept figures these azimuths, in reading order.
fn place(content: &mut PageContent, azimuths: &[Azimuth], id: JobId) -> Result<(), Problem> {
    let found = content.kept().count();
    if found != azimuths.len() {
        let detail = format!(
            "{found} figures of the page are kept, {} azimuths were given; /v1/pages/{id}/preview.png shows the figures: give one azimuth for each in their order",
            azimuths.len()
        );
        return Err(Problem::new(WRONG_NUMBER_OF_FIGURES, detail).part("azimuths"));
    }
    let kept = content.figures.iter_mut().filter(|figure| figure.kept);
    kept.zip(azimuths).for_each(|(figure, azimuth)| figure.azimuth_deg = azimuth.degrees());
    Ok(())
}

/// A stored document with the options and matches given laid over its own.
///
/// * `stored`: its matches, which are stored apart.
async fn completed(
    api: &Api,
    mut document: SheetDocument,
    mut parts: Parts,
    stored: Option<Bytes>,
    part: &str,
) -> Result<SheetDocument, Problem> {
    let given = std::mem::take(&mut parts.matches);
    let options = parse_options(&mut parts, document.options.take())?;
    check(&document, options.method, &api.limits, Some(part))?;
    if options.method.needs_equal_sizes() && document.width.is_none() {
        let detail = "the views of the source differ in size, and the method takes views of one";
        return Err(Problem::new(DIFFERING_SIZES, detail).part(part));
    }
    if document.width.is_some() {
        check_memory(&sizes(&document), &options, document.has_truth(), &api.limits)?;
    }
    // Matches may be many: not on a thread that answers others.
    let laid_over = move || {
        if let Some(stored) = stored {
            document.matches = serde_json::from_slice(&stored)
                .map_err(|error| Problem::internal("stored matches", &error))?;
        }
        matches::lay_over(&mut document.matches, matches::parse(&given)?);
        matches::check(&document.matches, &sizes(&document), &options)?;
        let options = serde_json::to_value(options).unwrap_or(Value::Null);
        document.options = Some(options);
        Ok(document)
    };
    api.decoders.run(laid_over).await?
}

/// The views of a stored document, by rising azimuth and elevation, with their one size.
fn sizes(document: &SheetDocument) -> Vec<(Viewpoint, PictureSize)> {
    let size = PictureSize {
        width: document.width.unwrap_or_default(),
        height: document.height.unwrap_or_default(),
    };
    let viewpoint = |view: &ViewDocument| {
        let elevation_deg = view.elevation_deg.unwrap_or(document.elevation_deg);
        Some(Viewpoint {
            azimuth: Azimuth::from_degrees(view.azimuth_deg).ok()?,
            elevation: Elevation::from_degrees(elevation_deg).ok()?,
        })
    };
    document.views.iter().filter_map(viewpoint).map(|view| (view, size)).collect()
}

/// The stored files that a document names.
pub(super) fn input_names(document: &SheetDocument) -> Vec<String> {
    let of_views = document.views.iter().flat_map(|view| {
        [Some(view.image.as_str()), view.mask.as_deref(), view.truth().map(|(_, name)| name)]
    });
    let model = document.truth.as_ref().and_then(|truth| truth.model.as_deref());
    of_views.chain([model]).flatten().map(str::to_owned).collect()
}

/// The source was deleted while its pictures were being copied.
pub(super) fn gone(source: JobId) -> Problem {
    unknown(&source.to_string())
}

fn unknown(source: &str) -> Problem {
    let detail = format!("there is no reconstruction or page `{source}` to take the views from");
    Problem::new(UNKNOWN_SOURCE, detail).part("source")
}
