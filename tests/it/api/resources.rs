//! Reconstructions from upload to deletion, over a real socket.

use std::time::{Duration, Instant};

use crate::api::harness::{LEASE, Service, drawing, encode, file, problem, views};
use image::ImageFormat;
use jobs::{Failure, JobId, JobStore};
use reqwest::header::HeaderMap;
use reqwest::multipart::Form;
use reqwest::{Response, StatusCode};
use serde_json::{Value, json};
use sheet::SheetDocument;
use turnaround::draft::options::{Method, Options};
use turnaround::kinds::ReconstructionPayload;

async fn body(response: Response) -> Value {
    assert!(response.status().is_success(), "{}", response.status());
    response.json().await.unwrap()
}

fn text<'h>(headers: &'h HeaderMap, name: &str) -> &'h str {
    headers.get(name).unwrap_or_else(|| panic!("no {name}")).to_str().unwrap()
}

async fn payload(service: &Service, id: JobId) -> SheetDocument {
    let job = service.store.get(id).await.unwrap();
    assert_eq!(job.kind, "reconstruction");
    serde_json::from_value::<ReconstructionPayload>(job.payload).unwrap().document
}

async fn accepted(response: Response) -> JobId {
    assert_eq!(response.status(), StatusCode::ACCEPTED);
    body(response).await["id"].as_str().unwrap().parse().unwrap()
}

#[tokio::test]
async fn views_named_by_azimuth_become_a_durable_job() {
    let service = Service::start().await;
    let [front, quarter, side, mask] = [0, 1, 2, 3].map(|seed| drawing(32, 24, seed));
    let side_jpeg = encode(32, 24, 2, ImageFormat::Jpeg);
    let form = Form::new()
        .part("mask[-45]", file(mask.clone(), "m.png"))
        .part("view[90]", file(side_jpeg.clone(), "side.jpg"))
        .part("view[360]", file(front.clone(), "front.png"))
        .part("view[-45]", file(quarter.clone(), "quarter.png"))
        .text("options", json!({"disparity": {"block_size": 21, "p1": 7}}).to_string())
        .text("disparity.block_size", "15")
        .text("method", "uncalibrated");
    drop(side);
    let response = service.upload(form).await;
    assert_eq!(response.status(), StatusCode::ACCEPTED);
    assert_eq!(text(response.headers(), "retry-after"), "1");
    let location = text(response.headers(), "location").to_owned();
    let answer = body(response).await;
    assert_eq!(answer["links"]["self"], location);
    assert_eq!(answer["state"], "queued");
    assert_eq!(answer["method"], "uncalibrated");
    let angles: Vec<_> = answer["views"].as_array().unwrap().iter().collect();
    assert_eq!(
        angles,
        [
            &json!({"azimuth_deg": 0.0, "elevation_deg": 0.0, "mask": false, "truth": false}),
            &json!({"azimuth_deg": 90.0, "elevation_deg": 0.0, "mask": false, "truth": false}),
            &json!({"azimuth_deg": 315.0, "elevation_deg": 0.0, "mask": true, "truth": false}),
        ]
    );

    let id: JobId = answer["id"].as_str().unwrap().parse().unwrap();
    let document = payload(&service, id).await;
    let names: Vec<_> = document.views.iter().map(|view| view.image.as_str()).collect();
    assert_eq!(names, ["views/0.png", "views/90.jpg", "views/315.png"]);
    assert_eq!(document.views[2].mask.as_deref(), Some("masks/315.png"));
    assert_eq!((document.width, document.height), (Some(32), Some(24)));
    let mut expected = Options { method: Method::Uncalibrated, ..Options::default() };
    expected.disparity.block_size = 15;
    expected.disparity.p1 = 7;
    assert_eq!(document.options, Some(serde_json::to_value(expected).unwrap()));
    let inputs = service
        .stored_inputs(id, &["views/0.png", "views/90.jpg", "views/315.png", "masks/315.png"]);
    assert_eq!(inputs.await, [front, side_jpeg, quarter, mask]);
}

#[tokio::test]
async fn a_sheet_document_places_its_files() {
    let service = Service::start().await;
    let sheet = json!({
        "name": "cube", "width": 960, "height": 540, "pixels_per_unit": 131.5,
        "elevation_deg": 5,
        "views": [
            {"image": "front.png", "azimuth_deg": 0, "elevation_deg": 0, "depth": "depth_000.png"},
            {"image": "drawings/side.png", "azimuth_deg": 90, "elevation_deg": 0, "mask": "side_mask.png"},
            {"image": "quarter.png", "azimuth_deg": 22.5},
        ],
        "truth": {"model": "model.obj"},
        "options": {"seed": 7, "cloud": {"stride_px": 4}},
    });
    let form = Form::new()
        .part("image", file(drawing(32, 24, 0), "front.png"))
        .part("mask", file(drawing(32, 24, 3), "side_mask.png"))
        .part("quarter.png", file(drawing(32, 24, 2), "whatever.png"))
        .part("sheet", file(sheet.to_string().into_bytes(), "sheet.json"))
        .part("image", file(drawing(32, 24, 1), "side.png"))
        .text("seed", "8");
    let id = accepted(service.upload(form).await).await;
    let document = payload(&service, id).await;
    assert_eq!(document.name.as_deref(), Some("cube"));
    assert_eq!((document.width, document.pixels_per_unit), (Some(32), Some(131.5)));
    assert_eq!(document.truth, None);
    let views: Vec<_> = document
        .views
        .iter()
        .map(|v| (v.image.as_str(), v.azimuth_deg, v.elevation_deg, v.mask.as_deref()))
        .collect();
    assert_eq!(
        views,
        [
            ("views/0.png", 0.0, Some(0.0), None),
            ("views/22.5_e5.png", 22.5, Some(5.0), None),
            ("views/90.png", 90.0, Some(0.0), Some("masks/90.png")),
        ]
    );
    let options = document.options.unwrap();
    assert_eq!((&options["seed"], &options["cloud"]["stride_px"]), (&json!(8), &json!(4)));
    let stored = service.stored_inputs(id, &["views/22.5_e5.png", "masks/90.png"]).await;
    assert_eq!(stored, [drawing(32, 24, 2), drawing(32, 24, 3)]);
}

#[tokio::test]
async fn an_earlier_job_is_a_source_of_views_and_options() {
    let service = Service::start().await;
    let form = views(&["0", "45", "90"]).text("seed", "5").text("cloud.stride_px", "3");
    let first = accepted(service.upload(form).await).await;
    let form = Form::new().text("source", first.to_string()).text("cloud.stride_px", "2");
    let again = body(service.upload(form).await).await;
    assert_eq!(again["source"], first.to_string());
    assert_eq!(
        (&again["options"]["seed"], &again["options"]["cloud"]["stride_px"]),
        (&json!(5), &json!(2))
    );
    let second: JobId = again["id"].as_str().unwrap().parse().unwrap();
    let deleted = service.delete(&format!("/v1/reconstructions/{first}")).send().await.unwrap();
    assert_eq!(deleted.status(), StatusCode::NO_CONTENT);
    let names = ["views/0.png", "views/45.png", "views/90.png"];
    let inputs = service.stored_inputs(second, &names).await;
    assert_eq!(inputs, [0, 1, 2].map(|seed| drawing(32, 24, seed)));
    let mixed = views(&["0", "45", "90"]).text("source", second.to_string());
    problem(service.upload(mixed).await, 422, "conflicting-parts").await;
}

#[tokio::test]
async fn the_list_goes_from_new_to_old_in_parts() {
    let service = Service::start().await;
    let mut ids = Vec::new();
    for _ in 0..3 {
        ids.push(service.queue().await.to_string());
    }
    ids.reverse();
    service.claim().await;
    let found = |value: &Value| -> Vec<String> {
        let jobs = value["reconstructions"].as_array().unwrap();
        jobs.iter().map(|job| job["id"].as_str().unwrap().to_owned()).collect()
    };
    let response = service.get("/v1/reconstructions?limit=2").send().await.unwrap();
    let link = text(response.headers(), "link").to_owned();
    let page = body(response).await;
    assert_eq!(found(&page), ids[..2]);
    let next = page["next"].as_str().unwrap();
    assert_eq!(link, format!("<{next}>; rel=\"next\""));
    let response = service.get(next).send().await.unwrap();
    assert!(!response.headers().contains_key("link"));
    let page = body(response).await;
    assert_eq!(found(&page), ids[2..]);
    assert_eq!(page["next"], Value::Null);
    let running =
        body(service.get("/v1/reconstructions?state=running").send().await.unwrap()).await;
    assert_eq!(found(&running), ids[2..]);
    for query in ["limit=0", "limit=101", "limit=x", "state=lost", "cursor=x", "colour=red"] {
        let path = format!("/v1/reconstructions?{query}");
        problem(service.get(&path).send().await.unwrap(), 400, "invalid-query").await;
    }
}

#[tokio::test]
async fn etags_follow_the_version() {
    let service = Service::start().await;
    let id = service.queue().await;
    let path = format!("/v1/reconstructions/{id}");
    let response = service.get(&path).send().await.unwrap();
    let etag = text(response.headers(), "etag").to_owned();
    let request = || service.get(&path).header("if-none-match", &etag);
    let response = request().send().await.unwrap();
    assert_eq!(response.status(), StatusCode::NOT_MODIFIED);
    assert_eq!(text(response.headers(), "etag"), etag);
    service.claim().await;
    let response = request().send().await.unwrap();
    assert_ne!(text(response.headers(), "etag"), etag);
    assert_eq!(body(response).await["state"], "running");
}

#[tokio::test]
async fn long_polls_end_with_the_job_or_the_wait() {
    let service = Service::start().await;
    let id = service.queue().await;
    let path = format!("/v1/reconstructions/{id}");
    let begun = Instant::now();
    let response = service.get(&path).header("prefer", "wait=1").send().await.unwrap();
    assert!(begun.elapsed() >= Duration::from_secs(1));
    assert_eq!(text(response.headers(), "preference-applied"), "wait=1");
    let etag = text(response.headers(), "etag").to_owned();
    assert_eq!(body(response).await["state"], "queued");

    let wait = |known: Option<String>| {
        let request = service.get(&path).header("prefer", "wait=30");
        let request = match known {
            Some(etag) => request.header("if-none-match", etag),
            None => request,
        };
        tokio::spawn(request.send())
    };
    let [changed, finished] = [wait(Some(etag)), wait(None)];
    tokio::time::sleep(Duration::from_millis(200)).await;
    let (_, attempt) = service.claim().await;
    let changed = body(changed.await.unwrap().unwrap()).await;
    assert_eq!(changed["state"], "running");
    assert!(!finished.is_finished());
    let begun = Instant::now();
    service.succeed(id, attempt, &[]).await;
    let finished = body(finished.await.unwrap().unwrap()).await;
    assert_eq!(finished["state"], "succeeded");
    assert!(begun.elapsed() < Duration::from_secs(5));
}

/// Number, kind and data of each event in the stream.
fn parse_events(stream: &str) -> Vec<(u64, String, Value)> {
    let field = |block: &str, name: &str| {
        let line = block.lines().find_map(|line| line.strip_prefix(name));
        line.map(|value| value.trim().to_owned())
    };
    let parse = |block: &str| {
        let data = serde_json::from_str(&field(block, "data:")?).unwrap();
        Some((field(block, "id:")?.parse().ok()?, field(block, "event:")?, data))
    };
    stream.split("\n\n").filter_map(parse).collect()
}

#[tokio::test]
async fn events_can_be_followed_and_resumed() {
    let service = Service::start().await;
    let id = service.queue().await;
    let path = format!("/v1/reconstructions/{id}/events");
    let followed = tokio::spawn({
        let request = service.get(&path);
        async move {
            let response = request.send().await.unwrap();
            assert_eq!(response.headers()["content-type"], "text/event-stream");
            response.text().await.unwrap()
        }
    });
    let (_, attempt) = service.claim().await;
    let progress = json!({"stage": "pairs", "done": 1, "total": 2, "fraction": 0.5});
    service.store.progress(id, attempt, progress.clone()).await.unwrap();
    let failure = Failure { code: "no_usable_pair".into(), detail: "too few matches".into() };
    service.store.fail(id, attempt, failure).await.unwrap();

    let events = parse_events(&followed.await.unwrap());
    let kinds: Vec<_> = events.iter().map(|(number, kind, _)| (*number, kind.as_str())).collect();
    assert_eq!(kinds, [(1, "queued"), (2, "started"), (3, "progress"), (4, "failed")]);
    assert_eq!(events[2].2["number"], 3);
    let resumed = service.get(&path).header("last-event-id", "2").send().await.unwrap();
    assert_eq!(parse_events(&resumed.text().await.unwrap()), events[2..]);
    let over = service.get(&path).header("last-event-id", "4").send().await.unwrap();
    assert_eq!(over.status(), StatusCode::NO_CONTENT);

    let job = body(service.get(&format!("/v1/reconstructions/{id}")).send().await.unwrap()).await;
    assert_eq!(job["failure"], json!({"code": "no_usable_pair", "detail": "too few matches"}));
    assert_eq!(job["progress"], progress);
    assert_eq!(job["links"]["artifacts"], Value::Null);
}

#[tokio::test]
async fn shutting_down_ends_event_streams_and_long_polls() {
    let service = Service::start().await;
    let id = service.queue().await;
    let path = format!("/v1/reconstructions/{id}");
    let events = tokio::spawn(service.get(&format!("{path}/events")).send());
    let poll = tokio::spawn(service.get(&path).header("prefer", "wait=60").send());
    let events = events.await.unwrap().unwrap();
    tokio::time::sleep(Duration::from_millis(100)).await;
    let begun = Instant::now();
    service.shutdown.cancel();
    assert_eq!(poll.await.unwrap().unwrap().status(), StatusCode::OK);
    assert_eq!(parse_events(&events.text().await.unwrap()).len(), 1);
    assert!(begun.elapsed() < Duration::from_secs(5));
}

#[tokio::test]
async fn cancelling() {
    let service = Service::start().await;
    let queued = service.queue().await;
    let cancel = |id: JobId| service.post(&format!("/v1/reconstructions/{id}/cancel")).send();
    let response = cancel(queued).await.unwrap();
    assert_eq!(response.status(), StatusCode::OK);
    assert_eq!(body(response).await["state"], "cancelled");
    problem(cancel(queued).await.unwrap(), 409, "already-finished").await;

    let running = service.queue().await;
    let (_, attempt) = service.claim().await;
    let response = cancel(running).await.unwrap();
    assert_eq!(response.status(), StatusCode::ACCEPTED);
    let job = body(response).await;
    assert_eq!((&job["state"], &job["cancel_requested"]), (&json!("running"), &json!(true)));
    let beat = service.store.heartbeat(running, attempt, LEASE).await.unwrap();
    assert_eq!(beat, jobs::Heartbeat::Held { cancel_requested: true });
    problem(cancel(JobId::new()).await.unwrap(), 404, "unknown-reconstruction").await;
}

#[tokio::test]
async fn deleting_takes_the_bytes_too() {
    let service = Service::start().await;
    let id = service.queue().await;
    let path = format!("/v1/reconstructions/{id}");
    let (_, attempt) = service.claim().await;
    service.succeed(id, attempt, &[("hull.glb", "model/gltf-binary", vec![1, 2, 3])]).await;
    let response = service.delete(&path).send().await.unwrap();
    assert_eq!(response.status(), StatusCode::NO_CONTENT);
    service.assert_nothing_stored().await;
    problem(service.get(&path).send().await.unwrap(), 404, "unknown-reconstruction").await;
    problem(service.delete(&path).send().await.unwrap(), 404, "unknown-reconstruction").await;
}

#[tokio::test]
async fn what_is_no_id_names_no_reconstruction() {
    let service = Service::start().await;
    for path in ["nonsense", "0191d6c1-7b1a-7c3e-8f00-0123456789ab", "%ff"] {
        for below in ["", "/events", "/metrics", "/artifacts"] {
            let path = format!("/v1/reconstructions/{path}{below}");
            problem(service.get(&path).send().await.unwrap(), 404, "unknown-reconstruction").await;
        }
    }
}

/// As generated clients send them, whose parts have names known beforehand.
#[tokio::test]
async fn views_with_azimuths_beside_them_become_the_same_job() {
    let service = Service::start().await;
    let drawings = [drawing(32, 24, 0), drawing(32, 24, 1), drawing(32, 24, 2)];
    let form = |azimuths: &[&str]| {
        let form = drawings.iter().fold(Form::new(), |form, drawing| {
            form.part("view", file(drawing.clone(), "drawing.png"))
        });
        azimuths.iter().fold(form, |form, azimuth| form.text("azimuth_deg", azimuth.to_string()))
    };
    for azimuths in [["22.5", "0", "90"].as_slice(), &["22.5, 0, 90"], &["[22.5,0,90]"]] {
        let response = service.upload(form(azimuths)).await;
        assert_eq!(response.status(), StatusCode::ACCEPTED);
        let job: Value = response.json().await.unwrap();
        let angles: Vec<_> = job["views"].as_array().unwrap().iter().collect();
        assert_eq!(
            angles.iter().map(|view| &view["azimuth_deg"]).collect::<Vec<_>>(),
            [0.0, 22.5, 90.0]
        );
        let id = job["id"].as_str().unwrap().parse().unwrap();
        let stored = service.stored_inputs(id, &["views/22.5.png", "views/0.png"]).await;
        assert_eq!(stored, drawings[..2]);
    }
    let body = problem(service.upload(form(&["0", "45"])).await, 422, "missing-part").await;
    assert_eq!(body["part"], "azimuth_deg");
    problem(service.upload(form(&["0", "45", "360"])).await, 422, "duplicate-azimuth").await;
    problem(service.upload(form(&["0", "left", "90"])).await, 422, "invalid-angle").await;
}
