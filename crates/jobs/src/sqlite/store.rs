//! The job queue's methods on SQLite, one transaction each.

use std::time::Duration;

use async_trait::async_trait;
use serde_json::Value;
use sqlx::{QueryBuilder, Sqlite};
use tokio::sync::broadcast;

use super::{SqliteStore, backend, rows};
use crate::record::{Ending, Record};
use crate::{
    ArtifactEntry, Claim, Event, Failure, Heartbeat, Job, JobChange, JobCounts, JobId, JobState,
    JobStore, ListQuery, NewJob, Page, StoreError,
};

impl SqliteStore {
    async fn end(&self, id: JobId, attempt: u32, ending: Ending) -> Result<JobState, StoreError> {
        let now = self.clock.now();
        let job = self
            .transition(id, |record| {
                record.check_held_by(attempt)?;
                Ok(Some(record.end(ending, now)))
            })
            .await?;
        Ok(job.state)
    }

    /// A job that may be claimed now, read without the write lock: an idle
    /// worker's polling must not stand in the way of writes.
    async fn has_queued(&self, now_ms: i64) -> Result<bool, StoreError> {
        sqlx::query_scalar(
            "SELECT EXISTS (SELECT 1 FROM jobs WHERE state = 'queued' AND not_before_ms <= ?1)",
        )
        .bind(now_ms)
        .fetch_one(&self.readers)
        .await
        .map_err(backend)
    }

    /// A lease that is over, read without the write lock.
    async fn has_expired(&self, now_ms: i64) -> Result<bool, StoreError> {
        sqlx::query_scalar(
            "SELECT EXISTS (SELECT 1 FROM jobs WHERE state = 'running' AND lease_until_ms <= ?1)",
        )
        .bind(now_ms)
        .fetch_one(&self.readers)
        .await
        .map_err(backend)
    }

    /// Ends one job whose lease is over. `false` if there is none.
    async fn reap_one(&self) -> Result<bool, StoreError> {
        let now = self.clock.now();
        if !self.has_expired(now.as_millisecond()).await? {
            return Ok(false);
        }
        let mut transaction = self.begin().await?;
        let expired: Option<Record> = sqlx::query_as(
            "SELECT * FROM jobs WHERE state = 'running' AND lease_until_ms <= ?1
             ORDER BY lease_until_ms LIMIT 1",
        )
        .bind(now.as_millisecond())
        .fetch_optional(&mut *transaction)
        .await
        .map_err(backend)?;
        let Some(mut record) = expired else { return Ok(false) };
        let change = record.end(Ending::Expired, now);
        self.commit(transaction, record, change).await?;
        Ok(true)
    }
}

#[async_trait]
impl JobStore for SqliteStore {
    async fn enqueue(&self, job: NewJob) -> Result<Job, StoreError> {
        let (mut record, change) = Record::new(job, self.clock.now());
        record.job.version = 1;
        let mut transaction = self.begin().await?;
        rows::insert(&mut transaction, &record).await?;
        self.finish(transaction, record.job, change).await
    }

    async fn get(&self, id: JobId) -> Result<Job, StoreError> {
        let mut connection = self.readers.acquire().await.map_err(backend)?;
        Ok(rows::load(&mut connection, id).await?.job)
    }

    async fn list(&self, query: &ListQuery) -> Result<Page, StoreError> {
        let limit = query.limit.max(1);
        let mut sql = QueryBuilder::<Sqlite>::new("SELECT * FROM jobs WHERE true");
        if let Some(kind) = &query.kind {
            sql.push(" AND kind = ").push_bind(kind);
        }
        if let Some(state) = query.state {
            sql.push(" AND state = ").push_bind(rows::state_name(state)?);
        }
        if let Some(before) = query.before {
            sql.push(" AND id < ").push_bind(before.to_string());
        }
        // One more than asked for tells whether there is a next part.
        sql.push(" ORDER BY id DESC LIMIT ").push_bind(i64::from(limit) + 1);
        let records: Vec<Record> =
            sql.build_query_as().fetch_all(&self.readers).await.map_err(backend)?;
        let mut jobs: Vec<Job> = records.into_iter().map(|record| record.job).collect();
        let more = jobs.len() > limit as usize;
        jobs.truncate(limit as usize);
        let next = if more { jobs.last().map(|job| job.id) } else { None };
        Ok(Page { jobs, next })
    }

    async fn events(&self, id: JobId, after: u64) -> Result<Vec<Event>, StoreError> {
        let after = i64::try_from(after).unwrap_or(i64::MAX);
        let events: Vec<Event> = sqlx::query_as(
            "SELECT number, at_ms, kind, data FROM events
             WHERE job_id = ?1 AND number > ?2 ORDER BY number",
        )
        .bind(id.to_string())
        .bind(after)
        .fetch_all(&self.readers)
        .await
        .map_err(backend)?;
        if events.is_empty() {
            self.get(id).await?;
        }
        Ok(events)
    }

    async fn claim(&self, worker: &str, lease: Duration) -> Result<Option<Claim>, StoreError> {
        let now = self.clock.now();
        if !self.has_queued(now.as_millisecond()).await? {
            return Ok(None);
        }
        let mut transaction = self.begin().await?;
        let oldest: Option<Record> = sqlx::query_as(
            "SELECT * FROM jobs WHERE state = 'queued' AND not_before_ms <= ?1
             ORDER BY id LIMIT 1",
        )
        .bind(now.as_millisecond())
        .fetch_optional(&mut *transaction)
        .await
        .map_err(backend)?;
        let Some(mut record) = oldest else { return Ok(None) };
        let change = record.claim(worker, now, lease);
        let job = self.commit(transaction, record, change).await?;
        Ok(Some(Claim { attempt: job.attempt, job }))
    }

    async fn heartbeat(
        &self,
        id: JobId,
        attempt: u32,
        lease: Duration,
    ) -> Result<Heartbeat, StoreError> {
        let mut transaction = self.begin().await?;
        let mut record = match rows::load(&mut transaction, id).await {
            Err(StoreError::NotFound(_)) => return Ok(Heartbeat::Lost),
            loaded => loaded?,
        };
        if !record.is_held_by(attempt) {
            return Ok(Heartbeat::Lost);
        }
        record.renew(self.clock.now(), lease);
        // No event and no new version: a renewed lease is not a visible change.
        rows::save(&mut transaction, &record).await?;
        transaction.commit().await.map_err(backend)?;
        Ok(Heartbeat::Held { cancel_requested: record.job.cancel_requested })
    }

    async fn progress(&self, id: JobId, attempt: u32, progress: Value) -> Result<(), StoreError> {
        self.transition(id, |record| {
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

    async fn reap(&self) -> Result<u64, StoreError> {
        let mut reaped = 0;
        while self.reap_one().await? {
            reaped += 1;
        }
        Ok(reaped)
    }

    async fn request_cancel(&self, id: JobId) -> Result<Job, StoreError> {
        let now = self.clock.now();
        self.transition(id, |record| record.request_cancel(now)).await
    }

    async fn delete(&self, id: JobId) -> Result<(), StoreError> {
        let mut transaction = self.begin().await?;
        let record = rows::load(&mut transaction, id).await?;
        if record.job.state == JobState::Running {
            return Err(StoreError::Running { id });
        }
        sqlx::query("DELETE FROM jobs WHERE id = ?1")
            .bind(id.to_string())
            .execute(&mut *transaction)
            .await
            .map_err(backend)?;
        transaction.commit().await.map_err(backend)
    }

    async fn ids(&self) -> Result<Vec<JobId>, StoreError> {
        let ids: Vec<String> = sqlx::query_scalar("SELECT id FROM jobs ORDER BY id")
            .fetch_all(&self.readers)
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
            .fetch_one(&self.readers)
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

    async fn depth(&self) -> Result<(u64, u64), StoreError> {
        let (queued, running): (i64, i64) = sqlx::query_as(
            "SELECT (SELECT count(*) FROM jobs WHERE state = 'queued'),
                    (SELECT count(*) FROM jobs WHERE state = 'running')",
        )
        .fetch_one(&self.readers)
        .await
        .map_err(backend)?;
        Ok((queued.cast_unsigned(), running.cast_unsigned()))
    }

    async fn ping(&self) -> Result<(), StoreError> {
        let _: i64 = sqlx::query_scalar("SELECT count(*) FROM (SELECT 1 FROM jobs LIMIT 1)")
            .fetch_one(&self.readers)
            .await
            .map_err(backend)?;
        // Touches no row, but needs the right and the room to write.
        let mut transaction = self.begin().await?;
        sqlx::query("UPDATE jobs SET version = version WHERE id = ''")
            .execute(&mut *transaction)
            .await
            .map_err(backend)?;
        transaction.commit().await.map_err(backend)
    }

    fn changes(&self) -> broadcast::Receiver<JobChange> {
        self.changes.subscribe()
    }
}
