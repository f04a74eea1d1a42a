//! The job store of a farm: one PostgreSQL database, any number of nodes.
//!
//! Leases, pauses and times of jobs are all by the database's clock: those of
//! the nodes may be wrong. Changes are announced by NOTIFY, with polling for
//! what is missed. Isolation is PostgreSQL's default, read committed: whoever
//! changes a row locks it first, and what is counted of a tenant (its waiting
//! jobs, its bytes, what it runs) is counted under a lock on the tenant.

#[path = "../sql/access.rs"]
mod access;
#[path = "../sql/change.rs"]
mod change;
mod claim;
mod failure;
#[path = "../sql/idempotency.rs"]
mod idempotency;
mod import;
mod listen;
#[path = "../sql/ownerless.rs"]
mod ownerless;
#[path = "../sql/pages.rs"]
mod pages;
#[path = "../sql/rows.rs"]
mod rows;
#[path = "../sql/storage.rs"]
mod storage;
#[path = "../sql/store.rs"]
mod store;
#[path = "../sql/webhooks.rs"]
mod webhooks;

use std::sync::Arc;
use std::time::Duration;

use jiff::Timestamp;
use sqlx::postgres::{PgConnectOptions, PgPool, PgPoolOptions};
use sqlx::{Postgres, QueryBuilder, Transaction};
use tokio::sync::broadcast;
use tokio::task::AbortHandle;

pub use self::import::{ImportError, Imported};

use self::failure::{backend, commit_error};
use self::listen::announce;
use super::record::Present;
use super::store::REMEMBERED_CHANGES;
use super::{Clock, JobChange, Revision, StoreError, Uptime};

// What the modules of `sql` are written in.
type Store = PostgresStore;
type Db = Postgres;
type Connection = sqlx::PgConnection;
type Row = sqlx::postgres::PgRow;

/// The end of a SELECT whose rows are changed.
const LOCK: &str = " FOR NO KEY UPDATE";
/// As [`LOCK`], passing over the rows that others have.
const SKIP: &str = " FOR NO KEY UPDATE SKIP LOCKED";
/// The texts of the JSON array `$3`.
const BUSY: &str = "SELECT json_array_elements_text(CAST($3 AS json))";

/// Adds the condition that a job has a label.
fn has_label(sql: &mut QueryBuilder<Db>, label: &str, value: &str) {
    sql.push("CAST(labels AS json) ->> ").push_bind(label.to_owned());
    sql.push(" = ").push_bind(value.to_owned());
}

/// How often a write is tried whose transaction surely came to nothing.
const TRIES: u32 = 5;
const PAUSE: Duration = Duration::from_millis(50);

/// How a node uses the database.
#[derive(Clone, Debug)]
pub struct PostgresOptions {
    /// Connections at a time, one more for listening besides.
    pub max_connections: u32,
    /// How long a call waits for one, and for a database that starts.
    pub patience: Duration,
}

impl Default for PostgresOptions {
    fn default() -> Self {
        Self { max_connections: 10, patience: Duration::from_secs(4) }
    }
}

/// Jobs in a PostgreSQL database, 13 or later.
pub struct PostgresStore {
    pool: PgPool,
    /// In place of the database's, for tests.
    clock: Option<Arc<dyn Clock>>,
    changes: broadcast::Sender<JobChange>,
    /// Tells the announcements of this store from those of others.
    node: String,
    listener: AbortHandle,
}

impl PostgresStore {
    /// Connects to the database of `url`, such as
    /// `postgres://user:secret@host/database?sslmode=verify-full`, and creates
    /// its tables if need be. Several nodes may do so at once.
    ///
    /// # Errors
    /// [`StoreError::Backend`] if `url` is none, or the database can't be reached
    /// or changed.
    pub async fn open(url: &str, options: &PostgresOptions) -> Result<Self, StoreError> {
        Self::connect(url, options, None).await
    }

    /// Whether the database of `url` has no tables of this store yet.
    ///
    /// # Errors
    /// [`StoreError::Backend`] if `url` is none, or the database can't be reached.
    pub async fn is_new(url: &str, options: &PostgresOptions) -> Result<bool, StoreError> {
        let pool = pool(url, options).await?;
        let found = sqlx::query_scalar("SELECT to_regclass('jobs') IS NULL");
        let is_new = found.fetch_one(&pool).await.map_err(backend)?;
        pool.close().await;
        Ok(is_new)
    }

    /// As [`Self::open`], with leases and times by `clock`.
    ///
    /// # Errors
    /// As [`Self::open`].
    #[doc(hidden)]
    pub async fn open_with_clock(url: &str, clock: Arc<dyn Clock>) -> Result<Self, StoreError> {
        Self::connect(url, &PostgresOptions::default(), Some(clock)).await
    }

    async fn connect(
        url: &str,
        options: &PostgresOptions,
        clock: Option<Arc<dyn Clock>>,
    ) -> Result<Self, StoreError> {
        let pool = pool(url, options).await?;
        // Under a lock of the database, which sqlx takes. Nodes of the version
        // before may start while those of the next one run.
        let mut migrations = sqlx::migrate!("./migrations/postgres");
        migrations.set_ignore_missing(true);
        migrations.run(&pool).await.map_err(backend)?;
        let (changes, _) = broadcast::channel(REMEMBERED_CHANGES);
        let node = uuid::Uuid::new_v4().simple().to_string();
        let listening = listen::listen(pool.connect_options(), node.clone(), changes.clone());
        let listener = tokio::spawn(listening).abort_handle();
        Ok(Self { pool, clock, changes, node, listener })
    }

    /// Waits for running statements and closes all connections.
    pub async fn close(&self) {
        self.listener.abort();
        self.pool.close().await;
    }

    /// Begins a write, and asks for the time.
    async fn begin(&self) -> Result<(Transaction<'static, Postgres>, Present), StoreError> {
        let mut transaction = self.pool.begin().await.map_err(backend)?;
        let now = self.present(&mut transaction).await?;
        Ok((transaction, now))
    }

    async fn present(&self, connection: &mut Connection) -> Result<Present, StoreError> {
        if let Some(clock) = &self.clock {
            return Ok(Present { time: clock.now(), uptime: clock.uptime() });
        }
        let ms = "SELECT CAST(floor(extract(epoch FROM clock_timestamp()) * 1000) AS BIGINT)";
        let ms: i64 = sqlx::query_scalar(ms).fetch_one(connection).await.map_err(backend)?;
        let time = Timestamp::from_millisecond(ms).map_err(backend)?;
        Ok(Present { time, uptime: Uptime { boot: "".into(), ms } })
    }

    /// To ask would be a round trip, as reading is.
    fn current_revision(&self) -> Option<Revision> {
        None
    }

    fn readers(&self) -> &PgPool {
        &self.pool
    }

    /// Nothing is kept ready here for a full disk.
    async fn prepare(&self) {}

    /// Does `write`, again if its connection was lost or the database ended it:
    /// but never once it may have been committed.
    async fn insist<T, W>(&self, mut write: impl FnMut() -> W) -> Result<T, StoreError>
    where
        W: Future<Output = Result<T, StoreError>>,
    {
        for tried in 1..TRIES {
            match write().await {
                Err(error) if failure::came_to_nothing(&error) => {
                    tracing::warn!(%error, "trying again what the database did not do");
                    tokio::time::sleep(PAUSE * tried).await;
                }
                written => return written,
            }
        }
        write().await
    }
}

async fn pool(url: &str, options: &PostgresOptions) -> Result<PgPool, StoreError> {
    let target: PgConnectOptions = url.parse().map_err(backend)?;
    PgPoolOptions::new()
        .max_connections(options.max_connections)
        .acquire_timeout(options.patience)
        .connect_with(target.application_name("turnaround"))
        .await
        .map_err(backend)
}

impl Drop for PostgresStore {
    fn drop(&mut self) {
        self.listener.abort();
    }
}
