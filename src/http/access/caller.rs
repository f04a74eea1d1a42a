//! Who sent a request.

use std::sync::Arc;

use axum::http::request::Parts;

use crate::http::problem::Problem;
use jobs::{Scope, TenantLimits, TenantName};

/// Who sent a request, as the layer found out.
#[derive(Clone, Debug)]
pub(crate) struct Caller {
    /// Whose jobs it is about.
    pub tenant: TenantName,
    /// What it may do.
    pub scope: Scope,
    /// The id of its key; empty if it needs none.
    pub key: String,
    /// What holds for its tenant.
    pub limits: TenantLimits,
}

impl Caller {
    /// The caller of a request that went through the layer.
    ///
    /// # Errors
    /// A fault of ours, if the route is open to everybody and has no caller.
    pub(crate) fn of(parts: &Parts) -> Result<Arc<Self>, Problem> {
        let found = parts.extensions.get::<Arc<Self>>().cloned();
        found.ok_or_else(|| Problem::internal("access", &"a route without a caller needs one"))
    }
}
