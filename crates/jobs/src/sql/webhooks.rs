//! Addresses, secrets and the outbox of messages.

use std::time::Duration;

use async_trait::async_trait;
use jiff::{SignedDuration, Timestamp};
use sqlx::{FromRow, Row as _};
use uuid::Uuid;

use super::access::{expect_tenant, tenant_name};
use super::{BUSY, Connection, Row, SKIP, Store, backend, commit_error, rows};
use crate::webhooks::{Delivery, DeliveryAttempt, Ended, WebhookStore};
use crate::{JobId, StoreError, TenantName};

impl<'r> FromRow<'r, Row> for Delivery {
    fn from_row(row: &'r Row) -> sqlx::Result<Self> {
        let id: &str = row.try_get("id")?;
        let job: &str = row.try_get("job_id")?;
        Ok(Self {
            id: id.parse().map_err(rows::decode)?,
            tenant: tenant_name(row, "tenant")?,
            url: row.try_get("url")?,
            ended: Ended {
                job: job.parse().map_err(rows::decode)?,
                kind: row.try_get("kind")?,
                state: rows::named(row, "job_state")?,
                name: row.try_get("name")?,
                labels: rows::json(row, "labels")?,
                failure: rows::optional_json(row, "failure")?,
                finished_at: rows::time(row, "finished_ms")?,
            },
            state: rows::named(row, "state")?,
            tries: rows::integer(row, "tries")?,
        })
    }
}

impl<'r> FromRow<'r, Row> for DeliveryAttempt {
    fn from_row(row: &'r Row) -> sqlx::Result<Self> {
        Ok(Self {
            at: rows::time(row, "at_ms")?,
            duration: Duration::from_millis(row.try_get::<i64, _>("duration_ms")?.cast_unsigned()),
            status: rows::optional_integer(row, "status")?,
            error: row.try_get("error")?,
        })
    }
}

/// Writes the message about a job that has just ended, if it has an address.
pub(super) async fn tell(connection: &mut Connection, job: &str) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO deliveries (id, job_id, tenant, url, kind, job_state, name, labels, failure,
             finished_ms, state)
         SELECT $1, jobs.id, jobs.tenant, coalesce(jobs.webhook, tenants.webhook), kind, state,
             jobs.name, labels, failure, finished_ms, 'pending'
         FROM jobs JOIN tenants ON tenants.name = jobs.tenant
         WHERE jobs.id = $2 AND coalesce(jobs.webhook, tenants.webhook) IS NOT NULL",
    )
    .bind(Uuid::now_v7().to_string())
    .bind(job)
    .execute(connection)
    .await
    .map_err(backend)?;
    Ok(())
}

#[async_trait]
impl WebhookStore for Store {
    async fn webhook(&self, tenant: &TenantName) -> Result<Option<String>, StoreError> {
        sqlx::query_scalar("SELECT webhook FROM tenants WHERE name = $1")
            .bind(tenant.as_str())
            .fetch_optional(self.readers())
            .await
            .map_err(backend)?
            .ok_or_else(|| StoreError::NoTenant(tenant.clone()))
    }

    async fn set_webhook(&self, tenant: &TenantName, url: Option<&str>) -> Result<(), StoreError> {
        let (mut transaction, _) = self.begin().await?;
        let set = sqlx::query("UPDATE tenants SET webhook = $2 WHERE name = $1")
            .bind(tenant.as_str())
            .bind(url)
            .execute(&mut *transaction)
            .await
            .map_err(backend)?;
        if set.rows_affected() == 0 {
            return Err(StoreError::NoTenant(tenant.clone()));
        }
        transaction.commit().await.map_err(commit_error)
    }

    async fn webhook_secrets(&self, tenant: &TenantName) -> Result<Vec<String>, StoreError> {
        let mut connection = self.readers().acquire().await.map_err(backend)?;
        let now = self.present(&mut connection).await?;
        sqlx::query_scalar(
            "SELECT secret FROM webhook_secrets
             WHERE tenant = $1 AND (until_ms IS NULL OR until_ms > $2)
             ORDER BY until_ms IS NOT NULL, until_ms DESC",
        )
        .bind(tenant.as_str())
        .bind(now.time.as_millisecond())
        .fetch_all(&mut *connection)
        .await
        .map_err(backend)
    }

    async fn add_webhook_secret(
        &self,
        tenant: &TenantName,
        secret: &str,
        overlap: Duration,
    ) -> Result<(), StoreError> {
        let (mut transaction, now) = self.begin().await?;
        expect_tenant(&mut transaction, tenant).await?;
        let overlap = SignedDuration::try_from(overlap).unwrap_or(SignedDuration::MAX);
        let until = now.time.checked_add(overlap).unwrap_or(Timestamp::MAX);
        for sql in [
            "DELETE FROM webhook_secrets WHERE tenant = $1 AND until_ms IS NOT NULL",
            "UPDATE webhook_secrets SET until_ms = $2 WHERE tenant = $1",
        ] {
            let old = sqlx::query(sql).bind(tenant.as_str()).bind(until.as_millisecond());
            old.execute(&mut *transaction).await.map_err(backend)?;
        }
        sqlx::query("INSERT INTO webhook_secrets (tenant, secret, created_ms) VALUES ($1, $2, $3)")
            .bind(tenant.as_str())
            .bind(secret)
            .bind(now.time.as_millisecond())
            .execute(&mut *transaction)
            .await
            .map_err(backend)?;
        transaction.commit().await.map_err(commit_error)
    }

    async fn claim_delivery(
        &self,
        lease: Duration,
        busy: &[TenantName],
    ) -> Result<Option<Delivery>, StoreError> {
        let due_first = format!(
            "SELECT id FROM deliveries
             WHERE state = 'pending' AND (boot <> $1 OR not_before_ms <= $2)
                 AND tenant NOT IN ({BUSY})
             ORDER BY tries > 0, id LIMIT 1"
        );
        let busy = serde_json::to_string(busy).map_err(backend)?;
        let mut connection = self.readers().acquire().await.map_err(backend)?;
        let now = self.present(&mut connection).await?.uptime;
        // Read without the write lock, for most often there is none.
        let due = sqlx::query_scalar(sqlx::AssertSqlSafe(due_first.clone()));
        let due = due.bind(&*now.boot).bind(now.ms).bind(&busy).fetch_optional(&mut *connection);
        let due: Option<String> = due.await.map_err(backend)?;
        drop(connection);
        if due.is_none() {
            return Ok(None);
        }
        let (mut transaction, _) = self.begin().await?;
        let claim = sqlx::AssertSqlSafe(format!(
            "UPDATE deliveries SET tries = tries + 1, boot = $1, not_before_ms = $4
             WHERE id = ({due_first}{SKIP}) RETURNING *"
        ));
        let claimed = sqlx::query_as(claim)
            .bind(&*now.boot)
            .bind(now.ms)
            .bind(&busy)
            .bind(now.after(lease).ms)
            .fetch_optional(&mut *transaction)
            .await
            .map_err(backend)?;
        transaction.commit().await.map_err(commit_error)?;
        Ok(claimed)
    }

    async fn attempted(
        &self,
        id: Uuid,
        attempt: &DeliveryAttempt,
        pause: Option<Duration>,
    ) -> Result<(), StoreError> {
        let id = id.to_string();
        let (mut transaction, now) = self.begin().await?;
        let state = match (&attempt.error, pause) {
            (None, _) => "delivered",
            (Some(_), Some(_)) => "pending",
            (Some(_), None) => "given_up",
        };
        // First, for it holds the message's row while its tries are counted.
        sqlx::query(
            "UPDATE deliveries SET state = $2, boot = $3, not_before_ms = $4 WHERE id = $1",
        )
        .bind(&id)
        .bind(state)
        .bind(&*now.uptime.boot)
        .bind(now.uptime.after(pause.unwrap_or_default()).ms)
        .execute(&mut *transaction)
        .await
        .map_err(backend)?;
        sqlx::query(
            "INSERT INTO delivery_attempts (delivery, number, at_ms, duration_ms, status, error)
             SELECT id, (SELECT count(*) + 1 FROM delivery_attempts WHERE delivery = $1), $2, $3,
                 $4, $5
             FROM deliveries WHERE id = $1",
        )
        .bind(&id)
        .bind(attempt.at.as_millisecond())
        .bind(i64::try_from(attempt.duration.as_millis()).unwrap_or(i64::MAX))
        .bind(attempt.status.map(i64::from))
        .bind(&attempt.error)
        .execute(&mut *transaction)
        .await
        .map_err(backend)?;
        // The log of a job that was deleted meanwhile goes after it.
        sqlx::query(
            "DELETE FROM deliveries
             WHERE id = $1 AND state <> 'pending' AND job_id NOT IN (SELECT id FROM jobs)",
        )
        .bind(&id)
        .execute(&mut *transaction)
        .await
        .map_err(backend)?;
        transaction.commit().await.map_err(commit_error)
    }

    async fn deliveries(
        &self,
        job: JobId,
    ) -> Result<Vec<(Delivery, Vec<DeliveryAttempt>)>, StoreError> {
        let mut connection = self.readers().acquire().await.map_err(backend)?;
        let found = sqlx::query_as("SELECT * FROM deliveries WHERE job_id = $1 ORDER BY id");
        let found: Vec<Delivery> =
            found.bind(job.to_string()).fetch_all(&mut *connection).await.map_err(backend)?;
        let mut deliveries = Vec::with_capacity(found.len());
        for delivery in found {
            let attempts = sqlx::query_as(
                "SELECT * FROM delivery_attempts WHERE delivery = $1 ORDER BY number",
            );
            let attempts = attempts.bind(delivery.id.to_string());
            let attempts = attempts.fetch_all(&mut *connection).await.map_err(backend)?;
            deliveries.push((delivery, attempts));
        }
        Ok(deliveries)
    }

    async fn redeliver(&self, job: JobId, id: Uuid) -> Result<bool, StoreError> {
        let (mut transaction, _) = self.begin().await?;
        let asked = sqlx::query(
            "UPDATE deliveries SET state = 'pending', tries = 0, not_before_ms = 0
             WHERE id = $1 AND job_id = $2",
        )
        .bind(id.to_string())
        .bind(job.to_string())
        .execute(&mut *transaction)
        .await
        .map_err(backend)?;
        transaction.commit().await.map_err(commit_error)?;
        Ok(asked.rows_affected() > 0)
    }
}
