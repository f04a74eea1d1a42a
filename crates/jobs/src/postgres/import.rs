//! The jobs of an embedded service, moved into the database and the bucket of a farm.
//!
//! Bytes first, then all rows in one transaction: until that is committed the farm's
//! database stays empty, so that an import that broke off is begun again, and finds the
//! bytes that it had copied.

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use futures::{StreamExt, TryStreamExt};
use sqlx::postgres::PgArguments;
use sqlx::query::Query;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection, SqliteLockingMode, SqliteRow};
use sqlx::{AssertSqlSafe, ConnectOptions, Postgres, Row as _};

use super::{Connection, PostgresStore, backend, commit_error};
use crate::bytes::{ByteError, ByteStore, Copied, Key};
use crate::{ArtifactEntry, JobId, SqliteStore, StoreError, SystemClock, TenantName};

/// What is copied, those that others refer to first. Marks of bytes without a row
/// (`ownerless`) are left behind, as those bytes are.
const TABLES: [&str; 11] = [
    "tenants",
    "keys",
    "secrets",
    "webhook_secrets",
    "jobs",
    "events",
    "pages",
    "idempotency",
    "deliveries",
    "delivery_attempts",
    // After `keys`, whose trigger writes it.
    "closed",
];

/// Rows that are sent at once.
const BATCH: usize = 500;
/// Texts that are sent at once, bytes, and one row more.
const BATCH_BYTES: usize = 8 << 20;
/// Jobs whose bytes are copied at a time.
const JOBS_AT_ONCE: usize = 8;
/// For another process to let go of the file.
const PATIENCE: Duration = Duration::from_secs(2);

/// Why nothing was imported.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// Somebody else has the file open.
    #[error("{0} is in use; stop the service and the workers that have it open")]
    InUse(PathBuf),
    /// There is something in the database already.
    #[error("the database has rows in {0} already; give an empty one that no node uses yet")]
    NotEmpty(&'static str),
    /// The two databases are not of the same form.
    #[error("the columns of {table} differ: {here} here, {there} there")]
    Columns {
        /// Of which table.
        table: &'static str,
        /// In the file.
        here: String,
        /// In the database.
        there: String,
    },
    /// An artifact is not what its job lists.
    #[error(
        "{name} of job {job} is {found}, not as the job lists it; put it back, or delete the job"
    )]
    Artifact {
        /// Whose it is.
        job: JobId,
        /// Its name.
        name: String,
        /// What is there.
        found: &'static str,
    },
    /// A row that makes no job or page.
    #[error("the stored job or page {0:?} can't be read; delete it")]
    Unreadable(String),
    /// A database could not be read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Bytes could not be read or written.
    #[error(transparent)]
    Bytes(#[from] ByteError),
}

/// What was imported.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Imported {
    /// Jobs and pages.
    pub jobs: u64,
    /// Their files.
    pub files: u64,
    /// Of these, those that were there from an import that broke off.
    pub found: u64,
    /// Size of all files, bytes.
    pub bytes: u64,
}

/// A job or page of the file.
struct Owner {
    id: JobId,
    tenant: TenantName,
    attempt: u32,
    artifacts: Vec<ArtifactEntry>,
}

impl PostgresStore {
    /// Copies all that an embedded service has: rows of every table and the bytes of every
    /// job and page, whose artifacts are held against what their job lists. What runs is as
    /// if its worker had died; what waits for a time waits no longer.
    ///
    /// The file is brought up to this version first, as opening it does.
    ///
    /// * `file`: the database of the service, which nobody else has open.
    /// * `from`, `to`: its bytes, and those of the farm.
    /// * `told`: hears how many jobs and pages are done, and how many there are.
    ///
    /// # Errors
    /// [`ImportError`]; the rows of this database are then as they were.
    pub async fn import(
        &self,
        file: &Path,
        from: &ByteStore,
        to: &ByteStore,
        told: impl Fn(u64, u64),
    ) -> Result<Imported, ImportError> {
        SqliteStore::open(file, Arc::new(SystemClock)).await?.close().await;
        let mut source = open_alone(file).await?;
        expect_empty(&mut *self.pool.acquire().await.map_err(backend)?).await?;
        let imported = copy_bytes(&mut source, from, to, told).await?;
        let mut transaction = self.pool.begin().await.map_err(backend)?;
        // Nodes that start meanwhile wait, and find it done.
        let all = TABLES.join(", ");
        let lock = AssertSqlSafe(format!("LOCK TABLE {all} IN EXCLUSIVE MODE"));
        sqlx::query(lock).execute(&mut *transaction).await.map_err(backend)?;
        expect_empty(&mut transaction).await?;
        for table in TABLES {
            copy_rows(&mut source, &mut transaction, table).await?;
        }
        transaction.commit().await.map_err(commit_error)?;
        Ok(imported)
    }
}

/// Opens the file for this process alone.
async fn open_alone(file: &Path) -> Result<SqliteConnection, ImportError> {
    let options = SqliteConnectOptions::new()
        .filename(file)
        .locking_mode(SqliteLockingMode::Exclusive)
        .busy_timeout(PATIENCE);
    let in_use = |error: sqlx::Error| match error.as_database_error().and_then(|it| it.code()) {
        // SQLITE_BUSY, and its kinds.
        Some(code) if code.parse().is_ok_and(|code: u32| code & 0xff == 5) => {
            ImportError::InUse(file.to_owned())
        }
        _ => backend(error).into(),
    };
    let mut source = options.connect().await.map_err(in_use)?;
    // The lock is taken by the first write, and kept until the connection is closed.
    for sql in ["BEGIN EXCLUSIVE", "COMMIT"] {
        sqlx::query(sql).execute(&mut source).await.map_err(in_use)?;
    }
    Ok(source)
}

/// Refuses a database in which anything is that a new one has not.
async fn expect_empty(connection: &mut Connection) -> Result<(), ImportError> {
    for table in TABLES.into_iter().chain(["ownerless"]) {
        // That one every database has.
        let besides = if table == "tenants" { " WHERE name <> 'default'" } else { "" };
        let sql = AssertSqlSafe(format!("SELECT EXISTS (SELECT 1 FROM {table}{besides})"));
        if sqlx::query_scalar(sql).fetch_one(&mut *connection).await.map_err(backend)? {
            return Err(ImportError::NotEmpty(table));
        }
    }
    Ok(())
}

/// Copies the bytes of every job and page.
async fn copy_bytes(
    source: &mut SqliteConnection,
    from: &ByteStore,
    to: &ByteStore,
    told: impl Fn(u64, u64),
) -> Result<Imported, ImportError> {
    let all = "SELECT (SELECT count(*) FROM jobs) + (SELECT count(*) FROM pages)";
    let all: i64 = sqlx::query_scalar(all).fetch_one(&mut *source).await.map_err(backend)?;
    let owners = sqlx::query(
        "SELECT id, tenant, attempt, artifacts FROM jobs
         UNION ALL SELECT id, tenant, 0, '[]' FROM pages",
    );
    let owners = owners.fetch(source).map(|row| Owner::read(&row.map_err(backend)?));
    let mut copies = owners
        .map(|owner| async { copy_bytes_of(&owner?, from, to).await })
        .buffer_unordered(JOBS_AT_ONCE);
    let mut imported = Imported::default();
    while let Some(copied) = copies.try_next().await? {
        imported.jobs += 1;
        imported.files += copied.len() as u64;
        imported.found += copied.values().filter(|copied| copied.was_there).count() as u64;
        imported.bytes += copied.values().map(|copied| copied.bytes).sum::<u64>();
        told(imported.jobs, all.cast_unsigned());
    }
    Ok(imported)
}

impl Owner {
    fn read(row: &SqliteRow) -> Result<Self, ImportError> {
        let text = |column| row.try_get::<String, _>(column).map_err(backend);
        let (id, tenant, artifacts) = (text("id")?, text("tenant")?, text("artifacts")?);
        let attempt: i64 = row.try_get("attempt").map_err(backend)?;
        let read = || {
            Some(Self {
                id: id.parse().ok()?,
                tenant: tenant.try_into().ok()?,
                attempt: attempt.try_into().ok()?,
                artifacts: serde_json::from_str(&artifacts).ok()?,
            })
        };
        read().ok_or(ImportError::Unreadable(id.clone()))
    }
}

async fn copy_bytes_of(
    owner: &Owner,
    from: &ByteStore,
    to: &ByteStore,
) -> Result<HashMap<String, Copied>, ImportError> {
    let home = owner.id.home(&owner.tenant);
    let (from, to) = (from.of(&home), to.of(&home));
    let copied = to.copy_job(&from, owner.id).await?;
    for artifact in &owner.artifacts {
        let key = Key::Artifact { job: owner.id, attempt: owner.attempt, name: &artifact.name };
        let wrong = match copied.get(&from.location(&key)?) {
            None => "missing",
            Some(copied) if copied.sha256 != artifact.sha256 => "another file",
            Some(_) => continue,
        };
        let name = artifact.name.clone();
        return Err(ImportError::Artifact { job: owner.id, name, found: wrong });
    }
    Ok(copied)
}

/// A column of rows on their way.
enum Column {
    Text(Vec<Option<String>>),
    Number(Vec<Option<i64>>),
}

impl Column {
    fn push(&mut self, row: &SqliteRow, index: usize) -> sqlx::Result<usize> {
        match self {
            Self::Text(values) => values.push(row.try_get(index)?),
            Self::Number(values) => values.push(row.try_get(index)?),
        }
        Ok(match self {
            Self::Text(values) => values.last().and_then(Option::as_ref).map_or(0, String::len),
            Self::Number(_) => size_of::<i64>(),
        })
    }

    /// Binds the values, and leaves none.
    fn bind<'q>(
        &mut self,
        query: Query<'q, Postgres, PgArguments>,
    ) -> Query<'q, Postgres, PgArguments> {
        match self {
            Self::Text(values) => query.bind(std::mem::take(values)),
            Self::Number(values) => query.bind(std::mem::take(values)),
        }
    }
}

/// Copies all rows of a table, some at a time.
async fn copy_rows(
    source: &mut SqliteConnection,
    target: &mut Connection,
    table: &'static str,
) -> Result<(), ImportError> {
    let columns = columns(source, target, table).await?;
    let names: Vec<_> = columns.iter().map(|(name, _)| format!("\"{name}\"")).collect();
    let read: Vec<_> = columns.iter().map(|(name, _)| expression(table, name)).collect();
    let arrays = columns.iter().enumerate().map(|(index, (_, is_text))| {
        let kind = if *is_text { "TEXT" } else { "BIGINT" };
        format!("CAST(${} AS {kind}[])", index + 1)
    });
    let arrays: Vec<_> = arrays.collect();
    // Jobs by arrival, which numbers them anew.
    let order = if table == "jobs" { " ORDER BY rowid" } else { "" };
    let select = format!("SELECT {} FROM {table}{order}", read.join(", "));
    let (names, arrays) = (names.join(", "), arrays.join(", "));
    let insert = format!("INSERT INTO {table} ({names}) SELECT * FROM UNNEST({arrays})");
    // What a new database has, and what the trigger of `keys` wrote.
    if matches!(table, "tenants" | "closed") {
        let delete = AssertSqlSafe(format!("DELETE FROM {table}"));
        sqlx::query(delete).execute(&mut *target).await.map_err(backend)?;
    }
    let kinds = columns.iter().map(|(_, is_text)| match is_text {
        true => Column::Text(Vec::new()),
        false => Column::Number(Vec::new()),
    });
    let mut batch: Vec<Column> = kinds.collect();
    let (mut waiting, mut bytes) = (0, 0);
    let mut rows = sqlx::query(AssertSqlSafe(select)).fetch(source);
    loop {
        let row = rows.try_next().await.map_err(backend)?;
        if let Some(row) = &row {
            for (index, column) in batch.iter_mut().enumerate() {
                bytes += column.push(row, index).map_err(backend)?;
            }
            waiting += 1;
        }
        let is_full = waiting == BATCH || bytes >= BATCH_BYTES;
        if waiting > 0 && (is_full || row.is_none()) {
            let sending = sqlx::query(AssertSqlSafe(insert.clone()));
            let sending = batch.iter_mut().fold(sending, |query, column| column.bind(query));
            sending.execute(&mut *target).await.map_err(backend)?;
            (waiting, bytes) = (0, 0);
        }
        if row.is_none() {
            return Ok(());
        }
    }
}

/// The columns of a table and whether they are texts; the same in both databases.
async fn columns(
    source: &mut SqliteConnection,
    target: &mut Connection,
    table: &'static str,
) -> Result<Vec<(String, bool)>, ImportError> {
    let there: Vec<(String, bool)> = sqlx::query_as(
        "SELECT CAST(column_name AS TEXT), data_type = 'text' FROM information_schema.columns
         WHERE table_schema = current_schema() AND table_name = $1 AND is_identity = 'NO'
         ORDER BY ordinal_position",
    )
    .bind(table)
    .fetch_all(target)
    .await
    .map_err(backend)?;
    let here: Vec<String> = sqlx::query_scalar("SELECT name FROM pragma_table_info($1)")
        .bind(table)
        .fetch_all(source)
        .await
        .map_err(backend)?;
    let sorted = |names: &mut dyn Iterator<Item = &String>| {
        let names: BTreeSet<_> = names.map(String::as_str).collect();
        Vec::from_iter(names).join(", ")
    };
    let told = sorted(&mut there.iter().map(|(name, _)| name));
    let here = sorted(&mut here.iter());
    if told != here {
        return Err(ImportError::Columns { table, here, there: told });
    }
    Ok(there)
}

/// How a column is read. Leases and pauses are of a clock that the farm does not have:
/// they are over.
fn expression(table: &str, column: &str) -> String {
    match (table, column) {
        ("jobs" | "deliveries", "boot") => "''".to_owned(),
        ("jobs" | "deliveries", "not_before_ms") => "0".to_owned(),
        ("jobs", "lease_until_ms") => "CASE WHEN state = 'running' THEN 0 END".to_owned(),
        _ => format!("\"{column}\""),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn no_table_is_left_behind() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("jobs.sqlite");
        SqliteStore::open(&file, Arc::new(SystemClock)).await.unwrap().close().await;
        let mut source = open_alone(&file).await.unwrap();
        let sql = "SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite%'";
        let there: Vec<String> = sqlx::query_scalar(sql).fetch_all(&mut source).await.unwrap();
        let there: BTreeSet<_> = there.iter().map(String::as_str).collect();
        let known = TABLES.into_iter().chain(["ownerless", "_sqlx_migrations"]);
        assert_eq!(there, known.collect());
    }
}
