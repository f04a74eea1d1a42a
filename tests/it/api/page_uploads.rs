//! A page in an upload: its figures become the views of the sheet, or a problem
//! says why they do not.

use std::io::Cursor;

use crate::api::harness::{Service, drawing, file, problem};
use image::{GrayImage, ImageFormat, Luma};
use jobs::{JobId, JobStore};
use reqwest::multipart::Form;
use serde_json::Value;
use sheet::SheetDocument;
use turnaround::kinds::ReconstructionPayload;

/// A page with `count` figures of head, trunk and two legs.
pub(crate) fn page(count: u32) -> Vec<u8> {
    let page = GrayImage::from_fn(120 + 150 * count, 320, |x, y| {
        let (figure, x) = (x.saturating_sub(60) / 150, x.saturating_sub(60) % 150);
        let head = (60..90).contains(&x) && (50..90).contains(&y);
        let trunk = (40..110).contains(&x) && (90..190).contains(&y);
        let legs = ((48..68).contains(&x) || (82..102).contains(&x)) && (190..280).contains(&y);
        let face = figure == 0 && (66..84).contains(&x) && (64..70).contains(&y);
        let inside = figure < count && (head || trunk || legs);
        Luma([if face {
            0
        } else if inside {
            120
        } else {
            255
        }])
    });
    let mut bytes = Cursor::new(Vec::new());
    page.write_to(&mut bytes, ImageFormat::Png).unwrap();
    bytes.into_inner()
}

fn with_page(bytes: Vec<u8>) -> Form {
    Form::new().part("page", file(bytes, "page.png"))
}

async fn azimuths(service: &Service, form: Form) -> Vec<f64> {
    let response = service.upload(form).await;
    assert_eq!(response.status(), 202);
    let body: Value = response.json().await.unwrap();
    let id: JobId = body["id"].as_str().unwrap().parse().unwrap();
    let job = service.store.get(id).await.unwrap();
    let document: SheetDocument =
        serde_json::from_value::<ReconstructionPayload>(job.payload).unwrap().document;
    let names: Vec<&str> = document.views.iter().map(|view| view.image.as_str()).collect();
    for bytes in service.stored_inputs(id, &names).await {
        let cut = image::load_from_memory(&bytes).unwrap();
        assert!(cut.width() < 150 && cut.height() > 230, "{}x{}", cut.width(), cut.height());
    }
    document.views.iter().map(|view| view.azimuth_deg).collect()
}

#[tokio::test]
async fn figures_become_views() {
    let service = Service::start().await;
    let given = with_page(page(3)).text("azimuths", "0,270,180");
    assert_eq!(azimuths(&service, given).await, [0.0, 180.0, 270.0]);
    let guessed = azimuths(&service, with_page(page(3)).text("azimuths", "auto")).await;
    assert_eq!((guessed.len(), guessed[0]), (3, 0.0));
    assert_eq!(azimuths(&service, with_page(page(3))).await, guessed);
    // A face, and none on the same figure: front and back.
    assert_eq!(azimuths(&service, with_page(page(2))).await, [0.0, 180.0]);
}

async fn refused(form: Form, name: &str) -> String {
    let service = Service::start().await;
    let body = problem(service.upload(form).await, 422, name).await;
    service.assert_nothing_stored().await;
    body["detail"].as_str().unwrap().to_owned()
}

#[tokio::test]
async fn wrong_numbers_say_what_was_found() {
    for given in ["0,90", "0,90,180,270"] {
        let form = with_page(page(3)).text("azimuths", given);
        let detail = refused(form, "wrong-number-of-figures").await;
        assert!(
            detail.contains("3 figures were found") && detail.contains("3 at columns"),
            "{detail}"
        );
    }
    let twice = with_page(page(2)).text("azimuths", "0,360");
    refused(twice, "duplicate-azimuth").await;
    refused(with_page(page(2)).text("azimuths", "0,side"), "invalid-angle").await;
}

#[tokio::test]
async fn pages_that_give_no_views() {
    let mut blank = Cursor::new(Vec::new());
    GrayImage::from_pixel(200, 100, Luma([255])).write_to(&mut blank, ImageFormat::Png).unwrap();
    refused(with_page(blank.into_inner()), "no-figure").await;
    let half = page(2).len() / 2;
    refused(with_page(page(2)[..half].to_vec()), "damaged-image").await;
    refused(with_page(b"no picture".to_vec()), "not-an-image").await;
}

#[tokio::test]
async fn a_page_goes_with_no_other_form() {
    refused(Form::new().text("azimuths", "0,90"), "missing-part").await;
    let mixed = with_page(page(2)).part("view[0]", file(drawing(32, 24, 1), "a.png"));
    refused(mixed, "conflicting-parts").await;
    let sheet = with_page(page(2)).text("sheet", r#"{"views": []}"#);
    refused(sheet, "conflicting-parts").await;
}

#[tokio::test]
async fn what_a_sheet_says_by_hand_is_kept() {
    let service = Service::start().await;
    let sheet = serde_json::json!({"views": [
        {"image": "side.png", "azimuth_deg": 90, "mirrored": true, "ignore": [[3, 4]]},
        {"image": "front.png", "azimuth_deg": 0, "polygon": [[1, 1], [30, 2], [9, 20]],
         "erase": [[[0, 0], [5, 0], [5, 5]]], "attach": [[7.5, 8]]},
    ]});
    let form = Form::new()
        .text("sheet", sheet.to_string())
        .part("image", file(drawing(32, 24, 1), "front.png"))
        .part("image", file(drawing(32, 24, 2), "side.png"));
    let body: Value = service.upload(form).await.json().await.unwrap();
    let id: JobId = body["id"].as_str().unwrap().parse().unwrap();
    let job = service.store.get(id).await.unwrap();
    let document = serde_json::from_value::<ReconstructionPayload>(job.payload).unwrap().document;
    let [front, side] = document.views.as_slice() else { panic!("{document:?}") };
    assert_eq!((front.polygon.len(), front.erase.len(), front.attach.len()), (3, 1, 1));
    assert!(!front.mirrored && side.mirrored);
    assert_eq!((side.image.as_str(), side.ignore.as_slice()), ("views/90.png", &[[3.0, 4.0]][..]));
}
