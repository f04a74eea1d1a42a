//! Descriptions for people and programs that do not change while it runs.

use std::sync::LazyLock;

use axum::extract::Path;
use axum::http::header;
use axum::response::{Html, IntoResponse, Response};
use serde_json::Value;
use utoipa_swagger_ui::{Config, SwaggerUi};

use super::openapi::{openapi, problem_responses};
use super::problem::{self, NOT_FOUND, Problem, ProblemType};
use crate::draft;
use drawing::DrawOptions;
use options::OptionSet;

problem_responses! { PageProblems: NOT_FOUND }

/// Every option of a reconstruction: type, range, unit, default and meaning.
#[utoipa::path(
    get,
    path = "/v1/options",
    operation_id = "options",
    tag = "reconstructions",
    responses((status = 200, description = "JSON Schema, draft 2020-12", body = Object,
               content_type = "application/schema+json"))
)]
pub(super) async fn options() -> Response {
    json("application/schema+json", draft::options::schema())
}

/// Every option of a drawn sheet: type, range, unit, default and meaning.
#[utoipa::path(
    get,
    path = "/v1/sheet-options",
    operation_id = "sheet_options",
    tag = "sheets",
    responses((status = 200, description = "JSON Schema, draft 2020-12", body = Object,
               content_type = "application/schema+json"))
)]
pub(super) async fn sheet_options() -> Response {
    json("application/schema+json", &DrawOptions::schema().document)
}

/// This description.
#[utoipa::path(
    get,
    path = "/openapi.json",
    operation_id = "openapi",
    tag = "service",
    responses((status = 200, description = "OpenAPI 3.1", body = Object))
)]
pub(super) async fn description() -> Response {
    static DESCRIPTION: LazyLock<Value> = LazyLock::new(openapi);
    json("application/json", &DESCRIPTION)
}

fn json(media_type: &'static str, value: &Value) -> Response {
    ([(header::CONTENT_TYPE, media_type)], value.to_string()).into_response()
}

/// What a kind of problem means.
#[utoipa::path(
    get,
    path = "/problems/{name}",
    operation_id = "problem",
    tag = "service",
    params(("name" = String, Path, description = "Last part of a problem's type",
            example = "not-an-image")),
    responses((status = 200, description = "A short page", body = String,
               content_type = "text/html"), PageProblems)
)]
pub(super) async fn problem(Path(name): Path<String>) -> Result<Html<String>, Problem> {
    let kind = ProblemType::named(&name).ok_or_else(|| {
        Problem::new(NOT_FOUND, "there is no such kind of problem; /problems lists all")
    })?;
    let body = format!(
        "<p>HTTP status {}, type <code>{}</code></p><p>{}</p><p><a href=\"/problems\">All kinds</a></p>",
        kind.status,
        kind.uri(),
        kind.about
    );
    Ok(page(kind.title, &body))
}

/// All kinds of problems.
#[utoipa::path(
    get,
    path = "/problems",
    operation_id = "problems",
    tag = "service",
    responses((status = 200, description = "A list with links", body = String,
               content_type = "text/html"))
)]
pub(super) async fn problems() -> Html<String> {
    let entry = |kind: &ProblemType| {
        format!("<li><a href=\"{}\">{}</a> {}</li>", kind.uri(), kind.title, kind.status.as_u16())
    };
    let entries: String = problem::ALL.iter().map(entry).collect();
    page("Problems", &format!("<ul>{entries}</ul>"))
}

/// All text is the catalogue's own, so nothing has to be escaped.
fn page(title: &str, body: &str) -> Html<String> {
    Html(format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>{title}</title>\
         <style>body{{font:1rem/1.5 sans-serif;max-width:40rem;margin:2rem auto;padding:0 1rem}}</style>\
         <h1>{title}</h1>{body}</html>"
    ))
}

/// The page at `/docs`, with its own copy of Swagger UI.
pub(super) fn docs() -> SwaggerUi {
    // Without this, Swagger UI asks a validator on the internet for a badge.
    SwaggerUi::new("/docs").config(Config::from("/openapi.json").validator_url("none"))
}
