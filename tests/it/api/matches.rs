//! Corrected matches: uploads that bring them, from the service's outside.

use crate::api::harness::{Service, drawing, file, problem, views};
use jobs::{JobId, JobStore};
use reqwest::multipart::Form;
use reqwest::{Response, StatusCode};
use serde_json::{Value, json};
use sheet::{PairMatchesDocument, SheetDocument};
use turnaround::kinds::{MATCHES_INPUT, ReconstructionPayload};

async fn accepted(response: Response) -> JobId {
    assert_eq!(response.status(), StatusCode::ACCEPTED, "{}", response.text().await.unwrap());
    let body: Value = response.json().await.unwrap();
    body["id"].as_str().unwrap().parse().unwrap()
}

async fn stored(service: &Service, id: JobId) -> SheetDocument {
    let job = service.store.get(id).await.unwrap();
    let payload: ReconstructionPayload = serde_json::from_value(job.payload).unwrap();
    let mut document = payload.document;
    assert!(document.matches.is_empty(), "matches are in the row, which every status reads");
    if payload.has_matches {
        let stored = &service.stored_inputs(id, &[MATCHES_INPUT]).await[0];
        document.matches = serde_json::from_slice(stored).unwrap();
    }
    document
}

fn pair(left: f64, right: f64, extra: Value) -> Value {
    let mut pair = json!({"left_azimuth_deg": left, "right_azimuth_deg": right});
    pair.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
    pair
}

/// As the artifact has them: views are 32x24.
fn served(x: f64) -> Value {
    let found = json!({"left": [x, 3.5], "right": [x + 1.0, 3.5], "distance": 7.0, "inlier": true});
    json!({"frame": "sheet pixels, x right, y down, pixel centres at half integers",
        "matches": [found]})
}

fn sheet_form(matches: Value) -> Form {
    let views = [("a.png", 0.0), ("b.png", 10.0), ("c.png", 20.0)];
    let listed: Vec<_> = views
        .iter()
        .map(|(image, azimuth_deg)| json!({"image": image, "azimuth_deg": azimuth_deg}))
        .collect();
    let sheet = json!({"views": listed, "matches": matches});
    let form = Form::new().text("sheet", sheet.to_string());
    views.iter().fold(form, |form, (name, _)| form.part("image", file(drawing(32, 24, 1), name)))
}

fn view_form(matches: &Value) -> Form {
    views(&["0", "10", "20"]).part("matches", file(matches.to_string().into_bytes(), "m.json"))
}

fn first_x(documents: &[PairMatchesDocument]) -> Vec<f64> {
    documents.iter().map(|pair| pair.matches.as_ref().unwrap()[0].left[0]).collect()
}

#[tokio::test]
async fn a_sheet_or_a_part_brings_matches_and_a_rerun_corrects_them() {
    let service = Service::start().await;
    let in_sheet = sheet_form(json!([pair(0.0, 10.0, served(1.5)), pair(10.0, 20.0, served(2.5))]));
    let first = accepted(service.upload(in_sheet).await).await;
    assert_eq!(first_x(&stored(&service, first).await.matches), [1.5, 2.5]);

    // What a client got as an artifact and changed.
    let corrected = pair(10.0, 380.0, served(9.5)).to_string();
    let again = Form::new()
        .text("source", first.to_string())
        .part("matches", file(corrected.into_bytes(), "matches.json"));
    let second = accepted(service.upload(again).await).await;
    assert_eq!(first_x(&stored(&service, second).await.matches), [1.5, 9.5]);

    let pairs = json!([pair(0.0, 10.0, served(4.5))]);
    let third = accepted(service.upload(view_form(&pairs)).await).await;
    let changes = stored(&service, third).await.matches;
    assert_eq!(first_x(&changes), [4.5]);
}

#[tokio::test]
async fn changes_of_matches_are_kept_as_given() {
    let service = Service::start().await;
    let given = json!({"left": [0, 0], "right": [32, 24]});
    let both = pair(0.0, 10.0, json!({"add": [given], "remove": [given, given]}));
    let id = accepted(service.upload(view_form(&both)).await).await;
    let kept = &stored(&service, id).await.matches[0];
    assert_eq!((kept.matches.is_none(), kept.add.len(), kept.remove.len()), (true, 1, 2));
    assert_eq!(kept.add[0].right, [32.0, 24.0]);
}

#[tokio::test]
async fn matches_that_cannot_be_used_are_refused_with_their_place() {
    let service = Service::start().await;
    let outside = json!({"left": [1, 2], "right": [32.5, 2]});
    let many = vec![json!({"left": [1, 2], "right": [3, 4]}); 10_001];
    for (matches, told) in [
        (pair(10.0, 0.0, served(1.5)), "the pairs are 0-10, 10-20, 20-0"),
        (pair(0.0, 20.0, served(1.5)), "no neighbours"),
        (pair(0.0, 45.0, served(1.5)), "no neighbours"),
        (pair(20.0, 0.0, served(1.5)), "340 degrees apart"),
        (pair(0.0, 10.0, json!({"add": [outside]})), "matches[0].add[0].right is (32.5, 2)"),
        (pair(0.0, 10.0, json!({})), "says nothing"),
        (pair(0.0, 10.0, json!({"matches": [], "add": [many[0]]})), "has both"),
        (pair(0.0, 10.0, json!({"matches": many})), "over the limit of 10000"),
        (pair(0.0, 10.0, json!({"matches": [{"left": [1, 2]}]})), "missing field `right`"),
        (pair(0.0, 10.0, json!({"moved": []})), "unknown field `moved`"),
        (pair(0.0, 10.0, json!({"matches": [], "frame": "mm"})), "coordinates are taken as"),
        (json!([pair(0.0, 10.0, served(1.5)), pair(360.0, 10.0, served(1.5))]), "same pair"),
        (json!(7), "invalid type: integer `7`"),
    ] {
        let response = service.upload(view_form(&matches)).await;
        let body = problem(response, 422, "invalid-sheet").await;
        assert_eq!(body["part"], "matches", "{body}");
        assert!(body["detail"].as_str().unwrap().contains(told), "{told}: {body}");
    }
    let response = service.upload(sheet_form(json!([pair(0.0, 90.0, served(1.5))]))).await;
    problem(response, 422, "invalid-sheet").await;
    service.assert_nothing_stored().await;
}

#[tokio::test]
async fn a_rerun_with_a_wrong_pair_is_refused() {
    let service = Service::start().await;
    let first = accepted(service.upload(views(&["0", "10", "20"])).await).await;
    let wrong = pair(0.0, 20.0, served(1.5)).to_string();
    let form = Form::new().text("source", first.to_string()).text("matches", wrong);
    let body = problem(service.upload(form).await, 422, "invalid-sheet").await;
    assert!(body["detail"].as_str().unwrap().contains("0-10, 10-20, 20-0"), "{body}");
    // Views farther apart than the options of this run pair.
    let form = Form::new()
        .text("source", first.to_string())
        .text("matches", pair(0.0, 10.0, served(1.5)).to_string())
        .text("max_pair_angle_deg", "5");
    let body = problem(service.upload(form).await, 422, "invalid-sheet").await;
    assert!(body["detail"].as_str().unwrap().contains("max_pair_angle_deg is 5"), "{body}");
}
