//! Uploads: multipart bodies become durable jobs, or nothing at all.
//!
//! Every part is held against its limits while it arrives, the parts against
//! each other once all are there, and every picture is decoded to its end. Only
//! then is anything stored: first the inputs, then the job that needs them.

mod assemble;
mod files;
mod intake;
mod matches;
mod parts;
mod pictures;
mod source;
mod truths;

pub use intake::Budget;
pub use pictures::Decoders;

use std::sync::Arc;

use axum::extract::Request;
use axum::http::{HeaderMap, HeaderValue, header};
use bytes::Bytes;
use futures::{StreamExt, stream};
use multer::Multipart;
use tokio::sync::OwnedSemaphorePermit;

use self::intake::{Intake, too_large};
use self::parts::Parts;
use super::Api;
use super::problem::{Problem, REQUEST_TIMEOUT, UNSUPPORTED_MEDIA_TYPE};
use crate::artifacts::{ByteError, ByteStore, Key};
use crate::jobs::{Job, JobId, NewJob};
use crate::sheet::{RECONSTRUCTION, ReconstructionPayload, SheetDocument};

/// How many inputs are written at a time: each waits for the disk.
const CONCURRENT_WRITES: usize = 8;

/// Where a job's pictures come from.
enum Inputs {
    Uploaded(Vec<(String, Bytes)>),
    /// The inputs of an earlier job, by name.
    Copied(JobId, Vec<String>),
}

/// Receives an upload and enqueues its job. Job and inputs are durable on return.
pub async fn receive(api: &Arc<Api>, request: Request) -> Result<Job, Problem> {
    let receiving = async {
        let (parts, hold) = read_parts(api, request).await?;
        let (document, inputs) = check(api, parts).await?;
        Ok((document, inputs, hold))
    };
    let received = tokio::time::timeout(api.limits.upload_timeout, receiving).await;
    let (document, inputs, _hold) = received.unwrap_or_else(|_| {
        let seconds = api.limits.upload_timeout.as_secs();
        let detail = format!("the upload took longer than {seconds} s; send it again");
        Err(Problem::new(REQUEST_TIMEOUT, detail))
    })?;
    // Beyond the timeout: nobody is told that a job failed to come that did.
    enqueue(api, document, inputs).await
}

async fn read_parts(
    api: &Api,
    request: Request,
) -> Result<(Parts, Option<OwnedSemaphorePermit>), Problem> {
    let (head, body) = request.into_parts();
    let limit = api.limits.max_body_bytes;
    let mut intake = Intake::new(body, limit, api.budget.clone());
    let read = match check_head(&head.headers, limit) {
        Ok(boundary) => parts::read(Multipart::new(&mut intake, boundary), &api.limits).await,
        Err(problem) => Err(problem),
    };
    match read {
        Ok(parts) => Ok((parts, intake.into_hold())),
        Err(problem) => {
            // A client that waits for 100 Continue sends nothing after this.
            if !head.headers.contains_key(header::EXPECT) {
                intake.drain().await;
            }
            Err(problem)
        }
    }
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

async fn check(api: &Api, mut parts: Parts) -> Result<(SheetDocument, Inputs), Problem> {
    if let Some(source) = parts.source.take() {
        let (id, document) = source::rerun(api, &source, parts).await?;
        let names = source::input_names(&document);
        return Ok((document, Inputs::Copied(id, names)));
    }
    let assembled = assemble::assemble(parts, &api.limits)?;
    let decoded = api.decoders.decode_all(&assembled.pictures(), &api.limits.image).await?;
    let truths = truths::check_all(&api.decoders, &assembled, &api.limits).await?;
    let (document, inputs) = assembled.finish(&decoded, &truths, &api.limits)?;
    Ok((document, Inputs::Uploaded(inputs)))
}

async fn enqueue(api: &Api, document: SheetDocument, inputs: Inputs) -> Result<Job, Problem> {
    let id = JobId::new();
    let source = match &inputs {
        Inputs::Uploaded(_) => None,
        Inputs::Copied(source, _) => Some(source.0),
    };
    let payload = ReconstructionPayload { document, source };
    let stored = async {
        store_inputs(api, id, inputs).await?;
        let payload = serde_json::to_value(payload);
        let payload = payload.map_err(|error| Problem::internal("payload", &error))?;
        let max_attempts = api.state.max_attempts;
        let job = NewJob { id, kind: RECONSTRUCTION.to_owned(), payload, max_attempts };
        Ok(api.state.store.enqueue(job).await?)
    };
    let result = stored.await;
    if result.is_err()
        && let Err(error) = api.state.bytes.delete_job(id).await
    {
        // The collector of ownerless bytes finds them later.
        tracing::warn!(%id, %error, "inputs of a refused job stay for now");
    }
    result
}

async fn store_inputs(api: &Api, job: JobId, inputs: Inputs) -> Result<(), Problem> {
    let bytes = &api.state.bytes;
    match inputs {
        Inputs::Uploaded(inputs) => {
            let writes: Vec<_> = inputs
                .into_iter()
                .map(|(name, content)| write_input(bytes.clone(), job, name, content))
                .collect();
            let mut writes = stream::iter(writes).buffer_unordered(CONCURRENT_WRITES);
            while let Some(written) = writes.next().await {
                written.map_err(|error| Problem::unavailable("byte store", &error))?;
            }
        }
        Inputs::Copied(source, names) => {
            for name in &names {
                let from = Key::Input { job: source, name };
                bytes.copy(&from, &Key::Input { job, name }).await.map_err(
                    |error| match error {
                        ByteError::NotFound(_) => source::gone(source),
                        other => Problem::unavailable("byte store", &other),
                    },
                )?;
            }
        }
    }
    Ok(())
}

async fn write_input(
    bytes: ByteStore,
    job: JobId,
    name: String,
    content: Bytes,
) -> Result<(), ByteError> {
    bytes.put(&Key::Input { job, name: &name }, content).await
}
