//! The embedded job store: one SQLite file, no other service.
//!
//! One connection writes, a few others read, so that a status request never
//! waits for a write to reach the disk. Several processes may share the file.

#[path = "../sql/access.rs"]
mod access;
#[path = "../sql/change.rs"]
mod change;
mod claim;
#[path = "../sql/idempotency.rs"]
mod idempotency;
#[path = "../sql/ownerless.rs"]
mod ownerless;
#[path = "../sql/pages.rs"]
mod pages;
mod reserve;
mod revision;
#[path = "../sql/rows.rs"]
mod rows;
#[path = "../sql/storage.rs"]
mod storage;
#[path = "../sql/store.rs"]
mod store;
#[path = "../sql/webhooks.rs"]
mod webhooks;

use std::fs::File;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use sqlx::Connection as _;
use sqlx::migrate::Migrator;
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use sqlx::{QueryBuilder, Sqlite, Transaction};
use tokio::sync::broadcast;

use self::reserve::Reserve;
use self::revision::Revisions;
use super::record::Present;
use super::store::REMEMBERED_CHANGES;
use super::{Clock, JobChange, Revision, StoreError};

// What the modules of `sql` are written in.
type Store = SqliteStore;
type Db = Sqlite;
type Connection = sqlx::SqliteConnection;
type Row = sqlx::sqlite::SqliteRow;

/// The end of a SELECT whose rows are changed: a write has the whole file.
const LOCK: &str = "";
/// As [`LOCK`], passing over the rows that others have.
const SKIP: &str = "";
/// The texts of the JSON array `$3`.
const BUSY: &str = "SELECT value FROM json_each($3)";

/// Adds the condition that a job has a label.
fn has_label(sql: &mut QueryBuilder<Db>, label: &str, value: &str) {
    sql.push("EXISTS (SELECT 1 FROM json_each(labels) WHERE key = ").push_bind(label.to_owned());
    sql.push(" AND value = ").push_bind(value.to_owned()).push(")");
}

/// Other processes find changes by polling.
async fn announce(_: &Store, _: &mut Connection, _: JobChange) -> Result<(), StoreError> {
    Ok(())
}

static MIGRATIONS: Migrator = sqlx::migrate!("./migrations/sqlite");

const READERS: u32 = 4;
/// How long to wait for another process to end its write.
const BUSY_TIMEOUT: Duration = Duration::from_secs(10);

/// Jobs in an SQLite file.
pub struct SqliteStore {
    writer: SqlitePool,
    readers: SqlitePool,
    clock: Arc<dyn Clock>,
    changes: broadcast::Sender<JobChange>,
    reserve: Arc<Reserve>,
    revisions: Revisions,
}

impl SqliteStore {
    /// Opens the file, creating it and its tables if need be.
    ///
    /// # Errors
    /// [`StoreError::Backend`] if the file can't be opened or is from a later
    /// version.
    pub async fn open(path: &Path, clock: Arc<dyn Clock>) -> Result<Self, StoreError> {
        let options = SqliteConnectOptions::new()
            .filename(path)
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            .foreign_keys(true)
            .busy_timeout(BUSY_TIMEOUT);
        let lock = lock_beside(path).await?;
        let writer = pool(1).connect_with(options.clone()).await.map_err(backend)?;
        MIGRATIONS.run(&writer).await.map_err(backend)?;
        drop(lock);
        sync_directory_of(path).map_err(backend)?;
        let reading = options.pragma("query_only", "ON");
        let readers = pool(READERS).connect_with(reading).await.map_err(backend)?;
        let file = path.to_owned();
        let revisions = tokio::task::spawn_blocking(move || Revisions::open(&file));
        let revisions = revisions.await.map_err(backend)?.map_err(backend)?;
        let (changes, _) = broadcast::channel(REMEMBERED_CHANGES);
        let reserve = Arc::new(Reserve::beside(path));
        let store = Self { writer, readers, clock, changes, reserve, revisions };
        store.prepare().await;
        Ok(store)
    }

    /// Takes the room on the disk that [`Self::insist`] gives up.
    async fn prepare(&self) {
        let reserve = Arc::clone(&self.reserve);
        let taking = tokio::task::spawn_blocking(move || reserve.take());
        if let Ok(Err(error)) = taking.await {
            tracing::warn!(%error, "no room on the disk is kept for deletions");
        }
    }

    /// Does `write`, for which room is kept: if the disk is full, the reserve is
    /// given up and the write tried once more.
    async fn insist<T, W>(&self, mut write: impl FnMut() -> W) -> Result<T, StoreError>
    where
        W: Future<Output = Result<T, StoreError>>,
    {
        match write().await {
            Err(StoreError::Full) if self.reserve.give_up() => write().await,
            written => written,
        }
    }

    /// Lets the database grow no more through the connection that writes, as on
    /// a full disk: for tests.
    ///
    /// # Errors
    /// [`StoreError::Backend`] if the database is closed.
    #[doc(hidden)]
    pub async fn refuse_growth(&self) -> Result<(), StoreError> {
        // Never less than there are.
        let sql = "PRAGMA max_page_count = 1";
        sqlx::query(sql).execute(&self.writer).await.map_err(backend)?;
        Ok(())
    }

    /// Waits for running statements and closes the file.
    pub async fn close(&self) {
        self.revisions.close();
        self.readers.close().await;
        self.writer.close().await;
    }

    /// Begins a write. The lock is taken at once: one that is taken at the first
    /// write after a read fails without waiting if another process wrote between.
    async fn begin(&self) -> Result<(Transaction<'static, Sqlite>, Present), StoreError> {
        let transaction = self.writer.begin_with("BEGIN IMMEDIATE").await.map_err(backend)?;
        Ok((transaction, self.now()))
    }

    fn now(&self) -> Present {
        Present { time: self.clock.now(), uptime: self.clock.uptime() }
    }

    async fn present(&self, _: &mut Connection) -> Result<Present, StoreError> {
        Ok(self.now())
    }

    fn current_revision(&self) -> Option<Revision> {
        self.revisions.current()
    }

    fn readers(&self) -> &SqlitePool {
        &self.readers
    }
}

fn pool(connections: u32) -> SqlitePoolOptions {
    SqlitePoolOptions::new()
        .max_connections(connections)
        .min_connections(connections)
        .idle_timeout(None)
        .max_lifetime(None)
        .test_before_acquire(false)
        // A commit that fails for want of room ends the transaction in SQLite
        // but not in the driver, which would then begin none any more.
        .after_release(|connection, _| Box::pin(async { Ok(!connection.is_in_transaction()) }))
}

/// Several processes may start at once; this lets one after the other set the
/// journal mode and migrate, for SQLite would not wait for either.
async fn lock_beside(path: &Path) -> Result<File, StoreError> {
    let mut name = path.as_os_str().to_owned();
    name.push(".lock");
    let locking = tokio::task::spawn_blocking(move || {
        let file = File::create(name)?;
        file.lock()?;
        std::io::Result::Ok(file)
    });
    locking.await.map_err(backend)?.map_err(backend)
}

/// Makes the file's name as durable as its content.
fn sync_directory_of(path: &Path) -> std::io::Result<()> {
    let directory = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    File::open(directory.unwrap_or(Path::new(".")))?.sync_all()
}

/// What SQLite answers when it finds no room: `SQLITE_FULL`, and the errors of
/// writing the log and of growing its index.
const FULL_CODES: [&str; 3] = ["13", "778", "4874"];

fn commit_error(error: sqlx::Error) -> StoreError {
    backend(error)
}

pub(super) fn backend<E: std::error::Error + Send + Sync + 'static>(error: E) -> StoreError {
    let error: Box<dyn std::error::Error + Send + Sync> = Box::new(error);
    match error.downcast_ref::<sqlx::Error>().and_then(sqlx::Error::as_database_error) {
        Some(found) if found.code().is_some_and(|code| FULL_CODES.contains(&&*code)) => {
            StoreError::Full
        }
        _ => StoreError::Backend(error),
    }
}
