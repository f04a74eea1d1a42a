//! Opens the stores that the settings name: SQLite and a folder, or those of a farm.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result, ensure};

use super::config::StoresConfig;
use jobs::bytes::ByteStore;
use jobs::{AccessStore, JobStore, PostgresOptions, PostgresStore, SqliteStore, SystemClock};

/// Jobs and bytes.
pub(super) struct Stores {
    pub jobs: Arc<dyn JobStore>,
    /// Of the same database.
    pub access: Arc<dyn AccessStore>,
    pub bytes: ByteStore,
}

impl Stores {
    /// Opens both, making what is missing; but no database beside bytes of jobs
    /// that it cannot know, unless it is told to.
    pub(super) async fn open(config: &StoresConfig, adopt_bytes: bool) -> Result<Self> {
        let bytes = match &config.store {
            Some(address) => ByteStore::s3(address, std::env::vars())
                .with_context(|| format!("opening the store {address}"))?,
            None => ByteStore::local(&config.data_dir.join("bytes"))
                .with_context(|| within(&config.data_dir))?,
        };
        let is_new = is_new(config).await?;
        ensure!(
            !is_new || adopt_bytes || bytes.all().await?.is_empty(),
            "{} has bytes of jobs, but no database; put its latest copy back, or start with --adopt-bytes to begin a new one beside them",
            config.store.clone().unwrap_or_else(|| config.data_dir.display().to_string())
        );
        let (jobs, access) = open_jobs(config).await?;
        Ok(Self { jobs, access, bytes })
    }
}

/// Opens the database of keys and tenants alone.
pub(super) async fn open_access(config: &StoresConfig) -> Result<Arc<dyn AccessStore>> {
    if config.database_url.is_none() {
        let folder = &config.data_dir;
        ensure!(
            config.store.is_some() || !is_new(config).await? || !folder.join("bytes").exists(),
            "{} has bytes but no database; put its latest copy back first",
            folder.display()
        );
    }
    Ok(open_jobs(config).await?.1)
}

async fn open_jobs(config: &StoresConfig) -> Result<(Arc<dyn JobStore>, Arc<dyn AccessStore>)> {
    if let Some(url) = &config.database_url {
        let options = postgres_options(config);
        let jobs = PostgresStore::open(url, &options).await.context(NO_DATABASE)?;
        let jobs = Arc::new(jobs);
        return Ok((jobs.clone(), jobs));
    }
    let folder = &config.data_dir;
    std::fs::create_dir_all(folder).with_context(|| within(folder))?;
    let database = folder.join("jobs.sqlite");
    let jobs = SqliteStore::open(&database, Arc::new(SystemClock)).await;
    let jobs = Arc::new(jobs.with_context(|| within(folder))?);
    Ok((jobs.clone(), jobs))
}

/// Whether there is no database yet.
async fn is_new(config: &StoresConfig) -> Result<bool> {
    match &config.database_url {
        Some(url) => {
            PostgresStore::is_new(url, &postgres_options(config)).await.context(NO_DATABASE)
        }
        None => {
            let database = config.data_dir.join("jobs.sqlite");
            Ok(!database.try_exists().with_context(|| within(&config.data_dir))?)
        }
    }
}

/// The URL is not told: it may hold a password.
const NO_DATABASE: &str = "opening the database of --database-url";

fn postgres_options(config: &StoresConfig) -> PostgresOptions {
    PostgresOptions { max_connections: config.database_connections, ..PostgresOptions::default() }
}

fn within(folder: &Path) -> String {
    format!("in the data folder {}", folder.display())
}
