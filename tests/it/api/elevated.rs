//! Views from above and below: named by azimuth and elevation, drawn, reconstructed, refused.

use crate::api::harness::{Service, drawing, file, problem, views};
use crate::api::sheets::{json_at, queue};
use reqwest::multipart::Form;
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::Duration;
use tokio::runtime::Handle;
use turnaround::worker::jobs::{Draw, Reconstruct};
use turnaround::worker::{Pool, Work, WorkerConfig};

async fn refused(form: Form, name: &str) -> Value {
    let service = Service::start().await;
    let body = problem(service.upload(form).await, 422, name).await;
    service.assert_nothing_stored().await;
    body
}

fn detail(body: &Value) -> &str {
    body["detail"].as_str().unwrap()
}

#[tokio::test]
async fn a_view_is_told_by_azimuth_and_elevation() {
    let service = Service::start().await;
    let mask = file(drawing(32, 24, 9), "mask.png");
    let form = views(&["0", "90", "0,90", "45.5,-30"]).part("mask[0,90]", mask);
    let response = service.upload(form).await;
    assert_eq!(response.status(), 202);
    let body: Value = response.json().await.unwrap();
    let angles: Vec<_> = body["views"]
        .as_array()
        .unwrap()
        .iter()
        .map(|view| [&view["azimuth_deg"], &view["elevation_deg"], &view["mask"]])
        .collect();
    let no = json!(false);
    assert_eq!(
        angles,
        [
            [&json!(0.0), &json!(0.0), &no],
            [&json!(0.0), &json!(90.0), &json!(true)],
            [&json!(45.5), &json!(-30.0), &no],
            [&json!(90.0), &json!(0.0), &no],
        ]
    );
    let id = body["id"].as_str().unwrap().parse().unwrap();
    let names = ["views/0.png", "views/0_e90.png", "views/45.5_e-30.png", "masks/0_e90.png"];
    let stored = service.stored_inputs(id, &names).await;
    assert_eq!(stored, [0, 2, 3, 9].map(|seed| drawing(32, 24, seed)));
    // A job that runs again on these views keeps their elevations.
    let again = service.upload(Form::new().text("source", id.to_string())).await;
    assert_eq!(again.status(), 202);
    let again: Value = again.json().await.unwrap();
    assert_eq!(again["views"], body["views"]);
}

#[tokio::test]
async fn loose_views_bring_their_elevations_along() {
    let loose = |elevations: &[&str]| {
        let mut form = Form::new();
        for (seed, azimuth) in ["0", "90", "0"].iter().enumerate() {
            form = form
                .part("view", file(drawing(32, 24, seed as u32), "view.png"))
                .text("azimuth_deg", (*azimuth).to_owned());
        }
        elevations
            .iter()
            .fold(form, |form, elevation| form.text("elevation_deg", (*elevation).to_owned()))
    };
    let service = Service::start().await;
    for elevations in [&["0", "0", "90"][..], &["[0, 0, 90]"]] {
        let response = service.upload(loose(elevations)).await;
        assert_eq!(response.status(), 202);
        let body: Value = response.json().await.unwrap();
        assert_eq!(body["views"][1]["elevation_deg"], 90.0);
    }
    let body = refused(loose(&["0", "90"]), "missing-part").await;
    assert!(detail(&body).contains("2 elevations"), "{body}");
    assert_eq!(body["part"], "elevation_deg");
    refused(loose(&["0", "0", "91"]), "invalid-angle").await;
}

#[tokio::test]
async fn angles_that_are_none_or_the_same() {
    for angles in ["0,91", "0,-90.5", "0,up", "0,", "0,nan", "0,1,2", ",30"] {
        let body = refused(views(&["0", "90", angles]), "invalid-angle").await;
        assert_eq!(body["part"], format!("view[{angles}]"));
    }
    let body = refused(views(&["0", "90", "0,30", "360,30"]), "duplicate-azimuth").await;
    assert!(detail(&body).contains("azimuth 0, elevation 30"), "{body}");
    // Straight from above an azimuth only turns the picture.
    let body = refused(views(&["0", "90", "0,90", "45,90"]), "duplicate-azimuth").await;
    assert!(detail(&body).contains("turns the picture"), "{body}");
    let sheet = json!({"views": [
        {"image": "a.png", "azimuth_deg": 0},
        {"image": "b.png", "azimuth_deg": 90},
        {"image": "c.png", "azimuth_deg": 0, "elevation_deg": -90},
        {"image": "d.png", "azimuth_deg": 90, "elevation_deg": -90},
    ]});
    let form = ["a.png", "b.png", "c.png", "d.png"]
        .iter()
        .fold(Form::new().text("sheet", sheet.to_string()), |form, name| {
            form.part("image", file(drawing(32, 24, 1), name))
        });
    let body = refused(form, "duplicate-azimuth").await;
    assert!(detail(&body).contains("views[2] and views[3]"), "{body}");
    let orphan = views(&["0", "90"]).part("mask[0,90]", file(drawing(32, 24, 1), "m.png"));
    let body = refused(orphan, "missing-part").await;
    assert!(detail(&body).contains("`view[0,90]`"), "{body}");
}

#[tokio::test]
async fn combinations_that_make_no_solid() {
    for angles in [&["0,90", "90,30"][..], &["0", "0,90", "45,30"], &["0,0", "0,-90"]] {
        let body = refused(views(angles), "too-few-views").await;
        assert!(detail(&body).contains("level views"), "{body}");
    }
    let uncalibrated = views(&["0", "10", "20", "10,30"]).text("method", "uncalibrated");
    let body = refused(uncalibrated, "elevated-view").await;
    assert!(detail(&body).contains("elevation 30"), "{body}");
    // All at one elevation are no better.
    let sheet = json!({"elevation_deg": 20, "views": [
        {"image": "a.png", "azimuth_deg": 0}, {"image": "b.png", "azimuth_deg": 90},
    ]});
    let form = Form::new()
        .text("sheet", sheet.to_string())
        .part("image", file(drawing(32, 24, 1), "a.png"))
        .part("image", file(drawing(32, 24, 2), "b.png"));
    let body = refused(form, "too-few-views").await;
    assert_eq!(body["part"], "sheet");
}

/// Waits until a job at `path` has ended.
async fn finished_at(service: &Service, path: &str) -> Value {
    for _ in 0..5 {
        let response = service.get(path).header("prefer", "wait=60").send().await.unwrap();
        let body: Value = response.json().await.unwrap();
        if body["finished_at"].is_string() {
            return body;
        }
    }
    panic!("{path} does not finish");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_sheet_with_a_top_view_is_drawn_and_reconstructed() {
    let service = Service::start().await;
    let config = WorkerConfig { threads_per_job: 2, ..WorkerConfig::default() };
    let works: Vec<Arc<dyn Work>> =
        vec![Arc::new(Draw::default()), Arc::new(Reconstruct::default())];
    let (store, bytes) = (service.store.clone(), service.bytes.clone());
    let pool = Pool::start(config, store, bytes, works, &Handle::current()).unwrap();
    let form = Form::new()
        .text("model", "builtin:torus_flat")
        .text("azimuths", "0,90,0@90,45@-30")
        .text("width_px", "240")
        .text("height_px", "180")
        .text("fit", "true");
    let (id, answer) = queue(&service, form).await;
    assert_eq!(answer["azimuths_deg"], json!([0.0, 0.0, 45.0, 90.0]));
    assert_eq!(answer["elevations_deg"], json!([0.0, 90.0, -30.0, 0.0]));
    let sheet = finished_at(&service, &format!("/v1/sheets/{id}")).await;
    assert_eq!(sheet["state"], "succeeded", "{sheet}");
    let artifact = async |path: String| {
        let response = service.get(&path).send().await.unwrap();
        assert_eq!(response.status(), 200, "{path}");
        response.bytes().await.unwrap().to_vec()
    };
    let of_sheet = |name: &str| artifact(format!("/v1/sheets/{id}/artifacts/{name}"));
    let document: Value = serde_json::from_slice(&of_sheet("sheet.json").await).unwrap();
    let mut form = Form::new().text("sheet", document.to_string());
    for view in document["views"].as_array().unwrap() {
        for key in ["image", "depth"] {
            let name = view[key].as_str().unwrap();
            form = form.part("image", file(of_sheet(name).await, name));
        }
    }
    let form = form
        .part("model.obj", file(of_sheet("model.obj").await, "model.obj"))
        .text("turntable.solid.resolution", "96")
        .text("evaluation.grid_cells", "64")
        .text("evaluation.samples", "2000");
    let response = service.upload(form).await;
    assert_eq!(response.status(), 202);
    let body: Value = response.json().await.unwrap();
    let job = body["links"]["self"].as_str().unwrap().to_owned();
    let done = finished_at(&service, &job).await;
    assert_eq!(done["state"], "succeeded", "{done}");
    let fit = done["summary"]["fit"].as_array().unwrap();
    let elevations: Vec<_> =
        fit.iter().map(|view| view["elevation_deg"].as_f64().unwrap()).collect();
    assert_eq!(elevations, [0.0, 0.0, 90.0, -30.0]);
    assert!(fit.iter().all(|view| view["silhouette_iou"].as_f64().unwrap() > 0.85), "{done}");
    let list = json_at(&service, done["links"]["artifacts"].as_str().unwrap()).await;
    let names: Vec<&str> =
        list["artifacts"].as_array().unwrap().iter().map(|a| a["name"].as_str().unwrap()).collect();
    for name in [
        "views/0/fit.png",
        "views/0_e90/fit.png",
        "views/45_e-30/depth.pfm",
        "views/0_e90/silhouette.png",
    ] {
        assert!(names.contains(&name), "{name} in {names:?}");
    }
    let metrics = json_at(&service, &format!("{job}/artifacts/metrics.json")).await;
    let cuts = metrics["solid"]["cuts"].as_array().unwrap();
    assert_eq!(cuts.len(), 2);
    assert!(cuts.iter().all(|cut| cut["used"] == json!(true)), "{cuts:?}");
    let truths = metrics["truth"]["views"].as_array().unwrap();
    let top = truths.iter().find(|view| view["elevation_deg"] == json!(90.0)).unwrap();
    // A ring whose hole line art does not show: its rim's depth is right nevertheless.
    assert!(top["silhouette"]["iou"].as_f64().unwrap() > 0.75, "{top}");
    assert!(metrics["truth"]["model"]["iou"].as_f64().unwrap() > 0.6, "{}", metrics["truth"]);
    pool.shutdown(Duration::from_secs(20)).await;
}
