//! Tenants and keys as administrators see them.

use std::num::NonZeroU32;

use jiff::Timestamp;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

use jobs::{ApiKey, Tenant, TenantLimits};

/// Somebody whose jobs nobody else sees.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Tenant, example = json!({
    "name": "show-7", "created_at": "2026-11-27T08:00:00Z", "limits": {"max_queued": 500}
}))]
pub(in crate::http) struct TenantDocument {
    #[schema(pattern = "^[a-z0-9-]{1,63}$")]
    pub name: String,
    #[schema(value_type = String, format = DateTime)]
    pub created_at: Timestamp,
    pub limits: Limits,
}

/// What of the service's limits is otherwise for a tenant; what is left out or null
/// holds as for all.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = TenantLimits, example = json!({
    "requests_per_second": 50, "max_queued": 500, "max_running": 2, "expires_in": 2_592_000
}))]
pub(in crate::http) struct Limits {
    /// Requests a second.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<i64>, minimum = 1, maximum = 4_294_967_295_i64)]
    pub requests_per_second: Option<NonZeroU32>,
    /// Jobs waiting at a time.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<i64>, minimum = 0, maximum = 4_294_967_295_i64)]
    pub max_queued: Option<u32>,
    /// Jobs running at a time.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<i64>, minimum = 0, maximum = 4_294_967_295_i64)]
    pub max_running: Option<u32>,
    /// Event streams open at a time.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<i64>, minimum = 0, maximum = 4_294_967_295_i64)]
    pub max_streams: Option<u32>,
    /// Bytes stored for jobs and pages: uploads are refused above.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "byte_count")]
    pub max_bytes: Option<u64>,
    /// Seconds after which jobs and pages are deleted that do not say it themselves.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<i64>, minimum = 1, maximum = 4_294_967_295_i64)]
    pub expires_in: Option<NonZeroU32>,
}

/// Of bytes, no more than a signed number has: more than any disk.
fn byte_count<'de, D: Deserializer<'de>>(from: D) -> Result<Option<u64>, D::Error> {
    let given = Option::<i64>::deserialize(from)?;
    given.map(|bytes| u64::try_from(bytes).map_err(D::Error::custom)).transpose()
}

/// A tenant to be made.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"name": "show-7"}))]
pub(in crate::http) struct NewTenant {
    #[schema(pattern = "^[a-z0-9-]{1,63}$")]
    pub name: String,
}

/// All tenants, by name.
#[derive(Debug, Serialize, ToSchema)]
pub(in crate::http) struct TenantList {
    pub tenants: Vec<TenantDocument>,
}

/// What a key allows; each includes those before it.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = Scope)]
pub(in crate::http) enum ScopeName {
    Read,
    Write,
    Admin,
}

/// A key to be made.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = NewKey, example = json!({"tenant": "show-7", "label": "render farm", "scope": "write"}))]
pub(in crate::http) struct NewKeyDocument {
    #[schema(pattern = "^[a-z0-9-]{1,63}$")]
    pub tenant: String,
    /// What people call it.
    #[schema(max_length = 200)]
    pub label: String,
    pub scope: ScopeName,
}

/// A key. The whole of it is shown once, when it is made.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Key)]
pub(in crate::http) struct KeyDocument {
    /// The readable first part of the key.
    #[schema(example = "ta_0123456789ab")]
    pub id: String,
    pub tenant: String,
    pub label: String,
    pub scope: ScopeName,
    #[schema(value_type = String, format = DateTime)]
    pub created_at: Timestamp,
    #[schema(value_type = Option<String>, format = DateTime)]
    pub revoked_at: Option<Timestamp>,
    /// The whole key, for `Authorization: Bearer`; only in the answer that makes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub key: Option<String>,
}

/// All keys, by tenant and age.
#[derive(Debug, Serialize, ToSchema)]
pub(in crate::http) struct KeyList {
    pub keys: Vec<KeyDocument>,
}

impl From<Tenant> for TenantDocument {
    fn from(tenant: Tenant) -> Self {
        let TenantLimits {
            requests_per_second,
            max_queued,
            max_running,
            max_streams,
            max_bytes,
            expires_in,
        } = tenant.limits;
        let limits = Limits {
            // A 0 was taken once.
            requests_per_second: requests_per_second.and_then(NonZeroU32::new),
            max_queued,
            max_running,
            max_streams,
            max_bytes,
            expires_in: expires_in.and_then(NonZeroU32::new),
        };
        Self { name: tenant.name.to_string(), created_at: tenant.created_at, limits }
    }
}

impl From<Limits> for TenantLimits {
    fn from(limits: Limits) -> Self {
        let Limits {
            requests_per_second,
            max_queued,
            max_running,
            max_streams,
            max_bytes,
            expires_in,
        } = limits;
        Self {
            requests_per_second: requests_per_second.map(NonZeroU32::get),
            max_queued,
            max_running,
            max_streams,
            max_bytes,
            expires_in: expires_in.map(NonZeroU32::get),
        }
    }
}

impl From<ApiKey> for KeyDocument {
    fn from(key: ApiKey) -> Self {
        Self {
            id: key.id,
            tenant: key.tenant.to_string(),
            label: key.label,
            scope: match key.scope {
                jobs::Scope::Read => ScopeName::Read,
                jobs::Scope::Write => ScopeName::Write,
                jobs::Scope::Admin => ScopeName::Admin,
            },
            created_at: key.created_at,
            revoked_at: key.revoked_at,
            key: None,
        }
    }
}

impl From<ScopeName> for jobs::Scope {
    fn from(scope: ScopeName) -> Self {
        match scope {
            ScopeName::Read => Self::Read,
            ScopeName::Write => Self::Write,
            ScopeName::Admin => Self::Admin,
        }
    }
}
