//! Stored bytes.

use async_trait::async_trait;
use sqlx::{Row as _, Transaction};

use super::access::expect_tenant;
use super::{Connection, Db, Row, Store, backend, commit_error, ownerless, rows};
use crate::bytes::BytesOf;
use crate::storage::StorageStore;
use crate::{JobId, StoreError, TenantName, Uptime};

/// Rows that are measured in one go.
const MEASURED_AT_A_TIME: u32 = 100;

/// Bytes stored for the tenant, or for all.
pub(super) async fn stored(
    connection: &mut Connection,
    tenant: Option<&TenantName>,
) -> Result<u64, StoreError> {
    let bytes: i64 = sqlx::query_scalar(
        "SELECT CAST(
             (SELECT coalesce(sum(bytes), 0) FROM jobs WHERE $1 IS NULL OR tenant = $1)
             + (SELECT coalesce(sum(bytes), 0) FROM pages WHERE $1 IS NULL OR tenant = $1)
         AS BIGINT)",
    )
    .bind(tenant.map(TenantName::as_str))
    .fetch_one(connection)
    .await
    .map_err(backend)?;
    Ok(bytes.cast_unsigned())
}

/// Refuses `more` bytes if the tenant would then have over `most`.
pub(super) async fn expect_room(
    connection: &mut Connection,
    tenant: &TenantName,
    more: u64,
    most: Option<u64>,
) -> Result<(), StoreError> {
    let Some(most) = most else { return Ok(()) };
    expect_tenant(connection, tenant).await?;
    if stored(connection, Some(tenant)).await?.saturating_add(more) <= most {
        return Ok(());
    }
    Err(StoreError::TooManyBytes { tenant: tenant.clone(), most })
}

/// Of rows with id and tenant.
pub(super) fn all_bytes_of(found: &[Row]) -> Result<Vec<BytesOf>, StoreError> {
    found.iter().map(|row| rows::bytes_of(row).map_err(backend)).collect()
}

impl Store {
    /// Ends a deletion: the jobs and pages were deleted, and their bytes are
    /// ownerless from now on.
    pub(super) async fn let_go(
        &self,
        mut transaction: Transaction<'static, Db>,
        gone: Vec<BytesOf>,
        now: &Uptime,
    ) -> Result<Vec<BytesOf>, StoreError> {
        for BytesOf { id, .. } in &gone {
            ownerless::add(&mut transaction, *id, now).await?;
        }
        transaction.commit().await.map_err(commit_error)?;
        Ok(gone)
    }

    async fn try_expire(&self) -> Result<Vec<BytesOf>, StoreError> {
        const JOBS: &str = "jobs WHERE state IN ('succeeded', 'failed', 'cancelled')
            AND (delete_requested = 1 OR (pinned = 0 AND expires_ms <= $1))";
        const PAGES: &str = "pages WHERE pinned = 0 AND expires_ms <= $1";
        let mut connection = self.readers().acquire().await.map_err(backend)?;
        let now_ms = self.present(&mut connection).await?.time.as_millisecond();
        let found = sqlx::AssertSqlSafe(format!(
            "SELECT EXISTS (SELECT 1 FROM {JOBS}) OR EXISTS (SELECT 1 FROM {PAGES})"
        ));
        let found = sqlx::query_scalar(found).bind(now_ms).fetch_one(&mut *connection);
        let found: bool = found.await.map_err(backend)?;
        drop(connection);
        if !found {
            return Ok(Vec::new());
        }
        let (mut transaction, now) = self.begin().await?;
        let mut gone = Vec::new();
        for table in [JOBS, PAGES] {
            let delete = format!("DELETE FROM {table} RETURNING id, tenant");
            let delete = sqlx::query(sqlx::AssertSqlSafe(delete)).bind(now_ms);
            let deleted = delete.fetch_all(&mut *transaction).await.map_err(backend)?;
            gone.extend(all_bytes_of(&deleted)?);
        }
        self.let_go(transaction, gone, &now.uptime).await
    }

    async fn try_make_room(&self, most: u64) -> Result<Vec<BytesOf>, StoreError> {
        let (mut transaction, now) = self.begin().await?;
        let mut over = stored(&mut transaction, None).await?.saturating_sub(most);
        let mut gone = Vec::new();
        let oldest = if over == 0 {
            Vec::new()
        } else {
            sqlx::query(
                "SELECT id, tenant, bytes FROM (
                     SELECT id, tenant, bytes, finished_ms AS at_ms FROM jobs
                     WHERE pinned = 0 AND state IN ('succeeded', 'failed', 'cancelled')
                     UNION ALL SELECT id, tenant, bytes, changed_ms FROM pages
                     WHERE pinned = 0) AS kept
                 ORDER BY at_ms, id",
            )
            .fetch_all(&mut *transaction)
            .await
            .map_err(backend)?
        };
        for row in oldest {
            let of = rows::bytes_of(&row).map_err(backend)?;
            let bytes: Option<i64> = row.try_get("bytes").map_err(backend)?;
            if over == 0 {
                break;
            }
            for sql in [
                // It may be pinned by now.
                "DELETE FROM jobs WHERE id = $1 AND pinned = 0",
                "DELETE FROM pages WHERE id = $1 AND pinned = 0",
            ] {
                let delete = sqlx::query(sql).bind(of.id.to_string()).execute(&mut *transaction);
                delete.await.map_err(backend)?;
            }
            over = over.saturating_sub(bytes.unwrap_or(0).cast_unsigned());
            gone.push(of);
        }
        self.let_go(transaction, gone, &now.uptime).await
    }
}

#[async_trait]
impl StorageStore for Store {
    async fn stored_bytes(&self, tenant: Option<&TenantName>) -> Result<u64, StoreError> {
        let mut connection = self.readers().acquire().await.map_err(backend)?;
        stored(&mut connection, tenant).await
    }

    async fn unmeasured(&self) -> Result<Vec<BytesOf>, StoreError> {
        let found = sqlx::query(
            "SELECT id, tenant FROM jobs
             WHERE bytes IS NULL AND state NOT IN ('queued', 'running')
             UNION ALL SELECT id, tenant FROM pages WHERE bytes IS NULL LIMIT $1",
        )
        .bind(i64::from(MEASURED_AT_A_TIME))
        .fetch_all(self.readers())
        .await
        .map_err(backend)?;
        all_bytes_of(&found)
    }

    async fn measured(&self, id: JobId, bytes: u64) -> Result<(), StoreError> {
        let (mut transaction, _) = self.begin().await?;
        for sql in [
            "UPDATE jobs SET bytes = $2 WHERE id = $1 AND bytes IS NULL",
            "UPDATE pages SET bytes = $2 WHERE id = $1 AND bytes IS NULL",
        ] {
            let write = sqlx::query(sql).bind(id.to_string()).bind(bytes.cast_signed());
            write.execute(&mut *transaction).await.map_err(backend)?;
        }
        transaction.commit().await.map_err(commit_error)
    }

    async fn expire(&self) -> Result<Vec<BytesOf>, StoreError> {
        self.insist(|| self.try_expire()).await
    }

    async fn make_room(&self, most: u64) -> Result<Vec<BytesOf>, StoreError> {
        self.insist(|| self.try_make_room(most)).await
    }
}
