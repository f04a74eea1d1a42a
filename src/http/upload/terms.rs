//! What a request says of its upload beside the parts: whose it is, how soon it
//! is wanted, and whether it may be sent again.

use std::sync::Arc;

use axum::extract::Query;
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderName};
use bytes::Bytes;
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

/// What a request says of a new page.
pub(in crate::http) struct PageTerms {
    /// The client's name for the upload.
    pub key: Option<String>,
    pub tags: Tags,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PageParameters {
    name: Option<String>,
    labels: Option<String>,
    expires_in: Option<i64>,
    #[serde(default)]
    pinned: bool,
}

impl PageTerms {
    pub(in crate::http) fn of(head: &Parts) -> Result<Self, Problem> {
        let Query(PageParameters { name, labels, expires_in, pinned }) =
            Query::try_from_uri(&head.uri)
                .map_err(|error| Problem::new(INVALID_QUERY, error.body_text()))?;
        let expires_in = expires_in.or(Caller::of(head)?.limits.expires_in.map(i64::from));
        let tags = tags::of_query(name, labels.as_deref(), expires_in, pinned, Timestamp::now())?;
        Ok(Self { key: key(&head.headers)?, tags })
    }
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
    let mut print = Fingerprint::default();
    print.add(upload.kind.as_bytes());
    print.add(&priority.to_le_bytes());
    print.add(upload.payload.to_string().as_bytes());
    let files = match &upload.inputs {
        Inputs::Uploaded(files) => files,
        Inputs::Copied { source, names, own } => {
            print.add(source.id.to_string().as_bytes());
            names.iter().for_each(|name| print.add(name.as_bytes()));
            own
        }
    };
    for (name, bytes) in files {
        print.add(name.as_bytes());
        print.add(bytes);
    }
    print.text()
}

/// The same of a page: its pictures and the azimuths as they came.
pub(in crate::http) fn page_fingerprint(pictures: &[Bytes], azimuths: Option<&str>) -> String {
    let mut print = Fingerprint::default();
    print.add(b"page");
    print.add(azimuths.unwrap_or("auto").as_bytes());
    pictures.iter().for_each(|bytes| print.add(bytes));
    print.text()
}

#[derive(Default)]
struct Fingerprint(Sha256);

impl Fingerprint {
    /// Lengths first, so that no two uploads run together to the same bytes.
    fn add(&mut self, bytes: &[u8]) {
        self.0.update((bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
    }

    /// SHA-256, lower-case hexadecimal.
    fn text(self) -> String {
        hex::encode(self.0.finalize())
    }
}
