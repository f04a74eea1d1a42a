//! Jobs that take their process along: neighbours go on, and they end after
//! exactly their attempts.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::Value;

use super::process::{Process, command, sheet};

const SETTINGS: &[&str] = &[
    "--workers",
    "2",
    "--max-job-mib",
    "256",
    "--max-attempts",
    "2",
    "--lease",
    "4",
    "--heartbeat",
    "1",
];

/// A service whose jobs of these seeds go wrong.
fn faulty(folder: &Path, faults: &str) -> Process {
    let mut command = command(folder, SETTINGS);
    command.env("TURNAROUND_TEST_FAULT", faults);
    Process::spawn(command)
}

async fn queue(service: &Process, seed: u32) -> String {
    let form = sheet().text("seed", seed.to_string());
    let sent = service.post("/v1/reconstructions").multipart(form).send().await.unwrap();
    assert_eq!(sent.status(), 202);
    sent.json::<Value>().await.unwrap()["links"]["self"].as_str().unwrap().to_owned()
}

async fn ended(service: &Process, path: &str) -> Value {
    service.until(path, |_, job| !job["finished_at"].is_null()).await
}

/// The processes that work for a service.
fn children(service: &Process) -> Vec<String> {
    let pid = service.child.id();
    let tasks = fs::read_dir(format!("/proc/{pid}/task")).unwrap();
    let of_task = |task: fs::DirEntry| fs::read_to_string(task.path().join("children"));
    let all = tasks.filter_map(|task| of_task(task.ok()?).ok()).collect::<String>();
    all.split_whitespace().map(str::to_owned).collect()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_job_that_kills_its_process_fails_alone_after_exactly_its_attempts() {
    let folder = tempfile::tempdir().unwrap();
    let service = faulty(folder.path(), "13=abort,14=overflow,15=allocate");
    for (seed, told) in [(13, "signal 6"), (14, "overflowed its stack"), (15, "allocation of")] {
        let faulty = queue(&service, seed).await;
        let mut neighbours = Vec::new();
        for _ in 0..2 {
            neighbours.push(queue(&service, 1).await);
        }
        for neighbour in neighbours {
            let job = ended(&service, &neighbour).await;
            assert_eq!((&job["state"], &job["attempt"]), (&"succeeded".into(), &1.into()));
        }
        let job = ended(&service, &faulty).await;
        assert_eq!((&job["state"], &job["attempt"]), (&"failed".into(), &2.into()), "{job}");
        let failure = &job["failure"];
        let detail = failure["detail"].as_str().unwrap();
        assert_eq!(failure["code"], "crashed");
        assert!(detail.contains("crashed 2 times") && detail.contains(told), "{detail}");
    }
    service.until("/health/ready", |status, _| status == 200).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_job_that_does_not_stop_is_killed_within_a_second() {
    let folder = tempfile::tempdir().unwrap();
    let service = faulty(folder.path(), "14=loop");
    let path = queue(&service, 14).await;
    service.until(&path, |_, job| job["state"] == "running").await;
    let cancelled = Instant::now();
    let url = format!("{path}/cancel");
    assert!(service.post(&url).send().await.unwrap().status().is_success());
    let job = ended(&service, &path).await;
    assert_eq!(job["state"], "cancelled");
    assert!(cancelled.elapsed() < Duration::from_secs(2), "{:?}", cancelled.elapsed());
    // Its process is gone too: nothing goes on computing.
    let next = queue(&service, 1).await;
    assert_eq!(ended(&service, &next).await["state"], "succeeded");
    for child in children(&service) {
        let state = fs::read_to_string(format!("/proc/{child}/stat")).unwrap_or_default();
        assert!(!state.contains(") R "), "{state}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn its_process_reaches_neither_network_nor_files_nor_programs() {
    let folder = tempfile::tempdir().unwrap();
    let service = faulty(folder.path(), "16=reach out");
    let job = ended(&service, &queue(&service, 16).await).await;
    let detail = job["failure"]["detail"].as_str().unwrap();
    let refused = "network Err(PermissionDenied), file Err(PermissionDenied), \
                   program Err(PermissionDenied), thread true";
    assert!(detail.contains(refused), "{detail}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn processes_die_with_their_service_and_no_job_is_stranded() {
    let folder = tempfile::tempdir().unwrap();
    let service = faulty(folder.path(), "14=loop");
    let path = queue(&service, 14).await;
    service.until(&path, |_, job| job["state"] == "running").await;
    let workers = children(&service);
    assert!(workers.len() >= 2, "{workers:?}");
    service.signal("KILL");
    drop(service);
    let begun = Instant::now();
    for worker in workers {
        while Path::new("/proc").join(&worker).join("cmdline").metadata().is_ok_and(|_| {
            let state = fs::read_to_string(format!("/proc/{worker}/stat"));
            state.is_ok_and(|state| !state.contains(") Z "))
        }) {
            assert!(begun.elapsed() < Duration::from_secs(5), "{worker} lives on");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }
    // The same service again, without the fault: what ran is run to its end.
    let settings = ["--lease", "2", "--heartbeat", "1"];
    let service = Process::start(folder.path(), &settings);
    let job = ended(&service, &path).await;
    assert_eq!((&job["state"], &job["attempt"]), (&"succeeded".into(), &2.into()));
}
