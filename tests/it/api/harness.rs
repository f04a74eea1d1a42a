//! A service on a port of its own, with a folder of its own and no workers.

use std::io::Cursor;
use std::sync::Arc;
use std::time::Duration;

use image::{GrayImage, ImageFormat, Luma};
use jobs::bytes::{ByteStore, Key};
use jobs::{
    AccessStore, ArtifactEntry, JobId, JobStore, KeyText, ListQuery, NewKey, Scope, SqliteStore,
    SystemClock, TenantLimits, TenantName,
};
use reqwest::multipart::{Form, Part};
use reqwest::{Client, RequestBuilder, Response, StatusCode};
use serde_json::Value;
use sha2::{Digest, Sha256};
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use turnaround::http::{
    self, Access, ApiState, Guard, HttpLimits, KeyPolicy, LinkKey, Redirects, ServerTimeouts,
};
use turnaround::outbound::{Outbound, OutboundPolicy};

pub(crate) const LEASE: Duration = Duration::from_secs(30);

pub(crate) struct Service {
    pub url: String,
    pub store: Arc<SqliteStore>,
    pub bytes: ByteStore,
    pub client: Client,
    pub outbound: Arc<Outbound>,
    pub draining: CancellationToken,
    pub shutdown: CancellationToken,
    folder: TempDir,
}

impl Service {
    pub(crate) async fn start() -> Self {
        Self::start_with(HttpLimits::default(), ServerTimeouts::default()).await
    }

    pub(crate) async fn start_with(limits: HttpLimits, timeouts: ServerTimeouts) -> Self {
        Self::start_as(limits, timeouts, false, None).await
    }

    /// One that stores new bytes below prefixes of their tenants.
    pub(crate) async fn start_by_tenant() -> Self {
        Self::start_as(HttpLimits::default(), ServerTimeouts::default(), true, None).await
    }

    /// One whose bytes are in a bucket, which sends the large ones itself.
    pub(crate) async fn start_redirecting(
        bytes: ByteStore,
        redirects: Redirects,
        bytes_by_tenant: bool,
    ) -> Self {
        let (limits, timeouts) = (HttpLimits::default(), ServerTimeouts::default());
        Self::start_as(limits, timeouts, bytes_by_tenant, Some((bytes, redirects))).await
    }

    async fn start_as(
        limits: HttpLimits,
        timeouts: ServerTimeouts,
        bytes_by_tenant: bool,
        bucket: Option<(ByteStore, Redirects)>,
    ) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("jobs.sqlite");
        let store = Arc::new(SqliteStore::open(&path, Arc::new(SystemClock)).await.unwrap());
        let (bytes, redirects) = match bucket {
            Some((bytes, redirects)) => (bytes, Some(redirects)),
            None => (ByteStore::local(&folder.path().join("bytes")).unwrap(), None),
        };
        let (draining, shutdown) = (CancellationToken::new(), CancellationToken::new());
        // Receivers of tests are on the loopback by this address alone.
        let policy =
            OutboundPolicy { trusted_hosts: vec!["127.0.0.1".to_owned()], allow_http: false };
        let outbound = Arc::new(Outbound::new(policy, Vec::new()).unwrap());
        let state = ApiState {
            store: store.clone(),
            bytes: bytes.clone(),
            bytes_by_tenant,
            redirects,
            metrics: http::prometheus().unwrap(),
            max_attempts: 3,
            access: Access {
                store: store.clone(),
                policy: KeyPolicy::OnceThereWasAKey,
                defaults: TenantLimits::default(),
                open_metrics: false,
                docs: true,
            },
            outbound: outbound.clone(),
            link_key: LinkKey::new(&store.secret("links").await.unwrap()),
            guard: Guard { origins: vec!["https://studio.example".to_owned()], ..Guard::default() },
            draining: draining.clone(),
            shutdown: shutdown.clone(),
        };
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let router = http::router(state, &limits);
        let stop = shutdown.clone();
        tokio::spawn(
            async move { http::serve(listener, router, &timeouts, 1000, stop).await.unwrap() },
        );
        let client = crate::client();
        Self { url, store, bytes, client, outbound, draining, shutdown, folder }
    }

    /// Makes a key, so that nothing is open any more.
    pub(crate) async fn close(&self) {
        let (tenant, label) = (TenantName::default(), "test".to_owned());
        let key = NewKey { tenant, label, scope: Scope::Admin };
        self.store.add_key(&key, &KeyText::generate()).await.unwrap();
        // That there are none is remembered for a second.
        tokio::time::sleep(Duration::from_millis(1100)).await;
    }

    /// Another store over the same file, as another process has it.
    pub(crate) async fn other_store(&self) -> SqliteStore {
        let path = self.folder.path().join("jobs.sqlite");
        SqliteStore::open(&path, Arc::new(SystemClock)).await.unwrap()
    }

    pub(crate) fn get(&self, path: &str) -> RequestBuilder {
        self.client.get(format!("{}{path}", self.url))
    }

    pub(crate) fn post(&self, path: &str) -> RequestBuilder {
        self.client.post(format!("{}{path}", self.url))
    }

    pub(crate) fn put(&self, path: &str) -> RequestBuilder {
        self.client.put(format!("{}{path}", self.url))
    }

    pub(crate) fn delete(&self, path: &str) -> RequestBuilder {
        self.client.delete(format!("{}{path}", self.url))
    }

    pub(crate) async fn upload(&self, form: Form) -> Response {
        self.post("/v1/reconstructions").multipart(form).send().await.unwrap()
    }

    /// Uploads a sheet of three views. Returns the new job's id.
    pub(crate) async fn queue(&self) -> JobId {
        let response = self.upload(views(&["0", "45", "90"])).await;
        assert_eq!(response.status(), StatusCode::ACCEPTED);
        let body: Value = response.json().await.unwrap();
        body["id"].as_str().unwrap().parse().unwrap()
    }

    /// Plays the worker: claims the next job.
    pub(crate) async fn claim(&self) -> (JobId, u32) {
        let claim = self.store.claim("test", LEASE).await.unwrap().expect("a queued job");
        (claim.job.id, claim.attempt)
    }

    /// Plays the worker: publishes `artifacts` and ends the job.
    pub(crate) async fn succeed(
        &self,
        id: JobId,
        attempt: u32,
        artifacts: &[(&str, &str, Vec<u8>)],
    ) {
        let mut entries = Vec::new();
        for (name, media_type, content) in artifacts {
            let key = Key::Artifact { job: id, attempt, name };
            let home = id.home(&TenantName::default());
            self.bytes.of(&home).put(&key, content.clone().into()).await.unwrap();
            entries.push(ArtifactEntry {
                name: (*name).to_owned(),
                media_type: (*media_type).to_owned(),
                bytes: content.len() as u64,
                sha256: hex::encode(Sha256::digest(content)),
            });
        }
        self.store.succeed(id, attempt, entries, None).await.unwrap();
    }

    /// A succeeded job with these artifacts.
    pub(crate) async fn finished(&self, artifacts: &[(&str, &str, Vec<u8>)]) -> JobId {
        let id = self.queue().await;
        let (claimed, attempt) = self.claim().await;
        assert_eq!(claimed, id);
        self.succeed(id, attempt, artifacts).await;
        id
    }

    /// Fails if there is a job, or a single file or folder of one.
    pub(crate) async fn assert_nothing_stored(&self) {
        let query = ListQuery { limit: 10, ..ListQuery::default() };
        assert!(self.store.list(&query).await.unwrap().jobs.is_empty(), "a job was stored");
        assert_eq!(self.bytes.all().await.unwrap(), [], "bytes were stored");
        let mut folders = vec![self.folder.path().join("bytes")];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                assert!(path.is_dir(), "{} was stored", path.display());
                folders.push(path);
            }
        }
    }

    /// Which file of the disk has these bytes.
    pub(crate) fn file_number(&self, key: &Key<'_>) -> u64 {
        let path = self.folder.path().join("bytes").join(key.path().unwrap().as_ref());
        std::os::unix::fs::MetadataExt::ino(&std::fs::metadata(path).unwrap())
    }

    pub(crate) async fn stored_inputs(&self, id: JobId, names: &[&str]) -> Vec<Vec<u8>> {
        let mut found = Vec::new();
        for name in names {
            found.push(self.bytes.get(&Key::Input { job: id, name }).await.unwrap().to_vec());
        }
        found
    }
}

/// A drawing whose pixels depend on `seed`.
pub(crate) fn drawing(width: u32, height: u32, seed: u32) -> Vec<u8> {
    encode(width, height, seed, ImageFormat::Png)
}

pub(crate) fn encode(width: u32, height: u32, seed: u32, format: ImageFormat) -> Vec<u8> {
    let image = GrayImage::from_fn(width, height, |x, y| {
        Luma([((x * 7 + y * 13 + seed * 31) % 251) as u8])
    });
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

pub(crate) fn file(bytes: Vec<u8>, name: &str) -> Part {
    Part::bytes(bytes).file_name(name.to_owned())
}

/// A form with a drawing at each of these angles, reconstructed whatever was before.
pub(crate) fn views(angles: &[&str]) -> Form {
    reusable_views(angles).text("reuse", "false")
}

/// As [`views`]; an earlier result will do.
pub(crate) fn reusable_views(angles: &[&str]) -> Form {
    let mut form = Form::new();
    for (index, angle) in angles.iter().enumerate() {
        let drawing = drawing(32, 24, index as u32);
        form = form.part(format!("view[{angle}]"), file(drawing, &format!("{angle}.png")));
    }
    form
}

/// Checks that `response` is problem details of this kind. Returns them.
pub(crate) async fn problem(response: Response, status: u16, name: &str) -> Value {
    let found = response.status().as_u16();
    let media_type = response.headers().get("content-type").cloned();
    let path = response.url().path().to_owned();
    let text = response.text().await.unwrap();
    assert_eq!(found, status, "{text}");
    assert_eq!(media_type.unwrap(), "application/problem+json", "{text}");
    let body: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(body["type"], format!("/problems/{name}"), "{text}");
    assert_eq!(body["status"], status, "{text}");
    assert_eq!(body["instance"], path, "{text}");
    assert!(body["title"].as_str().is_some_and(|title| !title.is_empty()), "{text}");
    assert!(body["detail"].as_str().is_some_and(|detail| detail.len() > 10), "{text}");
    body
}
