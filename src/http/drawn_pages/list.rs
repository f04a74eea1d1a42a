//! The list of a tenant's pages.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::Extension;
use axum::extract::rejection::QueryRejection;
use axum::extract::{Query, State};
use axum::response::Response;
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

use crate::http::Api;
use crate::http::access::Caller;
use crate::http::openapi::problem_responses;
use crate::http::problem::{INVALID_QUERY, Problem, UNAVAILABLE};
use crate::http::resource::{cursor, limit_of, next_uri, part_of_list};
use crate::http::tags::pairs;
use jobs::{PageQuery, StoredPage};

problem_responses! { ListProblems: INVALID_QUERY, UNAVAILABLE }

/// Which part of the list.
#[derive(Clone, Debug, Default, Deserialize, Serialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(in crate::http) struct PageListParameters {
    /// Only those that have all of these labels: `show:7,shot:12`.
    labels: Option<String>,
    /// Only those sent at this time or later (RFC 3339).
    #[param(value_type = Option<String>, format = DateTime)]
    created_from: Option<Timestamp>,
    /// Only those sent before this time.
    #[param(value_type = Option<String>, format = DateTime)]
    created_before: Option<Timestamp>,
    /// At most this many.
    #[param(minimum = 1, maximum = 100, default = 20)]
    limit: Option<u32>,
    /// Where to go on: from the last answer's `next`.
    #[param(value_type = Option<String>, format = Uuid)]
    cursor: Option<String>,
}

/// A page in a list.
#[derive(Debug, Serialize, ToSchema)]
struct PageSummary {
    id: Uuid,
    /// Counts the changes of what is on it, from 1.
    version: u64,
    /// What people call it.
    #[serde(skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    /// What it is found by.
    labels: BTreeMap<String, String>,
    #[schema(value_type = String, format = DateTime)]
    created_at: Timestamp,
    #[schema(value_type = String, format = DateTime)]
    changed_at: Timestamp,
    /// When it is deleted by itself, unless it is pinned; null if never.
    #[schema(value_type = Option<String>, format = DateTime)]
    expires_at: Option<Timestamp>,
    /// Whether it stays although its time is over.
    pinned: bool,
    /// The whole of it, as a relative URI.
    #[schema(format = "uri-reference")]
    href: String,
}

/// Part of the list of pages, newest first.
#[derive(Debug, Serialize, ToSchema)]
pub(in crate::http) struct PageList {
    pages: Vec<PageSummary>,
    /// The next part, as a relative URI; null at the end.
    #[schema(format = "uri-reference")]
    next: Option<String>,
}

impl From<StoredPage> for PageSummary {
    fn from(page: StoredPage) -> Self {
        Self {
            id: page.id.0,
            version: page.version,
            name: page.tags.name,
            labels: page.tags.labels,
            created_at: page.created_at,
            changed_at: page.changed_at,
            expires_at: page.tags.expires_at,
            pinned: page.tags.pinned,
            href: format!("/v1/pages/{}", page.id),
        }
    }
}

/// List pages, newest first.
#[utoipa::path(
    get,
    path = "/v1/pages",
    operation_id = "list_pages",
    tag = "pages",
    params(PageListParameters),
    responses(
        (status = 200, description = "Part of the list", body = PageList,
         headers(("Link" = String, description = "The next part, as rel=next"))),
        ListProblems,
    )
)]
pub(in crate::http) async fn list(
    State(api): State<Arc<Api>>,
    Extension(caller): Extension<Arc<Caller>>,
    parameters: Result<Query<PageListParameters>, QueryRejection>,
) -> Result<Response, Problem> {
    let Query(parameters) =
        parameters.map_err(|error| Problem::new(INVALID_QUERY, error.body_text()))?;
    let limit = limit_of(parameters.limit)?;
    let labels = parameters.labels.as_deref();
    let query = PageQuery {
        tenant: caller.tenant.clone(),
        labels: labels.map_or_else(|| Ok(BTreeMap::new()), |it| pairs(it, INVALID_QUERY))?,
        created_from: parameters.created_from,
        created_before: parameters.created_before,
        before: parameters.cursor.as_deref().map(cursor).transpose()?,
        // One more than asked for tells whether there is a next part.
        limit: limit + 1,
    };
    let mut found = api.state.store.pages(&query).await?;
    let more = found.len() > limit as usize;
    found.truncate(limit as usize);
    let last = found.last().filter(|_| more);
    let next = last.map(|page| next_uri("/v1/pages", &parameters, limit, page.id));
    let pages = found.into_iter().map(PageSummary::from).collect();
    Ok(part_of_list(next, |next| PageList { pages, next }))
}
