//! Jobs without a row whose stored bytes may be deleted.

use sqlx::SqliteConnection;
use sqlx::sqlite::SqlitePool;

use super::backend;
use crate::{JobId, StoreError, Uptime};

pub(super) async fn add(
    connection: &mut SqliteConnection,
    id: JobId,
    now: &Uptime,
) -> Result<(), StoreError> {
    sqlx::query("INSERT OR REPLACE INTO ownerless (job_id, boot, at_ms) VALUES (?1, ?2, ?3)")
        .bind(id.to_string())
        .bind(&*now.boot)
        .bind(now.ms)
        .execute(connection)
        .await
        .map_err(backend)?;
    Ok(())
}

pub(super) async fn remove(connection: &mut SqliteConnection, id: JobId) -> Result<(), StoreError> {
    sqlx::query("DELETE FROM ownerless WHERE job_id = ?1")
        .bind(id.to_string())
        .execute(connection)
        .await
        .map_err(backend)?;
    Ok(())
}

/// When the job came to be without a row; `None` if it did not.
pub(super) async fn since(readers: &SqlitePool, id: JobId) -> Result<Option<Uptime>, StoreError> {
    let found: Option<(String, i64)> =
        sqlx::query_as("SELECT boot, at_ms FROM ownerless WHERE job_id = ?1")
            .bind(id.to_string())
            .fetch_optional(readers)
            .await
            .map_err(backend)?;
    Ok(found.map(|(boot, ms)| Uptime { boot: boot.into(), ms }))
}
