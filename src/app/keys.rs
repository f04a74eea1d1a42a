//! `turnaround keys` and `turnaround tenants`: who may use a service, by its
//! data folder or database, whether it runs or not.

use anyhow::{Context, Result, ensure};
use clap::{Subcommand, ValueEnum};
use tokio::runtime::Runtime;

use super::config::StoresConfig;
use super::failure::Failure;
use super::stores::open_access;
use jobs::{KeyText, NewKey, Scope, TenantName};

/// What to do with keys.
#[derive(Subcommand, Debug)]
pub(super) enum KeyCommand {
    /// Make a key and print it; it is shown this once
    Create {
        #[command(flatten)]
        data: StoresConfig,
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
        data: StoresConfig,
    },
    /// Revoke a key for good
    Revoke {
        #[command(flatten)]
        data: StoresConfig,
        /// The first part of it, such as ta_0123456789ab
        id: String,
    },
    /// Let everybody in who reaches the service by the loopback, until the next key is made;
    /// only when all keys are revoked
    Open {
        #[command(flatten)]
        data: StoresConfig,
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
        data: StoresConfig,
        /// Lower-case letters, digits and hyphens
        name: TenantName,
    },
    /// List all tenants
    List {
        #[command(flatten)]
        data: StoresConfig,
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
                open_access(data).await?.add_key(&NewKey { tenant, label, scope }, &text).await?;
                println!("{}", text.reveal());
            }
            KeyCommand::List { data } => {
                for key in open_access(data).await?.keys().await? {
                    let scope = format!("{:?}", key.scope).to_lowercase();
                    let state = key.revoked_at.map(|at| format!("revoked {at}"));
                    let state = state.unwrap_or_else(|| "active".to_owned());
                    println!("{}\t{}\t{scope}\t{state}\t{}", key.id, key.tenant, key.label);
                }
            }
            KeyCommand::Revoke { data, id } => {
                open_access(data).await?.revoke_key(id).await?;
            }
            KeyCommand::Open { data } => {
                ensure!(
                    open_access(data).await?.open_to_all().await?,
                    "there are keys; revoke them first"
                );
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
                open_access(data).await?.create_tenant(name).await?;
            }
            TenantCommand::List { data } => {
                for tenant in open_access(data).await?.tenants().await? {
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
