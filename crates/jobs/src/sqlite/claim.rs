//! Which job is claimed next, and which lease is over.

use std::time::Duration;

use super::{SqliteStore, backend, rows};
use crate::{Claim, JobState, StoreError, Uptime};

impl SqliteStore {
    pub(super) async fn try_claim(
        &self,
        worker: &str,
        lease: Duration,
    ) -> Result<Option<Claim>, StoreError> {
        while let Some(id) = self.next_queued(&self.clock.uptime()).await? {
            match self.claim_one(&id, worker, lease).await {
                Ok(Some(claim)) => return Ok(Some(claim)),
                Ok(None) => {}
                Err(error @ StoreError::Unreadable(_)) => self.set_aside(&id, &error).await?,
                Err(error) => return Err(error),
            }
        }
        Ok(None)
    }

    /// The next job to claim, read without the write lock: an idle worker's
    /// polling must not stand in the way of writes.
    async fn next_queued(&self, now: &Uptime) -> Result<Option<String>, StoreError> {
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
        .fetch_optional(&self.readers)
        .await
        .map_err(backend)
    }

    /// Claims the job if nobody did since it was found.
    async fn claim_one(
        &self,
        id: &str,
        worker: &str,
        lease: Duration,
    ) -> Result<Option<Claim>, StoreError> {
        let (mut transaction, now) = self.begin().await?;
        let Some(record) = rows::find(&mut transaction, id).await? else { return Ok(None) };
        if record.job.state != JobState::Queued || !record.not_before.is_over(&now.uptime) {
            return Ok(None);
        }
        self.give(transaction, record, worker, lease, &now).await.map(Some)
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
