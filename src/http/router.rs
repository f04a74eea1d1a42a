//! The routes of the service, with their time limits.

use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::http::{Method, StatusCode, Uri};
use axum::middleware::from_fn_with_state;
use axum::routing::get;
use tower::ServiceBuilder;
use tower_http::compression::CompressionLayer;
use tower_http::timeout::TimeoutLayer;
use tower_http::validate_request::ValidateRequestHeaderLayer;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes as paths;

use super::conditional::MAX_WAIT;
use super::layers;
use super::openapi::Description;
use super::problem::{METHOD_NOT_ALLOWED, NOT_FOUND, Problem};
use super::state::{Api, ApiState};
use super::{
    HttpLimits, access, drawn_pages, guard, health, links, pages, reconstructions, sheets, web,
    webhooks,
};

/// The whole interface over `state`.
pub fn router(state: ApiState, limits: &HttpLimits) -> Router {
    let cors = layers::cors(&state.guard.origins);
    let gate = Arc::new(access::Gate::new(state.access.clone()));
    let guard = guard::Check(Arc::new(state.guard.clone()));
    let admission = ServiceBuilder::new()
        .layer(ValidateRequestHeaderLayer::custom(guard))
        .layer(from_fn_with_state(gate, access::admit))
        // Uploads have limits of their own; nothing else has a body.
        .layer(DefaultBodyLimit::max(64 << 10));
    let within =
        |time: Duration| TimeoutLayer::with_status_code(StatusCode::SERVICE_UNAVAILABLE, time);
    let answer = limits.answer_timeout;
    let compressed = ServiceBuilder::new().layer(CompressionLayer::new());
    let quick = quick_routes().layer(compressed.clone().layer(within(answer)));
    let patient = patient_routes().layer(compressed.clone().layer(within(answer + MAX_WAIT)));
    let untimed = upload_routes().merge(stream_routes()).merge(page_routes()).layer(compressed);
    let whole = content_routes().layer(within(answer));
    let (routes, _) = OpenApiRouter::new()
        .merge(quick)
        .merge(patient)
        .merge(untimed)
        .merge(whole)
        .split_for_parts();
    let router = routes
        .merge(pages::docs())
        .fallback(nothing_here)
        .method_not_allowed_fallback(wrong_method)
        .layer(admission);
    // A body over its limit is likely to be about as large as that again.
    let most_unread = limits.max_body_bytes.saturating_mul(2);
    layers::wrap(router, cors, most_unread).with_state(Api::new(state, *limits))
}

/// Every described route.
pub(super) fn routes() -> OpenApiRouter<Arc<Api>> {
    OpenApiRouter::with_openapi(Description::openapi())
        .merge(upload_routes())
        .merge(quick_routes())
        .merge(patient_routes())
        .merge(stream_routes())
        .merge(content_routes())
}

fn quick_routes() -> OpenApiRouter<Arc<Api>> {
    OpenApiRouter::new()
        .routes(paths!(reconstructions::list))
        .routes(paths!(reconstructions::delete))
        .routes(paths!(reconstructions::patch))
        .routes(paths!(reconstructions::cancel))
        .routes(paths!(reconstructions::artifacts))
        .routes(paths!(sheets::list))
        .routes(paths!(sheets::delete))
        .routes(paths!(sheets::patch))
        .routes(paths!(drawn_pages::delete))
        .routes(paths!(drawn_pages::patch))
        .routes(paths!(drawn_pages::list))
        .routes(paths!(sheets::cancel))
        .routes(paths!(sheets::artifacts))
        .routes(paths!(reconstructions::link))
        .routes(paths!(sheets::link))
        .routes(paths!(reconstructions::deliveries))
        .routes(paths!(reconstructions::redeliver))
        .routes(paths!(sheets::deliveries))
        .routes(paths!(sheets::redeliver))
        .routes(paths!(webhooks::get, webhooks::put))
        .routes(paths!(webhooks::new_secret))
        .routes(paths!(pages::options))
        .routes(paths!(pages::sheet_options))
        .routes(paths!(pages::description))
        .routes(paths!(pages::problems))
        .routes(paths!(pages::problem))
        .routes(paths!(access::create_tenant))
        .routes(paths!(access::tenants))
        .routes(paths!(access::limit_tenant))
        .routes(paths!(access::delete_tenant))
        .routes(paths!(access::create_key))
        .routes(paths!(access::keys))
        .routes(paths!(access::revoke_key))
        .routes(paths!(health::live))
        .routes(paths!(health::ready))
        .routes(paths!(health::metrics))
}

/// Takes up to [`MAX_WAIT`] if the client likes.
fn patient_routes() -> OpenApiRouter<Arc<Api>> {
    OpenApiRouter::new().routes(paths!(reconstructions::get)).routes(paths!(sheets::get))
}

/// Limits its time by itself, as uploads may take long.
fn upload_routes() -> OpenApiRouter<Arc<Api>> {
    OpenApiRouter::new()
        .routes(paths!(reconstructions::create))
        .routes(paths!(sheets::create))
        .routes(paths!(drawn_pages::create))
        .routes(paths!(drawn_pages::replace))
}

fn stream_routes() -> OpenApiRouter<Arc<Api>> {
    OpenApiRouter::new().routes(paths!(reconstructions::events)).routes(paths!(sheets::events))
}

/// Sent as they are stored: compressing would break strong ETags and ranges.
fn content_routes() -> OpenApiRouter<Arc<Api>> {
    OpenApiRouter::new()
        .routes(paths!(reconstructions::artifact))
        .routes(paths!(reconstructions::metrics))
        .routes(paths!(sheets::artifact))
        .routes(paths!(drawn_pages::get))
        .routes(paths!(drawn_pages::file))
        .routes(paths!(links::follow))
}

/// The web page, which is no part of the described interface.
fn page_routes() -> OpenApiRouter<Arc<Api>> {
    OpenApiRouter::new()
        .route("/", get(web::index))
        .route("/icon.svg", get(web::icon))
        .route("/assets/{name}", get(web::asset))
}

async fn nothing_here(uri: Uri) -> Problem {
    Problem::new(NOT_FOUND, format!("there is nothing at `{}`; /docs lists all paths", uri.path()))
}

async fn wrong_method(method: Method, uri: Uri) -> Problem {
    let detail =
        format!("`{}` does not take {method}; the Allow header lists what it takes", uri.path());
    Problem::new(METHOD_NOT_ALLOWED, detail)
}
