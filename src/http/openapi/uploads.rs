//! Uploads in the description: their parts, which no Rust type has, and examples.

use serde_json::{Value, json};

pub(super) fn upload_schema() -> Value {
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
            "azimuths": {"type": "string", "examples": ["0,45,90,180"],
                "description": "The azimuths of the page's figures in reading order, degrees; `auto` guesses them."},
            "source": {"type": "string", "format": "uuid",
                "description": "An earlier reconstruction: its views are taken again, and its options for those not given."},
            "reuse": {"type": "boolean",
                "description": "Whether the result of an earlier job with the same input, options and version will do: then the job has succeeded when it is answered. True if it is left out."},
            "view": {"type": "array", "items": picture,
                "description": "Drawings at any angles: repeated, each with a part `azimuth_deg`, and `elevation_deg` if some are not level, in the same order. The same as parts `view[AZIMUTH]`, for clients whose parts must have names known beforehand."},
            "azimuth_deg": {"type": "array", "items": {"type": "number"},
                "description": "The azimuths of the parts `view`, degrees, in their order."},
            "elevation_deg": {"type": "array", "items": {"type": "number", "minimum": -90, "maximum": 90},
                "description": "The elevations of the parts `view`, degrees, in their order; none if all are level."},
            "view[0]": picture, "view[45]": picture, "view[90]": picture, "view[0,90]": picture,
        },
        "patternProperties": {
            "^view\\[.+\\]$": {"type": "string", "format": "binary",
                "description": "The drawing (PNG, JPEG, WebP, TIFF, GIF, SVG) at this azimuth in degrees; of views that are not level at this azimuth and elevation, such as `view[0,90]` from straight above."},
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

pub(super) fn model_upload_schema() -> Value {
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
            "reuse": {"type": "boolean",
                "description": "Whether the result of an earlier job with the same input, options and version will do: then the job has succeeded when it is answered. True if it is left out."},
        },
        "additionalProperties": {"type": "string", "description": "A single option."},
    })
}

pub(super) fn page_upload_schema() -> Value {
    json!({
        "type": "object",
        "required": ["page"],
        "properties": {
            "page": {"type": "array", "minItems": 1, "items": {"type": "string", "format": "binary"},
                "description": "A picture with several views on it, an animated GIF of a turn, or several pictures of one view each, in even steps of a turn; problems call them `page`, `page[1]`, `page[2]`."},
            "azimuths": {"type": "string", "default": "auto", "examples": ["0,45,90,180"],
                "description": "The azimuths of the figures in reading order, degrees; `auto` guesses them."},
        },
        "additionalProperties": false,
    })
}

pub(super) fn page_edit_schema() -> Value {
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

/// Completes the operations that take uploads.
pub(super) fn describe(document: &mut Value) {
    let body = &mut document["paths"]["/v1/reconstructions"]["post"]["requestBody"];
    body["required"] = true.into();
    body["content"]["multipart/form-data"]["encoding"] = json!({
        "sheet": {"contentType": "application/json"},
        "options": {"contentType": "application/json"},
        "matches": {"contentType": "application/json"},
        "truth": {"contentType": "application/json"},
        "image": {"contentType": "image/png, image/jpeg, image/webp, image/tiff"},
    });
    body["content"]["multipart/form-data"]["examples"] = json!({
        "views": {
            "summary": "Drawings at three angles",
            "value": {
                "view": ["(front.png)", "(quarter.png)", "(side.png)"],
                "azimuth_deg": [0, 45, 90],
                "options": {"seed": 1},
            },
        },
        "page": {
            "summary": "A page with all views on it",
            "value": {"page": "(sheet.png)", "azimuths": "0,45,90,180"},
        },
        "sheet": {
            "summary": "A sheet document with the files that it names",
            "value": {
                "sheet": {"views": [
                    {"image": "front.png", "azimuth_deg": 0},
                    {"image": "side.png", "azimuth_deg": 90},
                ]},
                "image": ["(front.png)", "(side.png)"],
            },
        },
    });
    let body = &mut document["paths"]["/v1/pages"]["post"]["requestBody"];
    body["required"] = true.into();
    body["content"]["multipart/form-data"]["example"] =
        json!({"page": ["(sheet.png)"], "azimuths": "0,45,90,180"});
    let body = &mut document["paths"]["/v1/pages/{id}"]["put"]["requestBody"];
    body["required"] = true.into();
    body["content"]["application/json"]["example"] = json!({"figures": [
        {"box": {"left": 40, "top": 30, "right": 410, "bottom": 620}, "azimuth_deg": 0},
        {"box": {"left": 460, "top": 30, "right": 790, "bottom": 620}, "azimuth_deg": 90},
    ]});
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
