//! Refuses requests that are not meant for the service, or that a web page of
//! somebody else makes a browser send.

use std::sync::Arc;

use axum::body::Body;
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, Uri, Version, header};
use axum::response::{IntoResponse, Response};
use tower_http::validate_request::ValidateRequest;

use super::problem::{
    BAD_REQUEST, FOREIGN_ORIGIN, HEADER_TOO_LARGE, MISDIRECTED_REQUEST, Problem,
    UNSUPPORTED_MEDIA_TYPE,
};

/// The longest header of a request, bytes.
pub(super) const MAX_HEADER_BYTES: usize = 64 << 10;
/// The longest request id that is taken over from a client.
const MAX_REQUEST_ID: usize = 128;
pub(super) const X_REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// Which requests are meant for the service.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Guard {
    /// Names by which it may be called, without ports; empty for any.
    pub allowed_hosts: Vec<String>,
    /// Origins whose pages may change things; `*` for all.
    pub origins: Vec<String>,
}

/// Refuses what the guard does.
#[derive(Clone)]
pub(super) struct Check(pub Arc<Guard>);

impl ValidateRequest<Body> for Check {
    type ResponseBody = Body;

    fn validate(&mut self, request: &mut Request) -> Result<(), Response> {
        self.0.inspect(request).map_err(IntoResponse::into_response)
    }
}

/// Drops a request id that is no short word: it is written to the log and sent
/// back. The request gets one of ours.
pub(super) fn bound_request_id(mut request: Request) -> Request {
    let is_word = |id: &HeaderValue| {
        let bytes = id.as_bytes();
        let plain = |byte: &u8| byte.is_ascii_alphanumeric() || b"-_.:+/=".contains(byte);
        (1..=MAX_REQUEST_ID).contains(&bytes.len()) && bytes.iter().all(plain)
    };
    if request.headers().get(X_REQUEST_ID).is_some_and(|id| !is_word(id)) {
        request.headers_mut().remove(X_REQUEST_ID);
    }
    request
}

impl Guard {
    fn inspect(&self, request: &Request) -> Result<(), Problem> {
        expect_short(request)?;
        let host = host(request)?;
        if !self.allowed_hosts.is_empty() {
            let name = without_port(host);
            if !self.allowed_hosts.iter().any(|allowed| allowed.eq_ignore_ascii_case(name)) {
                let detail = format!(
                    "this service is not called `{name}`; who runs it can allow the name with --allowed-host"
                );
                return Err(Problem::new(MISDIRECTED_REQUEST, detail));
            }
        }
        let headers = request.headers();
        if is_unsafe(request.method()) && !headers.contains_key(header::AUTHORIZATION) {
            self.expect_own_origin(headers, host)?;
        }
        expect_identity(headers)
    }

    /// Browsers say which page makes them send what changes something. One of
    /// another origin must bring a key.
    fn expect_own_origin(&self, headers: &HeaderMap, host: &str) -> Result<(), Problem> {
        let origin = headers.get(header::ORIGIN).map(|origin| origin.to_str().unwrap_or("null"));
        let site = headers.get("sec-fetch-site").map(HeaderValue::as_bytes);
        let foreign = match origin {
            None if site == Some(b"cross-site") => "another site",
            None => return Ok(()),
            Some(origin) => {
                let own = origin.parse::<Uri>().ok();
                let own = own.as_ref().and_then(Uri::authority);
                if own.is_some_and(|own| own.as_str().eq_ignore_ascii_case(host))
                    || self.origins.iter().any(|allowed| allowed == "*" || allowed == origin)
                {
                    return Ok(());
                }
                origin
            }
        };
        let detail = format!(
            "a page of {foreign} may change nothing here without a key; who runs the service can allow it with --cors-origin"
        );
        Err(Problem::new(FOREIGN_ORIGIN, detail))
    }
}

fn expect_short(request: &Request) -> Result<(), Problem> {
    let lines = request.headers().iter();
    let bytes: usize = lines.map(|(name, value)| name.as_str().len() + value.len() + 4).sum();
    let bytes = bytes + request.uri().path_and_query().map_or(0, |path| path.as_str().len());
    if bytes <= MAX_HEADER_BYTES {
        return Ok(());
    }
    let detail = format!("the request's header has {bytes} bytes; send {MAX_HEADER_BYTES} at most");
    Err(Problem::new(HEADER_TOO_LARGE, detail))
}

/// The one host that the request names.
fn host(request: &Request) -> Result<&str, Problem> {
    if let Some(authority) = request.uri().authority() {
        return Ok(authority.as_str());
    }
    let mut hosts = request.headers().get_all(header::HOST).iter();
    match (hosts.next().map(HeaderValue::to_str), hosts.next()) {
        (Some(Ok(host)), None) => Ok(host),
        (None, None) if request.version() < Version::HTTP_11 => Ok(""),
        _ => Err(Problem::new(BAD_REQUEST, "the request must have one Host header; send one")),
    }
}

fn without_port(host: &str) -> &str {
    match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    }
}

fn is_unsafe(method: &Method) -> bool {
    !matches!(*method, Method::GET | Method::HEAD | Method::OPTIONS)
}

/// Bodies are read as they come.
fn expect_identity(headers: &HeaderMap) -> Result<(), Problem> {
    let coding = headers.get(header::CONTENT_ENCODING);
    if coding.is_none_or(|coding| coding.as_bytes().eq_ignore_ascii_case(b"identity")) {
        return Ok(());
    }
    let detail = "the body has a Content-Encoding, and is taken as it is alone; send it without";
    Err(Problem::new(UNSUPPORTED_MEDIA_TYPE, detail)
        .header(header::ACCEPT_ENCODING, HeaderValue::from_static("identity")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn verdict(guard: &Guard, method: Method, headers: &[(&str, &str)]) -> Result<(), u16> {
        let mut request = Request::builder().method(method).uri("/v1/reconstructions");
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let request = request.body(Body::empty()).unwrap();
        guard.inspect(&request).map_err(|problem| problem.into_response().status().as_u16())
    }

    #[test]
    fn only_its_own_names_are_answered() {
        let guard = Guard {
            allowed_hosts: vec!["localhost".to_owned(), "[::1]".to_owned()],
            ..Guard::default()
        };
        let of = |host| verdict(&guard, Method::GET, &[("host", host)]);
        for host in ["localhost", "LOCALHOST:8080", "[::1]", "[::1]:80"] {
            assert_eq!(of(host), Ok(()), "{host}");
        }
        for host in ["rebound.example", "localhost.rebound.example:8080", "[::2]:80"] {
            assert_eq!(of(host), Err(421), "{host}");
        }
        let two = [("host", "localhost"), ("host", "localhost")];
        assert_eq!(verdict(&guard, Method::GET, &two), Err(400));
        assert_eq!(verdict(&guard, Method::GET, &[]), Err(400));
    }

    #[test]
    fn pages_of_others_change_nothing_without_a_key() {
        let guard =
            Guard { origins: vec!["https://studio.example".to_owned()], ..Guard::default() };
        let from = |method, headers: &[(&str, &str)]| {
            verdict(&guard, method, &[&[("host", "127.0.0.1:8080")], headers].concat())
        };
        for origin in ["http://127.0.0.1:8080", "https://studio.example"] {
            assert_eq!(from(Method::POST, &[("origin", origin)]), Ok(()));
        }
        for origin in ["http://127.0.0.1:9", "https://evil.example", "null"] {
            assert_eq!(from(Method::POST, &[("origin", origin)]), Err(403), "{origin}");
            assert_eq!(from(Method::DELETE, &[("origin", origin)]), Err(403), "{origin}");
            assert_eq!(from(Method::GET, &[("origin", origin)]), Ok(()));
            let with_key = [("origin", origin), ("authorization", "Bearer x")];
            assert_eq!(from(Method::POST, &with_key), Ok(()));
        }
        assert_eq!(from(Method::POST, &[("sec-fetch-site", "cross-site")]), Err(403));
        assert_eq!(from(Method::POST, &[]), Ok(()));
    }

    #[test]
    fn compressed_bodies_are_not_taken() {
        let with = |coding| {
            let headers = [("host", "x"), ("content-encoding", coding)];
            verdict(&Guard::default(), Method::POST, &headers)
        };
        assert_eq!((with("gzip"), with("identity")), (Err(415), Ok(())));
    }
}
