//! Jobs without a row whose stored bytes may be deleted.

use super::{Connection, backend};
use crate::{JobId, StoreError, Uptime};

pub(super) async fn add(
    connection: &mut Connection,
    id: JobId,
    now: &Uptime,
) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO ownerless (job_id, boot, at_ms) VALUES ($1, $2, $3)
         ON CONFLICT (job_id) DO UPDATE SET boot = excluded.boot, at_ms = excluded.at_ms",
    )
    .bind(id.to_string())
    .bind(&*now.boot)
    .bind(now.ms)
    .execute(connection)
    .await
    .map_err(backend)?;
    Ok(())
}

pub(super) async fn remove(connection: &mut Connection, id: JobId) -> Result<(), StoreError> {
    sqlx::query("DELETE FROM ownerless WHERE job_id = $1")
        .bind(id.to_string())
        .execute(connection)
        .await
        .map_err(backend)?;
    Ok(())
}

/// When the job came to be without a row; `None` if it did not.
pub(super) async fn since(
    connection: &mut Connection,
    id: JobId,
) -> Result<Option<Uptime>, StoreError> {
    let found: Option<(String, i64)> =
        sqlx::query_as("SELECT boot, at_ms FROM ownerless WHERE job_id = $1")
            .bind(id.to_string())
            .fetch_optional(connection)
            .await
            .map_err(backend)?;
    Ok(found.map(|(boot, ms)| Uptime { boot: boot.into(), ms }))
}
