//! The resource `/v1/reconstructions`.

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
use super::representation::{ArtifactList, Reconstruction, ReconstructionList};
use super::resource::{self, Id, ListParameters, Listing, Resource};
use super::tags::Changes;
use super::upload::{self, Parts};
use super::webhooks::{self, DeliveryId, DeliveryList};
use crate::kinds::RECONSTRUCTION;

/// Sheets on their way to a draft.
pub(super) struct Reconstructions;

impl Resource for Reconstructions {
    const KIND: &'static str = RECONSTRUCTION;
    const PATH: &'static str = "/v1/reconstructions";
    const NOUN: &'static str = "reconstruction";
    const UNKNOWN: ProblemType = UNKNOWN_RECONSTRUCTION;
    type View = Reconstruction;
}

problem_responses! {
    UploadProblems: UNSUPPORTED_MEDIA_TYPE, MALFORMED_MULTIPART, INVALID_PART_NAME, INVALID_JSON,
        BODY_TOO_LARGE, PART_TOO_LARGE, TOO_MANY_PIXELS, TOO_MANY_VIEWS, TOO_FEW_VIEWS,
        MISSING_PART, UNKNOWN_PART, DUPLICATE_PART, CONFLICTING_PARTS, MISSING_FILE,
        DUPLICATE_AZIMUTH, ELEVATED_VIEW, INVALID_ANGLE, DIFFERING_SIZES, EMPTY_FILE, NO_FIGURE,
        WRONG_NUMBER_OF_FIGURES, NOT_AN_IMAGE, DAMAGED_IMAGE,
        INVALID_SHEET, JOB_TOO_LARGE, INVALID_TRUTH, UNKNOWN_OPTION, INVALID_OPTION, UNKNOWN_SOURCE, REQUEST_TIMEOUT,
        BUSY, UNAVAILABLE, INSUFFICIENT_STORAGE, INVALID_QUERY,
        INVALID_IDEMPOTENCY_KEY, IDEMPOTENCY_KEY_REUSED, IDEMPOTENT_JOB_GONE, TOO_MANY_JOBS, INVALID_WEBHOOK, NO_WEBHOOK_SECRET, TENANT_FULL, NOT_FETCHED
}
problem_responses! { JobProblems: UNKNOWN_RECONSTRUCTION, UNAVAILABLE }
problem_responses! { StreamProblems: UNKNOWN_RECONSTRUCTION, BUSY, UNAVAILABLE }
problem_responses! { ListProblems: INVALID_QUERY, UNAVAILABLE }
problem_responses! { CancelProblems: UNKNOWN_RECONSTRUCTION, ALREADY_FINISHED, UNAVAILABLE }
problem_responses! {
    NewLinkProblems: UNKNOWN_RECONSTRUCTION, UNKNOWN_ARTIFACT, INVALID_BODY, UNAVAILABLE
}
problem_responses! { RedeliverProblems: UNKNOWN_RECONSTRUCTION, UNKNOWN_DELIVERY, UNAVAILABLE }
problem_responses! { DeleteProblems: UNKNOWN_RECONSTRUCTION, UNAVAILABLE }
problem_responses! { PatchProblems: UNKNOWN_RECONSTRUCTION, INVALID_BODY, UNAVAILABLE }
problem_responses! {
    ArtifactProblems: UNKNOWN_RECONSTRUCTION, UNKNOWN_ARTIFACT, PRECONDITION_FAILED,
        RANGE_NOT_SATISFIABLE, UNAVAILABLE
}

/// Upload a sheet and have it reconstructed.
///
/// Answers once the job and its drawings are durable. Follow `Location`.
#[utoipa::path(
    post,
    path = "/v1/reconstructions",
    operation_id = "create",
    tag = "reconstructions",
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
    request_body(content = ref("#/components/schemas/Upload"), content_type = "multipart/form-data"),
    responses(
        (status = 202, description = "Queued", body = Reconstruction,
         headers(("Location" = String), ("Retry-After" = u32))),
        UploadProblems,
    )
)]
pub(super) async fn create(
    State(api): State<Arc<Api>>,
    request: Request,
) -> Result<Response, Problem> {
    let job = upload::receive::<Parts>(&api, request).await?;
    resource::accepted::<Reconstructions>(&job)
}

/// List reconstructions, newest first.
#[utoipa::path(
    get,
    path = "/v1/reconstructions",
    operation_id = "list",
    tag = "reconstructions",
    params(ListParameters),
    responses(
        (status = 200, description = "Part of the list", body = ReconstructionList,
         headers(("Link" = String, description = "The next part, as rel=next"))),
        ListProblems,
    )
)]
pub(super) async fn list(
    State(api): State<Arc<Api>>,
    listing: Listing,
) -> Result<Response, Problem> {
    resource::list::<Reconstructions, _>(&api, listing, |reconstructions, next| {
        ReconstructionList { reconstructions, next }
    })
    .await
}

/// Get a reconstruction.
///
/// With `Prefer: wait=N` the answer comes when it has finished or, beside
/// `If-None-Match`, when it has changed; at the latest after N seconds.
#[utoipa::path(
    get,
    path = "/v1/reconstructions/{id}",
    operation_id = "get",
    tag = "reconstructions",
    params(
        ("id" = String, Path, format = "uuid", description = "The reconstruction"),
        ("If-None-Match" = Option<String>, Header, description = "ETag of the version known"),
        ("Prefer" = Option<String>, Header, description = "How many seconds to wait, up to 60",
         example = "wait=10"),
    ),
    responses(
        (status = 200, description = "As it is now", body = Reconstruction,
         headers(("ETag" = String), ("Retry-After" = u32), ("Preference-Applied" = String))),
        (status = 304, description = "As in If-None-Match"),
        JobProblems,
    )
)]
pub(super) async fn get(
    State(api): State<Arc<Api>>,
    id: Id<Reconstructions>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    resource::get::<Reconstructions>(&api, id.0, &headers).await
}

/// Follow a reconstruction.
///
/// Server-sent events: `id` is the event's number, from 1 without gaps; `event`
/// its kind (queued, started, progress, cancel_requested, requeued, succeeded,
/// failed, cancelled); `data` a JSON object with `number`, `at`, `kind` and
/// `data`. The stream begins after `Last-Event-ID` and ends after the final
/// event; asking again after that gives 204, which ends a browser's attempts to
/// reconnect.
#[utoipa::path(
    get,
    path = "/v1/reconstructions/{id}/events",
    operation_id = "events",
    tag = "reconstructions",
    params(
        ("id" = String, Path, format = "uuid", description = "The reconstruction"),
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
    id: Id<Reconstructions>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    events::stream::<Reconstructions>(api, id.0, &headers).await
}

/// Cancel a reconstruction.
///
/// One that is queued is cancelled at once; one that runs stops within a second.
#[utoipa::path(
    post,
    path = "/v1/reconstructions/{id}/cancel",
    operation_id = "cancel",
    tag = "reconstructions",
    params(("id" = String, Path, format = "uuid", description = "The reconstruction")),
    responses(
        (status = 200, description = "Cancelled", body = Reconstruction),
        (status = 202, description = "Will stop soon", body = Reconstruction),
        CancelProblems,
    )
)]
pub(super) async fn cancel(
    State(api): State<Arc<Api>>,
    id: Id<Reconstructions>,
) -> Result<Response, Problem> {
    resource::cancel::<Reconstructions>(&api, id.0).await
}

/// Delete a reconstruction with its drawings and results.
#[utoipa::path(
    delete,
    path = "/v1/reconstructions/{id}",
    operation_id = "delete",
    tag = "reconstructions",
    params(("id" = String, Path, format = "uuid", description = "The reconstruction")),
    responses((status = 204, description = "Deleted"),
              (status = 202, description = "Cancelled, and deleted when it has stopped"), DeleteProblems)
)]
pub(super) async fn delete(
    State(api): State<Arc<Api>>,
    id: Id<Reconstructions>,
) -> Result<StatusCode, Problem> {
    resource::delete::<Reconstructions>(&api, id.0).await
}

/// Change the name, labels and time to stay of a reconstruction.
#[utoipa::path(
    patch,
    path = "/v1/reconstructions/{id}",
    operation_id = "patch",
    tag = "reconstructions",
    params(("id" = String, Path, format = "uuid", description = "The reconstruction")),
    request_body = Changes,
    responses(
        (status = 200, description = "As it is now", body = Reconstruction, headers(("ETag" = String))),
        PatchProblems,
    )
)]
pub(super) async fn patch(
    State(api): State<Arc<Api>>,
    id: Id<Reconstructions>,
    Body(changes): Body<Changes>,
) -> Result<Response, Problem> {
    resource::patch::<Reconstructions>(&api, id.0, changes).await
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
pub(super) async fn artifacts(
    State(api): State<Arc<Api>>,
    id: Id<Reconstructions>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    artifacts::list::<Reconstructions>(&api, id.0, &headers).await
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
    artifacts::named::<Reconstructions>(&api, path, &method, &headers).await
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
        (status = 307, description = "Large ones, where the service lets its bucket send them (`download_redirects`): fetch `Location` without the key, soon; with `Prefer: no-redirect` the bytes come from here",
         headers(("Location" = String))),
        (status = 304, description = "As in If-None-Match"),
        ArtifactProblems,
    )
)]
pub(super) async fn metrics(
    State(api): State<Arc<Api>>,
    id: Id<Reconstructions>,
    method: Method,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let status = resource::status::<Reconstructions>(&api, &id.0).await?;
    artifacts::serve(&api, &status.published, "metrics.json", &method, &headers, None).await
}

/// Make a link to a result of a reconstruction that needs no key.
///
/// It ends by itself, and with the reconstruction.
#[utoipa::path(
    post,
    path = "/v1/reconstructions/{id}/links",
    operation_id = "link",
    tag = "artifacts",
    params(("id" = String, Path, format = "uuid", description = "The reconstruction")),
    request_body = NewLink,
    responses((status = 201, description = "Made", body = Link), NewLinkProblems)
)]
pub(super) async fn link(
    State(api): State<Arc<Api>>,
    id: Id<Reconstructions>,
    Body(given): Body<NewLink>,
) -> Result<(StatusCode, Json<Link>), Problem> {
    links::create::<Reconstructions>(&api, id.0, given).await
}

/// List the messages about the end of a reconstruction.
#[utoipa::path(
    get,
    path = "/v1/reconstructions/{id}/deliveries",
    operation_id = "deliveries",
    tag = "webhooks",
    params(("id" = String, Path, format = "uuid", description = "The reconstruction")),
    responses((status = 200, description = "Oldest first, each with its tries", body = DeliveryList), JobProblems)
)]
pub(super) async fn deliveries(
    State(api): State<Arc<Api>>,
    id: Id<Reconstructions>,
) -> Result<Json<DeliveryList>, Problem> {
    webhooks::list::<Reconstructions>(&api, id.0).await
}

/// Send a message about the end of a reconstruction anew.
#[utoipa::path(
    post,
    path = "/v1/reconstructions/{id}/deliveries/{delivery}/redeliver",
    operation_id = "redeliver",
    tag = "webhooks",
    params(("id" = String, Path, format = "uuid", description = "The reconstruction"),
           ("delivery" = String, Path, format = "uuid", description = "The message")),
    responses((status = 202, description = "Will be sent soon", body = DeliveryList), RedeliverProblems)
)]
pub(super) async fn redeliver(
    State(api): State<Arc<Api>>,
    id: DeliveryId<Reconstructions>,
) -> Result<(StatusCode, Json<DeliveryList>), Problem> {
    webhooks::redeliver::<Reconstructions>(&api, id).await
}
