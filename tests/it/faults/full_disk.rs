//! A disk that fills up while the service runs, and has room again.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use super::process::{Process, command};

const DISK: &str = "size=48m";

/// Whether this process may mount a disk of its own.
fn may_mount(folder: &Path) -> bool {
    let mount = format!("mount -t tmpfs -o {DISK} tmpfs '{}'", folder.display());
    let tried = Command::new("unshare").args(["-m", "sh", "-c", &mount]).output();
    tried.is_ok_and(|done| done.status.success())
}

/// A service on a disk of its own, which only it sees.
fn on_small_disk(folder: &Path) -> Process {
    let served = command(folder, &["--min-free-mib", "8", "--lease", "4", "--heartbeat", "1"]);
    let words: Vec<_> = std::iter::once(served.get_program())
        .chain(served.get_args())
        .map(|word| format!("'{}'", word.to_str().unwrap()))
        .collect();
    let mount = format!("mount -t tmpfs -o {DISK} tmpfs '{}'", folder.display());
    let mut unshared = Command::new("unshare");
    unshared.args(["-m", "sh", "-c", &format!("{mount} && exec {}", words.join(" "))]);
    Process::spawn(unshared)
}

/// The folder as the service sees it.
fn inside(service: &Process, folder: &Path) -> PathBuf {
    Path::new("/proc")
        .join(service.child.id().to_string())
        .join("root")
        .join(folder.strip_prefix("/").unwrap())
}

/// Takes all that is left.
fn fill(disk: &Path) -> PathBuf {
    let path = disk.join("filler");
    let mut size = 1 << 20;
    let mut file = fs::File::create(&path).unwrap();
    while size > 0 {
        if std::io::Write::write_all(&mut file, &vec![1; size]).is_err() {
            size /= 2;
        }
    }
    path
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_full_disk_refuses_uploads_lets_jobs_wait_and_passes() {
    let folder = tempfile::tempdir().unwrap();
    if !may_mount(folder.path()) {
        eprintln!("left out: mounting a disk needs rights that this process has not");
        return;
    }
    let service = on_small_disk(folder.path());
    let disk = inside(&service, folder.path());
    let (status, first) = service.upload().await;
    assert_eq!(status, 202, "{first}");
    let first = first["links"]["self"].as_str().unwrap().to_owned();
    service.until(&first, |_, job| job["state"] == "succeeded").await;

    // One that waits for the worker when the disk fills up.
    let (_, waiting) = service.upload().await;
    let filler = fill(&disk);
    let (status, refused) = service.upload().await;
    assert_eq!((status, &refused["type"]), (507, &Value::from("/problems/insufficient-storage")));
    for _ in 0..3 {
        assert_eq!(service.get("/health/ready").send().await.unwrap().status(), 507);
    }
    // What makes room is possible, and reading too.
    assert_eq!(service.get(&first).send().await.unwrap().status(), 200);
    let deleted = service.client.delete(format!("{}{first}", service.url)).send().await.unwrap();
    assert_eq!(deleted.status(), 204, "{}", deleted.text().await.unwrap());
    let gone = disk.join("bytes/inputs").join(first.rsplit('/').next().unwrap());
    assert!(!gone.exists());

    // Nothing but room is needed for all to go on.
    fs::remove_file(filler).unwrap();
    service.until("/health/ready", |status, _| status == 200).await;
    let waiting = waiting["links"]["self"].as_str().unwrap();
    let ended = service.until(waiting, |_, job| !job["finished_at"].is_null()).await;
    assert_eq!(ended["state"], "succeeded", "{ended}");
    assert_eq!(service.upload().await.0, 202);
    let attempts = disk.join("bytes/artifacts").join(waiting.rsplit('/').next().unwrap());
    assert_eq!(fs::read_dir(attempts).unwrap().count(), 1, "bytes of broken attempts stay");
    let reserve = fs::metadata(disk.join("jobs.sqlite.reserve")).unwrap().len();
    assert_eq!(reserve, 4 << 20, "the reserve was not taken again");
}
