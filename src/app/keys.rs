//! `turnaround keys` and `turnaround tenants`: who may use a service, by its
//! data folder, whether it runs or not.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context, Result, ensure};
use clap::{Args, Subcommand, ValueEnum};
use tokio::runtime::Runtime;

use super::failure::Failure;
use jobs::{AccessStore, KeyText, NewKey, Scope, SqliteStore, SystemClock, TenantName};

/// Where the service keeps its database.
#[derive(Args, Debug)]
pub(super) struct DataArgs {
    /// Data folder of the service
    #[arg(long, env = "TURNAROUND_DATA_DIR", value_name = "DIR", default_value = "data")]
    data_dir: PathBuf,
}

/// What to do with keys.
#[derive(Subcommand, Debug)]
pub(super) enum KeyCommand {
    /// Make a key and print it; it is shown this once
    Create {
        #[command(flatten)]
        data: DataArgs,
        /// Whose it is
        #[arg(long, default_value_t)]
        tenant: TenantName,
        /// What it allows; each scope includes those before it
        #[arg(long, value_enum)]
        scope: ScopeArg,
        /// What people call it
        #[arg(long, default_value = "")]
        label: String,
    },
    /// List all keys, without their secrets
    List {
        #[command(flatten)]
        data: DataArgs,
    },
    /// Revoke a key for good
    Revoke {
        #[command(flatten)]
        data: DataArgs,
        /// The first part of it, such as ta_0123456789ab
        id: String,
    },
    /// Print a new key that no service knows, for --first-key-file
    Generate,
}

/// What to do with tenants.
#[derive(Subcommand, Debug)]
pub(super) enum TenantCommand {
    /// Make a tenant, whose jobs no other sees
    Create {
        #[command(flatten)]
        data: DataArgs,
        /// Lower-case letters, digits and hyphens
        name: TenantName,
    },
    /// List all tenants
    List {
        #[command(flatten)]
        data: DataArgs,
    },
}

#[derive(ValueEnum, Clone, Copy, Debug)]
pub(super) enum ScopeArg {
    Read,
    Write,
    Admin,
}

impl From<ScopeArg> for Scope {
    fn from(scope: ScopeArg) -> Self {
        match scope {
            ScopeArg::Read => Self::Read,
            ScopeArg::Write => Self::Write,
            ScopeArg::Admin => Self::Admin,
        }
    }
}

/// Runs a command about keys.
pub(super) fn keys(command: &KeyCommand) -> Result<(), Failure> {
    block_on(async {
        match command {
            KeyCommand::Create { data, tenant, scope, label } => {
                let text = KeyText::generate();
                let (tenant, label, scope) = (tenant.clone(), label.clone(), (*scope).into());
                data.open().await?.add_key(&NewKey { tenant, label, scope }, &text).await?;
                println!("{}", text.reveal());
            }
            KeyCommand::List { data } => {
                for key in data.open().await?.keys().await? {
                    let scope = format!("{:?}", key.scope).to_lowercase();
                    let state = key.revoked_at.map(|at| format!("revoked {at}"));
                    let state = state.unwrap_or_else(|| "active".to_owned());
                    println!("{}\t{}\t{scope}\t{state}\t{}", key.id, key.tenant, key.label);
                }
            }
            KeyCommand::Revoke { data, id } => {
                data.open().await?.revoke_key(id).await?;
            }
            KeyCommand::Generate => println!("{}", KeyText::generate().reveal()),
        }
        Ok(())
    })
}

/// Runs a command about tenants.
pub(super) fn tenants(command: &TenantCommand) -> Result<(), Failure> {
    block_on(async {
        match command {
            TenantCommand::Create { data, name } => {
                data.open().await?.create_tenant(name).await?;
            }
            TenantCommand::List { data } => {
                for tenant in data.open().await?.tenants().await? {
                    println!("{}\t{}", tenant.name, tenant.created_at);
                }
            }
        }
        Ok(())
    })
}

fn block_on(work: impl Future<Output = Result<()>>) -> Result<(), Failure> {
    let runtime = Runtime::new().context("starting the async runtime");
    runtime.map_err(Failure::Internal)?.block_on(work).map_err(Failure::Usage)
}

impl DataArgs {
    async fn open(&self) -> Result<SqliteStore> {
        let folder = &self.data_dir;
        let bytes = folder.join("bytes");
        let database = folder.join("jobs.sqlite");
        ensure!(
            database.exists() || !bytes.exists(),
            "{} has bytes but no database; put its latest copy back first",
            folder.display()
        );
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
        let opened = SqliteStore::open(&database, Arc::new(SystemClock)).await;
        opened.with_context(|| format!("in the data folder {}", folder.display()))
    }
}
