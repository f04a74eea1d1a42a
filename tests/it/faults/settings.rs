//! Settings and data folders that a service must not start with.

use std::process::{Command, Stdio};

use super::process::{Process, command};

/// What a service that does not start says.
fn refusal(mut command: Command) -> String {
    let done = command.stdin(Stdio::null()).output().unwrap();
    assert!(!done.status.success());
    String::from_utf8(done.stderr).unwrap()
}

#[test]
fn settings_that_make_no_sense_are_refused_at_the_start() {
    let folder = tempfile::tempdir().unwrap();
    let told = refusal(command(folder.path(), &["--lease", "5", "--heartbeat", "10"]));
    assert!(told.contains("two heartbeats"), "{told}");
    let told = refusal(command(folder.path(), &["--download-redirects", "60"]));
    assert!(told.contains("files in the data folder have no URLs"), "{told}");
    assert!(folder.path().read_dir().unwrap().next().is_none(), "something was made");
}

#[test]
fn authorities_that_are_none_are_refused_at_the_start() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("ca.pem");
    let garbled = "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n";
    for (text, remedy) in [("none at all", "has no certificate"), (garbled, "ca_file")] {
        std::fs::write(&file, text).unwrap();
        let settings = ["--ca-file", file.to_str().unwrap()];
        let told = refusal(command(&folder.path().join("data"), &settings));
        assert!(told.contains(remedy), "{told}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn bytes_without_their_database_are_not_served_and_not_deleted() {
    let folder = tempfile::tempdir().unwrap();
    let service = Process::start(folder.path(), &[]);
    let (_, job) = service.upload().await;
    service.signal("KILL");
    drop(service);
    for name in ["jobs.sqlite", "jobs.sqlite-wal", "jobs.sqlite-shm"] {
        let _ = std::fs::remove_file(folder.path().join(name));
    }
    let told = refusal(command(folder.path(), &[]));
    assert!(told.contains("--adopt-bytes"), "{told}");

    let service = Process::start(folder.path(), &["--adopt-bytes"]);
    service.until("/health/ready", |status, _| status == 200).await;
    let (_, second) = service.upload().await;
    let second = second["links"]["self"].as_str().unwrap().to_owned();
    service.until(&second, |_, job| job["state"] == "succeeded").await;
    let kept = folder.path().join("bytes/inputs").join(job["id"].as_str().unwrap());
    assert_eq!(kept.join("views").read_dir().unwrap().count(), 3);
}
