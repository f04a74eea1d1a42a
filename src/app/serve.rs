//! Wires stores, workers and the HTTP interface into running services.

use std::future::Future;
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::path::Path;
use std::sync::Arc;
use std::thread::available_parallelism;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use mesh::read::Limits;
use rustls::pki_types::CertificateDer;
use rustls::pki_types::pem::PemObject;
use tokio::net::TcpListener;
use tokio::runtime::{Handle, Runtime};
use tokio::signal::unix::{SignalKind, signal};
use tokio_util::sync::CancellationToken;

use super::config::{AccessConfig, Config, HttpConfig, Isolation, OutboundConfig};
use super::failure::Failure;
use super::stores::Stores;
use super::{descriptors, memory, telemetry};
use crate::draft::DraftLimits;
use crate::http::{
    self, Access, ApiState, Guard, HttpLimits, KeyPolicy, LinkKey, Redirects, ServerTimeouts,
};
use crate::outbound::{Outbound, OutboundPolicy};
use crate::webhooks::{Sender, SenderConfig};
use crate::worker::isolation::{ChildSettings, Isolated};
use crate::worker::jobs::{Draw, Reconstruct};
use crate::worker::{Pool, Work, WorkerConfig};
use jobs::bytes::UrlSigner;
use jobs::{AccessStore, KeyText, NewKey, Scope, TenantLimits, TenantName};

/// What a process needs beside the memory that a job may take: stacks, the network's
/// weights, what the estimate of a job leaves out.
const CHILD_BYTES: u64 = 512 << 20;

/// Runs the HTTP interface and the workers until SIGTERM or SIGINT.
pub(super) fn serve(config: &Config) -> Result<(), Failure> {
    run(|runtime| serve_until_signal(config, runtime))
}

/// Runs workers alone until SIGTERM or SIGINT.
pub(super) fn worker(config: &Config) -> Result<(), Failure> {
    run(|runtime| work_until_signal(config, runtime))
}

fn run<F: Future<Output = Result<()>>>(service: impl FnOnce(Handle) -> F) -> Result<(), Failure> {
    let runtime =
        Runtime::new().context("starting the async runtime").map_err(Failure::Internal)?;
    let served = runtime.block_on(service(runtime.handle().clone())).map_err(Failure::Internal);
    telemetry::flush();
    served
}

async fn serve_until_signal(config: &Config, runtime: Handle) -> Result<()> {
    let stores = Stores::open(&config.stores, config.storage.adopt_bytes).await?;
    let outbound = outbound(config)?;
    let (draining, shutdown) = (CancellationToken::new(), CancellationToken::new());
    let state = ApiState {
        store: stores.jobs.clone(),
        bytes: stores.bytes.clone(),
        bytes_by_tenant: config.storage.bytes_by_tenant,
        redirects: redirects(config)?,
        metrics: http::prometheus().context("recording metrics")?,
        max_attempts: config.workers.max_attempts,
        access: access(config, &stores).await?,
        outbound: outbound.clone(),
        link_key: link_key(config, &stores).await?,
        guard: guard(&config.http),
        draining: draining.clone(),
        shutdown: shutdown.clone(),
    };
    let connections = match (config.http.max_connections, descriptors::raise_limit()) {
        (0, files) => descriptors::connections(files),
        (set, _) => set,
    };
    let router = http::router(state, &http_limits(config, connections));
    let listen = config.http.listen;
    let listener =
        TcpListener::bind(listen).await.with_context(|| format!("listening on {listen}"))?;
    let pool = stores.start_workers(config, &runtime)?;
    let sender = tokio::spawn(stores.sender(outbound).run());
    println!("listening on http://{}", listener.local_addr()?);
    let timeouts = server_timeouts(&config.http);
    let stopped = shutdown.clone();
    let server = tokio::spawn(async move {
        http::serve(listener, router, &timeouts, connections, stopped).await
    });
    stop_signal().await?;
    draining.cancel();
    // Status requests are answered until running jobs have come to rest.
    pool.shutdown(Duration::from_secs(config.workers.shutdown_grace)).await;
    shutdown.cancel();
    // What it was sending is sent again after the next start.
    sender.abort();
    server.await.context("the server")??;
    Ok(())
}

async fn work_until_signal(config: &Config, runtime: Handle) -> Result<()> {
    ensure!(config.workers.workers > 0, "workers is 0, so that there is nothing to do");
    let metrics = http::prometheus().context("recording metrics")?;
    if let Some(listen) = config.workers.metrics_listen {
        let listener =
            TcpListener::bind(listen).await.with_context(|| format!("listening on {listen}"))?;
        println!("metrics on http://{}", listener.local_addr()?);
        tokio::spawn(async move { axum::serve(listener, http::of_worker(metrics)).await });
    }
    let stores = Stores::open(&config.stores, config.storage.adopt_bytes).await?;
    let pool = stores.start_workers(config, &runtime)?;
    let sender = tokio::spawn(stores.sender(outbound(config)?).run());
    stop_signal().await?;
    pool.shutdown(Duration::from_secs(config.workers.shutdown_grace)).await;
    sender.abort();
    Ok(())
}

async fn stop_signal() -> Result<()> {
    let mut terminate = signal(SignalKind::terminate())?;
    let mut interrupt = signal(SignalKind::interrupt())?;
    tokio::select! {
        _ = terminate.recv() => tracing::info!("SIGTERM: stopping"),
        _ = interrupt.recv() => tracing::info!("SIGINT: stopping"),
    }
    Ok(())
}

impl Stores {
    fn start_workers(&self, config: &Config, runtime: &Handle) -> Result<Pool> {
        let works = works(draft_limits(config), config.limits.model());
        let works = match config.workers.isolation {
            Isolation::None => works,
            Isolation::Process => isolated(config, &works).context("starting the workers")?,
        };
        let jobs = Arc::clone(&self.jobs);
        Pool::start(worker_config(config), jobs, self.bytes.clone(), works, runtime)
            .context("starting the workers")
    }

    /// What sends the messages of the outbox.
    fn sender(&self, outbound: Arc<Outbound>) -> Sender {
        Sender { config: SenderConfig::default(), store: Arc::clone(&self.jobs), outbound }
    }
}

/// Every kind of work.
pub(super) fn works(draft: DraftLimits, model: Limits) -> Vec<Arc<dyn Work>> {
    let draw = Draw { model, ..Draw::default() };
    vec![Arc::new(Reconstruct { limits: draft }), Arc::new(draw)]
}

/// Lets processes of this program do the work.
fn isolated(config: &Config, works: &[Arc<dyn Work>]) -> io::Result<Vec<Arc<dyn Work>>> {
    let draft = draft_limits(config);
    let settings = ChildSettings {
        log: config.log.log.clone(),
        memory_bytes: draft.max_working_bytes.saturating_add(CHILD_BYTES),
        draft,
        model: config.limits.model(),
    };
    // The program that runs, also when the file was replaced by another version.
    Isolated::all(works, Path::new("/proc/self/exe"), settings, config.workers.workers)
}

fn outbound(config: &Config) -> Result<Arc<Outbound>> {
    let OutboundConfig { trusted_host, allow_http, ca_file, .. } = config.outbound.clone();
    let policy = OutboundPolicy { trusted_hosts: trusted_host, allow_http };
    let authorities = ca_file.as_deref().map(authorities).transpose()?.unwrap_or_default();
    Ok(Arc::new(
        Outbound::new(policy, authorities)
            .context("preparing calls to others, with those of ca_file")?,
    ))
}

/// The certificates in a file that has some.
fn authorities(path: &Path) -> Result<Vec<CertificateDer<'static>>> {
    let within = || format!("reading the certificates of ca_file, {}", path.display());
    let pem = std::fs::read(path).with_context(within)?;
    let found: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(&pem).collect();
    let found = found.with_context(within)?;
    ensure!(!found.is_empty(), "{} has no certificate; give a file in PEM", path.display());
    Ok(found)
}

fn worker_config(Config { workers: config, storage, .. }: &Config) -> WorkerConfig {
    let processors = available_parallelism().map_or(1, usize::from);
    let threads_per_job = match config.threads_per_job {
        0 => (processors / config.workers.max(1)).max(1),
        threads => threads,
    };
    WorkerConfig {
        workers: config.workers,
        threads_per_job,
        lease: Duration::from_secs(config.lease),
        heartbeat: Duration::from_secs(config.heartbeat),
        max_job_time: Duration::from_secs(config.max_job_seconds),
        collect_unknown_after: storage
            .collect_unknown_after
            .map(|hours| Duration::from_secs(hours.saturating_mul(3600))),
        // Below the budget, so that there is room for the uploads that come next.
        make_room: storage
            .disk_budget_mib
            .filter(|_| storage.make_room)
            .map(|mib| (mib << 20) / 10 * 9),
        ..WorkerConfig::default()
    }
}

/// Who may use the service. One that others can reach must have a key, unless
/// it is told otherwise.
async fn access(config: &Config, stores: &Stores) -> Result<Access> {
    let AccessConfig { requests_per_second, max_queued, max_tenant_streams, expires_in, .. } =
        config.access;
    let store = Arc::clone(&stores.access);
    if let Some(path) = &config.access.first_key_file {
        first_key(store.as_ref(), path).await?;
    }
    let policy = match (config.access.insecure_no_auth, config.http.listen.ip().is_loopback()) {
        (true, _) => KeyPolicy::Off,
        (false, true) => KeyPolicy::OnceThereWasAKey,
        (false, false) => KeyPolicy::Required,
    };
    ensure!(
        policy != KeyPolicy::Required || store.has_keys().await?,
        "others can reach {}, and there is no key; make one with `turnaround keys create`, give one with --first-key-file, or let everybody in with --insecure-no-auth",
        config.http.listen
    );
    if policy == KeyPolicy::OnceThereWasAKey
        && store.is_closed().await?
        && !store.has_keys().await?
    {
        tracing::warn!(
            "every request is refused: all keys are revoked; make one with `turnaround keys create`, or let everybody in with `turnaround keys open`"
        );
    }
    let defaults = TenantLimits {
        requests_per_second,
        max_queued,
        max_running: None,
        max_streams: max_tenant_streams,
        max_bytes: config.access.max_tenant_mib.map(|mib| mib << 20),
        expires_in,
    };
    let (open_metrics, docs) = (config.access.open_metrics, !config.access.no_docs);
    Ok(Access { store, policy, defaults, open_metrics, docs })
}

/// What lets the bucket send large artifacts, if that is wanted.
fn redirects(Config { stores, storage, .. }: &Config) -> Result<Option<Redirects>> {
    let (Some(seconds), Some(address)) = (storage.download_redirects, &stores.store) else {
        return Ok(None);
    };
    let signer = UrlSigner::s3(address, std::env::vars(), storage.download_endpoint.as_deref())
        .with_context(|| format!("signing URLs of the store {address} for download_redirects"))?;
    Ok(Some(Redirects::new(signer, Duration::from_secs(seconds.into()))))
}

/// What links are signed with: given, or made once and kept.
async fn link_key(config: &Config, stores: &Stores) -> Result<LinkKey> {
    let Some(path) = &config.access.link_secret_file else {
        return Ok(LinkKey::new(&stores.access.secret("links").await?));
    };
    let within = || format!("reading the secret of links from {}", path.display());
    let secret = std::fs::read_to_string(path).with_context(within)?;
    ensure!(
        secret.trim().len() >= 32,
        "{} has {} bytes; a secret of links needs 32 at least",
        path.display(),
        secret.trim().len()
    );
    Ok(LinkKey::new(&secret))
}

/// Stores the key in `path` unless it is there.
async fn first_key(store: &dyn AccessStore, path: &Path) -> Result<()> {
    let within = || format!("reading the first key from {}", path.display());
    let text = std::fs::read_to_string(path).with_context(within)?;
    let text: KeyText = text.trim().parse().with_context(within)?;
    let is_there =
        async || -> Result<bool> { Ok(store.keys().await?.iter().any(|key| key.id == text.id())) };
    if is_there().await? {
        return Ok(());
    }
    let (tenant, label) = (TenantName::default(), "first".to_owned());
    let added = store.add_key(&NewKey { tenant, label, scope: Scope::Admin }, &text).await;
    // Another node may have been faster.
    if added.is_err() && is_there().await? {
        return Ok(());
    }
    added?;
    Ok(())
}

/// Which requests are meant for the service: listening on the loopback, those
/// that call it by the loopback's names.
fn guard(config: &HttpConfig) -> Guard {
    let mut allowed_hosts = config.allowed_host.clone();
    if allowed_hosts.is_empty() && config.listen.ip().is_loopback() {
        allowed_hosts = ["localhost", "127.0.0.1", "[::1]"].map(str::to_owned).to_vec();
        let own = without_port(config.listen);
        allowed_hosts.extend((!allowed_hosts.contains(&own)).then_some(own));
    }
    Guard { allowed_hosts, origins: config.cors_origin.clone() }
}

fn without_port(address: SocketAddr) -> String {
    match address.ip() {
        IpAddr::V4(ip) => ip.to_string(),
        IpAddr::V6(ip) => format!("[{ip}]"),
    }
}

/// What one reconstruction may cost: what the machine has for each worker.
fn draft_limits(config: &Config) -> DraftLimits {
    let max_working_bytes = match config.limits.max_job_mib {
        0 => memory::of_a_job(config.workers.workers),
        mib => mib << 20,
    };
    DraftLimits { image: config.limits.image(), max_working_bytes }
}

fn http_limits(whole: &Config, connections: usize) -> HttpLimits {
    let Config { limits: config, http, storage, outbound, .. } = whole;
    HttpLimits {
        disk_budget_bytes: storage.disk_budget_mib.map(|mib| mib << 20),
        inputs_by_url: outbound.inputs_by_url,
        min_free_bytes: storage.min_free_mib << 20,
        // Others than streams must find a connection.
        max_streams: http.max_streams.min(connections / 2),
        draft: draft_limits(whole),
        threads_per_job: worker_config(whole).threads_per_job,
        image: config.image(),
        model: config.model(),
        max_body_bytes: config.max_body_mib << 20,
        max_views: config.max_views,
        ..HttpLimits::default()
    }
}

fn server_timeouts(config: &HttpConfig) -> ServerTimeouts {
    ServerTimeouts {
        header_read: Duration::from_secs(config.header_timeout),
        body_idle: Duration::from_secs(config.body_idle_timeout),
        write: Duration::from_secs(config.write_timeout),
        ..ServerTimeouts::default()
    }
}
