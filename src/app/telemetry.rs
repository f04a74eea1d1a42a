//! Where log lines and traces go.

use std::env;
use std::io::{self, IsTerminal};
use std::sync::OnceLock;

use anyhow::{Context, Result};
use opentelemetry::trace::TracerProvider;
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::trace::SdkTracerProvider;
use tracing::Subscriber;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer};

use super::config::{LogConfig, LogFormat};

/// Where a collector takes traces over HTTP, as all programs call it. Its like for
/// headers, timeouts and sampling are obeyed too.
const COLLECTOR: &str = "OTEL_EXPORTER_OTLP_ENDPOINT";
/// What the service is called there, unless `OTEL_SERVICE_NAME` says otherwise.
const SERVICE: &str = "turnaround";

/// Sends spans to the collector, if there is one.
static TRACES: OnceLock<SdkTracerProvider> = OnceLock::new();

/// Sends log lines to standard error as `config` says, and traces to the collector
/// that the environment names.
///
/// # Errors
/// If the level is no tracing directive, or the collector's address is none.
pub(super) fn init(config: &LogConfig) -> Result<()> {
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(io::stderr)
        .with_ansi(io::stderr().is_terminal());
    let lines = match config.log_format {
        LogFormat::Text => lines.boxed(),
        LogFormat::Json => lines.json().boxed(),
    };
    let filter = filter(&config.log)?;
    tracing_subscriber::registry().with(lines).with(filter).with(traces()?).init();
    Ok(())
}

fn traces<S: Subscriber + for<'s> LookupSpan<'s>>() -> Result<Option<impl Layer<S>>> {
    if env::var_os(COLLECTOR).is_none_or(|address| address.is_empty()) {
        return Ok(None);
    }
    // Of the two that could be linked, the one that is.
    let _ = rustls::crypto::ring::default_provider().install_default();
    let exporter = opentelemetry_otlp::SpanExporter::builder().with_http().build();
    let exporter = exporter.with_context(|| format!("sending traces to {COLLECTOR}"))?;
    let mut resource = Resource::builder();
    if env::var_os("OTEL_SERVICE_NAME").is_none() {
        resource = resource.with_service_name(SERVICE);
    }
    let provider = SdkTracerProvider::builder().with_batch_exporter(exporter);
    let provider = provider.with_resource(resource.build()).build();
    let tracer = TRACES.get_or_init(|| provider).tracer(SERVICE);
    Ok(Some(tracing_opentelemetry::layer().with_tracer(tracer)))
}

/// Sends the spans that have not been sent yet.
pub(super) fn flush() {
    if let Some(Err(error)) = TRACES.get().map(SdkTracerProvider::shutdown) {
        tracing::warn!(%error, "the last traces could not be sent");
    }
}

/// Sends log lines to the service that started this process, which adds the time.
///
/// # Errors
/// If `level` is no tracing directive.
pub(super) fn init_child(level: &str) -> Result<()> {
    let lines = tracing_subscriber::fmt().with_env_filter(filter(level)?);
    lines.with_writer(io::stderr).with_ansi(false).without_time().init();
    Ok(())
}

fn filter(level: &str) -> Result<EnvFilter> {
    EnvFilter::try_new(level).with_context(|| format!("--log {level}: not a level or directive"))
}
