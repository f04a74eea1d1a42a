//! Between records and rows. Enumerations are stored under the names they have
//! in JSON; a row that can't be read is an error of the backend.

use std::sync::Arc;

use jiff::Timestamp;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use sqlx::{FromRow, Row as _};

use super::access::tenant_name;
use super::{Connection, LOCK, Row, backend};
use crate::bytes::BytesOf;
use crate::record::{Change, Record};
use crate::{Event, Job, JobId, JobState, StoreError, Tags, Uptime};

/// A stored value that this version can't read.
#[derive(Debug, thiserror::Error)]
#[error("stored {column} is unreadable: {value:?}")]
struct Unreadable {
    column: &'static str,
    value: String,
}

impl<'r> FromRow<'r, Row> for Record {
    fn from_row(row: &'r Row) -> sqlx::Result<Self> {
        let boot: Arc<str> = text(row, "boot")?.into();
        let uptime = |ms| Uptime { boot: Arc::clone(&boot), ms };
        let job = Job {
            id: JobId(text(row, "id")?.parse().map_err(decode)?),
            tenant: tenant_name(row, "tenant")?,
            kind: text(row, "kind")?,
            priority: integer(row, "priority")?,
            tags: tags(row)?,
            webhook: row.try_get("webhook")?,
            request_id: row.try_get("request_id")?,
            payload: json(row, "payload")?,
            state: named(row, "state")?,
            attempt: integer(row, "attempt")?,
            attempts_used: integer(row, "attempts_used")?,
            max_attempts: integer(row, "max_attempts")?,
            cancel_requested: flag(row, "cancel_requested")?,
            progress: optional_json(row, "progress")?,
            failure: optional_json(row, "failure")?,
            artifacts: json(row, "artifacts")?,
            summary: optional_json(row, "summary")?,
            reused_from: reused_from(row)?,
            created_at: time(row, "created_ms")?,
            started_at: optional_time(row, "started_ms")?,
            finished_at: optional_time(row, "finished_ms")?,
            version: row.try_get::<i64, _>("version")?.cast_unsigned(),
        };
        Ok(Self {
            job,
            worker: row.try_get("worker")?,
            lease_until: row.try_get::<Option<i64>, _>("lease_until_ms")?.map(uptime),
            not_before: uptime(row.try_get("not_before_ms")?),
            troubles: integer(row, "troubles")?,
        })
    }
}

impl<'r> FromRow<'r, Row> for Event {
    fn from_row(row: &'r Row) -> sqlx::Result<Self> {
        Ok(Self {
            number: row.try_get::<i64, _>("number")?.cast_unsigned(),
            at: time(row, "at_ms")?,
            kind: named(row, "kind")?,
            data: json(row, "data")?,
        })
    }
}

pub(super) async fn load(connection: &mut Connection, id: JobId) -> Result<Record, StoreError> {
    let row = sqlx::query("SELECT * FROM jobs WHERE id = $1").bind(id.to_string());
    let row = row.fetch_optional(connection).await.map_err(backend)?;
    record(row.as_ref())?.ok_or(StoreError::NotFound(id))
}

/// Loads a job that nobody else may change until the transaction ends.
pub(super) async fn lock(connection: &mut Connection, id: JobId) -> Result<Record, StoreError> {
    find(connection, &id.to_string()).await?.ok_or(StoreError::NotFound(id))
}

/// As [`lock`]; `None` if there is no such job.
pub(super) async fn find(
    connection: &mut Connection,
    id: &str,
) -> Result<Option<Record>, StoreError> {
    let row = sqlx::AssertSqlSafe(format!("SELECT * FROM jobs WHERE id = $1{LOCK}"));
    let row = sqlx::query(row).bind(id).fetch_optional(connection).await.map_err(backend)?;
    record(row.as_ref())
}

pub(super) fn record(row: Option<&Row>) -> Result<Option<Record>, StoreError> {
    row.map(Record::from_row).transpose().map_err(unreadable)
}

/// The state alone, which every row has; the job is locked as by [`lock`].
pub(super) async fn state(connection: &mut Connection, id: JobId) -> Result<JobState, StoreError> {
    let row = sqlx::AssertSqlSafe(format!("SELECT state FROM jobs WHERE id = $1{LOCK}"));
    let row = sqlx::query(row).bind(id.to_string());
    let row = row.fetch_optional(connection).await.map_err(backend)?;
    named(&row.ok_or(StoreError::NotFound(id))?, "state").map_err(unreadable)
}

/// Where the bytes of a listed row of jobs or pages lie.
pub(super) fn bytes_of(row: &Row) -> sqlx::Result<BytesOf> {
    let id = JobId(text(row, "id")?.parse().map_err(decode)?);
    Ok(BytesOf { id, home: id.home(&tenant_name(row, "tenant")?) })
}

/// The id of a listed row.
pub(super) fn id(row: &Row) -> Option<JobId> {
    text(row, "id").ok()?.parse().ok()
}

fn reused_from(row: &Row) -> sqlx::Result<Option<JobId>> {
    let id: Option<&str> = row.try_get("reused_from")?;
    id.map(|id| id.parse().map_err(decode)).transpose()
}

/// The job of a listed row. One that can't be read is left out: it must not
/// take the others with it.
pub(super) fn job(row: &Row) -> Option<Job> {
    match Record::from_row(row) {
        Ok(record) => Some(record.job),
        Err(error) => {
            let id = text(row, "id").unwrap_or_default();
            tracing::error!(job = id, %error, "a stored job can't be read and is not listed");
            None
        }
    }
}

fn unreadable(error: sqlx::Error) -> StoreError {
    StoreError::Unreadable(Box::new(error))
}

pub(super) async fn insert(
    connection: &mut Connection,
    record: &Record,
    bytes: u64,
    result_key: Option<&str>,
) -> Result<(), StoreError> {
    let job = &record.job;
    sqlx::query(
        "INSERT INTO jobs (id, kind, payload, state, attempt, attempts_used, max_attempts,
             cancel_requested, boot, not_before_ms, artifacts, created_ms, version, tenant,
             priority, name, labels, expires_ms, pinned, webhook,
             bytes, result_key, reused_from, request_id)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, '[]', $11, $12, $13, $14,
             $15, $16, $17, $18, $19, $20, $21, $22, $23)",
    )
    .bind(job.id.to_string())
    .bind(&job.kind)
    .bind(job.payload.to_string())
    .bind(name(&job.state)?)
    .bind(i64::from(job.attempt))
    .bind(i64::from(job.attempts_used))
    .bind(i64::from(job.max_attempts))
    .bind(i64::from(job.cancel_requested))
    .bind(&*record.not_before.boot)
    .bind(record.not_before.ms)
    .bind(job.created_at.as_millisecond())
    .bind(job.version.cast_signed())
    .bind(job.tenant.as_str())
    .bind(i64::from(job.priority))
    .bind(&job.tags.name)
    .bind(serde_json::to_string(&job.tags.labels).map_err(backend)?)
    .bind(job.tags.expires_at.map(Timestamp::as_millisecond))
    .bind(i64::from(job.tags.pinned))
    .bind(&job.webhook)
    .bind(bytes.cast_signed())
    .bind(result_key)
    .bind(job.reused_from.map(|id| id.to_string()))
    .bind(&job.request_id)
    .execute(connection)
    .await
    .map_err(backend)?;
    Ok(())
}

/// Writes everything that may change in a job's life.
pub(super) async fn save(connection: &mut Connection, record: &Record) -> Result<(), StoreError> {
    let job = &record.job;
    let failure = job.failure.as_ref().map(serde_json::to_string).transpose().map_err(backend)?;
    sqlx::query(
        "UPDATE jobs SET state = $2, attempt = $3, attempts_used = $4, cancel_requested = $5,
             worker = $6, lease_until_ms = $7, not_before_ms = $8, progress = $9, failure = $10,
             artifacts = $11, started_ms = $12, finished_ms = $13, version = $14,
             summary = $15, boot = $16, troubles = $17
         WHERE id = $1",
    )
    .bind(job.id.to_string())
    .bind(name(&job.state)?)
    .bind(i64::from(job.attempt))
    .bind(i64::from(job.attempts_used))
    .bind(i64::from(job.cancel_requested))
    .bind(&record.worker)
    .bind(record.lease_until.as_ref().map(|until| until.ms))
    .bind(record.not_before.ms)
    .bind(job.progress.as_ref().map(Value::to_string))
    .bind(failure)
    .bind(serde_json::to_string(&job.artifacts).map_err(backend)?)
    .bind(job.started_at.map(Timestamp::as_millisecond))
    .bind(job.finished_at.map(Timestamp::as_millisecond))
    .bind(job.version.cast_signed())
    .bind(job.summary.as_ref().map(Value::to_string))
    // A running job is not waited for: the moment that counts is its lease's.
    .bind(&*record.lease_until.as_ref().unwrap_or(&record.not_before).boot)
    .bind(i64::from(record.troubles))
    .execute(connection)
    .await
    .map_err(backend)?;
    Ok(())
}

/// Appends the event that goes with the job's version.
pub(super) async fn append(
    connection: &mut Connection,
    job: &Job,
    change: &Change,
    at: Timestamp,
) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO events (job_id, number, at_ms, kind, data) VALUES ($1, $2, $3, $4, $5)",
    )
    .bind(job.id.to_string())
    .bind(job.version.cast_signed())
    .bind(at.as_millisecond())
    .bind(name(&change.kind)?)
    .bind(change.data.to_string())
    .execute(connection)
    .await
    .map_err(backend)?;
    Ok(())
}

/// The name a unit variant has in JSON.
pub(super) fn name<T: Serialize>(variant: &T) -> Result<String, StoreError> {
    match serde_json::to_value(variant).map_err(backend)? {
        Value::String(name) => Ok(name),
        other => Err(backend(Unreadable { column: "name", value: other.to_string() })),
    }
}

pub(super) fn state_name(state: JobState) -> Result<String, StoreError> {
    name(&state)
}

/// What people say of a job or page.
pub(super) fn tags(row: &Row) -> sqlx::Result<Tags> {
    Ok(Tags {
        name: row.try_get("name")?,
        labels: json(row, "labels")?,
        expires_at: optional_time(row, "expires_ms")?,
        pinned: flag(row, "pinned")?,
    })
}

pub(super) fn decode<E: std::error::Error + Send + Sync + 'static>(error: E) -> sqlx::Error {
    sqlx::Error::Decode(Box::new(error))
}

pub(super) fn text(row: &Row, column: &'static str) -> sqlx::Result<String> {
    row.try_get(column)
}

/// Numbers are stored in 64 bits, and flags as 0 and 1, in every database.
pub(super) fn integer<T>(row: &Row, column: &'static str) -> sqlx::Result<T>
where
    T: TryFrom<i64, Error = std::num::TryFromIntError>,
{
    row.try_get::<i64, _>(column)?.try_into().map_err(decode)
}

pub(super) fn optional_integer<T>(row: &Row, column: &'static str) -> sqlx::Result<Option<T>>
where
    T: TryFrom<i64, Error = std::num::TryFromIntError>,
{
    row.try_get::<Option<i64>, _>(column)?.map(T::try_from).transpose().map_err(decode)
}

pub(super) fn flag(row: &Row, column: &'static str) -> sqlx::Result<bool> {
    Ok(row.try_get::<i64, _>(column)? != 0)
}

pub(super) fn json<T: DeserializeOwned>(row: &Row, column: &'static str) -> sqlx::Result<T> {
    serde_json::from_str(row.try_get(column)?).map_err(decode)
}

pub(super) fn optional_json<T: DeserializeOwned>(
    row: &Row,
    column: &'static str,
) -> sqlx::Result<Option<T>> {
    let text: Option<&str> = row.try_get(column)?;
    text.map(serde_json::from_str).transpose().map_err(decode)
}

pub(super) fn named<T: DeserializeOwned>(row: &Row, column: &'static str) -> sqlx::Result<T> {
    let value = text(row, column)?;
    serde_json::from_value(Value::String(value.clone()))
        .map_err(|_| decode(Unreadable { column, value }))
}

pub(super) fn time(row: &Row, column: &'static str) -> sqlx::Result<Timestamp> {
    Timestamp::from_millisecond(row.try_get(column)?).map_err(decode)
}

pub(super) fn optional_time(row: &Row, column: &'static str) -> sqlx::Result<Option<Timestamp>> {
    let ms: Option<i64> = row.try_get(column)?;
    ms.map(Timestamp::from_millisecond).transpose().map_err(decode)
}
