//! The job queue's methods, one transaction each.

use std::collections::BTreeMap;
use std::time::Duration;

use async_trait::async_trait;
use jiff::Timestamp;
use serde_json::{Value, json};
use sqlx::QueryBuilder;
use tokio::sync::broadcast;

use super::access::expect_tenant;
use super::{
    Connection, Db, Store, backend, commit_error, has_label, idempotency, ownerless, rows, storage,
};
use crate::record::{Change, Ending, Record};
use crate::{
    ArtifactEntry, Claim, Event, EventKind, Failure, Heartbeat, Idempotency, Job, JobChange,
    JobCounts, JobId, JobState, JobStore, ListQuery, NewJob, Page, Queue, Revision, StoreError,
    Tags, TenantName,
};

async fn expect_queue(
    connection: &mut Connection,
    tenant: &TenantName,
    most: u32,
) -> Result<(), StoreError> {
    let waiting: i64 =
        sqlx::query_scalar("SELECT count(*) FROM jobs WHERE state = 'queued' AND tenant = $1")
            .bind(tenant.as_str())
            .fetch_one(connection)
            .await
            .map_err(backend)?;
    if waiting < i64::from(most) {
        return Ok(());
    }
    Err(StoreError::TooManyQueued { tenant: tenant.clone(), most })
}

/// Adds the conditions that lists of jobs and of pages have in common.
///
/// * `from`, `until`: when they were made, the end left out.
/// * `before`: the last of the part of the list before, which goes from new to old.
pub(super) fn narrow(
    sql: &mut QueryBuilder<Db>,
    labels: &BTreeMap<String, String>,
    from: Option<Timestamp>,
    until: Option<Timestamp>,
    before: Option<JobId>,
) {
    for (label, value) in labels {
        // Names are held to plain characters before they get here, and bound
        // all the same.
        has_label(sql.push(" AND "), label, value);
    }
    if let Some(from) = from {
        sql.push(" AND created_ms >= ").push_bind(from.as_millisecond());
    }
    if let Some(until) = until {
        sql.push(" AND created_ms < ").push_bind(until.as_millisecond());
    }
    if let Some(before) = before {
        sql.push(" AND id < ").push_bind(before.to_string());
    }
}

#[async_trait]
impl JobStore for Store {
    async fn enqueue(&self, job: NewJob) -> Result<Job, StoreError> {
        let (max_queued, given) = (job.max_queued, job.idempotency.clone());
        let (bytes, max_bytes) = (job.bytes, job.max_bytes);
        let (result_key, result) = (job.result_key.clone(), job.result.clone());
        let (mut transaction, now) = self.begin().await?;
        let (mut record, change) = Record::new(job, &now);
        record.job.version = 1;
        expect_tenant(&mut transaction, &record.job.tenant).await?;
        if let Some(given) = &given {
            let (tenant, id) = (&record.job.tenant, record.job.id);
            if let Some(id) = idempotency::find(&mut transaction, tenant, given, now.time).await? {
                return Ok(rows::load(&mut transaction, id).await?.job);
            }
            idempotency::remember(&mut transaction, tenant, given, id, now.time).await?;
        }
        if let Some(most) = max_queued.filter(|_| result.is_none()) {
            expect_queue(&mut transaction, &record.job.tenant, most).await?;
        }
        let artifacts = result.iter().flat_map(|result| &result.artifacts);
        let room = bytes + artifacts.map(|artifact| artifact.bytes).sum::<u64>();
        storage::expect_room(&mut transaction, &record.job.tenant, room, max_bytes).await?;
        rows::insert(&mut transaction, &record, bytes, result_key.as_deref()).await?;
        ownerless::remove(&mut transaction, record.job.id).await?;
        if let Some(result) = result {
            rows::append(&mut transaction, &record.job, &change, now.time).await?;
            let change = record.answer(result, &now);
            return self.commit(transaction, record, change, &now).await;
        }
        self.finish(transaction, record.job, change, &now).await
    }

    async fn enqueued(
        &self,
        tenant: &TenantName,
        given: &Idempotency,
    ) -> Result<Option<Job>, StoreError> {
        let mut connection = self.readers().acquire().await.map_err(backend)?;
        let now = self.present(&mut connection).await?.time;
        match idempotency::find(&mut connection, tenant, given, now).await? {
            Some(id) => Ok(Some(rows::load(&mut connection, id).await?.job)),
            None => Ok(None),
        }
    }

    async fn with_result(
        &self,
        tenant: &TenantName,
        kind: &str,
        result_key: &str,
    ) -> Result<Option<Job>, StoreError> {
        let mut connection = self.readers().acquire().await.map_err(backend)?;
        let now = self.present(&mut connection).await?.time;
        let row = sqlx::query(
            "SELECT * FROM jobs
             WHERE tenant = $1 AND result_key = $2 AND state = 'succeeded' AND kind = $3
                 AND (expires_ms IS NULL OR pinned = 1 OR expires_ms > $4)
             ORDER BY id DESC LIMIT 1",
        )
        .bind(tenant.as_str())
        .bind(result_key)
        .bind(kind)
        .bind(now.as_millisecond())
        .fetch_optional(&mut *connection)
        .await
        .map_err(backend)?;
        Ok(row.as_ref().and_then(rows::job))
    }

    async fn get(&self, id: JobId) -> Result<Job, StoreError> {
        let mut connection = self.readers().acquire().await.map_err(backend)?;
        Ok(rows::load(&mut connection, id).await?.job)
    }

    async fn list(&self, query: &ListQuery) -> Result<Page, StoreError> {
        let limit = query.limit.max(1);
        let mut sql = QueryBuilder::<Db>::new("SELECT * FROM jobs WHERE true");
        if let Some(tenant) = &query.tenant {
            sql.push(" AND tenant = ").push_bind(tenant.as_str());
        }
        if let Some(kind) = &query.kind {
            sql.push(" AND kind = ").push_bind(kind);
        }
        if let Some(state) = query.state {
            sql.push(" AND state = ").push_bind(rows::state_name(state)?);
        }
        let ListQuery { labels, created_from, created_before, before, .. } = query;
        narrow(&mut sql, labels, *created_from, *created_before, *before);
        // One more than asked for tells whether there is a next part.
        sql.push(" ORDER BY id DESC LIMIT ").push_bind(i64::from(limit) + 1);
        let mut rows = sql.build().fetch_all(self.readers()).await.map_err(backend)?;
        let more = rows.len() > limit as usize;
        rows.truncate(limit as usize);
        let next = if more { rows.last().and_then(rows::id) } else { None };
        Ok(Page { jobs: rows.iter().filter_map(rows::job).collect(), next })
    }

    async fn events(&self, id: JobId, after: u64) -> Result<Vec<Event>, StoreError> {
        let after = i64::try_from(after).unwrap_or(i64::MAX);
        let events: Vec<Event> = sqlx::query_as(
            "SELECT number, at_ms, kind, data FROM events
             WHERE job_id = $1 AND number > $2 ORDER BY number",
        )
        .bind(id.to_string())
        .bind(after)
        .fetch_all(self.readers())
        .await
        .map_err(backend)?;
        if events.is_empty() {
            self.get(id).await?;
        }
        Ok(events)
    }

    async fn claim(&self, worker: &str, lease: Duration) -> Result<Option<Claim>, StoreError> {
        self.try_claim(worker, lease).await
    }

    async fn heartbeat(
        &self,
        id: JobId,
        attempt: u32,
        lease: Duration,
    ) -> Result<Heartbeat, StoreError> {
        self.insist(|| self.try_heartbeat(id, attempt, lease)).await
    }

    async fn progress(&self, id: JobId, attempt: u32, progress: Value) -> Result<(), StoreError> {
        self.transition(id, |record, _| {
            record.check_held_by(attempt)?;
            Ok(Some(record.progress(progress)))
        })
        .await?;
        Ok(())
    }

    async fn succeed(
        &self,
        id: JobId,
        attempt: u32,
        artifacts: Vec<ArtifactEntry>,
        summary: Option<Value>,
    ) -> Result<JobState, StoreError> {
        self.end(id, attempt, Ending::Succeeded(artifacts, summary)).await
    }

    async fn fail(
        &self,
        id: JobId,
        attempt: u32,
        failure: Failure,
    ) -> Result<JobState, StoreError> {
        self.end(id, attempt, Ending::Failed(failure)).await
    }

    async fn cancelled(&self, id: JobId, attempt: u32) -> Result<JobState, StoreError> {
        self.end(id, attempt, Ending::Cancelled).await
    }

    async fn retry(
        &self,
        id: JobId,
        attempt: u32,
        failure: Failure,
        pause: Duration,
    ) -> Result<JobState, StoreError> {
        self.end(id, attempt, Ending::Broken(failure, pause)).await
    }

    async fn release(&self, id: JobId, attempt: u32) -> Result<JobState, StoreError> {
        self.end(id, attempt, Ending::Released).await
    }

    async fn postpone(
        &self,
        id: JobId,
        attempt: u32,
        failure: Failure,
    ) -> Result<JobState, StoreError> {
        self.end(id, attempt, Ending::Troubled(failure)).await
    }

    async fn reap(&self) -> Result<u64, StoreError> {
        self.prepare().await;
        let mut reaped = 0;
        while let Some(id) = self.next_expired().await? {
            match self.insist(|| self.reap_one(&id)).await {
                Err(error @ StoreError::Unreadable(_)) => {
                    self.set_aside(&id, &error).await?;
                    reaped += 1;
                }
                done => reaped += u64::from(done?),
            }
        }
        Ok(reaped)
    }

    async fn request_cancel(&self, id: JobId) -> Result<Job, StoreError> {
        let cancel = || self.transition(id, |record, now| record.request_cancel(now.time));
        self.insist(cancel).await
    }

    async fn tag(&self, id: JobId, tags: &Tags) -> Result<Job, StoreError> {
        let (mut transaction, now) = self.begin().await?;
        let mut record = rows::lock(&mut transaction, id).await?;
        record.job.tags = tags.clone();
        // A new version, for it is answered otherwise, and an event that says so.
        let change = Change { kind: EventKind::Tagged, data: json!({}) };
        sqlx::query(
            "UPDATE jobs SET name = $2, labels = $3, expires_ms = $4, pinned = $5 WHERE id = $1",
        )
        .bind(id.to_string())
        .bind(&tags.name)
        .bind(serde_json::to_string(&tags.labels).map_err(backend)?)
        .bind(tags.expires_at.map(Timestamp::as_millisecond))
        .bind(i64::from(tags.pinned))
        .execute(&mut *transaction)
        .await
        .map_err(backend)?;
        self.commit(transaction, record, change, &now).await
    }

    async fn delete_when_ended(&self, id: JobId) -> Result<bool, StoreError> {
        match self.request_cancel(id).await {
            Ok(job) if job.state == JobState::Running => {}
            Ok(_) | Err(StoreError::Finished { .. }) => return Ok(false),
            Err(error) => return Err(error),
        }
        let (mut transaction, _) = self.begin().await?;
        sqlx::query("UPDATE jobs SET delete_requested = 1 WHERE id = $1")
            .bind(id.to_string())
            .execute(&mut *transaction)
            .await
            .map_err(backend)?;
        transaction.commit().await.map_err(commit_error)?;
        Ok(true)
    }

    async fn delete(&self, id: JobId) -> Result<(), StoreError> {
        self.insist(|| self.try_delete(id)).await
    }

    async fn expect_bytes(&self, id: JobId) -> Result<(), StoreError> {
        let (mut transaction, now) = self.begin().await?;
        ownerless::add(&mut transaction, id, &now.uptime).await?;
        transaction.commit().await.map_err(commit_error)
    }

    async fn is_ownerless(&self, id: JobId, for_at_least: Duration) -> Result<bool, StoreError> {
        let mut connection = self.readers().acquire().await.map_err(backend)?;
        let since = ownerless::since(&mut connection, id).await?;
        let now = self.present(&mut connection).await?.uptime;
        Ok(since.is_some_and(|since| since.after(for_at_least).is_over(&now)))
    }

    async fn forget_bytes(&self, id: JobId) -> Result<(), StoreError> {
        let (mut transaction, _) = self.begin().await?;
        ownerless::remove(&mut transaction, id).await?;
        transaction.commit().await.map_err(commit_error)
    }

    async fn ids(&self) -> Result<Vec<JobId>, StoreError> {
        let ids: Vec<String> = sqlx::query_scalar("SELECT id FROM jobs ORDER BY id")
            .fetch_all(self.readers())
            .await
            .map_err(backend)?;
        ids.iter().map(|id| id.parse().map_err(backend)).collect()
    }

    async fn counts(&self) -> Result<JobCounts, StoreError> {
        let (queued, running, succeeded, failed, cancelled): (i64, i64, i64, i64, i64) =
            sqlx::query_as(
                "SELECT count(*) FILTER (WHERE state = 'queued'),
                        count(*) FILTER (WHERE state = 'running'),
                        count(*) FILTER (WHERE state = 'succeeded'),
                        count(*) FILTER (WHERE state = 'failed'),
                        count(*) FILTER (WHERE state = 'cancelled')
                 FROM jobs",
            )
            .fetch_one(self.readers())
            .await
            .map_err(backend)?;
        Ok(JobCounts {
            queued: queued.cast_unsigned(),
            running: running.cast_unsigned(),
            succeeded: succeeded.cast_unsigned(),
            failed: failed.cast_unsigned(),
            cancelled: cancelled.cast_unsigned(),
        })
    }

    async fn queues(&self) -> Result<Vec<Queue>, StoreError> {
        let queues: Vec<(String, i64, i64)> = sqlx::query_as(
            "SELECT tenant, count(*), min(created_ms) FROM jobs WHERE state = 'queued'
             GROUP BY tenant ORDER BY tenant",
        )
        .fetch_all(self.readers())
        .await
        .map_err(backend)?;
        let queue = |(tenant, jobs, oldest_ms): (String, i64, i64)| {
            let tenant = tenant.try_into().map_err(backend)?;
            let oldest = Timestamp::from_millisecond(oldest_ms).map_err(backend)?;
            Ok(Queue { tenant, jobs: jobs.cast_unsigned(), oldest })
        };
        queues.into_iter().map(queue).collect()
    }

    async fn depth(&self) -> Result<(u64, u64), StoreError> {
        let (queued, running): (i64, i64) = sqlx::query_as(
            "SELECT (SELECT count(*) FROM jobs WHERE state = 'queued'),
                    (SELECT count(*) FROM jobs WHERE state = 'running')",
        )
        .fetch_one(self.readers())
        .await
        .map_err(backend)?;
        Ok((queued.cast_unsigned(), running.cast_unsigned()))
    }

    async fn ping(&self) -> Result<(), StoreError> {
        let _: i64 = sqlx::query_scalar("SELECT count(*) FROM (SELECT 1 FROM jobs LIMIT 1) AS one")
            .fetch_one(self.readers())
            .await
            .map_err(backend)?;
        // Touches no row, but needs the right and the room to write.
        let (mut transaction, _) = self.begin().await?;
        sqlx::query("UPDATE jobs SET version = version WHERE id = ''")
            .execute(&mut *transaction)
            .await
            .map_err(backend)?;
        transaction.commit().await.map_err(commit_error)
    }

    fn revision(&self) -> Option<Revision> {
        self.current_revision()
    }

    fn changes(&self) -> broadcast::Receiver<JobChange> {
        self.changes.subscribe()
    }
}
