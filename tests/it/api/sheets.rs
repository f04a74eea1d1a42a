//! Drawn sheets: from the upload of a model to the reconstruction of its sheet.

use std::collections::BTreeMap;
use std::io::{Cursor, Read};
use std::sync::Arc;
use std::time::Duration;

use crate::api::harness::{Service, file, problem};
use base64::prelude::{BASE64_STANDARD, Engine};
use drawing::{DrawError, DrawOptions, PreparedModel, SheetLimits, draw_sheet};
use frames::Azimuth;
use jobs::bytes::Key;
use jobs::{Failure, JobId, JobStore, NewJob};
use mesh::builtin::ProceduralModel;
use progress::Silent;
use reqwest::multipart::Form;
use reqwest::{Response, StatusCode};
use serde_json::{Value, json};
use tokio::runtime::Handle;
use turnaround::kinds::{DRAWING, DrawPayload, ModelSource};
use turnaround::worker::jobs::Draw;
use turnaround::worker::{Pool, Work, WorkerConfig};

/// A tetrahedron.
pub(super) const OBJ: &str =
    "v 0 0 1\nv 1 0 -1\nv -1 1 -1\nv -1 -1 -1\nf 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n";
/// Small enough to be drawn in a moment.
const SMALL: [(&str, &str); 2] = [("width_px", "96"), ("height_px", "54")];

pub(super) async fn post(service: &Service, form: Form) -> Response {
    service.post("/v1/sheets").multipart(form).send().await.unwrap()
}

pub(super) fn model(bytes: impl Into<Vec<u8>>, name: &str) -> Form {
    Form::new().part("model", file(bytes.into(), name))
}

pub(super) fn builtin(name: &str) -> Form {
    let form = Form::new().text("model", format!("builtin:{name}"));
    SMALL.into_iter().fold(form, |form, (option, value)| form.text(option, value))
}

pub(super) async fn queue(service: &Service, form: Form) -> (JobId, Value) {
    let response = post(service, form).await;
    let status = response.status();
    let body: Value = response.json().await.unwrap();
    assert_eq!(status, StatusCode::ACCEPTED, "{body}");
    (body["id"].as_str().unwrap().parse().unwrap(), body)
}

pub(super) async fn json_at(service: &Service, path: &str) -> Value {
    let response = service.get(path).send().await.unwrap();
    assert_eq!(response.status(), StatusCode::OK, "{path}");
    response.json().await.unwrap()
}

fn workers(service: &Service) -> Pool {
    let config = WorkerConfig { threads_per_job: 2, ..WorkerConfig::default() };
    let works: Vec<Arc<dyn Work>> = vec![Arc::new(Draw::default())];
    let store = service.store.clone();
    Pool::start(config, store, service.bytes.clone(), works, &Handle::current()).unwrap()
}

async fn finished(service: &Service, id: JobId) -> Value {
    for _ in 0..3 {
        let path = format!("/v1/sheets/{id}");
        let response = service.get(&path).header("prefer", "wait=60").send().await.unwrap();
        let body: Value = response.json().await.unwrap();
        if body["finished_at"].is_string() {
            return body;
        }
    }
    panic!("{id} does not finish");
}

#[tokio::test]
async fn a_model_becomes_a_durable_job() {
    let service = Service::start().await;
    let form = model(OBJ, "shapes/tetra hedron.OBJ")
        .text("azimuths", "90,0:45:22.5,-45")
        .text("up_axis", "y")
        .text("options", json!({"line_width_px": 3, "degrade": {"preset": "light"}}).to_string())
        .text("line_width_px", "2")
        .text("degrade.seed", "7");
    let response = post(&service, form).await;
    assert_eq!(response.status(), StatusCode::ACCEPTED);
    assert_eq!(response.headers()["retry-after"], "1");
    let location = response.headers()["location"].to_str().unwrap().to_owned();
    let answer: Value = response.json().await.unwrap();
    let id: JobId = answer["id"].as_str().unwrap().parse().unwrap();
    assert_eq!(location, format!("/v1/sheets/{id}"));
    assert_eq!(answer["links"]["self"], location);
    assert_eq!(answer["links"]["cancel"], format!("{location}/cancel"));
    assert_eq!((&answer["state"], &answer["links"]["sheet"]), (&json!("queued"), &Value::Null));
    let expected = json!({"file": "tetra hedron.OBJ", "format": "obj", "up_axis": "y"});
    assert_eq!(answer["model"], expected);
    assert_eq!(answer["azimuths_deg"], json!([0.0, 22.5, 45.0, 90.0, 315.0]));
    let mut options = DrawOptions { line_width_px: 2.0, ..DrawOptions::default() };
    options.degrade = serde_json::from_value(json!({"preset": "light", "seed": 7})).unwrap();
    assert_eq!(answer["options"], serde_json::to_value(&options).unwrap());

    let job = service.store.get(id).await.unwrap();
    assert_eq!(job.kind, DRAWING);
    let payload: DrawPayload = serde_json::from_value(job.payload).unwrap();
    assert_eq!(payload.options, options);
    assert_eq!(service.stored_inputs(id, &["model.obj"]).await, [OBJ.as_bytes()]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_drawn_sheet_can_be_reconstructed_as_it_is() {
    let service = Service::start().await;
    let pool = workers(&service);
    let (id, _) = queue(&service, builtin("dude").text("azimuths", "0:20:10,90")).await;
    let sheet = finished(&service, id).await;
    assert_eq!(sheet["state"], "succeeded", "{sheet}");
    let progress = &sheet["progress"];
    assert_eq!((&progress["stage"], &progress["done"]), (&json!("views"), &json!(4)), "{sheet}");

    let list = json_at(&service, sheet["links"]["artifacts"].as_str().unwrap()).await;
    let mut files = BTreeMap::new();
    for artifact in list["artifacts"].as_array().unwrap() {
        let href = artifact["href"].as_str().unwrap();
        assert!(href.starts_with(&format!("/v1/sheets/{id}/artifacts/")), "{href}");
        let response = service.get(href).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::OK, "{href}");
        let media_type = response.headers()["content-type"].to_str().unwrap().to_owned();
        assert_eq!(artifact["media_type"], media_type);
        let bytes = response.bytes().await.unwrap().to_vec();
        files.insert(artifact["name"].as_str().unwrap().to_owned(), (media_type, bytes));
    }
    for (name, media_type) in [
        ("view_010.png", "image/png"),
        ("view_010.svg", "image/svg+xml"),
        ("depth_010.png", "image/png"),
        ("depth_010.pfm", "image/x-portable-floatmap"),
        ("disparity_010_020.pfm", "image/x-portable-floatmap"),
        ("mask_010.png", "image/png"),
        ("normals_010.png", "image/png"),
        ("page.png", "image/png"),
        ("model.obj", "model/obj"),
        ("sheet.json", "application/json"),
        ("bundle.zip", "application/zip"),
    ] {
        assert_eq!(files[name].0, media_type, "{name}");
    }
    assert_eq!(without_bundle(&files), drawn_here(&[0.0, 10.0, 20.0, 90.0]));
    assert_eq!(unzipped(&files["bundle.zip"].1), without_bundle(&files));
    for (link, name) in [("sheet", "sheet.json"), ("page", "page.png"), ("bundle", "bundle.zip")] {
        let response = service.get(sheet["links"][link].as_str().unwrap()).send().await.unwrap();
        assert_eq!(response.bytes().await.unwrap(), files[name].1, "{link}");
    }

    let document: Value = serde_json::from_slice(&files["sheet.json"].1).unwrap();
    for keys in [["image"].as_slice(), &["image", "depth"]] {
        let mut form = Form::new().text("sheet", document.to_string());
        for view in document["views"].as_array().unwrap() {
            let names = keys.iter().map(|key| view[*key].as_str().unwrap());
            form = names
                .fold(form, |form, name| form.part("image", file(files[name].1.clone(), name)));
        }
        if keys.contains(&"depth") {
            form = form.part("model.obj", file(files["model.obj"].1.clone(), "model.obj"));
        }
        let response = service.upload(form).await;
        let status = response.status();
        let reconstruction: Value = response.json().await.unwrap();
        assert_eq!(status, StatusCode::ACCEPTED, "{reconstruction}");
        assert_eq!(reconstruction["views"].as_array().unwrap().len(), 4);
    }
    pool.shutdown(Duration::from_secs(20)).await;
}

type Files = BTreeMap<String, Vec<u8>>;

fn without_bundle(files: &BTreeMap<String, (String, Vec<u8>)>) -> Files {
    let files = files.iter().filter(|(name, _)| *name != "bundle.zip");
    files.map(|(name, (_, bytes))| (name.clone(), bytes.clone())).collect()
}

fn unzipped(bytes: &[u8]) -> Files {
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
    let mut files = Files::new();
    for index in 0..archive.len() {
        let mut entry = archive.by_index(index).unwrap();
        let mut content = Vec::new();
        entry.read_to_end(&mut content).unwrap();
        files.insert(entry.name().unwrap().into_owned(), content);
    }
    files
}

/// What the command line writes into its folder.
fn drawn_here(azimuths_deg: &[f64]) -> Files {
    let model = PreparedModel::new(&ProceduralModel::Dude.build()).unwrap();
    let azimuths: Vec<_> = azimuths_deg
        .iter()
        .map(|&degrees| Azimuth::from_degrees(degrees).unwrap().into())
        .collect();
    let options = DrawOptions { width_px: 96, height_px: 54, ..DrawOptions::default() };
    let mut files = Files::new();
    let mut keep = |file: artifacts::Artifact| -> Result<(), DrawError> {
        files.insert(file.name, file.bytes.into());
        Ok(())
    };
    draw_sheet(&model, &azimuths, &options, &SheetLimits::default(), &Silent, &mut keep).unwrap();
    files
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_only_drawing_can_tell_fails_with_a_reason() {
    let service = Service::start().await;
    // As an upload is stored, but with a camera inside the model.
    let payload = DrawPayload {
        model: ModelSource::Builtin(ProceduralModel::Cube),
        azimuths_deg: vec![0.0],
        elevations_deg: Vec::new(),
        options: DrawOptions { distance: 0.5, ..DrawOptions::default() },
    };
    let id = JobId::new();
    let payload = serde_json::to_value(payload).unwrap();
    let job = NewJob::new(id, DRAWING, payload, 3);
    service.store.enqueue(job).await.unwrap();
    let pool = workers(&service);
    let sheet = finished(&service, id).await;
    assert_eq!((&sheet["state"], &sheet["attempt"]), (&json!("failed"), &json!(1)));
    assert_eq!(sheet["failure"]["code"], "camera_inside_model");
    assert!(sheet["failure"]["detail"].as_str().unwrap().contains("fitted"), "{sheet}");
    assert_eq!(sheet["links"]["artifacts"], Value::Null);
    pool.shutdown(Duration::from_secs(20)).await;
}

#[tokio::test]
async fn one_kind_of_job_does_not_answer_for_the_other() {
    let service = Service::start().await;
    let (sheet, _) = queue(&service, builtin("cube")).await;
    let reconstruction = service.queue().await;
    let ids = |body: &Value, key: &str| -> Vec<String> {
        let jobs = body[key].as_array().unwrap();
        jobs.iter().map(|job| job["id"].as_str().unwrap().to_owned()).collect()
    };
    let sheets = json_at(&service, "/v1/sheets").await;
    assert_eq!(ids(&sheets, "sheets"), [sheet.to_string()]);
    let reconstructions = json_at(&service, "/v1/reconstructions").await;
    assert_eq!(ids(&reconstructions, "reconstructions"), [reconstruction.to_string()]);

    for (path, kind) in [
        (format!("/v1/sheets/{reconstruction}"), "unknown-sheet"),
        (format!("/v1/reconstructions/{sheet}"), "unknown-reconstruction"),
    ] {
        for below in ["", "/events", "/artifacts", "/artifacts/page.png"] {
            let response = service.get(&format!("{path}{below}")).send().await.unwrap();
            problem(response, 404, kind).await;
        }
        let waiting = service.get(&path).header("prefer", "wait=30").send();
        problem(waiting.await.unwrap(), 404, kind).await;
        problem(service.delete(&path).send().await.unwrap(), 404, kind).await;
        let cancel = service.post(&format!("{path}/cancel")).send().await.unwrap();
        problem(cancel, 404, kind).await;
    }
    let form = Form::new().text("source", sheet.to_string());
    problem(service.upload(form).await, 422, "unknown-source").await;
    assert_eq!(service.store.get(sheet).await.unwrap().version, 1);
    assert_eq!(service.store.get(reconstruction).await.unwrap().version, 1);
    for path in ["nonsense", "0191d6c1-7b1a-7c3e-8f00-0123456789ab", "%ff"] {
        let response = service.get(&format!("/v1/sheets/{path}")).send().await.unwrap();
        problem(response, 404, "unknown-sheet").await;
    }
}

#[tokio::test]
async fn the_list_goes_from_new_to_old_in_parts() {
    let service = Service::start().await;
    let (first, _) = queue(&service, builtin("cube")).await;
    let (second, _) = queue(&service, builtin("cone")).await;
    let response = service.get("/v1/sheets?limit=1").send().await.unwrap();
    let link = response.headers()["link"].to_str().unwrap().to_owned();
    let page: Value = response.json().await.unwrap();
    assert_eq!(page["sheets"][0]["id"], second.to_string());
    assert_eq!(page["sheets"][0]["model"], json!({"builtin": "cone"}));
    let next = page["next"].as_str().unwrap();
    assert!(next.starts_with("/v1/sheets?") && link.contains(next), "{next}");
    let page = json_at(&service, next).await;
    assert_eq!(
        (&page["sheets"][0]["id"], &page["next"]),
        (&first.to_string().into(), &Value::Null)
    );
    let running = json_at(&service, "/v1/sheets?state=running").await;
    assert_eq!(running["sheets"], json!([]));
    let response = service.get("/v1/sheets?limit=0").send().await.unwrap();
    problem(response, 400, "invalid-query").await;
}

#[tokio::test]
async fn a_sheet_is_followed_cancelled_and_deleted_like_a_reconstruction() {
    let service = Service::start().await;
    let (id, _) = queue(&service, builtin("cube")).await;
    let path = format!("/v1/sheets/{id}");
    let response = service.get(&path).send().await.unwrap();
    let etag = response.headers()["etag"].to_str().unwrap().to_owned();
    let known = || service.get(&path).header("if-none-match", &etag);
    assert_eq!(known().send().await.unwrap().status(), StatusCode::NOT_MODIFIED);
    let waiting = tokio::spawn(known().header("prefer", "wait=30").send());
    let events = tokio::spawn(service.get(&format!("{path}/events")).send());
    tokio::time::sleep(Duration::from_millis(100)).await;
    let (_, attempt) = service.claim().await;
    let changed: Value = waiting.await.unwrap().unwrap().json().await.unwrap();
    assert_eq!(changed["state"], "running");
    // Which cancels it, as asking for that does.
    let deleted = service.delete(&path).send().await.unwrap();
    assert_eq!(deleted.status(), StatusCode::ACCEPTED);
    let cancel = || service.post(&format!("{path}/cancel")).send();
    assert_eq!(cancel().await.unwrap().status(), StatusCode::ACCEPTED);
    service.store.cancelled(id, attempt).await.unwrap();
    let stream = events.await.unwrap().unwrap().text().await.unwrap();
    let kinds: Vec<_> = stream.lines().filter_map(|line| line.strip_prefix("event:")).collect();
    assert_eq!(
        kinds.iter().map(|kind| kind.trim()).collect::<Vec<_>>(),
        ["queued", "started", "cancel_requested", "cancelled"]
    );
    problem(cancel().await.unwrap(), 409, "already-finished").await;
    let missing = service.get(&format!("{path}/artifacts/page.png")).send().await.unwrap();
    let body = problem(missing, 404, "unknown-artifact").await;
    assert!(body["detail"].as_str().unwrap().contains("sheet"), "{body}");
    assert_eq!(service.delete(&path).send().await.unwrap().status(), StatusCode::NO_CONTENT);
    service.assert_nothing_stored().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_running_drawing_stops_when_cancelled() {
    let service = Service::start().await;
    let pool = workers(&service);
    let form = Form::new().text("model", "builtin:sphere").text("azimuths", "0:119:1");
    let form = form.text("width_px", "480").text("height_px", "270");
    let (id, _) = queue(&service, form).await;
    let path = format!("/v1/sheets/{id}");
    while json_at(&service, &path).await["progress"].is_null() {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let response = service.post(&format!("{path}/cancel")).send().await.unwrap();
    assert_eq!(response.status(), StatusCode::ACCEPTED);
    let sheet = finished(&service, id).await;
    assert_eq!(sheet["state"], "cancelled");
    assert!(sheet["progress"]["done"].as_u64().unwrap() < 120, "{sheet}");
    let key = Key::Artifact { job: id, attempt: 1, name: "view_000.png" };
    assert!(service.bytes.get(&key).await.is_err(), "files of a cancelled drawing stayed");
    pool.shutdown(Duration::from_secs(20)).await;
}

#[tokio::test]
async fn failures_are_told() {
    let service = Service::start().await;
    let (id, _) = queue(&service, builtin("cube")).await;
    let (_, attempt) = service.claim().await;
    let failure = Failure { code: "too_complex".into(), detail: "triangles hide others".into() };
    service.store.fail(id, attempt, failure).await.unwrap();
    let sheet = json_at(&service, &format!("/v1/sheets/{id}")).await;
    let expected = json!({"code": "too_complex", "detail": "triangles hide others"});
    assert_eq!((&sheet["state"], &sheet["failure"]), (&json!("failed"), &expected));
}

/// A glTF document with one triangle in a buffer at `uri`.
pub(super) fn gltf(uri: &str) -> Value {
    json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "buffers": [{"uri": uri, "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                       "min": [0, 0, 0], "max": [1, 1, 0]}],
    })
}

pub(super) fn triangle_uri(corners: [[f32; 3]; 3]) -> String {
    let bytes: Vec<u8> = corners.as_flattened().iter().flat_map(|c| c.to_le_bytes()).collect();
    format!("data:application/octet-stream;base64,{}", BASE64_STANDARD.encode(bytes))
}

/// Bow ties, a fan of three triangles at one edge, a loose triangle, one seen from its edge only:
/// nothing that is closed or has an inside, and all of it can be drawn.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn models_that_are_no_solids_are_drawn() {
    let service = Service::start().await;
    let pool = workers(&service);
    let obj = "v 0 0 0\nv 0 0 1\nv 1 0 0\nv -1 1 0\nv -1 -1 0\nv 0.5 0.5 2\nv 0.5 -0.5 2\nv 2 0 2\n\
               f 1 2 3\nf 1 2 4\nf 2 1 5\nf 1 2 3\nf 6 7 8\nf 1 4 5\n";
    let form = model(obj, "open.obj").text("azimuths", "0,90");
    let form = SMALL.into_iter().fold(form, |form, (option, value)| form.text(option, value));
    let (id, _) = queue(&service, form).await;
    assert_eq!(finished(&service, id).await["state"], "succeeded");
    let triangle = triangle_uri([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let form = model(gltf(&triangle).to_string(), "flat.gltf").text("azimuths", "0,90");
    let form = SMALL.into_iter().fold(form, |form, (option, value)| form.text(option, value));
    let (id, body) = queue(&service, form).await;
    assert_eq!(body["model"], json!({"file": "flat.gltf", "format": "gltf"}));
    assert_eq!(finished(&service, id).await["state"], "succeeded");
    pool.shutdown(Duration::from_secs(20)).await;
}

#[tokio::test]
async fn answers_are_as_described() {
    let service = Service::start().await;
    let (id, _) = queue(&service, builtin("cube")).await;
    let description = turnaround::http::openapi();
    let validator = |schema: &str| {
        let components = description["components"].clone();
        let root =
            json!({"components": components, "$ref": format!("#/components/schemas/{schema}")});
        jsonschema::draft202012::new(&root).unwrap()
    };
    for (path, schema) in
        [(format!("/v1/sheets/{id}"), "Sheet"), ("/v1/sheets".into(), "SheetList")]
    {
        let body = json_at(&service, &path).await;
        let validator = validator(schema);
        let errors: Vec<_> = validator.iter_errors(&body).map(|e| e.to_string()).collect();
        assert!(errors.is_empty(), "{errors:?} in {body}");
    }
    let schemas = &description["components"]["schemas"];
    let errors = |schema: &str, value: &Value| {
        validator(schema).iter_errors(value).map(|e| e.to_string()).collect::<Vec<_>>()
    };
    let example = &schemas["Sheet"]["example"];
    assert!(example.is_object());
    assert_eq!(errors("Sheet", example), [""; 0]);
    let form = &description["paths"]["/v1/sheets"]["post"]["requestBody"]["content"]["multipart/form-data"];
    for example in form["examples"].as_object().unwrap().values() {
        let value = &example["value"];
        assert_eq!(errors("ModelUpload", value), [""; 0], "{value}");
        // The examples do what they say.
        let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        let parts = value.as_object().unwrap().iter();
        let form =
            parts.fold(Form::new(), |form, (part, value)| form.text(part.clone(), text(value)));
        queue(&service, form).await;
    }
}
