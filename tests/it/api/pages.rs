//! Pages: figures found, looked at, put right and reconstructed.

use std::io::Cursor;
use std::time::Duration;

use image::{GrayImage, ImageFormat, Luma};
use jobs::bytes::{BytesOf, Home, Key};
use jobs::{JobId, JobStore, TenantName};
use reqwest::Response;
use reqwest::multipart::Form;
use serde_json::{Value, json};
use sheet::SheetDocument;
use turnaround::http::{HttpLimits, ServerTimeouts};
use turnaround::kinds::ReconstructionPayload;
use turnaround::worker::{Collected, WorkerConfig, collect};

use super::harness::{Service, drawing, file, problem};
use super::page_uploads::page;

async fn posted(service: &Service, form: Form) -> Response {
    service.post("/v1/pages").multipart(form).send().await.unwrap()
}

fn of(bytes: Vec<u8>) -> Form {
    Form::new().part("page", file(bytes, "page.png"))
}

/// A stored page with so many figures.
async fn stored(service: &Service, figures: u32) -> Value {
    let response = posted(service, of(page(figures))).await;
    assert_eq!(response.status(), 201);
    let location = response.headers()["location"].to_str().unwrap().to_owned();
    assert_eq!(response.headers()["etag"], "\"1\"");
    let body: Value = response.json().await.unwrap();
    assert_eq!(body["links"]["self"], location);
    assert_eq!(location, path(&body));
    body
}

fn path(page: &Value) -> String {
    format!("/v1/pages/{}", page["id"].as_str().unwrap())
}

async fn put(service: &Service, page: &Value) -> Response {
    service.put(&path(page)).json(page).send().await.unwrap()
}

async fn refused(service: &Service, page: &Value, name: &str) -> Value {
    let status = if name == "precondition-failed" { 412 } else { 422 };
    let body = problem(put(service, page).await, status, name).await;
    // Nothing changed.
    let now: Value = service.get(&path(page)).send().await.unwrap().json().await.unwrap();
    assert_eq!(now["version"], 1);
    body
}

async fn picture(service: &Service, href: &Value) -> image::DynamicImage {
    let response = service.get(href.as_str().unwrap()).send().await.unwrap();
    assert_eq!(response.status(), 200, "{href}");
    assert_eq!(response.headers()["content-type"], "image/png");
    image::load_from_memory(&response.bytes().await.unwrap()).unwrap()
}

#[tokio::test]
async fn figures_are_proposed_with_masks_and_a_preview() {
    let service = Service::start().await;
    let page = stored(&service, 3).await;
    let figures = page["figures"].as_array().unwrap();
    assert_eq!(figures.len(), 3);
    assert_eq!(page["pictures"][0]["height"], 320);
    for figure in figures {
        assert_eq!(figure["kept"], true, "{figure}");
        let side = |a: &str, b: &str| {
            figure["crop"][a].as_u64().unwrap() - figure["crop"][b].as_u64().unwrap()
        };
        let size = (side("right", "left") as u32, side("bottom", "top") as u32);
        let crop = picture(&service, &figure["crop_picture"]).await;
        let mask = picture(&service, &figure["mask_picture"]).await.into_luma8();
        assert_eq!((crop.width(), crop.height()), size);
        assert_eq!(mask.dimensions(), size);
        // Head, trunk and two legs are drawn with so many pixels.
        let inside = mask.pixels().filter(|pixel| pixel.0[0] == 255).count();
        assert!((10_500..14_500).contains(&inside), "{inside} px");
        assert!(figure["outline"].as_array().unwrap().len() >= 8, "{figure}");
        assert_eq!(figure["baseline_row"], 280);
    }
    let preview = picture(&service, &page["links"]["preview"]).await.into_rgb8();
    let alone = picture(&service, &page["pictures"][0]["picture"]).await.into_rgb8();
    assert_eq!(preview.dimensions(), alone.dimensions());
    let coloured = |picture: &image::RgbImage| {
        picture.pixels().filter(|p| p.0[0].abs_diff(p.0[2]) > 60).count()
    };
    assert!(coloured(&preview) > 1000 && coloured(&alone) == 0);
    let sheet: SheetDocument = serde_json::from_value(page["sheet"].clone()).unwrap();
    assert_eq!(sheet.views.len(), 3);
    assert_eq!(sheet.views[1].image, "figures/1/crop.png");
}

#[tokio::test]
async fn versions_are_told_by_tags_and_deleting_takes_all() {
    let service = Service::start().await;
    let page = stored(&service, 2).await;
    let again = service.get(&path(&page)).send().await.unwrap();
    assert_eq!(again.json::<Value>().await.unwrap(), page);
    for path in [path(&page), format!("{}/preview.png", path(&page))] {
        let known = service.get(&path).header("if-none-match", "\"1\"").send().await.unwrap();
        assert_eq!(
            (known.status(), &known.headers()["etag"]),
            (304.try_into().unwrap(), &"\"1\"".parse().unwrap())
        );
    }
    let head = service.client.head(format!("{}{}/preview.png", service.url, path(&page)));
    let head = head.send().await.unwrap();
    assert_eq!(head.status(), 200);
    assert!(head.headers()["content-length"].to_str().unwrap().parse::<u64>().unwrap() > 1000);
    for missing in ["figures/2/mask.png", "figures/x/mask.png", "../x", "source/0", "1/x"] {
        let response = service.get(&format!("{}/{missing}", path(&page))).send().await.unwrap();
        assert_eq!(response.status(), 404, "{missing}");
    }
    assert_eq!(service.delete(&path(&page)).send().await.unwrap().status(), 204);
    for gone in [
        service.get(&path(&page)),
        service.delete(&path(&page)),
        service.put(&path(&page)).json(&page),
    ] {
        problem(gone.send().await.unwrap(), 404, "unknown-page").await;
    }
    problem(service.get("/v1/pages/first").send().await.unwrap(), 404, "unknown-page").await;
    service.assert_nothing_stored().await;
}

#[tokio::test]
async fn an_edited_page_has_other_masks_and_previews() {
    let service = Service::start().await;
    let mut page = stored(&service, 3).await;
    let before = picture(&service, &page["links"]["preview"]).await;
    page["figures"][0]["azimuth_deg"] = json!(315);
    page["figures"][1]["kept"] = json!(false);
    // The upper half of the third, by hand: a triangle in it is the subject.
    let place = page["figures"][2]["box"].clone();
    page["figures"][2]["box"]["bottom"] = json!(180);
    let (left, right) = (place["left"].as_f64().unwrap(), place["right"].as_f64().unwrap());
    page["figures"][2]["polygon"] = json!([[left, 175], [(left + right) / 2.0, 95], [right, 175]]);
    page["figures"][2]["azimuth_deg"] = json!(-90);
    page["figures"][2]["mirrored"] = json!(true);
    let response = put(&service, &page).await;
    assert_eq!(response.status(), 200);
    assert_eq!(response.headers()["etag"], "\"2\"");
    let edited: Value = response.json().await.unwrap();
    assert_eq!(edited["version"], 2);
    assert_eq!(edited["figures"][0]["azimuth_deg"], 315.0);
    assert_eq!(edited["figures"][0]["confidence"], 1.0);
    assert_eq!(edited["figures"][2]["azimuth_deg"], 270.0);
    let mask = picture(&service, &edited["figures"][2]["mask_picture"]).await.into_luma8();
    let inside = mask.pixels().filter(|pixel| pixel.0[0] == 255).count() as f64;
    assert!((inside / ((right - left) * 80.0 / 2.0) - 1.0).abs() < 0.05, "{inside} px");
    let after = picture(&service, &edited["links"]["preview"]).await;
    assert_ne!(before, after);
    let sheet: SheetDocument = serde_json::from_value(edited["sheet"].clone()).unwrap();
    let azimuths: Vec<f64> = sheet.views.iter().map(|view| view.azimuth_deg).collect();
    assert_eq!(azimuths, [315.0, 270.0]);
    assert!(sheet.views[1].mirrored && sheet.views[1].polygon.len() == 3);
    // Only the version of now is left.
    let id: JobId = page["id"].as_str().unwrap().parse().unwrap();
    let old = Key::Input { job: id, name: "1/figures/0/crop.png" };
    assert!(service.bytes.get(&old).await.is_err());
    // Who edited the first version is told.
    let late = service.put(&path(&page)).header("if-match", "\"1\"").json(&page);
    problem(late.send().await.unwrap(), 412, "precondition-failed").await;
    let known = service.put(&path(&page)).header("if-match", "\"2\"").json(&edited);
    assert_eq!(known.send().await.unwrap().json::<Value>().await.unwrap()["version"], 3);
}

#[tokio::test]
async fn pictures_of_a_page_lie_below_its_tenant() {
    let service = Service::start_by_tenant().await;
    let page = stored(&service, 2).await;
    let response = put(&service, &page).await;
    assert_eq!(response.status(), 200);
    let edited: Value = response.json().await.unwrap();
    picture(&service, &edited["links"]["preview"]).await;
    let form = Form::new().text("page", page["id"].as_str().unwrap().to_owned());
    let sent = service.upload(form.text("azimuths", "0,90")).await;
    assert_eq!(sent.status(), 202);
    let job: Value = sent.json().await.unwrap();
    let home = Home::Tenant(TenantName::default());
    let ids = [&page, &job].map(|it| it["id"].as_str().unwrap().parse().unwrap());
    let found = service.bytes.all().await.unwrap();
    assert_eq!(found, ids.map(|id| BytesOf { id, home: home.clone() }));
    assert_eq!(service.delete(&path(&page)).send().await.unwrap().status(), 204);
    let left = service.bytes.all().await.unwrap();
    assert_eq!(left, [BytesOf { id: ids[1], home }], "the job has its own copies");
}

/// White in the upper half.
fn mask(width: u32, height: u32) -> Vec<u8> {
    let mask =
        GrayImage::from_fn(width, height, |_, y| Luma([if y < height / 2 { 255 } else { 0 }]));
    let mut bytes = Cursor::new(Vec::new());
    mask.write_to(&mut bytes, ImageFormat::Png).unwrap();
    bytes.into_inner()
}

fn with_mask(page: &Value, part: &str, bytes: Vec<u8>) -> Form {
    Form::new().text("document", page.to_string()).part(part.to_owned(), file(bytes, "mask.png"))
}

#[tokio::test]
async fn masks_by_hand_are_kept_and_used() {
    let service = Service::start().await;
    let page = stored(&service, 2).await;
    let found = picture(&service, &page["figures"][1]["mask_picture"]).await;
    let (width, height) = (found.width(), found.height());
    let edit = |form| service.put(&path(&page)).multipart(form).send();
    let wrong = with_mask(&page, "mask[1]", mask(width + 1, height));
    let body = problem(edit(wrong).await.unwrap(), 422, "differing-sizes").await;
    assert_eq!(body["part"], "mask[1]");
    assert!(body["detail"].as_str().unwrap().contains(&format!("{width}x{height}")), "{body}");
    let nobody = with_mask(&page, "mask[7]", mask(width, height));
    problem(edit(nobody).await.unwrap(), 422, "invalid-page").await;
    let no_picture = with_mask(&page, "mask[1]", b"no picture".to_vec());
    problem(edit(no_picture).await.unwrap(), 422, "not-an-image").await;
    let other = with_mask(&page, "masks", mask(width, height));
    problem(edit(other).await.unwrap(), 422, "unknown-part").await;
    let alone = Form::new().part("mask[1]", file(mask(width, height), "mask.png"));
    problem(edit(alone).await.unwrap(), 422, "missing-part").await;

    let given = edit(with_mask(&page, "mask[1]", mask(width, height))).await.unwrap();
    assert_eq!(given.status(), 200);
    let edited: Value = given.json().await.unwrap();
    assert_eq!(edited["figures"][1]["mask_given"], true);
    let upper = picture(&service, &edited["figures"][1]["mask_picture"]).await.into_luma8();
    assert_eq!(upper.get_pixel(width / 2, 2).0[0], 255);
    assert_eq!(upper.get_pixel(width / 2, height - 2).0[0], 0);
    // Put back without the mask, it stays.
    let again: Value = put(&service, &edited).await.json().await.unwrap();
    assert_eq!(picture(&service, &again["figures"][1]["mask_picture"]).await.into_luma8(), upper);
    assert_eq!(again["sheet"]["views"].as_array().unwrap()[1]["mask"], "figures/1/mask.png");
    // Whether it covers the outline's stroke is the sheet's to know, and goes with the mask.
    let covers = |page: &Value, at: usize| {
        let told = page["sheet"]["views"][at].get("mask_with_outline").is_some();
        (told, page["figures"][at]["mask_with_outline"].clone())
    };
    assert_eq!(covers(&again, 1), (false, json!(false)));
    let mut covering = again.clone();
    covering["figures"][0]["mask_with_outline"] = json!(true);
    covering["figures"][1]["mask_with_outline"] = json!(true);
    let covering: Value = put(&service, &covering).await.json().await.unwrap();
    assert_eq!(covers(&covering, 0), (false, json!(false)));
    assert_eq!(covers(&covering, 1), (true, json!(true)));
    let mut without = covering.clone();
    without["figures"][1]["mask_given"] = json!(false);
    let without: Value = put(&service, &without).await.json().await.unwrap();
    assert_eq!(covers(&without, 1), (false, json!(false)));
    // One that was never sent cannot stay.
    let mut claimed = without.clone();
    claimed["figures"][0]["mask_given"] = json!(true);
    problem(put(&service, &claimed).await, 422, "invalid-page").await;
}

#[tokio::test]
async fn pages_that_give_nothing_are_refused() {
    let service = Service::start().await;
    let mut blank = Cursor::new(Vec::new());
    GrayImage::from_pixel(200, 100, Luma([255])).write_to(&mut blank, ImageFormat::Png).unwrap();
    let half = page(2).len() / 2;
    for (form, name) in [
        (of(blank.into_inner()), "no-figure"),
        (of(page(2)[..half].to_vec()), "damaged-image"),
        (of(b"no picture".to_vec()), "not-an-image"),
        (Form::new().text("azimuths", "0,90"), "missing-part"),
        (of(page(2)).text("view[0]", "x"), "unknown-part"),
        (of(page(3)).text("azimuths", "0,90"), "wrong-number-of-figures"),
        (of(page(3)).text("azimuths", "0,90,180,270"), "wrong-number-of-figures"),
        (of(page(2)).text("azimuths", "0,360"), "duplicate-azimuth"),
        (of(page(2)).text("azimuths", "0,side"), "invalid-angle"),
    ] {
        problem(posted(&service, form).await, 422, name).await;
    }
    service.assert_nothing_stored().await;
    let mut small = HttpLimits::default();
    small.image.max_pixels = 10_000;
    let service = Service::start_with(small, ServerTimeouts::default()).await;
    let body = problem(posted(&service, of(page(2))).await, 413, "too-many-pixels").await;
    assert_eq!(body["part"], "page");
}

#[tokio::test]
async fn edits_that_cannot_be_are_refused() {
    let service = Service::start().await;
    let page = stored(&service, 2).await;
    let edit = |change: &dyn Fn(&mut Value)| {
        let mut edited = page.clone();
        change(&mut edited);
        edited
    };
    let outside = edit(&|page| page["figures"][1]["box"]["right"] = json!(5000));
    let body = refused(&service, &outside, "invalid-page").await;
    assert_eq!(body["part"], "figures[1]");
    let empty = edit(&|page| {
        page["figures"][0]["box"]["bottom"] = page["figures"][0]["box"]["top"].clone()
    });
    refused(&service, &empty, "invalid-page").await;
    refused(&service, &edit(&|page| page["figures"][0]["picture"] = json!(3)), "invalid-page")
        .await;
    refused(&service, &edit(&|page| page["figures"][0]["azimut"] = json!(3)), "invalid-page").await;
    let same = edit(&|page| {
        page["figures"][0]["azimuth_deg"] = json!(90);
        page["figures"][1]["azimuth_deg"] = json!(450);
    });
    refused(&service, &same, "duplicate-azimuth").await;
    let blank = edit(&|page| {
        page["figures"][0]["box"] = json!({"left": 0, "top": 0, "right": 20, "bottom": 20});
    });
    refused(&service, &blank, "no-figure").await;
    let line = edit(&|page| page["figures"][0]["polygon"] = json!([[70, 60], [80, 70]]));
    refused(&service, &line, "no-figure").await;
    let text = service.put(&path(&page)).header("content-type", "application/json").body("{");
    problem(text.send().await.unwrap(), 400, "invalid-json").await;
    let text = service.put(&path(&page)).body("x");
    problem(text.send().await.unwrap(), 415, "unsupported-media-type").await;
}

async fn reconstructed(service: &Service, form: Form) -> (JobId, ReconstructionPayload) {
    let response = service.upload(form).await;
    assert_eq!(response.status(), 202);
    let body: Value = response.json().await.unwrap();
    let id: JobId = body["id"].as_str().unwrap().parse().unwrap();
    let job = service.store.get(id).await.unwrap();
    (id, serde_json::from_value(job.payload).unwrap())
}

#[tokio::test]
async fn a_reconstruction_takes_what_was_seen() {
    let service = Service::start().await;
    let mut page = stored(&service, 3).await;
    let named = |page: &Value| Form::new().text("page", page["id"].as_str().unwrap().to_owned());
    page["figures"][1]["kept"] = json!(false);
    page["figures"][0]["azimuth_deg"] = json!(90);
    page["figures"][2]["azimuth_deg"] = json!(0);
    page["figures"][2]["ignore"] = json!([[1.0, 2.0]]);
    let page: Value = put(&service, &page).await.json().await.unwrap();
    let seen = service.get(page["figures"][2]["crop_picture"].as_str().unwrap()).send().await;
    let seen = seen.unwrap().bytes().await.unwrap();

    let (id, payload) = reconstructed(&service, named(&page).text("seed", "7")).await;
    assert_eq!(payload.page.unwrap().to_string(), page["id"].as_str().unwrap());
    let views = &payload.document.views;
    assert_eq!(views.iter().map(|view| view.azimuth_deg).collect::<Vec<_>>(), [0.0, 90.0]);
    assert_eq!(views[0].ignore.len(), 1);
    assert_eq!(payload.document.options.unwrap()["seed"], 7);
    assert_eq!(service.stored_inputs(id, &[&views[0].image]).await, [seen.to_vec()]);
    let body: Value = service
        .get(&format!("/v1/reconstructions/{id}"))
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    assert_eq!(body["page"], page["id"]);

    // Other azimuths for this once, in reading order.
    let turned = named(&page).text("azimuths", "0,45");
    let (_, payload) = reconstructed(&service, turned).await;
    let views = &payload.document.views;
    assert_eq!(views.iter().map(|view| view.azimuth_deg).collect::<Vec<_>>(), [0.0, 45.0]);
    assert!(views[0].image.contains("figures/0/"), "{}", views[0].image);
    // What is made of a page outlives it, and can be run again.
    assert_eq!(service.delete(&path(&page)).send().await.unwrap().status(), 204);
    let (_, again) = reconstructed(&service, Form::new().text("source", id.to_string())).await;
    assert_eq!(again.document.views.len(), 2);
}

#[tokio::test]
async fn pages_that_cannot_be_reconstructed_are_told() {
    let service = Service::start().await;
    let page = stored(&service, 3).await;
    let id = page["id"].as_str().unwrap().to_owned();
    let named = || Form::new().text("page", id.clone());
    for given in ["0,90", "0,90,180,270"] {
        let form = named().text("azimuths", given);
        let body = problem(service.upload(form).await, 422, "wrong-number-of-figures").await;
        let detail = body["detail"].as_str().unwrap();
        assert!(detail.contains(&format!("/v1/pages/{id}/preview.png")), "{detail}");
    }
    let twice = named().text("azimuths", "0,90,360");
    problem(service.upload(twice).await, 422, "duplicate-azimuth").await;
    let mixed = named().part("view[0]", file(drawing(32, 24, 1), "a.png"));
    problem(service.upload(mixed).await, 422, "conflicting-parts").await;
    let both = named().text("source", id.clone());
    problem(service.upload(both).await, 422, "conflicting-parts").await;
    let unknown = Form::new().text("page", JobId::new().to_string());
    problem(service.upload(unknown).await, 422, "unknown-source").await;
    problem(service.upload(Form::new().text("page", "first")).await, 422, "unknown-source").await;
    // Crops of one size are what this method needs; boxes of two are not.
    let mut two = page.clone();
    two["figures"][0]["box"]["top"] = json!(two["figures"][0]["box"]["top"].as_u64().unwrap() - 9);
    assert_eq!(put(&service, &two).await.status(), 200);
    let form = named().text("method", "uncalibrated");
    problem(service.upload(form).await, 422, "differing-sizes").await;
    // One figure is no sheet.
    for figure in 1..3 {
        two["figures"][figure]["kept"] = json!(false);
    }
    assert_eq!(put(&service, &two).await.status(), 200);
    let body = problem(service.upload(named()).await, 422, "too-few-views").await;
    assert_eq!(body["part"], "page");
}

#[tokio::test]
async fn several_pictures_are_a_turn() {
    let service = Service::start().await;
    let one = |half: u32| {
        let view = GrayImage::from_fn(120, 200, |x, y| {
            let inside = (60 - half..60 + half).contains(&x) && (30..180).contains(&y);
            Luma([if inside { 90 } else { 255 }])
        });
        let mut bytes = Cursor::new(Vec::new());
        view.write_to(&mut bytes, ImageFormat::Png).unwrap();
        file(bytes.into_inner(), "view.png")
    };
    // What is wrong with one of them is said of that one.
    let wrong = file(b"no picture".to_vec(), "view.png");
    for (wrong, kind) in [(wrong, "not-an-image"), (one(0), "no-figure")] {
        let form = Form::new().part("page", one(20)).part("page", wrong);
        let refused = problem(posted(&service, form).await, 422, kind).await;
        assert_eq!(refused["part"], "page[1]");
    }
    let form = (0..4).fold(Form::new(), |form, k| form.part("page", one(20 + 8 * (k % 2))));
    let response = posted(&service, form).await;
    assert_eq!(response.status(), 201);
    let page: Value = response.json().await.unwrap();
    assert_eq!(page["pictures"].as_array().unwrap().len(), 4);
    let figures = page["figures"].as_array().unwrap();
    let pictures: Vec<_> =
        figures.iter().map(|figure| figure["picture"].as_u64().unwrap()).collect();
    assert_eq!(pictures, [0, 1, 2, 3]);
    picture(&service, &page["pictures"][3]["preview"]).await;
    let edited: Value = put(&service, &page).await.json().await.unwrap();
    assert_eq!(edited["figures"], page["figures"]);
}

#[tokio::test]
async fn the_collector_leaves_pages_alone() {
    let service = Service::start().await;
    let page = stored(&service, 2).await;
    let at_once = WorkerConfig { collect_after: Duration::ZERO, ..WorkerConfig::default() };
    let done = collect(service.store.as_ref(), &service.bytes, &at_once).await.unwrap();
    assert_eq!(done, Collected::default());
    picture(&service, &page["links"]["preview"]).await;
    // Files of a page whose row is gone belong to nobody.
    let id: JobId = page["id"].as_str().unwrap().parse().unwrap();
    jobs::PageStore::delete_page(service.store.as_ref(), id).await.unwrap();
    let done = collect(service.store.as_ref(), &service.bytes, &at_once).await.unwrap();
    assert_eq!(done, Collected { jobs: 1, ..Collected::default() });
    service.assert_nothing_stored().await;
}
