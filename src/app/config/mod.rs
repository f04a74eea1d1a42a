//! Settings of the service: flags over environment over file over defaults.
//!
//! Each concern is one small struct that is at once its flags, its environment
//! variables and its keys in the file, so the three cannot drift apart.

mod access;
mod check;
mod http;
mod limits;
mod log;
mod outbound;
mod storage;
mod workers;

pub(super) use access::AccessConfig;
pub(super) use http::HttpConfig;
pub(super) use limits::LimitConfig;
pub(super) use log::{LogConfig, LogFormat};
pub(super) use outbound::OutboundConfig;
pub(super) use storage::{StorageConfig, StoresConfig};
pub(super) use workers::{Isolation, WorkersConfig};

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::parser::ValueSource;
use clap::{ArgMatches, Args};
use figment::Figment;
use figment::providers::{Format, Serialized, Toml};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// Everything the service can be told.
#[derive(Args, Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Config {
    #[command(flatten)]
    #[serde(flatten)]
    pub http: HttpConfig,
    #[command(flatten)]
    #[serde(flatten)]
    pub access: AccessConfig,
    #[command(flatten)]
    #[serde(flatten)]
    pub outbound: OutboundConfig,
    #[command(flatten)]
    #[serde(flatten)]
    pub stores: StoresConfig,
    #[command(flatten)]
    #[serde(flatten)]
    pub storage: StorageConfig,
    #[command(flatten)]
    #[serde(flatten)]
    pub workers: WorkersConfig,
    #[command(flatten)]
    #[serde(flatten)]
    pub limits: LimitConfig,
    #[command(flatten)]
    #[serde(flatten)]
    pub log: LogConfig,
}

/// The flags of `serve` and `worker`.
#[derive(Args, Clone, Debug)]
pub(super) struct ConfigArgs {
    /// TOML file with settings: each key is a flag's name with underscores
    #[arg(long, value_name = "FILE", env = "TURNAROUND_CONFIG")]
    config: Option<PathBuf>,
    #[command(flatten)]
    values: Config,
}

impl ConfigArgs {
    /// Lays flags and environment (as `matches` found them) over the file.
    ///
    /// # Errors
    /// If the file can't be read, has a key that is no setting, or a value of
    /// the wrong type.
    pub(super) fn resolve(self, matches: &ArgMatches) -> Result<Config> {
        let defaults = object(serde_json::to_value(&self.values)?);
        let given: Map<String, Value> = defaults
            .iter()
            .filter(|(key, _)| {
                matches!(
                    matches.value_source(key),
                    Some(ValueSource::CommandLine | ValueSource::EnvVariable)
                )
            })
            .map(|(key, value)| (key.clone(), value.clone()))
            .collect();
        let mut figment = Figment::from(Serialized::defaults(&defaults));
        if let Some(path) = &self.config {
            let text = std::fs::read_to_string(path)
                .with_context(|| format!("reading settings from {}", path.display()))?;
            let in_file: Map<String, Value> = Figment::from(Toml::string(&text))
                .extract()
                .with_context(|| format!("reading settings from {}", path.display()))?;
            if let Some(key) = in_file.keys().find(|key| !defaults.contains_key(*key)) {
                let known: Vec<_> = defaults.keys().map(String::as_str).collect();
                bail!("{}: {key} is no setting; there are {}", path.display(), known.join(", "));
            }
            figment = figment.merge(Toml::string(&text));
        }
        let config: Config = figment
            .merge(Serialized::defaults(&given))
            .extract()
            .context("reading the settings")?;
        config.check()?;
        Ok(config)
    }
}

fn object(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(map) => map,
        other => unreachable!("settings serialise to an object, not {other}"),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use clap::{Command, FromArgMatches};
    use std::io::Write;

    pub(super) fn resolve(args: &[&str]) -> Result<Config> {
        let command = ConfigArgs::augment_args(Command::new("serve"));
        let matches = command.try_get_matches_from([&["serve"], args].concat())?;
        ConfigArgs::from_arg_matches(&matches)?.resolve(&matches)
    }

    fn file(text: &str) -> tempfile::NamedTempFile {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        file
    }

    #[test]
    fn a_flag_wins_over_the_file_and_the_file_over_the_default() {
        let file = file("listen = \"127.0.0.1:1\"\nlease = 77\n");
        let path = file.path().to_str().unwrap();
        let config = resolve(&["--config", path, "--listen", "127.0.0.1:2"]).unwrap();
        assert_eq!(config.http.listen.port(), 2);
        assert_eq!(config.workers.lease, 77);
        assert_eq!(config.workers.heartbeat, 10);
    }

    #[test]
    fn a_misspelt_key_in_the_file_is_refused() {
        let file = file("lisen = \"127.0.0.1:1\"\n");
        let error = resolve(&["--config", file.path().to_str().unwrap()]).unwrap_err();
        assert!(error.to_string().contains("lisen is no setting"), "{error}");
    }
}
