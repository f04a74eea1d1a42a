//! The resource `/v1/sheets`.

use std::sync::Arc;

use axum::Json;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, Method, StatusCode};
use axum::response::Response;

use super::Api;
use super::artifacts::{self, IdAndName};
use super::body::Body;
use super::events;
use super::links::{self, Link, NewLink};
use super::openapi::problem_responses;
use super::problem::*;
use super::representation::ArtifactList;
use super::resource::{self, Id, ListParameters, Listing, Resource};
use super::sheet_representation::{Sheet, SheetList};
use super::tags::Changes;
use super::upload::{self, ModelForm};
use super::webhooks::{self, DeliveryId, DeliveryList};
use crate::kinds::DRAWING;

/// Models on their way to a drawn sheet.
pub(super) struct Sheets;

impl Resource for Sheets {
    const KIND: &'static str = DRAWING;
    const PATH: &'static str = "/v1/sheets";
    const NOUN: &'static str = "sheet";
    const UNKNOWN: ProblemType = UNKNOWN_SHEET;
    type View = Sheet;
}

problem_responses! {
    UploadProblems: UNSUPPORTED_MEDIA_TYPE, MALFORMED_MULTIPART, INVALID_PART_NAME, INVALID_JSON,
        BODY_TOO_LARGE, PART_TOO_LARGE, MODEL_TOO_LARGE, MISSING_PART, UNKNOWN_PART,
        DUPLICATE_PART, INVALID_ANGLE, EMPTY_FILE, UNKNOWN_MODEL, UNKNOWN_MODEL_FORMAT,
        INVALID_MODEL, UNSUPPORTED_MODEL, EXTERNAL_REFERENCE, CAMERA_INSIDE_MODEL,
        TOO_MANY_VIEWS, SHEET_TOO_LARGE, UNKNOWN_OPTION, INVALID_OPTION, REQUEST_TIMEOUT, BUSY,
        UNAVAILABLE, INSUFFICIENT_STORAGE, INVALID_QUERY, INVALID_IDEMPOTENCY_KEY,
        IDEMPOTENCY_KEY_REUSED, IDEMPOTENT_JOB_GONE, TOO_MANY_JOBS, INVALID_WEBHOOK, NO_WEBHOOK_SECRET, TENANT_FULL
}
problem_responses! { JobProblems: UNKNOWN_SHEET, UNAVAILABLE }
problem_responses! { StreamProblems: UNKNOWN_SHEET, BUSY, UNAVAILABLE }
problem_responses! { ListProblems: INVALID_QUERY, UNAVAILABLE }
problem_responses! { CancelProblems: UNKNOWN_SHEET, ALREADY_FINISHED, UNAVAILABLE }
problem_responses! {
    NewLinkProblems: UNKNOWN_SHEET, UNKNOWN_ARTIFACT, INVALID_BODY, UNAVAILABLE
}
problem_responses! { RedeliverProblems: UNKNOWN_SHEET, UNKNOWN_DELIVERY, UNAVAILABLE }
problem_responses! { DeleteProblems: UNKNOWN_SHEET, UNAVAILABLE }
problem_responses! { PatchProblems: UNKNOWN_SHEET, INVALID_BODY, UNAVAILABLE }
problem_responses! {
    ArtifactProblems: UNKNOWN_SHEET, UNKNOWN_ARTIFACT, PRECONDITION_FAILED,
        RANGE_NOT_SATISFIABLE, UNAVAILABLE
}

/// Upload a model and have its sheet drawn.
///
/// Answers once the job and its model are durable. Follow `Location`. The result is what a
/// reconstruction takes, with the truth of every view: depth, disparity, mask, normals.
#[utoipa::path(
    post,
    path = "/v1/sheets",
    operation_id = "create_sheet",
    tag = "sheets",
    params(
        ("priority" = Option<i32>, Query, minimum = -100, maximum = 100,
         description = "Runs before others of its tenant that have a lower one; 0 if not given"),
        ("name" = Option<String>, Query, max_length = 200, description = "What people call it"),
        ("labels" = Option<String>, Query, example = "show:7,shot:12",
         description = "What it is found by: NAME:TEXT pairs, 16 at most"),
        ("expires_in" = Option<i64>, Query, minimum = 0, maximum = 316_224_000,
         description = "Seconds until it is deleted by itself, once it has ended"),
        ("webhook" = Option<String>, Query, max_length = 2048, format = "uri", pattern = "^https?://", example = "https://studio.example/hook",
         description = "Where its end is told, in place of the tenant's address"),
        ("pinned" = Option<bool>, Query, description = "Whether it stays although its time is over"),
        ("Idempotency-Key" = Option<String>, Header, max_length = 255, pattern = "^(\\x22[\\x21\\x23-\\x7E]+\\x22|[\\x21\\x23-\\x7E]+)$",
         example = "8e03978e-40d5",
         description = "A name for this upload: sent again within a day with the same key, it is answered as the first time and becomes no second job"),
    ),
    request_body(content = ref("#/components/schemas/ModelUpload"), content_type = "multipart/form-data"),
    responses(
        (status = 202, description = "Queued", body = Sheet,
         headers(("Location" = String), ("Retry-After" = u32))),
        UploadProblems,
    )
)]
pub(super) async fn create(
    State(api): State<Arc<Api>>,
    request: Request,
) -> Result<Response, Problem> {
    let job = upload::receive::<ModelForm>(&api, request).await?;
    resource::accepted::<Sheets>(&job)
}

/// List drawn sheets, newest first.
#[utoipa::path(
    get,
    path = "/v1/sheets",
    operation_id = "list_sheets",
    tag = "sheets",
    params(ListParameters),
    responses(
        (status = 200, description = "Part of the list", body = SheetList,
         headers(("Link" = String, description = "The next part, as rel=next"))),
        ListProblems,
    )
)]
pub(super) async fn list(
    State(api): State<Arc<Api>>,
    listing: Listing,
) -> Result<Response, Problem> {
    resource::list::<Sheets, _>(&api, listing, |sheets, next| SheetList { sheets, next }).await
}

/// Get a drawn sheet.
///
/// With `Prefer: wait=N` the answer comes when it has finished or, beside
/// `If-None-Match`, when it has changed; at the latest after N seconds.
#[utoipa::path(
    get,
    path = "/v1/sheets/{id}",
    operation_id = "get_sheet",
    tag = "sheets",
    params(
        ("id" = String, Path, format = "uuid", description = "The sheet"),
        ("If-None-Match" = Option<String>, Header, description = "ETag of the version known"),
        ("Prefer" = Option<String>, Header, description = "How many seconds to wait, up to 60",
         example = "wait=10"),
    ),
    responses(
        (status = 200, description = "As it is now", body = Sheet,
         headers(("ETag" = String), ("Retry-After" = u32), ("Preference-Applied" = String))),
        (status = 304, description = "As in If-None-Match"),
        JobProblems,
    )
)]
pub(super) async fn get(
    State(api): State<Arc<Api>>,
    id: Id<Sheets>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    resource::get::<Sheets>(&api, id.0, &headers).await
}

/// Follow the drawing of a sheet.
///
/// Server-sent events, as those of a reconstruction.
#[utoipa::path(
    get,
    path = "/v1/sheets/{id}/events",
    operation_id = "sheet_events",
    tag = "sheets",
    params(
        ("id" = String, Path, format = "uuid", description = "The sheet"),
        ("Last-Event-ID" = Option<String>, Header, description = "Number of the last event received; what is none counts as 0"),
    ),
    responses(
        (status = 200, description = "Events, until the final one", body = String,
         content_type = "text/event-stream"),
        (status = 204, description = "The final event was received already"),
        StreamProblems,
    )
)]
pub(super) async fn events(
    State(api): State<Arc<Api>>,
    id: Id<Sheets>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    events::stream::<Sheets>(api, id.0, &headers).await
}

/// Cancel the drawing of a sheet.
///
/// One that is queued is cancelled at once; one that runs stops before its next view.
#[utoipa::path(
    post,
    path = "/v1/sheets/{id}/cancel",
    operation_id = "cancel_sheet",
    tag = "sheets",
    params(("id" = String, Path, format = "uuid", description = "The sheet")),
    responses(
        (status = 200, description = "Cancelled", body = Sheet),
        (status = 202, description = "Will stop soon", body = Sheet),
        CancelProblems,
    )
)]
pub(super) async fn cancel(
    State(api): State<Arc<Api>>,
    id: Id<Sheets>,
) -> Result<Response, Problem> {
    resource::cancel::<Sheets>(&api, id.0).await
}

/// Delete a sheet with its model and files.
#[utoipa::path(
    delete,
    path = "/v1/sheets/{id}",
    operation_id = "delete_sheet",
    tag = "sheets",
    params(("id" = String, Path, format = "uuid", description = "The sheet")),
    responses((status = 204, description = "Deleted"),
              (status = 202, description = "Cancelled, and deleted when it has stopped"), DeleteProblems)
)]
pub(super) async fn delete(
    State(api): State<Arc<Api>>,
    id: Id<Sheets>,
) -> Result<StatusCode, Problem> {
    resource::delete::<Sheets>(&api, id.0).await
}

/// Change the name, labels and time to stay of a sheet.
#[utoipa::path(
    patch,
    path = "/v1/sheets/{id}",
    operation_id = "patch_sheet",
    tag = "sheets",
    params(("id" = String, Path, format = "uuid", description = "The sheet")),
    request_body = Changes,
    responses(
        (status = 200, description = "As it is now", body = Sheet, headers(("ETag" = String))),
        PatchProblems,
    )
)]
pub(super) async fn patch(
    State(api): State<Arc<Api>>,
    id: Id<Sheets>,
    Body(changes): Body<Changes>,
) -> Result<Response, Problem> {
    resource::patch::<Sheets>(&api, id.0, changes).await
}

/// List the files of a sheet.
#[utoipa::path(
    get,
    path = "/v1/sheets/{id}/artifacts",
    operation_id = "sheet_artifacts",
    tag = "sheets",
    params(("id" = String, Path, format = "uuid", description = "The sheet")),
    responses(
        (status = 200, description = "In order of publication; empty until it has succeeded",
         body = ArtifactList, headers(("ETag" = String))),
        (status = 304, description = "As in If-None-Match"),
        JobProblems,
    )
)]
pub(super) async fn artifacts(
    State(api): State<Arc<Api>>,
    id: Id<Sheets>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    artifacts::list::<Sheets>(&api, id.0, &headers).await
}

/// Get a file of a sheet.
///
/// Its bytes never change: the ETag is the content's SHA-256. Takes byte ranges, If-Match,
/// If-None-Match and If-Range.
#[utoipa::path(
    method(get, head),
    path = "/v1/sheets/{id}/artifacts/{*name}",
    operation_id = "sheet_artifact",
    tag = "sheets",
    params(
        ("id" = String, Path, format = "uuid", description = "The sheet"),
        ("name" = String, Path, description = "Name from the list",
         example = "view_045.png"),
        ("Range" = Option<String>, Header, description = "One byte range", example = "bytes=0-1023"),
    ),
    responses(
        (status = 200, description = "The bytes, in the media type of the list", body = Vec<u8>,
         content_type = "application/octet-stream",
         headers(("ETag" = String), ("Accept-Ranges" = String), ("Content-Disposition" = String))),
        (status = 206, description = "The bytes of the range", body = Vec<u8>,
         content_type = "application/octet-stream", headers(("Content-Range" = String))),
        (status = 307, description = "Large ones, where the service lets its bucket send them (`download_redirects`): fetch `Location` without the key, soon; with `Prefer: no-redirect` the bytes come from here",
         headers(("Location" = String))),
        (status = 304, description = "As in If-None-Match"),
        ArtifactProblems,
    )
)]
pub(super) async fn artifact(
    State(api): State<Arc<Api>>,
    path: IdAndName,
    method: Method,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    artifacts::named::<Sheets>(&api, path, &method, &headers).await
}

/// Make a link to a result of a sheet that needs no key.
///
/// It ends by itself, and with the sheet.
#[utoipa::path(
    post,
    path = "/v1/sheets/{id}/links",
    operation_id = "link_sheet",
    tag = "artifacts",
    params(("id" = String, Path, format = "uuid", description = "The sheet")),
    request_body = NewLink,
    responses((status = 201, description = "Made", body = Link), NewLinkProblems)
)]
pub(super) async fn link(
    State(api): State<Arc<Api>>,
    id: Id<Sheets>,
    Body(given): Body<NewLink>,
) -> Result<(StatusCode, Json<Link>), Problem> {
    links::create::<Sheets>(&api, id.0, given).await
}

/// List the messages about the end of a sheet.
#[utoipa::path(
    get,
    path = "/v1/sheets/{id}/deliveries",
    operation_id = "sheet_deliveries",
    tag = "webhooks",
    params(("id" = String, Path, format = "uuid", description = "The sheet")),
    responses((status = 200, description = "Oldest first, each with its tries", body = DeliveryList), JobProblems)
)]
pub(super) async fn deliveries(
    State(api): State<Arc<Api>>,
    id: Id<Sheets>,
) -> Result<Json<DeliveryList>, Problem> {
    webhooks::list::<Sheets>(&api, id.0).await
}

/// Send a message about the end of a sheet anew.
#[utoipa::path(
    post,
    path = "/v1/sheets/{id}/deliveries/{delivery}/redeliver",
    operation_id = "redeliver_sheet",
    tag = "webhooks",
    params(("id" = String, Path, format = "uuid", description = "The sheet"),
           ("delivery" = String, Path, format = "uuid", description = "The message")),
    responses((status = 202, description = "Will be sent soon", body = DeliveryList), RedeliverProblems)
)]
pub(super) async fn redeliver(
    State(api): State<Arc<Api>>,
    id: DeliveryId<Sheets>,
) -> Result<(StatusCode, Json<DeliveryList>), Problem> {
    webhooks::redeliver::<Sheets>(&api, id).await
}
