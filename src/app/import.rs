//! `turnaround import`: moves an embedded service into a farm, once.

use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use tokio::runtime::Runtime;

use super::failure::Failure;
use jobs::bytes::ByteStore;
use jobs::{ImportError, PostgresOptions, PostgresStore};

/// From where to where.
#[derive(Args, Debug)]
pub(super) struct ImportArgs {
    /// Data folder of the service, which is stopped; it is only read, but for bringing its
    /// database up to this version
    #[arg(long, value_name = "DIR")]
    from: PathBuf,
    /// PostgreSQL database of the farm, empty, such as
    /// postgres://user:password@host/name?sslmode=verify-full
    #[arg(long, env = "TURNAROUND_DATABASE_URL", value_name = "URL", hide_env_values = true)]
    database_url: String,
    /// Bucket of the farm: s3://BUCKET or s3://BUCKET/PREFIX; endpoint and credentials by
    /// AWS_ENDPOINT_URL, AWS_REGION, AWS_ACCESS_KEY_ID ...
    #[arg(long, env = "TURNAROUND_STORE", value_name = "ADDRESS")]
    store: String,
}

/// Copies everything, and says what it was.
pub(super) fn run(args: &ImportArgs) -> Result<(), Failure> {
    let runtime = Runtime::new().context("starting the async runtime");
    runtime.map_err(Failure::Internal)?.block_on(import(args))
}

async fn import(args: &ImportArgs) -> Result<(), Failure> {
    let (database, bytes) = (args.from.join("jobs.sqlite"), args.from.join("bytes"));
    let folders = || -> Result<ByteStore> {
        for path in [&database, &bytes] {
            ensure!(path.exists(), "{} is not there; --from is a data folder", path.display());
        }
        Ok(ByteStore::local(&bytes)?)
    };
    let from = folders().map_err(Failure::Usage)?;
    let to = ByteStore::s3(&args.store, std::env::vars())
        .with_context(|| format!("opening the store {}", args.store))
        .map_err(Failure::Usage)?;
    // The URL is not told: it may hold a password.
    let farm = PostgresStore::open(&args.database_url, &PostgresOptions::default())
        .await
        .context("opening the database of --database-url")
        .map_err(Failure::Usage)?;
    let style = ProgressStyle::with_template("{bar:40} {pos} of {len} jobs and pages");
    let bar = ProgressBar::new(0).with_style(style.expect("the template is valid"));
    let told = |done, all| {
        bar.set_length(all);
        bar.set_position(done);
    };
    let imported = farm.import(&database, &from, &to, told).await;
    bar.finish_and_clear();
    farm.close().await;
    let imported = imported.map_err(|error| match error {
        ImportError::Store(_) | ImportError::Bytes(_) => Failure::Internal(error.into()),
        refused => Failure::Input(refused.into()),
    })?;
    println!(
        "imported {} jobs and pages with {} files of {} bytes, {} of which were there already",
        imported.jobs, imported.files, imported.bytes, imported.found
    );
    Ok(())
}
