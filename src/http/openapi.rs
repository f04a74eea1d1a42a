//! The description of the API (OpenAPI 3.1), made from the handlers and from
//! the schemas of options and sheet documents.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};
use utoipa::OpenApi;
use utoipa::openapi::{ContentBuilder, Ref, RefOr, Response, ResponseBuilder};

use super::problem::{
    FOREIGN_ORIGIN, INSUFFICIENT_SCOPE, ProblemDocument, ProblemType, TOO_MANY_REQUESTS,
    UNAUTHORIZED,
};
use super::router::routes;
use crate::draft;
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
    describe_uploads(&mut document);
    describe_access(&mut document);
    for (name, schema) in foreign_schemas() {
        document["components"]["schemas"][name] = schema;
    }
    document
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
        ("Upload", upload_schema()),
        ("ModelUpload", model_upload_schema()),
        ("PageUpload", page_upload_schema()),
        ("PageEditUpload", page_edit_schema()),
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

fn upload_schema() -> Value {
    let picture = json!({"type": "string", "format": "binary"});
    json!({
        "type": "object",
        "description": "One of five forms: parts `view[AZIMUTH]`; a part `page` with all views on it; a part `page` with the id of one; a part `sheet` with the files it names, as parts `image` found by their file names or as parts named like the files; a part `source`. Options come as a part `options`, and singly by their dotted names, such as `disparity.block_size`; later ones in this list lie over earlier ones: the source's, the sheet's, the part's, single ones.",
        "properties": {
            "sheet": {"$ref": "#/components/schemas/SheetDocument"},
            "image": {"type": "array", "items": picture,
                "description": "The files that the sheet names."},
            "options": {"$ref": "#/components/schemas/Options"},
            "truth": truth_schema(),
            "truth_model": {"type": "string", "format": "binary",
                "description": "The true model (OBJ, PLY, STL, GLB, glTF), its origin on the turntable axis at the pictures' middle row; `truth` then gives `pixels_per_unit`. In the sheet form the document names it."},
            "page": {"anyOf": [{"type": "string", "format": "binary"}, {"type": "string", "format": "uuid"}],
                "description": "A picture with several views on it, or an animated GIF of a turn: its figures are found and cut out. Or, without a file name, the id of a page: its kept figures become the views as they are seen there."},
            "azimuths": {"type": "string", "default": "auto", "examples": ["0,45,90,180"],
                "description": "The azimuths of the page's figures in reading order, degrees; `auto` guesses them."},
            "source": {"type": "string", "format": "uuid",
                "description": "An earlier reconstruction: its views are taken again, and its options for those not given."},
            "view": {"type": "array", "items": picture,
                "description": "Drawings at any angles: repeated, each with a part `azimuth_deg` in the same order. The same as parts `view[AZIMUTH]`, for clients whose parts must have names known beforehand."},
            "azimuth_deg": {"type": "array", "items": {"type": "number"},
                "description": "The azimuths of the parts `view`, degrees, in their order."},
            "view[0]": picture, "view[45]": picture, "view[90]": picture,
        },
        "patternProperties": {
            "^view\\[.+\\]$": {"type": "string", "format": "binary",
                "description": "The drawing (PNG, JPEG, WebP, TIFF, GIF, SVG) at this azimuth in degrees."},
            "^mask\\[.+\\]$": {"type": "string", "format": "binary",
                "description": "The mask of the drawing at this azimuth: white inside."},
            "^truth\\[.+\\]$": {"type": "string", "format": "binary",
                "description": "True depth or disparity of the view at this azimuth: PNG (8 or 16 bits, 0 is background), PFM or EXR. The metrics then tell how the result compares."},
        },
        "additionalProperties": {"type": "string", "description": "A single option."},
    })
}

/// What the part `truth` says: a sheet document's own truth, and what it says
/// elsewhere.
fn truth_schema() -> Value {
    let number = |description: &str| json!({"type": "number", "description": description});
    json!({
        "type": "object",
        "description": "How the pictures `truth[AZIMUTH]` and the part `truth_model` are to be read; a sheet document says so itself.",
        "additionalProperties": false,
        "properties": {
            "kind": {"enum": ["depth", "disparity"],
                "description": "What the pictures hold: distance from the camera plane, or disparity (nearer is larger). Unsaid, 8-bit PNG are ramps of nearness and all others depth."},
            "pixels_per_unit": number("Sheet pixels a unit of depth and of the model."),
            "model_up_axis": {"enum": ["y", "z"],
                "description": "Which axis of the model points up; glTF has y, the others are read as z."},
            "depth_counts_per_unit": number("Counts of PNG depth pictures a unit."),
            "camera_distance": number("Distance of the camera plane from the turntable axis, units."),
            "disparity_pair_deg": number("Signed angle from each view to the one that disparity pictures are towards, degrees: they are px then."),
        },
    })
}

fn model_upload_schema() -> Value {
    let file = json!({"type": "string", "format": "binary",
        "description": "GLB, glTF with embedded buffers, OBJ, PLY or STL; the file's name tells which."});
    let builtin = json!({"type": "string", "pattern": "^builtin:[a-z_]+$",
        "description": "A built-in model, such as builtin:teapot."});
    json!({
        "type": "object",
        "description": "A model, and how it is drawn. Options come as a part `options`, and singly by their dotted names, such as `degrade.preset`; single ones lie over the part's.",
        "required": ["model"],
        "properties": {
            "model": {"anyOf": [file, builtin]},
            "azimuths": {"type": "string", "default": "0:90:5", "examples": ["0:90:5,135,180"],
                "description": "The views, degrees: a list of angles and of FROM:TO:STEP."},
            "up_axis": {"type": "string", "enum": ["y", "z"],
                "description": "Which axis of the file points up; y in glTF and z in the others if not given."},
            "options": {"$ref": "#/components/schemas/SheetOptions"},
        },
        "additionalProperties": {"type": "string", "description": "A single option."},
    })
}

fn page_upload_schema() -> Value {
    json!({
        "type": "object",
        "required": ["page"],
        "properties": {
            "page": {"type": "array", "items": {"type": "string", "format": "binary"},
                "description": "A picture with several views on it, an animated GIF of a turn, or several pictures of one view each, in even steps of a turn."},
            "azimuths": {"type": "string", "default": "auto", "examples": ["0,45,90,180"],
                "description": "The azimuths of the figures in reading order, degrees; `auto` guesses them."},
        },
        "additionalProperties": false,
    })
}

fn page_edit_schema() -> Value {
    json!({
        "type": "object",
        "required": ["document"],
        "properties": {
            "document": {"$ref": "#/components/schemas/PageEdit"},
            "mask[0]": {"type": "string", "format": "binary"},
        },
        "patternProperties": {
            "^mask\\[[0-9]+\\]$": {"type": "string", "format": "binary",
                "description": "The mask of the figure of this number, white inside, of the size of its crop."},
        },
        "additionalProperties": false,
    })
}

fn describe_uploads(document: &mut Value) {
    let body = &mut document["paths"]["/v1/reconstructions"]["post"]["requestBody"];
    body["required"] = true.into();
    body["content"]["multipart/form-data"]["encoding"] = json!({
        "sheet": {"contentType": "application/json"},
        "options": {"contentType": "application/json"},
        "matches": {"contentType": "application/json"},
        "truth": {"contentType": "application/json"},
        "image": {"contentType": "image/png, image/jpeg, image/webp, image/tiff"},
    });
    document["paths"]["/v1/pages"]["post"]["requestBody"]["required"] = true.into();
    let body = &mut document["paths"]["/v1/pages/{id}"]["put"]["requestBody"];
    body["required"] = true.into();
    body["content"]["multipart/form-data"] = json!({
        "schema": {"$ref": "#/components/schemas/PageEditUpload"},
        "encoding": {"document": {"contentType": "application/json"}},
    });
    let body = &mut document["paths"]["/v1/sheets"]["post"]["requestBody"];
    body["required"] = true.into();
    let form = &mut body["content"]["multipart/form-data"];
    form["encoding"] = json!({"options": {"contentType": "application/json"}});
    form["examples"] = json!({
        "builtin": {
            "summary": "A built-in model from three sides",
            "value": {"model": "builtin:teapot", "azimuths": "0,45,90"},
        },
        "degraded": {
            "summary": "As if drawn by hand, with options in both ways",
            "value": {
                "model": "builtin:caped_figure",
                "azimuths": "0:90:15,180",
                "options": {"degrade": {"preset": "middle", "seed": 7}},
                "line_width_px": "2",
            },
        },
    });
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
