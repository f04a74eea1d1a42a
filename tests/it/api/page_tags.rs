//! What people say of pages, as of jobs, and of their figures' places.

use jobs::JobStore;
use reqwest::multipart::Form;
use reqwest::{Response, StatusCode};
use serde_json::{Value, json};
use sheet::SheetDocument;
use turnaround::kinds::ReconstructionPayload;

use super::harness::{Service, file, problem};
use super::page_uploads::page;

async fn posted(service: &Service, query: &str, figures: u32) -> Response {
    let form = Form::new().part("page", file(page(figures), "page.png"));
    service.post(&format!("/v1/pages{query}")).multipart(form).send().await.unwrap()
}

async fn stored(service: &Service, query: &str) -> Value {
    let response = posted(service, query, 2).await;
    assert_eq!(response.status(), StatusCode::CREATED);
    response.json().await.unwrap()
}

fn path(page: &Value) -> String {
    page["links"]["self"].as_str().unwrap().to_owned()
}

async fn listed(service: &Service, query: &str) -> (Vec<Value>, Value) {
    let list = service.get(&format!("/v1/pages?{query}")).send().await.unwrap();
    let list: Value = list.json().await.unwrap();
    let pages = list["pages"].as_array().unwrap();
    (pages.iter().map(|page| page["id"].clone()).collect(), list["next"].clone())
}

#[tokio::test]
async fn pages_are_labelled_found_and_labelled_anew() {
    let service = Service::start().await;
    let first = stored(&service, "?name=Ida&labels=show:7,shot:12&expires_in=3600").await;
    assert_eq!((&first["name"], &first["labels"]["shot"]), (&json!("Ida"), &json!("12")));
    assert!(first["expires_at"].is_string() && first["pinned"] == false, "{first}");
    let second = stored(&service, "?labels=show:7").await;
    assert_eq!(listed(&service, "labels=shot:12").await.0, [first["id"].clone()]);
    assert_eq!(listed(&service, "created_before=2020-01-01T00:00:00Z").await.0, [] as [Value; 0]);
    // The next part is of the same list.
    stored(&service, "").await;
    let (newest, next) = listed(&service, "labels=show:7&limit=1").await;
    assert_eq!(newest, [second["id"].clone()]);
    let next = next.as_str().unwrap().strip_prefix("/v1/pages?").unwrap().to_owned();
    assert_eq!(listed(&service, &next).await, (vec![first["id"].clone()], Value::Null));

    let patch = |changes: Value| {
        service.client.patch(format!("{}{}", service.url, path(&first))).json(&changes).send()
    };
    let changes = json!({"labels": {"take": "ä"}, "name": null, "pinned": true});
    let response = patch(changes).await.unwrap();
    // Told from the page before, though what is on it is the same.
    assert_eq!(response.headers()["etag"], "\"1.1\"");
    let changed: Value = response.json().await.unwrap();
    assert_eq!((&changed["labels"], changed.get("name")), (&json!({"take": "ä"}), None));
    assert_eq!((&changed["version"], &changed["pinned"]), (&json!(1), &json!(true)));
    assert_eq!(changed["expires_at"], first["expires_at"], "what was not given has changed");
    let known = service.get(&path(&first)).header("if-none-match", "\"1\"").send().await.unwrap();
    assert_eq!(known.status(), StatusCode::OK);
    let preview = service.get(&format!("{}/preview.png", path(&first))).send().await.unwrap();
    assert_eq!(preview.status(), StatusCode::OK);
    // What is put back keeps what is said of it.
    let put = service.put(&path(&first)).json(&changed).send().await.unwrap();
    assert_eq!(put.headers()["etag"], "\"2.1\"");
    assert_eq!(put.json::<Value>().await.unwrap()["labels"], json!({"take": "ä"}));
    for wrong in [
        json!({"labels": {"a b": "x"}}),
        json!({"labels": {"a": "x".repeat(201)}}),
        json!({"expires_in": -1}),
        json!({"colour": "red"}),
    ] {
        problem(patch(wrong).await.unwrap(), 422, "invalid-body").await;
    }
    for wrong in
        ["?labels=show", "?expires_in=-1", "?name=%00", "?lable=show:7", "?webhook=https://h/"]
    {
        problem(posted(&service, wrong, 2).await, 400, "invalid-query").await;
    }
    let list = service.get("/v1/pages?labels=show").send().await.unwrap();
    problem(list, 400, "invalid-query").await;
}

#[tokio::test]
async fn a_page_sent_again_with_its_key_is_the_first() {
    let service = Service::start().await;
    let send = |key: &str, figures: u32, azimuths: Option<&str>| {
        let form = Form::new().part("page", file(page(figures), "page.png"));
        let form = match azimuths {
            Some(azimuths) => form.text("azimuths", azimuths.to_owned()),
            None => form,
        };
        service.post("/v1/pages").header("idempotency-key", key).multipart(form).send()
    };
    let first = send("ida-1", 2, None).await.unwrap();
    assert_eq!(first.status(), StatusCode::CREATED);
    let first: Value = first.json().await.unwrap();
    let again = send("ida-1", 2, None).await.unwrap();
    assert_eq!(again.status(), StatusCode::CREATED);
    assert_eq!(again.headers()["location"], path(&first));
    assert_eq!(again.json::<Value>().await.unwrap(), first);
    assert_eq!(listed(&service, "").await.0.len(), 1);
    for (figures, azimuths) in [(3, None), (2, Some("0,90"))] {
        let other = send("ida-1", figures, azimuths).await.unwrap();
        problem(other, 422, "idempotency-key-reused").await;
    }
    problem(send("two words", 2, None).await.unwrap(), 400, "invalid-idempotency-key").await;
    assert_eq!(service.delete(&path(&first)).send().await.unwrap().status(), 204);
    problem(send("ida-1", 2, None).await.unwrap(), 409, "idempotent-job-gone").await;
    service.assert_nothing_stored().await;
}

/// Two at once: one page, and no files of the other.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn pages_sent_twice_at_once_are_one() {
    let service = Service::start().await;
    let send = || {
        let form = Form::new().part("page", file(page(2), "page.png"));
        service.post("/v1/pages").header("idempotency-key", "k").multipart(form).send()
    };
    let (one, two) = tokio::join!(send(), send());
    let (one, two): (Value, Value) =
        (one.unwrap().json().await.unwrap(), two.unwrap().json().await.unwrap());
    assert_eq!(one["id"], two["id"]);
    assert_eq!(listed(&service, "").await.0.len(), 1);
    assert_eq!(service.delete(&path(&one)).send().await.unwrap().status(), 204);
    service.assert_nothing_stored().await;
}

#[tokio::test]
async fn places_by_hand_reach_the_sheet() {
    let service = Service::start().await;
    let page = stored(&service, "").await;
    let figure = &page["figures"][1];
    assert_eq!((&figure["axis_x"], &figure["elevation_deg"]), (&Value::Null, &json!(0.0)));
    let side = |name: &str| figure["box"][name].as_f64().unwrap();
    let middle = [(side("left") + side("right")) / 2.0, (side("top") + side("bottom")) / 2.0];
    let edited = |changes: Value| {
        let mut edited = page.clone();
        let figure = edited["figures"][1].as_object_mut().unwrap();
        figure.extend(changes.as_object().unwrap().clone());
        edited
    };
    let put = |page: Value| service.put(&path(&page)).json(&page).send();
    let axis = side("left") + 3.0;
    let changes = json!({
        "axis_x": axis, "ground_y": 250.5, "scale_by_hand": 2.0, "holes": [middle],
        "azimuth_deg": 0, "elevation_deg": 90,
    });
    let mut level = edited(changes);
    level["figures"][0]["azimuth_deg"] = json!(0);
    let put_back = put(level).await.unwrap();
    assert_eq!(put_back.status(), StatusCode::OK, "{}", put_back.text().await.unwrap());
    let now: Value = put_back.json().await.unwrap();
    let figure = &now["figures"][1];
    assert_eq!((&figure["axis_column"], &figure["baseline_row"]), (&json!(axis), &json!(251)));
    let sheet: SheetDocument = serde_json::from_value(now["sheet"].clone()).unwrap();
    let (view, crop) = (&sheet.views[1], &figure["crop"]);
    let [left, top] = ["left", "top"].map(|name| crop[name].as_f64().unwrap());
    assert_eq!((view.axis_x, view.ground_y), (Some(axis - left), Some(250.5 - top)));
    assert_eq!((view.scale, view.elevation_deg), (Some(2.0), Some(90.0)));
    assert_eq!(sheet.views[0].elevation_deg, None);
    let hole = &sheet.holes[0];
    assert_eq!(
        (hole.elevation_deg, hole.x, hole.y),
        (Some(90.0), middle[0] - left, middle[1] - top)
    );
    // What is seen is what a job takes.
    let level = edited(json!({"axis_x": axis, "holes": [middle], "azimuth_deg": 90}));
    assert_eq!(put(level).await.unwrap().status(), StatusCode::OK);
    let form = Form::new().text("page", page["id"].as_str().unwrap().to_owned());
    let queued = service.upload(form).await;
    assert_eq!(queued.status(), StatusCode::ACCEPTED, "{}", queued.text().await.unwrap());
    let queued: Value = queued.json().await.unwrap();
    let job = service.store.get(queued["id"].as_str().unwrap().parse().unwrap()).await.unwrap();
    let payload: ReconstructionPayload = serde_json::from_value(job.payload).unwrap();
    assert_eq!(payload.document.holes.len(), 1);
    assert!(payload.document.views.iter().any(|view| view.axis_x == Some(axis - left)));
    for (changes, kind, told) in [
        (json!({"axis_x": 100_000}), "invalid-page", "axis_x is 100000"),
        (json!({"ground_y": -1}), "invalid-page", "ground_y is -1"),
        (json!({"scale_by_hand": 9}), "invalid-page", "from 0.125 to 8"),
        (json!({"holes": [[0, 0]]}), "invalid-page", "outside of its box"),
        (json!({"elevation_deg": 91}), "invalid-angle", "from -90 to 90"),
    ] {
        let refused = problem(put(edited(changes)).await.unwrap(), 422, kind).await;
        assert_eq!(refused["part"], "figures[1]");
        assert!(refused["detail"].as_str().unwrap().contains(told), "{refused}");
    }
}
