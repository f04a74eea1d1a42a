//! What every request goes through: its id, log line, metrics, CORS and error body.

use std::sync::Arc;

use axum::Router;
use axum::extract::{Request, State};
use axum::http::{HeaderName, HeaderValue, Method, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::Response;
use tower::ServiceBuilder;
use tower_http::ServiceBuilderExt;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::cors::{AllowHeaders, AllowOrigin, CorsLayer, ExposeHeaders};
use tower_http::request_id::MakeRequestUuid;
use tower_http::set_header::SetResponseHeaderLayer;
use tower_http::trace::TraceLayer;
use tracing::Span;

use super::conditional::{PREFER, PREFERENCE_APPLIED};
use super::guard::X_REQUEST_ID;
use super::telemetry::Series;
use super::unread::Lending;
use super::upload::IDEMPOTENCY_KEY;
use super::{guard, problem};

/// What pages of the service may load and do: their own files, and pictures that
/// they hold themselves. Nobody may frame them.
const CONTENT_SECURITY_POLICY: &str = "default-src 'self'; img-src 'self' data: blob:; \
    style-src 'self' 'unsafe-inline'; object-src 'none'; base-uri 'none'; form-action 'self'; \
    frame-ancestors 'none'";

/// What [`around`] works with.
struct Around {
    /// How much of an unread body is read on, bytes.
    most_unread: u64,
    series: Series,
}

/// Lays around every route what all requests go through, outermost first.
///
/// One `ServiceBuilder`, and one function in it: each `Router::layer` and each
/// `from_fn` copies and boxes all that it lies around for every request.
///
/// * `most_unread`: of a body that nobody reads, this much is read on, bytes.
pub(super) fn wrap<S: Clone + Send + Sync + 'static>(
    router: Router<S>,
    cors: Option<CorsLayer>,
    most_unread: u64,
) -> Router<S> {
    let state = Arc::new(Around { most_unread, series: Series::default() });
    let nosniff = SetResponseHeaderLayer::overriding(
        header::X_CONTENT_TYPE_OPTIONS,
        HeaderValue::from_static("nosniff"),
    );
    // Unless an answer says otherwise: it is one client's and may change.
    let cache = SetResponseHeaderLayer::if_not_present(
        header::CACHE_CONTROL,
        HeaderValue::from_static("private, no-cache"),
    );
    let policy = SetResponseHeaderLayer::if_not_present(
        header::CONTENT_SECURITY_POLICY,
        HeaderValue::from_static(CONTENT_SECURITY_POLICY),
    );
    router.layer(
        ServiceBuilder::new()
            .map_request(guard::bound_request_id)
            .set_x_request_id(MakeRequestUuid)
            .layer(TraceLayer::new_for_http().make_span_with(span))
            .propagate_x_request_id()
            .layer(from_fn_with_state(state, around))
            .option_layer(cors)
            .layer(nosniff)
            .layer(cache)
            .layer(policy)
            .layer(CatchPanicLayer::custom(problem::panicked)),
    )
}

/// Times the request, writes the body of an error, and reads what is left of the request's.
async fn around(State(state): State<Arc<Around>>, request: Request, next: Next) -> Response {
    let timing = state.series.begin(&request);
    let uri = request.uri().clone();
    let (lending, request) = Lending::of(request);
    let response = problem::render(next.run(request).await, uri.path()).await;
    timing.end(&response);
    lending.settle(response, state.most_unread).await
}

fn span(request: &Request) -> Span {
    let id = request.headers().get(X_REQUEST_ID).and_then(|id| id.to_str().ok());
    tracing::info_span!(
        "request",
        method = %request.method(),
        path = request.uri().path(),
        id = id.unwrap_or_default(),
    )
}

/// Lets the pages of `origins` use the service; none of them means no layer.
pub(super) fn cors(origins: &[String]) -> Option<CorsLayer> {
    if origins.is_empty() {
        return None;
    }
    let allowed = if origins.iter().any(|origin| origin == "*") {
        AllowOrigin::any()
    } else {
        AllowOrigin::list(origins.iter().filter_map(|origin| origin.parse().ok()))
    };
    let exposed = [
        header::ETAG,
        header::LOCATION,
        header::LINK,
        header::RETRY_AFTER,
        header::CONTENT_RANGE,
        header::CONTENT_DISPOSITION,
        PREFERENCE_APPLIED,
        X_REQUEST_ID,
        header::WWW_AUTHENTICATE,
        HeaderName::from_static("ratelimit-limit"),
        HeaderName::from_static("ratelimit-remaining"),
        HeaderName::from_static("ratelimit-reset"),
    ];
    let accepted = [
        header::CONTENT_TYPE,
        header::IF_MATCH,
        header::IF_NONE_MATCH,
        header::IF_RANGE,
        header::RANGE,
        PREFER,
        HeaderName::from_static("last-event-id"),
        header::AUTHORIZATION,
        IDEMPOTENCY_KEY,
    ];
    let layer = CorsLayer::new()
        .allow_origin(allowed)
        .allow_methods([
            Method::GET,
            Method::HEAD,
            Method::POST,
            Method::PUT,
            Method::PATCH,
            Method::DELETE,
        ])
        .allow_headers(AllowHeaders::list(accepted))
        .expose_headers(ExposeHeaders::list(exposed));
    Some(layer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::body::{self, Body};
    use axum::http::StatusCode;
    use axum::response::Response;
    use axum::routing::get;
    use serde_json::Value;
    use std::time::Duration;
    use tower::ServiceExt;
    use tower_http::timeout::TimeoutLayer;

    async fn answer(path: &str) -> Response {
        async fn panics() {
            panic!("on purpose");
        }
        async fn sleeps() {
            tokio::time::sleep(Duration::from_secs(60)).await;
        }
        let timeout = TimeoutLayer::with_status_code(
            StatusCode::SERVICE_UNAVAILABLE,
            Duration::from_millis(10),
        );
        let router = Router::new()
            .route("/panics", get(panics))
            .route("/sleeps", get(sleeps))
            .route("/teapot", get(|| async { (StatusCode::IM_A_TEAPOT, "short and stout") }))
            .layer(timeout);
        let request = Request::builder().uri(path).body(Body::empty()).unwrap();
        wrap(router, None, 0).oneshot(request).await.unwrap()
    }

    async fn expect_problem(path: &str, status: u16, kind: &str) -> Value {
        let response = answer(path).await;
        assert_eq!(response.status().as_u16(), status);
        assert_eq!(response.headers()["content-type"], "application/problem+json");
        assert!(response.headers().contains_key("x-request-id"));
        let bytes = body::to_bytes(response.into_body(), 10_000).await.unwrap();
        let problem: Value = serde_json::from_slice(&bytes).unwrap();
        assert_eq!(problem["type"], kind, "{problem}");
        assert_eq!(problem["instance"], path);
        problem
    }

    #[tokio::test]
    async fn panics_timeouts_and_bare_statuses_are_problems() {
        let panicked = expect_problem("/panics", 500, "/problems/internal").await;
        assert!(!panicked.to_string().contains("on purpose"), "{panicked}");
        expect_problem("/sleeps", 503, "/problems/busy").await;
        let teapot = expect_problem("/teapot", 418, "/problems/bad-request").await;
        assert_eq!(
            (&teapot["status"], &teapot["detail"]),
            (&418.into(), &"short and stout".into())
        );
    }
}
