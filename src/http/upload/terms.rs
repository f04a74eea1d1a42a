//! What a request says of its upload beside the parts: whose it is, how soon it
//! is wanted, and whether it may be sent again.

use std::sync::Arc;

use axum::extract::Query;
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderName};
use jiff::Timestamp;
use serde::Deserialize;
use sha2::{Digest, Sha256};

use super::{Inputs, Upload};
use crate::http::access::Caller;
use crate::http::guard::X_REQUEST_ID;
use crate::http::problem::{INVALID_IDEMPOTENCY_KEY, INVALID_QUERY, Problem};
use crate::http::tags;
use jobs::Tags;

pub(in crate::http) const IDEMPOTENCY_KEY: HeaderName = HeaderName::from_static("idempotency-key");
/// The longest key.
const MAX_KEY_BYTES: usize = 255;
/// Priorities lie between this and its negative.
const MAX_PRIORITY: i32 = 100;

/// What a request says of its upload.
pub(super) struct Terms {
    pub caller: Arc<Caller>,
    /// The client's name for the upload.
    pub key: Option<String>,
    /// What the request is called in the logs.
    pub request_id: Option<String>,
    pub priority: i32,
    pub tags: Tags,
    /// Where the job's end is told, not yet checked.
    pub webhook: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    #[serde(default)]
    priority: i32,
    name: Option<String>,
    labels: Option<String>,
    expires_in: Option<i64>,
    #[serde(default)]
    pinned: bool,
    webhook: Option<String>,
}

impl Terms {
    pub(super) fn of(head: &Parts) -> Result<Self, Problem> {
        let Query(Parameters { priority, name, labels, expires_in, pinned, webhook }) =
            Query::try_from_uri(&head.uri)
                .map_err(|error| Problem::new(INVALID_QUERY, error.body_text()))?;
        if !(-MAX_PRIORITY..=MAX_PRIORITY).contains(&priority) {
            let detail =
                format!("`priority` is {priority}; give -{MAX_PRIORITY} to {MAX_PRIORITY}");
            return Err(Problem::new(INVALID_QUERY, detail).parameter("priority"));
        }
        let caller = Caller::of(head)?;
        let expires_in = expires_in.or(caller.limits.expires_in.map(i64::from));
        let tags = tags::of_query(name, labels.as_deref(), expires_in, pinned, Timestamp::now())?;
        let request_id = head.headers.get(X_REQUEST_ID).and_then(|id| id.to_str().ok());
        let request_id = request_id.map(str::to_owned);
        Ok(Self { caller, key: key(&head.headers)?, request_id, priority, tags, webhook })
    }
}

/// The key, a string in quotes as the draft has it, or without.
fn key(headers: &HeaderMap) -> Result<Option<String>, Problem> {
    let mut given = headers.get_all(IDEMPOTENCY_KEY).iter();
    let Some(first) = given.next() else { return Ok(None) };
    let text = first.to_str().unwrap_or_default().trim();
    let text = text.strip_prefix('"').and_then(|it| it.strip_suffix('"')).unwrap_or(text);
    let is_plain = text.bytes().all(|byte| byte.is_ascii_graphic() && byte != b'"');
    if given.next().is_some() || !is_plain || !(1..=MAX_KEY_BYTES).contains(&text.len()) {
        let detail = format!(
            "Idempotency-Key must be one string of 1 to {MAX_KEY_BYTES} visible characters, such as a UUID"
        );
        return Err(Problem::new(INVALID_IDEMPOTENCY_KEY, detail));
    }
    Ok(Some(text.to_owned()))
}

/// What tells this upload from another: all that is stored of it. Boundaries and
/// the order of parts, which clients make anew each time, are no part of it.
pub(super) fn fingerprint(upload: &Upload, priority: i32) -> String {
    let mut hasher = Sha256::new();
    // Lengths first, so that no two uploads run together to the same bytes.
    let mut add = |bytes: &[u8]| {
        hasher.update((bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    };
    add(upload.kind.as_bytes());
    add(&priority.to_le_bytes());
    add(upload.payload.to_string().as_bytes());
    let files = match &upload.inputs {
        Inputs::Uploaded(files) => files,
        Inputs::Copied { source, names, own } => {
            add(source.to_string().as_bytes());
            names.iter().for_each(|name| add(name.as_bytes()));
            own
        }
    };
    for (name, bytes) in files {
        add(name.as_bytes());
        add(bytes);
    }
    hex::encode(hasher.finalize())
}
