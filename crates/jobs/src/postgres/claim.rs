//! Which job is claimed next, and which lease is over.

use std::time::Duration;

use super::{PostgresStore, SKIP, access, backend, rows};
use crate::record::Present;
use crate::{Claim, StoreError, TenantName};

/// After a restart of the database, workers have this long to renew the leases
/// that went by meanwhile: they live, and only could not say so.
const GRACE: Duration = Duration::from_secs(15);

/// Tenants with a job to claim and room to run it: who has the fewest running and
/// was served longest ago comes first.
const NEXT_TENANTS: &str = "SELECT name FROM (
         SELECT name, served,
             EXISTS (SELECT 1 FROM jobs
                     WHERE state = 'queued' AND tenant = tenants.name
                         AND (boot <> $1 OR not_before_ms <= $2)) AS waits,
             (SELECT count(*) FROM jobs
              WHERE state = 'running' AND tenant = tenants.name) AS running,
             CAST(CAST(limits AS json) ->> 'max_running' AS BIGINT) AS most
         FROM tenants) AS served
     WHERE waits AND running < coalesce(most, running + 1)
     ORDER BY running, served";

impl PostgresStore {
    pub(super) async fn try_claim(
        &self,
        worker: &str,
        lease: Duration,
    ) -> Result<Option<Claim>, StoreError> {
        let mut connection = self.pool.acquire().await.map_err(backend)?;
        let now = self.present(&mut connection).await?;
        let tenants = sqlx::query_scalar(NEXT_TENANTS).bind(&*now.uptime.boot).bind(now.uptime.ms);
        let tenants: Vec<String> = tenants.fetch_all(&mut *connection).await.map_err(backend)?;
        drop(connection);
        for tenant in tenants {
            let tenant = tenant.try_into().map_err(backend)?;
            if let Some(claim) = self.claim_of(&tenant, worker, lease).await? {
                return Ok(Some(claim));
            }
        }
        Ok(None)
    }

    /// Claims the tenant's next job that nobody else is at.
    async fn claim_of(
        &self,
        tenant: &TenantName,
        worker: &str,
        lease: Duration,
    ) -> Result<Option<Claim>, StoreError> {
        loop {
            let (mut transaction, now) = self.begin().await?;
            match access::expect_tenant(&mut transaction, tenant).await {
                Err(StoreError::NoTenant(_)) => return Ok(None),
                held => held?,
            }
            let Some(row) = self.next_of(&mut transaction, tenant, &now).await? else {
                return Ok(None);
            };
            match rows::record(Some(&row)) {
                Ok(Some(record)) => {
                    return self.give(transaction, record, worker, lease, &now).await.map(Some);
                }
                Ok(None) => return Ok(None),
                Err(error) => {
                    transaction.rollback().await.map_err(backend)?;
                    self.set_aside(&rows::text(&row, "id").map_err(backend)?, &error).await?;
                }
            }
        }
    }

    async fn next_of(
        &self,
        connection: &mut super::Connection,
        tenant: &TenantName,
        now: &Present,
    ) -> Result<Option<super::Row>, StoreError> {
        // The tenant is locked: nobody else counts what it runs, or adds to it.
        let next = format!(
            "SELECT * FROM jobs
             WHERE state = 'queued' AND tenant = $1 AND (boot <> $2 OR not_before_ms <= $3)
                 AND (SELECT coalesce(running < most, TRUE) FROM (
                          SELECT CAST(CAST(limits AS json) ->> 'max_running' AS BIGINT) AS most,
                              (SELECT count(*) FROM jobs
                               WHERE state = 'running' AND tenant = $1) AS running
                          FROM tenants WHERE name = $1) AS room)
             ORDER BY priority DESC, rowid LIMIT 1{SKIP}"
        );
        sqlx::query(sqlx::AssertSqlSafe(next))
            .bind(tenant.as_str())
            .bind(&*now.uptime.boot)
            .bind(now.uptime.ms)
            .fetch_optional(connection)
            .await
            .map_err(backend)
    }

    /// A running job whose lease is over.
    pub(super) async fn next_expired(&self) -> Result<Option<String>, StoreError> {
        let mut connection = self.pool.acquire().await.map_err(backend)?;
        let now = self.present(&mut connection).await?.uptime;
        let grace_s = if self.clock.is_none() { GRACE.as_secs_f64() } else { 0.0 };
        sqlx::query_scalar(
            "SELECT id FROM jobs
             WHERE state = 'running' AND (boot <> $1 OR lease_until_ms <= $2)
                 AND clock_timestamp() >= pg_postmaster_start_time() + make_interval(secs => $3)
             ORDER BY lease_until_ms LIMIT 1",
        )
        .bind(&*now.boot)
        .bind(now.ms)
        .bind(grace_s)
        .fetch_optional(&mut *connection)
        .await
        .map_err(backend)
    }
}
