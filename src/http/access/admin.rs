//! The resources under `/v1/admin`: tenants and keys.

use std::sync::Arc;

use axum::Json;
use axum::extract::{Path, State};
use axum::http::StatusCode;

use super::documents::{
    KeyDocument, KeyList, Limits, NewKeyDocument, NewTenant, TenantDocument, TenantList,
};
use crate::http::Api;
use crate::http::body::Body;
use crate::http::openapi::problem_responses;
use crate::http::problem::{
    INVALID_BODY, Problem, TENANT_EXISTS, TENANT_IN_USE, UNAVAILABLE, UNKNOWN_KEY, UNKNOWN_TENANT,
};
use jobs::bytes::BytesOf;
use jobs::{KeyText, NewKey, TenantName};

const MAX_LABEL: usize = 200;

problem_responses! { TenantProblems: INVALID_BODY, TENANT_EXISTS, UNAVAILABLE }
problem_responses! { TenantListProblems: UNAVAILABLE }
problem_responses! { LimitProblems: INVALID_BODY, UNKNOWN_TENANT, UNAVAILABLE }
problem_responses! { TenantDeleteProblems: UNKNOWN_TENANT, TENANT_IN_USE, UNAVAILABLE }
problem_responses! { KeyProblems: INVALID_BODY, UNKNOWN_TENANT, UNAVAILABLE }
problem_responses! { KeyListProblems: UNAVAILABLE }
problem_responses! { RevokeProblems: UNKNOWN_KEY, UNAVAILABLE }

fn tenant_name(text: &str) -> Result<TenantName, Problem> {
    text.parse().map_err(|error| Problem::new(INVALID_BODY, format!("{error}")))
}

/// What is no name names no tenant.
fn known_name(text: &str) -> Result<TenantName, Problem> {
    text.parse().map_err(|error| Problem::new(UNKNOWN_TENANT, format!("{error}")))
}

/// Make a tenant.
#[utoipa::path(
    post,
    path = "/v1/admin/tenants",
    operation_id = "create_tenant",
    tag = "admin",
    request_body = NewTenant,
    responses((status = 201, description = "Made", body = TenantDocument), TenantProblems)
)]
pub(in crate::http) async fn create_tenant(
    State(api): State<Arc<Api>>,
    Body(given): Body<NewTenant>,
) -> Result<(StatusCode, Json<TenantDocument>), Problem> {
    let name = tenant_name(&given.name)?;
    let tenant = api.state.access.store.create_tenant(&name).await?;
    Ok((StatusCode::CREATED, Json(tenant.into())))
}

/// List all tenants.
#[utoipa::path(
    get,
    path = "/v1/admin/tenants",
    operation_id = "tenants",
    tag = "admin",
    responses((status = 200, description = "By name", body = TenantList), TenantListProblems)
)]
pub(in crate::http) async fn tenants(
    State(api): State<Arc<Api>>,
) -> Result<Json<TenantList>, Problem> {
    let tenants = api.state.access.store.tenants().await?;
    Ok(Json(TenantList { tenants: tenants.into_iter().map(Into::into).collect() }))
}

/// Set a tenant's limits.
///
/// They replace those it had.
#[utoipa::path(
    put,
    path = "/v1/admin/tenants/{name}/limits",
    operation_id = "limit_tenant",
    tag = "admin",
    params(("name" = String, Path, description = "The tenant", example = "show-7")),
    request_body = Limits,
    responses((status = 200, description = "As it is now", body = TenantDocument), LimitProblems)
)]
pub(in crate::http) async fn limit_tenant(
    State(api): State<Arc<Api>>,
    Path(name): Path<String>,
    Body(given): Body<Limits>,
) -> Result<Json<TenantDocument>, Problem> {
    let limits = given.into();
    let tenant = api.state.access.store.limit_tenant(&known_name(&name)?, &limits).await?;
    Ok(Json(tenant.into()))
}

/// Delete a tenant with its keys, jobs and results.
#[utoipa::path(
    delete,
    path = "/v1/admin/tenants/{name}",
    operation_id = "delete_tenant",
    tag = "admin",
    params(("name" = String, Path, description = "The tenant", example = "show-7")),
    responses((status = 204, description = "Deleted"), TenantDeleteProblems)
)]
pub(in crate::http) async fn delete_tenant(
    State(api): State<Arc<Api>>,
    Path(name): Path<String>,
) -> Result<StatusCode, Problem> {
    for gone in api.state.access.store.delete_tenant(&known_name(&name)?).await? {
        let BytesOf { id, home } = gone;
        if let Err(error) = api.state.bytes.of(&home).delete_job(id).await {
            // The collector of ownerless bytes takes the rest.
            tracing::warn!(%id, %error, "bytes of a deleted job stay for now");
        }
    }
    Ok(StatusCode::NO_CONTENT)
}

/// Make a key.
///
/// The whole key is in this answer and nowhere else.
#[utoipa::path(
    post,
    path = "/v1/admin/keys",
    operation_id = "create_key",
    tag = "admin",
    request_body = NewKeyDocument,
    responses((status = 201, description = "Made", body = KeyDocument), KeyProblems)
)]
pub(in crate::http) async fn create_key(
    State(api): State<Arc<Api>>,
    Body(given): Body<NewKeyDocument>,
) -> Result<(StatusCode, Json<KeyDocument>), Problem> {
    let NewKeyDocument { tenant, label, scope } = given;
    if label.len() > MAX_LABEL {
        let detail = format!("`label` has {} bytes; give {MAX_LABEL} at most", label.len());
        return Err(Problem::new(INVALID_BODY, detail));
    }
    let new = NewKey { tenant: tenant_name(&tenant)?, label, scope: scope.into() };
    let text = KeyText::generate();
    let key = api.state.access.store.add_key(&new, &text).await?;
    let document = KeyDocument { key: Some(text.reveal().to_owned()), ..key.into() };
    Ok((StatusCode::CREATED, Json(document)))
}

/// List all keys, revoked ones too.
#[utoipa::path(
    get,
    path = "/v1/admin/keys",
    operation_id = "keys",
    tag = "admin",
    responses((status = 200, description = "By tenant and age", body = KeyList), KeyListProblems)
)]
pub(in crate::http) async fn keys(State(api): State<Arc<Api>>) -> Result<Json<KeyList>, Problem> {
    let keys = api.state.access.store.keys().await?;
    Ok(Json(KeyList { keys: keys.into_iter().map(Into::into).collect() }))
}

/// Revoke a key for good.
#[utoipa::path(
    delete,
    path = "/v1/admin/keys/{id}",
    operation_id = "revoke_key",
    tag = "admin",
    params(("id" = String, Path, description = "The key's id", example = "ta_0123456789ab")),
    responses((status = 200, description = "Revoked", body = KeyDocument), RevokeProblems)
)]
pub(in crate::http) async fn revoke_key(
    State(api): State<Arc<Api>>,
    Path(id): Path<String>,
) -> Result<Json<KeyDocument>, Problem> {
    Ok(Json(api.state.access.store.revoke_key(&id).await?.into()))
}
