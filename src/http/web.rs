//! The web page at `/`, built from `web/` and held in the program.
//!
//! It uses nothing but the public interface. Without Node the program is built
//! without it, and `/` says how to get it.

use axum::body::Body;
use axum::extract::Path;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{Html, IntoResponse, Response};
use axum_extra::headers::{ETag, HeaderMapExt};
use rust_embed::{EmbeddedFile, RustEmbed};

use super::conditional::is_known;
use super::problem::{NOT_FOUND, Problem};

/// What Vite wrote. A debug build reads it when it is asked for.
#[derive(RustEmbed)]
#[folder = "web/dist"]
struct Built;

/// Nothing but the service's own files, and what the page makes of answers:
/// pictures as blobs, which the reader of glTF fetches.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; \
    img-src 'self' blob:; connect-src 'self' blob:; base-uri 'none'; form-action 'none'; \
    frame-ancestors 'none'";

const MISSING: &str = "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Turnaround</title>\
    <h1>The service runs, its web page is not built in</h1>\
    <p>With Node 18 or newer: <code>npm ci --prefix web &amp;&amp; npm run build --prefix web</code>, \
    then build the service again. <code>make run</code> does both.</p>\
    <p><a href=\"docs\">The interface</a> needs no page.</p></html>";

/// The page.
pub(super) async fn index(headers: HeaderMap) -> Response {
    let mut response = match Built::get("index.html") {
        Some(file) => answer(file, "index.html", &headers, "no-cache"),
        // No error of the client's: the service is there and works.
        None => Html(MISSING).into_response(),
    };
    secure(response.headers_mut());
    response
}

/// The page's icon.
pub(super) async fn icon(headers: HeaderMap) -> Result<Response, Problem> {
    named("icon.svg", &headers, "public, max-age=86400")
}

/// A script or style of the page; its name has its content's hash.
pub(super) async fn asset(
    Path(name): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    named(&format!("assets/{name}"), &headers, "public, max-age=31536000, immutable")
}

fn named(name: &str, headers: &HeaderMap, cache: &'static str) -> Result<Response, Problem> {
    let file = Built::get(name);
    let file = file.ok_or_else(|| Problem::new(NOT_FOUND, format!("there is no `/{name}`")))?;
    let mut response = answer(file, name, headers, cache);
    secure(response.headers_mut());
    Ok(response)
}

fn answer(file: EmbeddedFile, name: &str, headers: &HeaderMap, cache: &'static str) -> Response {
    // Weak, because it may be compressed.
    let etag = format!("W/\"{}\"", hex::encode(file.metadata.sha256_hash()));
    let etag: ETag = etag.parse().expect("a hash in quotes is an ETag");
    let mut response = if is_known(headers, &etag) {
        StatusCode::NOT_MODIFIED.into_response()
    } else {
        let media_type = HeaderValue::from_static(media_type(name));
        let body = Body::from(file.data.into_owned());
        ([(header::CONTENT_TYPE, media_type)], body).into_response()
    };
    response.headers_mut().typed_insert(etag);
    response.headers_mut().insert(header::CACHE_CONTROL, HeaderValue::from_static(cache));
    response
}

fn secure(headers: &mut HeaderMap) {
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::REFERRER_POLICY, "no-referrer"),
        (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
}

fn media_type(name: &str) -> &'static str {
    match name.rsplit('.').next() {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn the_page_or_how_to_get_it_is_answered_under_a_strict_policy() {
        let response = index(HeaderMap::new()).await;
        let policy = response.headers()["content-security-policy"].to_str().unwrap();
        assert!(policy.starts_with("default-src 'none'") && !policy.contains("unsafe"), "{policy}");
        assert!(response.headers().get("set-cookie").is_none());
        let is_built = Built::get("index.html").is_some();
        assert_eq!(response.status(), StatusCode::OK);
        let body = axum::body::to_bytes(response.into_body(), 1 << 20).await.unwrap();
        let body = String::from_utf8(body.to_vec()).unwrap();
        if is_built {
            // Below any path, and nothing from elsewhere.
            assert!(body.contains("src=\"./assets/"), "{body}");
            assert!(!body.contains("http://") && !body.contains("https://"), "{body}");
        } else {
            assert!(body.contains("npm ci"), "{body}");
        }
    }

    #[tokio::test]
    async fn files_are_known_by_their_tags_and_others_are_missing() {
        let missing = asset(Path("../Cargo.toml".to_owned()), HeaderMap::new()).await;
        assert!(missing.is_err());
        let Some(name) = Built::iter().find(|name| name.ends_with(".js")) else { return };
        let name = name.trim_start_matches("assets/").to_owned();
        let first = asset(Path(name.clone()), HeaderMap::new()).await.unwrap();
        assert_eq!(first.headers()["content-type"], "text/javascript; charset=utf-8");
        assert!(first.headers()["cache-control"].to_str().unwrap().contains("immutable"));
        let mut headers = HeaderMap::new();
        headers.insert(header::IF_NONE_MATCH, first.headers()["etag"].clone());
        assert_eq!(asset(Path(name), headers).await.unwrap().status(), StatusCode::NOT_MODIFIED);
    }
}
