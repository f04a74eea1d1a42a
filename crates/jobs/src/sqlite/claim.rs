//! Which job is claimed next, and which lease is over.

use std::time::Duration;

use super::{Connection, SqliteStore, backend, rows};
use crate::{Claim, StoreError, Uptime};

impl SqliteStore {
    pub(super) async fn try_claim(
        &self,
        worker: &str,
        lease: Duration,
    ) -> Result<Option<Claim>, StoreError> {
        loop {
            // Read without the write lock: an idle worker's polling must not stand in the way of
            // writes.
            let mut reader = self.readers.acquire().await.map_err(backend)?;
            if next_queued(&mut reader, &self.clock.uptime()).await?.is_none() {
                return Ok(None);
            }
            drop(reader);
            // Looked for again under the lock: workers that all went for the one found before
            // would get it one at a time, and the rest find it gone.
            let (mut transaction, now) = self.begin().await?;
            let Some(id) = next_queued(&mut transaction, &now.uptime).await? else {
                return Ok(None);
            };
            match rows::find(&mut transaction, &id).await {
                Ok(Some(record)) => {
                    return self.give(transaction, record, worker, lease, &now).await.map(Some);
                }
                Ok(None) => {}
                Err(error @ StoreError::Unreadable(_)) => {
                    transaction.rollback().await.map_err(backend)?;
                    self.set_aside(&id, &error).await?;
                }
                Err(error) => return Err(error),
            }
        }
    }

    /// A running job whose lease is over, read without the write lock.
    pub(super) async fn next_expired(&self) -> Result<Option<String>, StoreError> {
        let now = self.clock.uptime();
        sqlx::query_scalar(
            "SELECT id FROM jobs
             WHERE state = 'running' AND (boot <> $1 OR lease_until_ms <= $2)
             ORDER BY lease_until_ms LIMIT 1",
        )
        .bind(&*now.boot)
        .bind(now.ms)
        .fetch_optional(&self.readers)
        .await
        .map_err(backend)
    }
}

/// The next job to claim.
async fn next_queued(
    connection: &mut Connection,
    now: &Uptime,
) -> Result<Option<String>, StoreError> {
    sqlx::query_scalar(
        "SELECT next FROM (
                 SELECT served,
                     (SELECT id FROM jobs
                      WHERE state = 'queued' AND tenant = tenants.name
                          AND (boot <> $1 OR not_before_ms <= $2)
                      ORDER BY priority DESC, rowid LIMIT 1) AS next,
                     (SELECT count(*) FROM jobs
                      WHERE state = 'running' AND tenant = tenants.name) AS running,
                     json_extract(limits, '$.max_running') AS most
                 FROM tenants)
             WHERE next IS NOT NULL AND running < coalesce(most, running + 1)
             ORDER BY running, served LIMIT 1",
    )
    .bind(&*now.boot)
    .bind(now.ms)
    .fetch_optional(connection)
    .await
    .map_err(backend)
}
