//! A service that is told to stop.

use std::time::{Duration, Instant};

use super::process::Process;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_signal_ends_it_within_ten_seconds_and_what_ran_goes_on_later() {
    let folder = tempfile::tempdir().unwrap();
    let mut service = Process::start(folder.path(), &[]);
    // Longer than the grace: a turn of the prior at the finest grid.
    let drawn = reqwest::multipart::Form::new()
        .text("model", "builtin:caped_figure")
        .text("azimuths", "0:355:1")
        .text("width_px", "1920")
        .text("height_px", "1080");
    let response = service.post("/v1/sheets").multipart(drawn).send().await.unwrap();
    assert_eq!(response.status(), 422, "a sheet of 356 views is over the limit");
    let drawn = reqwest::multipart::Form::new()
        .text("model", "builtin:caped_figure")
        .text("azimuths", "0:89.5:0.5")
        .text("width_px", "820")
        .text("height_px", "440");
    let response = service.post("/v1/sheets").multipart(drawn).send().await.unwrap();
    let job: serde_json::Value = response.json().await.unwrap();
    let path = job["links"]["self"].as_str().unwrap_or_else(|| panic!("{job}")).to_owned();
    service.until(&path, |_, job| job["state"] == "running").await;
    let mut events = service.get(&format!("{path}/events")).send().await.unwrap();

    let told = Instant::now();
    service.signal("TERM");
    service.until("/health/ready", |status, _| status == 503).await;
    assert!(told.elapsed() < Duration::from_secs(1), "readiness took {:?}", told.elapsed());
    let (status, refused) = service.upload().await;
    assert_eq!((status, &refused["type"]), (503, &"/problems/unavailable".into()));
    // Those that wait for the job may ask on until it has come to rest.
    assert_eq!(service.get(&path).send().await.unwrap().status(), 200);
    while let Ok(Some(_)) = events.chunk().await {}
    assert!(service.child.wait().unwrap().success());
    assert!(told.elapsed() < Duration::from_secs(10), "stopping took {:?}", told.elapsed());

    let service = Process::start(folder.path(), &[]);
    let job = service.until(&path, |_, job| job["state"] == "running").await;
    assert_eq!((&job["attempt"], &job["cancel_requested"]), (&2.into(), &false.into()));
}
