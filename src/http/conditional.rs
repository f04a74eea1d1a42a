//! Request headers that ask for a version or for patience.

use std::time::Duration;

use axum::http::{HeaderMap, HeaderName};
use axum_extra::headers::{ETag, HeaderMapExt, IfMatch, IfNoneMatch};

/// The longest wait that a client may ask for.
pub(super) const MAX_WAIT: Duration = Duration::from_secs(60);

pub(super) const PREFER: HeaderName = HeaderName::from_static("prefer");
pub(super) const PREFERENCE_APPLIED: HeaderName = HeaderName::from_static("preference-applied");

/// Whether the client has this version already.
pub(super) fn is_known(headers: &HeaderMap, etag: &ETag) -> bool {
    headers.typed_get::<IfNoneMatch>().is_some_and(|known| !known.precondition_passes(etag))
}

/// Whether the client asks for versions that do not include this one.
pub(super) fn is_unwanted(headers: &HeaderMap, etag: &ETag) -> bool {
    headers.typed_get::<IfMatch>().is_some_and(|wanted| !wanted.precondition_passes(etag))
}

/// How long the client prefers to wait (RFC 7240), whole seconds, at most
/// [`MAX_WAIT`]. What cannot be read is ignored, as the RFC has it.
pub(super) fn preferred_wait(headers: &HeaderMap) -> Option<Duration> {
    let seconds = preferences(headers).find_map(|preference| {
        let (name, value) = preference.split_once('=')?;
        let is_wait = name.trim().eq_ignore_ascii_case("wait");
        is_wait.then(|| value.trim().trim_matches('"').parse::<u64>().ok())?
    })?;
    Some(Duration::from_secs(seconds).min(MAX_WAIT))
}

/// Whether the client prefers the bytes to where they are (`Prefer: no-redirect`).
pub(super) fn prefers_no_redirect(headers: &HeaderMap) -> bool {
    preferences(headers).any(|preference| preference.trim().eq_ignore_ascii_case("no-redirect"))
}

/// What the client prefers, without parameters.
fn preferences(headers: &HeaderMap) -> impl Iterator<Item = &str> {
    let values = headers.get_all(PREFER).iter().filter_map(|value| value.to_str().ok());
    let preferences = values.flat_map(|value| value.split(','));
    preferences.map(|preference| preference.split(';').next().unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    fn preferring(values: &[&'static str]) -> HeaderMap {
        values.iter().map(|value| (PREFER, HeaderValue::from_static(value))).collect()
    }

    fn wait(values: &[&'static str]) -> Option<u64> {
        preferred_wait(&preferring(values)).map(|wait| wait.as_secs())
    }

    #[test]
    fn finds_that_no_redirect_is_wanted() {
        for given in [["wait=5, No-Redirect"].as_slice(), &["wait=5", "no-redirect; x=y"]] {
            assert!(prefers_no_redirect(&preferring(given)), "{given:?}");
        }
        for given in [["no-redirects"].as_slice(), &["x=no-redirect"], &[]] {
            assert!(!prefers_no_redirect(&preferring(given)), "{given:?}");
        }
    }

    #[test]
    fn finds_wait_among_preferences_and_caps_it() {
        assert_eq!(wait(&["wait=5"]), Some(5));
        assert_eq!(wait(&["respond-async, Wait = \"10\"; x=y"]), Some(10));
        assert_eq!(wait(&["handling=lenient", "wait=600"]), Some(60));
        assert_eq!(wait(&["wait=soon"]), None);
        assert_eq!(wait(&["wait"]), None);
        assert_eq!(wait(&[]), None);
    }
}
