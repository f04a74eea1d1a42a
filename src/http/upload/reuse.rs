//! Results of earlier jobs: what an upload asks for may have been made already.

use std::collections::BTreeMap;

use futures::{StreamExt, TryStreamExt, stream};
use multer::Field;
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::parts::read_text;
use super::{CONCURRENT_WRITES, Inputs, Upload};
use crate::http::Api;
use crate::http::problem::{INVALID_OPTION, Problem};
use crate::provenance::PROGRAM;
use jobs::bytes::{ByteError, ByteStore, Home, Key};
use jobs::{EarlierResult, JobId, TenantName};

/// What a payload has that the result does not depend on.
const INDIFFERENT: &[&str] = &["source", "page"];

/// Reads the part `reuse`; capitals are as good, as Python's clients write `True`.
pub(super) async fn read(field: Field<'_>, name: &str) -> Result<bool, Problem> {
    let text = read_text(field, name).await?;
    text.trim().to_ascii_lowercase().parse().map_err(|_| {
        let detail = format!("`reuse` is `{text}`; give true or false");
        Problem::new(INVALID_OPTION, detail).part(name)
    })
}

/// A hash of all that the upload's result depends on: kind and payload in
/// canonical form, inputs, and the program. Lower-case hexadecimal.
pub(super) async fn key(api: &Api, upload: &Upload) -> Result<String, Problem> {
    let (own, copied) = match &upload.inputs {
        Inputs::Uploaded(own) => (own, None),
        Inputs::Copied { source, names, own } => (own, Some((source, names))),
    };
    let mut inputs: BTreeMap<String, _> = own.iter().cloned().collect();
    if let Some((source, names)) = copied {
        for name in names {
            let from = api.state.bytes.of(&source.home);
            let found = from.get(&Key::Input { job: source.id, name }).await;
            let bytes = found.map_err(|error| super::copy_problem(source.id, error))?;
            inputs.insert(name.clone(), bytes);
        }
    }
    let mut payload = upload.payload.clone();
    if let Value::Object(fields) = &mut payload {
        fields.retain(|name, _| !INDIFFERENT.contains(&name.as_str()));
    }
    payload.sort_all_objects();
    let kind = upload.kind;
    let hash = move || {
        let mut hasher = Sha256::new();
        // Lengths first, so that no two run together to the same bytes.
        let mut add = |bytes: &[u8]| {
            hasher.update((bytes.len() as u64).to_le_bytes());
            hasher.update(bytes);
        };
        add(PROGRAM.build.as_bytes());
        add(kind.as_bytes());
        add(payload.to_string().as_bytes());
        for (name, bytes) in &inputs {
            add(name.as_bytes());
            add(bytes);
        }
        hex::encode(hasher.finalize())
    };
    api.decoders.run(hash).await
}

/// The result of the tenant's latest job with this key, its artifacts' bytes made
/// those of the job `id`, which lie in `bytes`, as well. `None` if there is none, or no more.
pub(super) async fn take(
    api: &Api,
    tenant: &TenantName,
    (kind, key): (&str, &str),
    (id, bytes): (JobId, &ByteStore),
) -> Result<Option<EarlierResult>, Problem> {
    let Some(job) = api.state.store.with_result(tenant, kind, key).await? else {
        return Ok(None);
    };
    let mut copies = Vec::with_capacity(job.artifacts.len());
    for entry in &job.artifacts {
        copies.push(copy(bytes.clone(), (job.home(), job.id, job.attempt), id, entry.name.clone()));
    }
    let copied: Result<(), ByteError> =
        stream::iter(copies).buffer_unordered(CONCURRENT_WRITES).try_collect().await;
    match copied {
        Ok(()) => {}
        // It was deleted meanwhile: the work is done anew.
        Err(ByteError::NotFound(_)) => {
            bytes.delete_attempt(id, 1).await?;
            return Ok(None);
        }
        Err(error) => return Err(error.into()),
    }
    Ok(Some(EarlierResult { of: job.id, artifacts: job.artifacts, summary: job.summary }))
}

async fn copy(
    bytes: ByteStore,
    (home, of, attempt): (Home, JobId, u32),
    id: JobId,
    name: String,
) -> Result<(), ByteError> {
    let from = Key::Artifact { job: of, attempt, name: &name };
    bytes.copy(&home, &from, &Key::Artifact { job: id, attempt: 1, name: &name }).await
}
