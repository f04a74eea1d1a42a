//! Jobs by the keys that clients gave with their uploads.

use std::time::Duration;

use jiff::{SignedDuration, Timestamp};

use super::{Connection, backend};
use crate::{Idempotency, JobId, StoreError, TenantName};

/// How long a key is remembered.
const REMEMBERED: Duration = Duration::from_secs(24 * 3600);

/// The job that this key became, if it did.
///
/// # Errors
/// [`StoreError::OtherUpload`] if the key came with another upload.
pub(super) async fn find(
    connection: &mut Connection,
    tenant: &TenantName,
    given: &Idempotency,
    now: Timestamp,
) -> Result<Option<JobId>, StoreError> {
    let found: Option<(String, String)> = sqlx::query_as(
        "SELECT fingerprint, job_id FROM idempotency
         WHERE tenant = $1 AND key = $2 AND at_ms > $3",
    )
    .bind(tenant.as_str())
    .bind(&given.key)
    .bind(oldest(now))
    .fetch_optional(connection)
    .await
    .map_err(backend)?;
    let Some((fingerprint, id)) = found else { return Ok(None) };
    if fingerprint != given.fingerprint {
        return Err(StoreError::OtherUpload(given.key.clone()));
    }
    id.parse().map(Some).map_err(backend)
}

/// Remembers what the key became.
pub(super) async fn remember(
    connection: &mut Connection,
    tenant: &TenantName,
    given: &Idempotency,
    job: JobId,
    now: Timestamp,
) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO idempotency (tenant, key, fingerprint, job_id, at_ms)
         VALUES ($1, $2, $3, $4, $5)
         ON CONFLICT (tenant, key) DO UPDATE
         SET fingerprint = excluded.fingerprint, job_id = excluded.job_id, at_ms = excluded.at_ms",
    )
    .bind(tenant.as_str())
    .bind(&given.key)
    .bind(&given.fingerprint)
    .bind(job.to_string())
    .bind(now.as_millisecond())
    .execute(&mut *connection)
    .await
    .map_err(backend)?;
    // On the way, those that are remembered no more.
    sqlx::query("DELETE FROM idempotency WHERE at_ms <= $1 AND tenant = $2")
        .bind(oldest(now))
        .bind(tenant.as_str())
        .execute(connection)
        .await
        .map_err(backend)?;
    Ok(())
}

fn oldest(now: Timestamp) -> i64 {
    let remembered = SignedDuration::try_from(REMEMBERED).unwrap_or(SignedDuration::MAX);
    now.checked_sub(remembered).unwrap_or(Timestamp::MIN).as_millisecond()
}
