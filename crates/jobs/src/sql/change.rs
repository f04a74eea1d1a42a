//! Changes of jobs: each loads a record, applies a transition and saves record
//! and event in one transaction.

use std::time::Duration;

use sqlx::Transaction;

use super::{Db, Store, announce, backend, commit_error, ownerless, rows, webhooks};
use crate::record::{Change, Ending, Present, Record};
use crate::{
    Claim, EventKind, Failure, Heartbeat, Job, JobChange, JobId, JobState, StoreError, UNREADABLE,
};

impl Store {
    /// Loads a job, lets `apply` change it and saves job and event together.
    /// Nothing is written if `apply` has no change or fails.
    pub(super) async fn transition<F>(&self, id: JobId, apply: F) -> Result<Job, StoreError>
    where
        F: FnOnce(&mut Record, &Present) -> Result<Option<Change>, StoreError> + Send,
    {
        let (mut transaction, now) = self.begin().await?;
        let mut record = rows::lock(&mut transaction, id).await?;
        match apply(&mut record, &now)? {
            None => Ok(record.job),
            Some(change) => self.commit(transaction, record, change, &now).await,
        }
    }

    /// Saves a changed job and its event, commits and tells who listens.
    pub(super) async fn commit(
        &self,
        mut transaction: Transaction<'static, Db>,
        mut record: Record,
        change: Change,
        now: &Present,
    ) -> Result<Job, StoreError> {
        record.job.version += 1;
        rows::save(&mut transaction, &record).await?;
        if change.kind == EventKind::Succeeded {
            let bytes: u64 = record.job.artifacts.iter().map(|artifact| artifact.bytes).sum();
            sqlx::query("UPDATE jobs SET bytes = bytes + $2 WHERE id = $1")
                .bind(record.job.id.to_string())
                .bind(bytes.cast_signed())
                .execute(&mut *transaction)
                .await
                .map_err(backend)?;
        }
        if change.kind.is_final() {
            webhooks::tell(&mut transaction, &record.job.id.to_string()).await?;
        }
        self.finish(transaction, record.job, change, now).await
    }

    /// Writes the event of an already written job, commits and tells who listens.
    pub(super) async fn finish(
        &self,
        mut transaction: Transaction<'static, Db>,
        job: Job,
        change: Change,
        now: &Present,
    ) -> Result<Job, StoreError> {
        rows::append(&mut transaction, &job, &change, now.time).await?;
        let told = JobChange { id: job.id, kind: change.kind, version: job.version };
        announce(self, &mut transaction, told).await?;
        transaction.commit().await.map_err(commit_error)?;
        // An error only means that nobody listens.
        let _ = self.changes.send(told);
        Ok(job)
    }

    pub(super) async fn end(
        &self,
        id: JobId,
        attempt: u32,
        ending: Ending,
    ) -> Result<JobState, StoreError> {
        let ending = || {
            self.transition(id, |record, now| {
                record.check_held_by(attempt)?;
                Ok(Some(record.end(ending.clone(), now)))
            })
        };
        Ok(self.insist(ending).await?.state)
    }

    /// Gives a locked job to `worker`.
    pub(super) async fn give(
        &self,
        mut transaction: Transaction<'static, Db>,
        mut record: Record,
        worker: &str,
        lease: Duration,
        now: &Present,
    ) -> Result<Claim, StoreError> {
        let change = record.claim(worker, now, lease);
        sqlx::query(
            "UPDATE tenants SET served = (SELECT max(served) + 1 FROM tenants) WHERE name = $1",
        )
        .bind(record.job.tenant.as_str())
        .execute(&mut *transaction)
        .await
        .map_err(backend)?;
        let job = self.commit(transaction, record, change, now).await?;
        Ok(Claim { attempt: job.attempt, job })
    }

    /// Ends the attempt if its lease is still over.
    pub(super) async fn reap_one(&self, id: &str) -> Result<bool, StoreError> {
        let (mut transaction, now) = self.begin().await?;
        let Some(mut record) = rows::find(&mut transaction, id).await? else { return Ok(false) };
        let lease_until = record.lease_until.as_ref();
        if !lease_until.is_some_and(|lease_until| lease_until.is_over(&now.uptime)) {
            return Ok(false);
        }
        let change = record.end(Ending::Expired, &now);
        self.commit(transaction, record, change, &now).await?;
        Ok(true)
    }

    /// Fails a job whose row can't be read, so that it stands in nobody's way.
    pub(super) async fn set_aside(&self, id: &str, error: &StoreError) -> Result<(), StoreError> {
        tracing::error!(job = id, %error, "a stored job can't be read and is failed");
        let failure = Failure {
            code: UNREADABLE.to_owned(),
            detail: "the stored job can't be read; send it again".to_owned(),
        };
        let failure = serde_json::to_string(&failure).map_err(backend)?;
        let (mut transaction, now) = self.begin().await?;
        sqlx::query(
            "UPDATE jobs SET state = 'failed', failure = $2, finished_ms = $3, worker = NULL,
                 lease_until_ms = NULL, progress = NULL, artifacts = '[]', summary = NULL
             WHERE id = $1 AND state IN ('queued', 'running')",
        )
        .bind(id)
        .bind(failure)
        .bind(now.time.as_millisecond())
        .execute(&mut *transaction)
        .await
        .map_err(backend)?;
        webhooks::tell(&mut transaction, id).await?;
        transaction.commit().await.map_err(commit_error)
    }

    pub(super) async fn try_heartbeat(
        &self,
        id: JobId,
        attempt: u32,
        lease: Duration,
    ) -> Result<Heartbeat, StoreError> {
        let (mut transaction, now) = self.begin().await?;
        let mut record = match rows::lock(&mut transaction, id).await {
            Err(StoreError::NotFound(_)) => return Ok(Heartbeat::Lost),
            loaded => loaded?,
        };
        if !record.is_held_by(attempt) {
            return Ok(Heartbeat::Lost);
        }
        record.renew(&now.uptime, lease);
        // No event and no new version: a renewed lease is not a visible change.
        rows::save(&mut transaction, &record).await?;
        transaction.commit().await.map_err(commit_error)?;
        Ok(Heartbeat::Held { cancel_requested: record.job.cancel_requested })
    }

    pub(super) async fn try_delete(&self, id: JobId) -> Result<(), StoreError> {
        let (mut transaction, now) = self.begin().await?;
        let state = rows::state(&mut transaction, id).await?;
        if state == JobState::Running {
            return Err(StoreError::Running { id });
        }
        sqlx::query("DELETE FROM jobs WHERE id = $1")
            .bind(id.to_string())
            .execute(&mut *transaction)
            .await
            .map_err(backend)?;
        ownerless::add(&mut transaction, id, &now.uptime).await?;
        transaction.commit().await.map_err(commit_error)
    }
}
