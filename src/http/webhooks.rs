//! Where the ends of jobs are told, and what came of it.

use std::fmt::Display;
use std::marker::PhantomData;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::rejection::PathRejection;
use axum::extract::{FromRequestParts, Path, State};
use axum::http::StatusCode;
use axum::http::request::Parts;
use axum::{Extension, Json};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use url::Url;
use utoipa::ToSchema;
use uuid::Uuid;

use super::Api;
use super::access::Caller;
use super::body::Body;
use super::openapi::problem_responses;
use super::problem::{
    INVALID_BODY, INVALID_WEBHOOK, NO_WEBHOOK_SECRET, Problem, UNAVAILABLE, UNKNOWN_DELIVERY,
};
use super::resource::{Id, OwnedId, Resource, find};
use jobs::{Delivery, DeliveryAttempt, DeliveryState, TenantName};

/// How long a secret is signed with after there is a newer one.
const OVERLAP: Duration = Duration::from_secs(24 * 3600);

problem_responses! { GetProblems: UNAVAILABLE }
problem_responses! { PutProblems: INVALID_BODY, INVALID_WEBHOOK, NO_WEBHOOK_SECRET, UNAVAILABLE }

/// Where the ends of a tenant's jobs are told.
#[derive(Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = Webhook, example = json!({"url": "https://studio.example/turnaround"}))]
pub(super) struct WebhookDocument {
    /// An https URL; null tells nobody but those that jobs name themselves.
    #[serde(deserialize_with = "Option::deserialize")]
    #[schema(max_length = 2048, format = "uri", pattern = "^https?://", required)]
    url: Option<String>,
}

/// What messages are signed with.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = WebhookSecret)]
pub(super) struct SecretDocument {
    /// Of the form of Standard Webhooks; shown this once.
    #[schema(example = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSwMfKQ9r8GKYo=")]
    secret: String,
    /// Until then messages are signed with the secret before as well, if there is one.
    #[schema(value_type = String, format = DateTime)]
    overlap_until: Timestamp,
}

/// Where a message is in its life.
#[derive(Clone, Copy, Debug, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = DeliveryState)]
enum DeliveryStateName {
    Pending,
    Delivered,
    GivenUp,
}

/// What came of sending a message once.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = DeliveryAttempt)]
struct AttemptDocument {
    #[schema(value_type = String, format = DateTime)]
    at: Timestamp,
    /// From then to the end of the answer.
    duration_ms: u64,
    /// What the receiver answered; null if nothing.
    status: Option<u16>,
    /// Why it was no success; null if it was.
    error: Option<String>,
}

/// A message about the end of a job.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Delivery)]
pub(super) struct DeliveryDocument {
    #[schema(format = Uuid)]
    id: String,
    state: DeliveryStateName,
    /// Scheme and host of the receiver: the rest of an address may be a secret.
    #[schema(example = "https://studio.example")]
    receiver: String,
    /// Oldest first.
    attempts: Vec<AttemptDocument>,
}

/// The messages about the end of a job, oldest first.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct DeliveryList {
    deliveries: Vec<DeliveryDocument>,
}

impl From<(Delivery, Vec<DeliveryAttempt>)> for DeliveryDocument {
    fn from((delivery, attempts): (Delivery, Vec<DeliveryAttempt>)) -> Self {
        let receiver = Url::parse(&delivery.url).map(|url| url.origin().ascii_serialization());
        let attempt = |attempt: DeliveryAttempt| AttemptDocument {
            at: attempt.at,
            duration_ms: u64::try_from(attempt.duration.as_millis()).unwrap_or(u64::MAX),
            status: attempt.status,
            error: attempt.error,
        };
        Self {
            id: delivery.id.to_string(),
            state: match delivery.state {
                DeliveryState::Pending => DeliveryStateName::Pending,
                DeliveryState::Delivered => DeliveryStateName::Delivered,
                DeliveryState::GivenUp => DeliveryStateName::GivenUp,
            },
            receiver: receiver.unwrap_or_default(),
            attempts: attempts.into_iter().map(attempt).collect(),
        }
    }
}

/// The id of an `R` and of a message about it in the path.
pub(super) struct DeliveryId<R> {
    job: OwnedId,
    /// What is no id names none.
    message: Option<Uuid>,
    of: PhantomData<R>,
}

impl<R: Resource, S: Send + Sync> FromRequestParts<S> for DeliveryId<R> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let path: Result<Path<(String, String)>, PathRejection> =
            Path::from_request_parts(parts, state).await;
        let Path((job, message)) =
            path.map_err(|error| Problem::new(R::UNKNOWN, error.body_text()))?;
        let job = OwnedId { id: Id::<R>::parse(&job)?, caller: Caller::of(parts)? };
        Ok(Self { job, message: message.parse().ok(), of: PhantomData })
    }
}

/// Holds an address against what may be called, and whether there is a secret.
pub(super) async fn check(api: &Api, tenant: &TenantName, url: &str) -> Result<(), Problem> {
    let refused = |why: &dyn Display| {
        Problem::new(INVALID_WEBHOOK, format!("the URL of the webhook is refused: {why}"))
    };
    api.state.outbound.policy().check(url).map_err(|error| refused(&error))?;
    // It is answered as it was given: one that browsers would mend is none yet.
    fluent_uri::Uri::parse(url).map_err(|_| {
        refused(&"it has characters that no URL has; percent-encode them and give an https URL")
    })?;
    if api.state.store.webhook_secrets(tenant).await?.is_empty() {
        let detail = format!(
            "tenant {tenant} has no secret to sign messages with; make one with POST /v1/webhook/secret"
        );
        return Err(Problem::new(NO_WEBHOOK_SECRET, detail));
    }
    Ok(())
}

/// Get where the ends of jobs are told.
#[utoipa::path(
    get,
    path = "/v1/webhook",
    operation_id = "webhook",
    tag = "webhooks",
    responses((status = 200, description = "As it is now", body = WebhookDocument), GetProblems)
)]
pub(super) async fn get(
    State(api): State<Arc<Api>>,
    Extension(caller): Extension<Arc<Caller>>,
) -> Result<Json<WebhookDocument>, Problem> {
    Ok(Json(WebhookDocument { url: api.state.store.webhook(&caller.tenant).await? }))
}

/// Set where the ends of jobs are told.
///
/// Holds for jobs of the tenant that end from now on and have no `webhook` of their own.
#[utoipa::path(
    put,
    path = "/v1/webhook",
    operation_id = "set_webhook",
    tag = "webhooks",
    request_body = WebhookDocument,
    responses((status = 200, description = "As it is now", body = WebhookDocument), PutProblems)
)]
pub(super) async fn put(
    State(api): State<Arc<Api>>,
    Extension(caller): Extension<Arc<Caller>>,
    Body(document): Body<WebhookDocument>,
) -> Result<Json<WebhookDocument>, Problem> {
    if let Some(url) = &document.url {
        let checked = check(&api, &caller.tenant, url).await;
        checked.map_err(|problem| problem.part("url"))?;
    }
    api.state.store.set_webhook(&caller.tenant, document.url.as_deref()).await?;
    Ok(Json(document))
}

/// Make a new secret to sign messages with.
///
/// It is shown this once. The secret before goes on beside it for a day, so that
/// receivers can change over.
#[utoipa::path(
    post,
    path = "/v1/webhook/secret",
    operation_id = "new_webhook_secret",
    tag = "webhooks",
    responses((status = 201, description = "Made", body = SecretDocument), GetProblems)
)]
pub(super) async fn new_secret(
    State(api): State<Arc<Api>>,
    Extension(caller): Extension<Arc<Caller>>,
) -> Result<(StatusCode, Json<SecretDocument>), Problem> {
    let secret = jobs::new_webhook_secret();
    api.state.store.add_webhook_secret(&caller.tenant, &secret, OVERLAP).await?;
    let overlap_until = Timestamp::now() + OVERLAP;
    Ok((StatusCode::CREATED, Json(SecretDocument { secret, overlap_until })))
}

/// Answers the messages about a job.
pub(super) async fn list<R: Resource>(
    api: &Api,
    asked: OwnedId,
) -> Result<Json<DeliveryList>, Problem> {
    let id = find::<R>(api, &asked).await?.id;
    let deliveries = api.state.store.deliveries(id).await?;
    Ok(Json(DeliveryList { deliveries: deliveries.into_iter().map(Into::into).collect() }))
}

/// Has a message sent anew.
pub(super) async fn redeliver<R: Resource>(
    api: &Api,
    asked: DeliveryId<R>,
) -> Result<(StatusCode, Json<DeliveryList>), Problem> {
    let DeliveryId { job, message, .. } = asked;
    let id = find::<R>(api, &job).await?.id;
    let found = match message {
        Some(message) => api.state.store.redeliver(id, message).await?,
        None => false,
    };
    if !found {
        let detail = format!("there is no such message about {id}");
        return Err(Problem::new(UNKNOWN_DELIVERY, detail));
    }
    Ok((StatusCode::ACCEPTED, list::<R>(api, job).await?))
}
