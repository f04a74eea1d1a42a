//! Problem details (RFC 9457): every error answer of the service.

mod kinds;
mod render;

pub use kinds::*;
pub(super) use render::{panicked, render};

use axum::http::{HeaderMap, HeaderName, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;

use jobs::StoreError;
use jobs::bytes::ByteError;
use options::{OptionProblemKind, OptionProblems};

/// The longest detail sent, bytes: details may quote what the client sent.
const MAX_DETAIL_BYTES: usize = 600;
/// Of a longer one so much of the end stays, where the remedy is.
const END_OF_DETAIL_BYTES: usize = 200;

/// An error on its way to the client.
#[derive(Clone, Debug)]
pub struct Problem(Box<Contents>);

#[derive(Clone, Debug)]
struct Contents {
    kind: ProblemType,
    detail: String,
    part: Option<String>,
    parameter: Option<String>,
    errors: Vec<OptionError>,
    headers: HeaderMap,
}

/// One thing wrong with the options.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, ToSchema)]
pub struct OptionError {
    /// Dotted name, such as `disparity.block_size`; empty for the whole.
    pub option: String,
    /// What is wrong and what would be accepted.
    pub detail: String,
}

/// Problem details (RFC 9457), as `application/problem+json`.
#[derive(Clone, Debug, Serialize, ToSchema)]
#[schema(as = Problem)]
pub struct ProblemDocument {
    /// Kind of problem, a relative URI that leads to a page about it.
    #[serde(rename = "type")]
    #[schema(format = "uri-reference", example = "/problems/not-an-image")]
    pub kind: String,
    /// Summary of the kind.
    pub title: &'static str,
    /// HTTP status.
    #[schema(minimum = 400, maximum = 599)]
    pub status: u16,
    /// What happened, where, and how to mend it.
    pub detail: String,
    /// Path of the request.
    #[schema(format = "uri-reference")]
    pub instance: String,
    /// Name of the part to blame, such as `view[45]`, or of the field of a JSON body.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub part: Option<String>,
    /// Name of the query parameter to blame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameter: Option<String>,
    /// Every option that is wrong.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub errors: Vec<OptionError>,
}

impl Problem {
    /// A problem of this kind; `detail` says what happened, where, and how to mend it.
    pub fn new(kind: ProblemType, detail: impl Into<String>) -> Self {
        Self(Box::new(Contents {
            kind,
            detail: shorten(detail.into()),
            part: None,
            parameter: None,
            errors: Vec::new(),
            headers: HeaderMap::new(),
        }))
    }

    /// Names the part of the upload that is to blame.
    pub fn part(mut self, part: impl Into<String>) -> Self {
        self.0.part = Some(part.into());
        self
    }

    /// Names the query parameter that is to blame.
    pub fn parameter(mut self, parameter: impl Into<String>) -> Self {
        self.0.parameter = Some(parameter.into());
        self
    }

    /// Sets a header of the answer, such as `Retry-After`.
    pub fn header(mut self, name: HeaderName, value: impl Into<HeaderValue>) -> Self {
        self.0.headers.insert(name, value.into());
        self
    }

    /// Everything wrong with the options.
    pub fn options(problems: &OptionProblems) -> Self {
        let unknown = problems.0.iter().any(|p| p.kind == OptionProblemKind::Unknown);
        let kind = if unknown { UNKNOWN_OPTION } else { INVALID_OPTION };
        let errors = problems.0.iter().map(|problem| OptionError {
            option: problem.option.clone(),
            detail: shorten(problem.detail.clone()),
        });
        let mut problem = Self::new(kind, problems.to_string());
        // A list of hundreds helps nobody.
        problem.0.errors = errors.take(50).collect();
        problem
    }

    /// A fault of the service: the cause goes to the log, not to the client.
    pub fn internal(context: &str, cause: &dyn std::fmt::Display) -> Self {
        tracing::error!(context, %cause, "request failed");
        Self::new(INTERNAL, "the service failed to answer; its log has the cause")
    }

    /// Something that the service needs cannot be reached.
    pub fn unavailable(context: &str, cause: &dyn std::fmt::Display) -> Self {
        tracing::error!(context, %cause, "unavailable");
        Self::new(UNAVAILABLE, format!("the {context} cannot be reached; try again later"))
            .header(header::RETRY_AFTER, HeaderValue::from_static("5"))
    }

    /// The service is about to stop.
    pub fn stopping() -> Self {
        Self::new(UNAVAILABLE, "the service is shutting down; try again when it is back")
            .header(header::RETRY_AFTER, HeaderValue::from_static("10"))
    }

    /// No room is left for what the client sends.
    pub fn full() -> Self {
        let detail = "the service has no room left on its disk; delete jobs that are not needed, or try again later";
        Self::new(INSUFFICIENT_STORAGE, detail)
            .header(header::RETRY_AFTER, HeaderValue::from_static("60"))
    }

    /// The tenant has used up its room.
    pub fn tenant_full(tenant: &str, most: u64) -> Self {
        let detail = format!(
            "tenant {tenant} may store {most} bytes, and would store more; delete jobs or pages that are not needed"
        );
        Self::new(TENANT_FULL, detail).header(header::RETRY_AFTER, HeaderValue::from_static("60"))
    }

    /// Too much is going on.
    pub fn busy(detail: &str) -> Self {
        Self::new(BUSY, detail).header(header::RETRY_AFTER, HeaderValue::from_static("5"))
    }

    /// The body of the answer to a request for `instance`.
    pub(super) fn body(&self, instance: &str) -> Vec<u8> {
        serde_json::to_vec(&self.document(instance)).unwrap_or_default()
    }

    /// The client's own part of something is used up.
    pub fn too_much(detail: &str) -> Self {
        Self::new(TOO_MANY_REQUESTS, detail)
            .header(header::RETRY_AFTER, HeaderValue::from_static("5"))
    }

    fn document(&self, instance: &str) -> ProblemDocument {
        let Contents { kind, detail, part, parameter, errors, .. } = &*self.0;
        ProblemDocument {
            kind: kind.uri(),
            title: kind.title,
            status: kind.status.as_u16(),
            detail: detail.clone(),
            instance: instance.to_owned(),
            part: part.clone(),
            parameter: parameter.clone(),
            errors: errors.clone(),
        }
    }
}

impl From<StoreError> for Problem {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::NotFound(id) => Self::new(NOT_FOUND, format!("there is no job {id}")),
            StoreError::Finished { id } => Self::new(
                ALREADY_FINISHED,
                format!("{id} is finished already, so it cannot be cancelled"),
            ),
            StoreError::Running { id } => Self::new(
                STILL_RUNNING,
                format!("{id} is running; cancel it and wait, then delete it"),
            ),
            StoreError::Full => Self::full(),
            StoreError::NoTenant(_) => Self::new(UNKNOWN_TENANT, error.to_string()),
            StoreError::TenantExists(_) => Self::new(TENANT_EXISTS, error.to_string()),
            StoreError::TenantInUse(_) => Self::new(TENANT_IN_USE, error.to_string()),
            StoreError::NoKey(_) => Self::new(UNKNOWN_KEY, error.to_string()),
            StoreError::TooManyQueued { .. } => Self::new(TOO_MANY_JOBS, error.to_string())
                .header(header::RETRY_AFTER, HeaderValue::from_static("10")),
            StoreError::TooManyBytes { tenant, most } => Self::tenant_full(tenant.as_str(), most),
            StoreError::OtherUpload(key) => Self::new(
                IDEMPOTENCY_KEY_REUSED,
                format!("the Idempotency-Key `{key}` came with another upload; use a new one"),
            ),
            StoreError::LeaseLost { .. } | StoreError::Unreadable(_) => {
                Self::internal("job store", &error)
            }
            StoreError::Changed { id, version } => Self::new(
                PRECONDITION_FAILED,
                format!("{id} was changed meanwhile and is at version {version}; get it again"),
            ),
            StoreError::Backend(cause) => Self::unavailable("job store", &cause),
        }
    }
}

impl From<ByteError> for Problem {
    fn from(error: ByteError) -> Self {
        match error {
            ByteError::Full => Self::full(),
            other => Self::unavailable("byte store", &other),
        }
    }
}

/// The body is written further out, by `render`, which knows the path.
impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let mut response = self.0.kind.status.into_response();
        response.headers_mut().extend(self.0.headers.clone());
        response.extensions_mut().insert(self);
        response
    }
}

/// Cuts the middle out of what is too long, and writes control characters as escapes.
fn shorten(mut text: String) -> String {
    if text.len() > MAX_DETAIL_BYTES {
        let from = text.floor_char_boundary(MAX_DETAIL_BYTES - END_OF_DETAIL_BYTES);
        let to = text.ceil_char_boundary(text.len() - END_OF_DETAIL_BYTES);
        text.replace_range(from..to, "…");
    }
    if !text.chars().any(char::is_control) {
        return text;
    }
    let plain = |c: char| if c.is_control() { c.escape_default().to_string() } else { c.into() };
    text.chars().map(plain).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_details_are_cut_between_characters() {
        let problem = Problem::new(INTERNAL, format!("x{}; mend it", "ä".repeat(1000)));
        assert!(problem.0.detail.len() <= MAX_DETAIL_BYTES + '…'.len_utf8());
        assert!(problem.0.detail.starts_with("xä") && problem.0.detail.contains("ä…ä"));
        assert!(problem.0.detail.ends_with("ä; mend it"));
    }

    #[test]
    fn control_characters_of_details_are_escaped() {
        let problem = Problem::new(INTERNAL, "a\u{1b}[2J\nä\u{7f}");
        assert_eq!(problem.0.detail, "a\\u{1b}[2J\\nä\\u{7f}");
    }

    #[test]
    fn an_unknown_option_outranks_an_invalid_one() {
        let value = serde_json::json!({"disparity": {"block_size": 8}, "speed": 1});
        let problem = Problem::options(&crate::draft::options::parse(&value).unwrap_err());
        assert_eq!(problem.0.kind, UNKNOWN_OPTION);
        let named: Vec<_> = problem.0.errors.iter().map(|e| e.option.as_str()).collect();
        assert!(named.contains(&"speed") && named.contains(&"disparity.block_size"), "{named:?}");
    }
}
