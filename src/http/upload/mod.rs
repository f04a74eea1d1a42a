//! Uploads: multipart bodies become durable jobs, or nothing at all.
//!
//! Every part is held against its limits while it arrives, the parts against
//! each other once all are there, and every picture and model is decoded to its
//! end. Only then is anything stored: first the inputs, then the job that needs them.

mod assemble;
mod document;
mod fetch;
mod files;
mod intake;
mod matches;
mod model;
mod option_parts;
mod page;
mod page_forms;
mod parts;
mod pictures;
mod reuse;
mod source;
mod terms;
mod truths;

pub(super) use document::Document;
pub(super) use intake::Budget;
pub(super) use model::ModelForm;
pub(super) use page::{azimuth_part, search};
pub(super) use page_forms::{EditForm, PageForm};
pub(super) use parts::{FilePart, Parts};
pub(super) use pictures::{Decoders, image_problem};
pub(super) use terms::{IDEMPOTENCY_KEY, PageTerms, page_fingerprint};

use std::future::Future;

use axum::body::Body;
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderValue, header};
use bytes::Bytes;
use futures::{StreamExt, TryStreamExt, stream};
use multer::{Field, Multipart};
use serde::Serialize;
use serde_json::Value;
use tokio::sync::OwnedSemaphorePermit;

use self::intake::{Intake, too_large};
use self::terms::Terms;
use super::access::Caller;
use super::problem::{IDEMPOTENT_JOB_GONE, Problem, REQUEST_TIMEOUT, UNSUPPORTED_MEDIA_TYPE};
use super::{Api, HttpLimits, webhooks};
use jobs::bytes::{ByteError, ByteStore, BytesOf, Key};
use jobs::{Idempotency, Job, JobId, NewJob, StoreError};

/// How many inputs are written at a time: each waits for the disk.
const CONCURRENT_WRITES: usize = 8;

/// The parts of one kind of upload.
pub(super) trait Form: Default + Send {
    /// Takes a part, held against its own limit while it arrives.
    fn read_one(
        &mut self,
        field: Field<'_>,
        limits: &HttpLimits,
    ) -> impl Future<Output = Result<(), Problem>> + Send;
}

/// The parts of an upload that becomes a job.
pub(super) trait JobForm: Form {
    /// Checks the parts against each other and decodes them to their ends.
    fn check(
        self,
        api: &Api,
        caller: &Caller,
    ) -> impl Future<Output = Result<Upload, Problem>> + Send;
}

/// A checked upload: the job that it will be.
pub(super) struct Upload {
    kind: &'static str,
    payload: Value,
    inputs: Inputs,
    /// Whether an earlier job's result will do.
    reuse: bool,
    /// On the budget, for what was fetched beside the body.
    fetched: Option<OwnedSemaphorePermit>,
}

/// Where a job's inputs come from.
enum Inputs {
    Uploaded(Vec<(String, Bytes)>),
    /// The inputs of an earlier job, by name, and those that are not its own.
    Copied {
        source: BytesOf,
        names: Vec<String>,
        own: Vec<(String, Bytes)>,
    },
}

impl Upload {
    fn new(kind: &'static str, payload: &impl Serialize, inputs: Inputs) -> Result<Self, Problem> {
        let payload = serde_json::to_value(payload);
        let payload = payload.map_err(|error| Problem::internal("payload", &error))?;
        Ok(Self { kind, payload, inputs, reuse: true, fetched: None })
    }
}

/// Receives an upload and enqueues its job. Job and inputs are durable on return.
pub(super) async fn receive<F: JobForm>(api: &Api, request: Request) -> Result<Job, Problem> {
    let (head, body) = request.into_parts();
    let terms = Terms::of(&head)?;
    if let Some(url) = &terms.webhook {
        let checked = webhooks::check(api, &terms.caller.tenant, url).await;
        checked.map_err(|problem| problem.parameter("webhook"))?;
    }
    let request = Request::from_parts(head, body);
    let work = async |form: F| form.check(api, &terms.caller).await;
    let (upload, _hold) = read_and(api, &terms.caller, request, work).await?;
    // Beyond the timeout: nobody is told that a job failed to come that did.
    enqueue(api, upload, &terms).await
}

/// Reads a form and works on it, both within the time for an upload. The hold on
/// the budget is to be kept as long as the bytes.
pub(super) async fn read_and<F: Form, T>(
    api: &Api,
    caller: &Caller,
    request: Request,
    work: impl AsyncFnOnce(F) -> Result<T, Problem>,
) -> Result<(T, Option<OwnedSemaphorePermit>), Problem> {
    expect_room(api, caller, request.headers()).await?;
    let (head, body) = request.into_parts();
    let receiving = async {
        let (form, hold) = read_form::<F>(api, &head.headers, body).await?;
        // Parsed documents take more room than their bytes: a few at a time.
        let _slot = api.checks.acquire().await;
        Ok((work(form).await?, hold))
    };
    let received = tokio::time::timeout(api.limits.upload_timeout, receiving).await;
    received.unwrap_or_else(|_| {
        let seconds = api.limits.upload_timeout.as_secs();
        let detail = format!("the upload took longer than {seconds} s; send it again");
        Err(Problem::new(REQUEST_TIMEOUT, detail))
    })
}

/// Refuses uploads while the service stops and while its disk is about full:
/// the rest is kept for what makes room and for jobs that run.
async fn expect_room(api: &Api, caller: &Caller, headers: &HeaderMap) -> Result<(), Problem> {
    if api.state.draining.is_cancelled() {
        return Err(Problem::stopping());
    }
    let length = headers.get(header::CONTENT_LENGTH).and_then(|value| value.to_str().ok());
    let coming = length.and_then(|length| length.parse().ok()).unwrap_or(0);
    let needed = api.limits.min_free_bytes.saturating_add(coming);
    match api.state.bytes.free_bytes()? {
        Some(free) if free < needed => return Err(Problem::full()),
        _ => {}
    }
    let store = &api.state.store;
    if let Some(most) = api.limits.disk_budget_bytes
        && store.stored_bytes(None).await?.saturating_add(coming) > most
    {
        return Err(Problem::full());
    }
    if let Some(most) = caller.limits.max_bytes
        && store.stored_bytes(Some(&caller.tenant)).await?.saturating_add(coming) > most
    {
        return Err(Problem::tenant_full(caller.tenant.as_str(), most));
    }
    Ok(())
}

async fn read_form<F: Form>(
    api: &Api,
    headers: &HeaderMap,
    body: Body,
) -> Result<(F, Option<OwnedSemaphorePermit>), Problem> {
    let limit = api.limits.max_body_bytes;
    let mut intake = Intake::new(body, limit, api.budget.clone());
    let boundary = check_head(headers, limit)?;
    let form = parts::read(Multipart::new(&mut intake, boundary), &api.limits).await?;
    Ok((form, intake.into_hold()))
}

/// Checks what the header says of the body. Returns the multipart boundary.
fn check_head(headers: &HeaderMap, limit: u64) -> Result<String, Problem> {
    let content_type = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok());
    let boundary = multer::parse_boundary(content_type.unwrap_or_default()).map_err(|_| {
        let detail = format!(
            "the body is `{}`; send multipart/form-data with a boundary, as curl -F does",
            content_type.unwrap_or("of no media type")
        );
        Problem::new(UNSUPPORTED_MEDIA_TYPE, detail)
            .header(header::ACCEPT, HeaderValue::from_static("multipart/form-data"))
    })?;
    let length = headers.get(header::CONTENT_LENGTH).and_then(|value| value.to_str().ok());
    match length.and_then(|length| length.parse::<u64>().ok()) {
        Some(length) if length > limit => Err(too_large(limit)),
        _ => Ok(boundary),
    }
}

async fn enqueue(api: &Api, upload: Upload, terms: &Terms) -> Result<Job, Problem> {
    let Terms { caller, key, request_id, priority, tags, webhook } = terms;
    let (upload, idempotency) = match key {
        None => (upload, None),
        Some(key) => {
            let (key, priority) = (key.clone(), *priority);
            let named = move || {
                let fingerprint = terms::fingerprint(&upload, priority);
                (upload, Some(Idempotency { key, fingerprint }))
            };
            api.decoders.run(named).await?
        }
    };
    if let Some(given) = &idempotency
        && let Some(job) =
            api.state.store.enqueued(&caller.tenant, given).await.map_err(idempotency_problem)?
    {
        return Ok(job);
    }
    let (id, store) = api.state.new_name(&caller.tenant);
    let stored = async {
        let result_key = reuse::key(api, &upload).await?;
        let Upload { kind, payload, inputs, reuse, fetched: _hold } = upload;
        api.state.store.expect_bytes(id).await?;
        store_inputs(&store, id, inputs).await?;
        let bytes = store.stored(id).await?;
        let result = match reuse {
            true => reuse::take(api, &caller.tenant, (kind, &result_key), (id, &store)).await?,
            false => None,
        };
        let max_attempts = api.state.max_attempts;
        let job = NewJob {
            tenant: caller.tenant.clone(),
            priority: *priority,
            tags: tags.clone(),
            webhook: webhook.clone(),
            max_queued: caller.limits.max_queued,
            bytes,
            max_bytes: caller.limits.max_bytes,
            idempotency,
            request_id: request_id.clone(),
            result_key: Some(result_key),
            result,
            ..NewJob::new(id, kind, payload, max_attempts)
        };
        api.state.store.enqueue(job).await.map_err(idempotency_problem)
    };
    let result = stored.await;
    // Refused, or the same as one that was faster.
    if result.as_ref().map_or(true, |job| job.id != id) {
        // Otherwise the collector of ownerless bytes finds them later.
        let forgotten = async {
            store.delete_job(id).await.map_err(|error| error.to_string())?;
            api.state.store.forget_bytes(id).await.map_err(|error| error.to_string())
        };
        if let Err(error) = forgotten.await {
            tracing::warn!(%id, error, "inputs of a refused job stay for now");
        }
    }
    result
}

/// What a store that looks a key up answers, as a problem.
pub(super) fn idempotency_problem(error: StoreError) -> Problem {
    match error {
        StoreError::NotFound(id) => {
            let detail = format!("{id}, which this key became, is deleted; use another key");
            Problem::new(IDEMPOTENT_JOB_GONE, detail)
        }
        other => other.into(),
    }
}

async fn store_inputs(bytes: &ByteStore, job: JobId, inputs: Inputs) -> Result<(), Problem> {
    match inputs {
        Inputs::Uploaded(inputs) => write_inputs(bytes, job, inputs).await?,
        Inputs::Copied { source, names, own } => {
            write_inputs(bytes, job, own).await?;
            for name in &names {
                let from = Key::Input { job: source.id, name };
                let copied = bytes.copy(&source.home, &from, &Key::Input { job, name }).await;
                copied.map_err(|error| copy_problem(source.id, error))?;
            }
        }
    }
    Ok(())
}

fn copy_problem(source: JobId, error: ByteError) -> Problem {
    match error {
        ByteError::NotFound(_) => source::gone(source),
        other => other.into(),
    }
}

/// Writes the files of a job or page, a few at a time; they are durable on return.
pub(super) async fn write_inputs(
    bytes: &ByteStore,
    job: JobId,
    inputs: Vec<(String, Bytes)>,
) -> Result<(), ByteError> {
    let writes: Vec<_> = inputs
        .into_iter()
        .map(|(name, content)| write_input(bytes.clone(), job, name, content))
        .collect();
    stream::iter(writes).buffer_unordered(CONCURRENT_WRITES).try_collect().await
}

async fn write_input(
    bytes: ByteStore,
    job: JobId,
    name: String,
    content: Bytes,
) -> Result<(), ByteError> {
    bytes.put(&Key::Input { job, name: &name }, content).await
}
