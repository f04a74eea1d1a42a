//! The description of the API (OpenAPI 3.1), made from the handlers and from
//! the schemas of options and sheet documents.

mod uploads;

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};
use utoipa::OpenApi;
use utoipa::openapi::{ContentBuilder, Ref, RefOr, Response, ResponseBuilder};

use crate::draft;
use crate::http::problem::{
    FOREIGN_ORIGIN, INSUFFICIENT_SCOPE, MISDIRECTED_REQUEST, ProblemDocument, ProblemType,
    TOO_MANY_REQUESTS, UNAUTHORIZED,
};
use crate::http::router::routes;
use artifacts::PFM_MEDIA_TYPE;
use drawing::DrawOptions;
use options::{OptionSet, Schema};
use sheet::SheetDocument;

#[derive(OpenApi)]
#[openapi(
    info(
        title = "Turnaround",
        description = "Turns a model sheet (drawn views at known angles) into depth maps, metrics and a 3D draft, and draws model sheets from 3D models. Errors are problem details (RFC 9457)."
    ),
    components(schemas(ProblemDocument)),
    tags(
        (name = "reconstructions", description = "Sheets on their way to a draft"),
        (name = "pages", description = "Pictures with several views: what is found on them, and put right"),
        (name = "artifacts", description = "What came out"),
        (name = "sheets", description = "Sheets drawn from 3D models, with their truth"),
        (name = "webhooks", description = "Messages that tell other services how jobs ended"),
        (name = "admin", description = "Tenants and keys, for keys of the scope admin"),
        (name = "service", description = "The service itself"),
    )
)]
pub(super) struct Description;

/// Says which problems an operation answers with.
macro_rules! problem_responses {
    ($visibility:vis $name:ident: $($kind:path),* $(,)?) => {
        $visibility struct $name;

        impl utoipa::IntoResponses for $name {
            fn responses() -> std::collections::BTreeMap<
                String,
                utoipa::openapi::RefOr<utoipa::openapi::Response>,
            > {
                $crate::http::openapi::responses_of(&[$($kind),*])
            }
        }
    };
}
pub(super) use problem_responses;

/// One response a status, which names its kinds of problem.
pub(super) fn responses_of(kinds: &[ProblemType]) -> BTreeMap<String, RefOr<Response>> {
    let mut by_status: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for kind in kinds {
        let line = format!("`{}`: {}", kind.uri(), kind.title);
        by_status.entry(kind.status.as_str().to_owned()).or_default().push(line);
    }
    by_status
        .into_iter()
        .map(|(status, lines)| {
            let schema = Ref::from_schema_name("Problem");
            let content = ContentBuilder::new().schema(Some(schema)).build();
            let response = ResponseBuilder::new()
                .description(lines.join("\n\n"))
                .content("application/problem+json", content)
                .build();
            (status, RefOr::T(response))
        })
        .collect()
}

/// For fields that hold the options of a reconstruction.
pub(super) fn options_reference() -> Ref {
    Ref::from_schema_name("Options")
}

/// For fields that hold a sheet document.
pub(super) fn sheet_reference() -> Ref {
    Ref::from_schema_name("SheetDocument")
}

/// For fields that hold the options of a drawn sheet.
pub(super) fn sheet_options_reference() -> Ref {
    Ref::from_schema_name("SheetOptions")
}

/// The description, complete.
pub fn openapi() -> Value {
    let (_, description) = routes().split_for_parts();
    let mut document = serde_json::to_value(description).unwrap_or_default();
    name_wildcards(&mut document);
    describe_other_errors(&mut document);
    tell_head_from_get(&mut document);
    describe_bytes(&mut document);
    describe_tags(&mut document);
    uploads::describe(&mut document);
    describe_access(&mut document);
    for (name, schema) in foreign_schemas() {
        document["components"]["schemas"][name] = schema;
    }
    document
}

/// A text without control characters.
const TEXT: &str = r"^[^\x00-\x1F\x7F-\x9F]*$";
/// Pairs of labels as a query gives them.
const LABELS: &str = concat!(
    r"^,*([A-Za-z0-9_.-]{1,63}:[^,\x00-\x1F\x7F-\x9F]{0,200}",
    r"(,+[A-Za-z0-9_.-]{1,63}:[^,\x00-\x1F\x7F-\x9F]{0,200}){0,15},*)?$",
);

/// Says of what form names and labels are, wherever they are given.
fn describe_tags(document: &mut Value) {
    let changes = &mut document["components"]["schemas"]["Changes"]["properties"];
    changes["name"]["pattern"] = TEXT.into();
    let labels = &mut changes["labels"];
    labels["propertyNames"] = json!({"pattern": "^[A-Za-z0-9_.-]{1,63}$"});
    labels["additionalProperties"]["maxLength"] = 200.into();
    labels["additionalProperties"]["pattern"] = TEXT.into();
    labels["maxProperties"] = 16.into();
    let operations =
        document["paths"].as_object_mut().into_iter().flat_map(|paths| paths.values_mut());
    let operations = operations.filter_map(Value::as_object_mut).flat_map(|path| path.values_mut());
    for parameter in operations.filter_map(|it| it.get_mut("parameters")?.as_array_mut()).flatten()
    {
        let pattern = match (parameter["in"].as_str(), parameter["name"].as_str()) {
            (Some("query"), Some("name")) => TEXT,
            (Some("query"), Some("labels")) => LABELS,
            _ => continue,
        };
        parameter["schema"]["pattern"] = pattern.into();
    }
}

/// Schemas that are made elsewhere, as components.
fn foreign_schemas() -> Map<String, Value> {
    let mut sheet = Schema::of::<SheetDocument>().document;
    sheet["properties"]["options"] = json!({
        "$ref": "#/components/schemas/Options",
        "description": "Options, nested by stage."
    });
    let schemas = [
        ("Options", draft::options::schema().clone()),
        ("SheetOptions", DrawOptions::schema().document.clone()),
        ("SheetDocument", sheet),
        ("Upload", uploads::upload_schema()),
        ("ModelUpload", uploads::model_upload_schema()),
        ("PageUpload", uploads::page_upload_schema()),
        ("PageEditUpload", uploads::page_edit_schema()),
    ];
    let component = |(name, schema): (&str, Value)| {
        let mut schema = options::with_enums(&schema);
        if let Some(schema) = schema.as_object_mut() {
            schema.remove("$schema");
        }
        (name.to_owned(), schema)
    };
    schemas.map(component).into_iter().collect()
}

/// Everything that an artifact may be, of whichever kind of job.
const ARTIFACT_MEDIA_TYPES: [&str; 11] = [
    "application/octet-stream",
    "image/png",
    "image/svg+xml",
    PFM_MEDIA_TYPE,
    "model/gltf-binary",
    "model/obj",
    "model/stl",
    "model/3mf",
    "model/ply",
    "application/json",
    "application/zip",
];

/// An entry of an event stream.
fn event_schema() -> Value {
    json!({
        "type": "object",
        "required": ["id", "event", "data"],
        "properties": {
            "id": {"type": "string", "description": "Number of the event, from 1 without gaps."},
            "event": {"type": "string", "description": "Its kind."},
            "data": {"type": "string", "contentMediaType": "application/json"},
        },
    })
}

/// Bodies that are bytes: not lists of numbers, and of artifacts every type there is.
fn describe_bytes(document: &mut Value) {
    let binary = json!({"schema": {"type": "string", "format": "binary"}});
    let items = document["paths"].as_object_mut().into_iter().flat_map(Map::values_mut);
    let operations = items.filter_map(Value::as_object_mut).flat_map(Map::values_mut);
    for operation in operations {
        let is_artifact =
            operation["operationId"].as_str().is_some_and(|id| id.ends_with("artifact"));
        let responses = operation["responses"].as_object_mut();
        for response in responses.into_iter().flat_map(Map::values_mut) {
            let Some(content) = response.get_mut("content").and_then(Value::as_object_mut) else {
                continue;
            };
            if let Some(stream) = content.get_mut("text/event-stream") {
                stream["schema"] = event_schema();
            }
            if content.values().any(|body| body["schema"]["items"]["format"] == "int32") {
                let types: Vec<String> = match is_artifact {
                    true => ARTIFACT_MEDIA_TYPES.map(str::to_owned).to_vec(),
                    false => content.keys().cloned().collect(),
                };
                let body = |name: String| {
                    // JSON is parsed before anybody sees its bytes.
                    let is_json = name == "application/json";
                    (name, if is_json { json!({"schema": {}}) } else { binary.clone() })
                };
                *content = types.into_iter().map(body).collect();
            }
        }
    }
}

/// Which operations need a key, and what they answer without.
fn describe_access(document: &mut Value) {
    document["servers"] = json!([{"url": "/", "description": "Where the description is"}]);
    document["components"]["securitySchemes"]["key"] = json!({
        "type": "http",
        "scheme": "bearer",
        "description": "A key, as `turnaround keys create` makes it. A service on the loopback that has no keys needs none."
    });
    document["security"] = json!([{"key": []}]);
    let Some(paths) = document["paths"].as_object_mut() else { return };
    for (path, item) in paths {
        let is_closed = path.starts_with("/v1/") || path == "/metrics";
        for operation in item.as_object_mut().into_iter().flat_map(Map::values_mut) {
            if !is_closed {
                operation["security"] = json!([]);
                continue;
            }
            let refusals = [UNAUTHORIZED, INSUFFICIENT_SCOPE, FOREIGN_ORIGIN, TOO_MANY_REQUESTS];
            for (status, refusal) in responses_of(&refusals) {
                let known = &mut operation["responses"][&status];
                let refusal = serde_json::to_value(refusal).unwrap_or_default();
                match known["description"].as_str() {
                    None => *known = refusal,
                    Some(told) => {
                        let more = refusal["description"].as_str().unwrap_or_default();
                        known["description"] = format!("{told}\n\n{more}").into();
                    }
                }
            }
        }
    }
}

/// OpenAPI has no parameters with slashes; it is named like any other.
fn name_wildcards(document: &mut Value) {
    let Some(paths) = document["paths"].as_object_mut() else { return };
    *paths = std::mem::take(paths)
        .into_iter()
        .map(|(path, item)| (path.replace("{*", "{"), item))
        .collect();
}

/// Faults of the service, and what the framework refuses by itself.
fn describe_other_errors(document: &mut Value) {
    let items = document["paths"].as_object_mut().into_iter().flat_map(Map::values_mut);
    for operation in items.filter_map(Value::as_object_mut).flat_map(Map::values_mut) {
        operation["responses"]["default"] = json!({
            "description": "Any other problem",
            "content": {"application/problem+json": {
                "schema": {"$ref": "#/components/schemas/Problem"}
            }},
        });
        for (status, refusal) in responses_of(&[MISDIRECTED_REQUEST]) {
            operation["responses"][status] = serde_json::to_value(refusal).unwrap_or_default();
        }
        if operation.get("description").is_none() {
            operation["description"] = operation["summary"].clone();
        }
    }
}

/// Operation ids must be unique, and a HEAD answers without a body.
fn tell_head_from_get(document: &mut Value) {
    let Some(paths) = document["paths"].as_object_mut() else { return };
    for operation in paths.values_mut().filter_map(|item| item.get_mut("head")) {
        if let Some(id) = operation["operationId"].as_str() {
            operation["operationId"] = format!("head_{id}").into();
        }
        for response in operation["responses"].as_object_mut().into_iter().flat_map(Map::values_mut)
        {
            if let Some(response) = response.as_object_mut() {
                response.remove("content");
            }
        }
    }
}
