//! Error answers as problem details (RFC 9457), the framework's own too.

use std::any::Any;

use axum::body::{self, Body};
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};

use super::{INTERNAL, Problem, ProblemType};

const PROBLEM_JSON: HeaderValue = HeaderValue::from_static("application/problem+json");

/// Writes the body of every error answer: those of the handlers and those that
/// the framework and its layers make by themselves.
///
/// * `instance`: the path of the request.
pub(crate) async fn render(mut response: Response, instance: &str) -> Response {
    if !response.status().is_client_error() && !response.status().is_server_error() {
        return response;
    }
    let problem = match response.extensions_mut().remove::<Problem>() {
        Some(problem) => problem,
        None => framework_problem(&mut response).await,
    };
    let body = problem.body(instance);
    let headers = response.headers_mut();
    for name in [header::CONTENT_LENGTH, header::CONTENT_ENCODING, header::ETAG] {
        headers.remove(name);
    }
    headers.insert(header::CONTENT_TYPE, PROBLEM_JSON);
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    *response.body_mut() = Body::from(body);
    response
}

/// What the framework meant: its status, and its text if it is short.
async fn framework_problem(response: &mut Response) -> Problem {
    let kind = ProblemType::of_status(response.status());
    let kind = ProblemType { status: response.status(), ..kind };
    let is_text = response
        .headers()
        .get(header::CONTENT_TYPE)
        .is_some_and(|value| value.as_bytes().starts_with(b"text/plain"));
    let text = body::to_bytes(std::mem::take(response.body_mut()), 1024).await.unwrap_or_default();
    match std::str::from_utf8(&text) {
        Ok(text) if is_text && !text.is_empty() && kind.status.is_client_error() => {
            Problem::new(kind, text)
        }
        _ => Problem::new(kind, kind.about),
    }
}

/// The answer to a panic in a handler.
pub(crate) fn panicked(cause: Box<dyn Any + Send + 'static>) -> Response {
    let message = cause
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| cause.downcast_ref::<&str>().copied())
        .unwrap_or("no message");
    tracing::error!(panic = message, "a handler panicked");
    Problem::new(INTERNAL, "the service failed to answer; its log has the cause").into_response()
}
