//! Kills the service at random moments while jobs are uploaded and run, and
//! holds what the accepted ones end with against an undisturbed run.
//!
//! `CRASH_KILLS` sets how often it is killed, `CRASH_SEED` when, `CRASH_DELAY_MS`
//! how long it lives at most, `CRASH_JOBS` how many jobs there are.
//! `CRASH_SHEET` names a sheet document to use instead of drawings made here.

use std::collections::BTreeMap;
use std::env;
use std::io::{BufRead, BufReader, Cursor};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use image::{GrayImage, ImageFormat, Luma};
use imageproc::drawing::draw_antialiased_line_segment_mut;
use imageproc::pixelops::interpolate;
use jobs::bytes::{ByteStore, Key};
use jobs::{EventKind, JobId, JobState, JobStore, SqliteStore, SystemClock};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use reqwest::multipart::{Form, Part};
use reqwest::{Client, StatusCode};
use serde_json::Value;
use sha2::{Digest, Sha256};
use sheet::SheetDocument;

const PATIENCE: Duration = Duration::from_secs(600);

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_accepted_job_ends_once_however_often_the_service_is_killed() {
    let (kills, jobs) = (setting("CRASH_KILLS", 2), setting("CRASH_JOBS", 2));
    let delay_ms = setting("CRASH_DELAY_MS", 1500);
    let mut rng = ChaCha8Rng::seed_from_u64(setting("CRASH_SEED", 1));

    let calm_folder = tempfile::tempdir().unwrap();
    let service = Service::start(calm_folder.path(), kills);
    let accepted = service.upload((0..jobs).collect()).await;
    service.wait(&accepted).await;
    drop(service);
    let (calm, _) = results(calm_folder.path(), &accepted).await;

    let folder = tempfile::tempdir().unwrap();
    let mut accepted = BTreeMap::new();
    let mut service = Service::start(folder.path(), kills);
    for kill in 1..=kills {
        // However slow or fast the machine, the last kill hits a running job:
        // one is held back until then, and the kill comes as soon as it runs.
        let is_last = kill == kills;
        let offered = if is_last { jobs } else { jobs - 1 };
        let left = (0..offered).filter(|seed| !accepted.contains_key(seed)).collect();
        let uploading = tokio::spawn(service.uploader.clone().upload_all(left));
        let delay = Duration::from_millis(rng.random_range(0..delay_ms));
        if is_last {
            service.wait_for_running().await;
        } else {
            tokio::time::sleep(delay).await;
        }
        drop(service);
        accepted.extend(uploading.await.unwrap());
        service = Service::start(folder.path(), kills);
    }
    let left = (0..jobs).filter(|seed| !accepted.contains_key(seed)).collect();
    accepted.extend(service.upload(left).await);
    service.wait(&accepted).await;
    drop(service);
    let (disturbed, attempts) = results(folder.path(), &accepted).await;
    println!("{kills} kills, {attempts} attempts for {jobs} jobs");
    assert_eq!(disturbed.len() as u64, jobs);
    assert_eq!(disturbed, calm);
    assert!(attempts > jobs, "no kill hit a running job");
}

fn setting(name: &str, default: u64) -> u64 {
    env::var(name).map_or(default, |text| text.parse().expect(name))
}

/// A service process of ours; killed without warning when dropped.
struct Service {
    child: Child,
    uploader: Uploader,
}

impl Service {
    fn start(folder: &Path, kills: u64) -> Self {
        let attempts = (kills + 1).to_string();
        let mut child = Command::new(env!("CARGO_BIN_EXE_turnaround"))
            .args(["serve", "--listen", "127.0.0.1:0", "--workers", "2", "--threads-per-job", "1"])
            .args(["--lease", "3", "--heartbeat", "1", "--max-attempts", &attempts])
            .arg("--data-dir")
            .arg(folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let url = lines
            .map_while(Result::ok)
            .find_map(|line| line.split_once("http://").map(|(_, address)| address.to_owned()))
            .expect("the service says where it listens");
        let client = crate::client();
        let url = format!("http://{}/v1/reconstructions", url.trim());
        Self { child, uploader: Uploader { client, url } }
    }

    async fn upload(&self, seeds: Vec<u64>) -> BTreeMap<u64, JobId> {
        let wanted = seeds.len();
        let accepted = self.uploader.clone().upload_all(seeds).await;
        assert_eq!(accepted.len(), wanted, "an undisturbed upload failed");
        accepted
    }

    async fn wait_for_running(&self) {
        let url = format!("{}?state=running", self.uploader.url);
        let begun = Instant::now();
        loop {
            let response = self.uploader.client.get(&url).send().await.unwrap();
            let listing: Value = response.json().await.unwrap();
            if !listing["reconstructions"].as_array().unwrap().is_empty() {
                return;
            }
            assert!(begun.elapsed() < PATIENCE, "no job runs");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }

    async fn wait(&self, accepted: &BTreeMap<u64, JobId>) {
        let begun = Instant::now();
        for id in accepted.values() {
            while !self.uploader.is_finished(*id).await {
                assert!(begun.elapsed() < PATIENCE, "job {id} does not end");
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
        }
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        // SIGKILL on Unix.
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

#[derive(Clone)]
struct Uploader {
    client: Client,
    url: String,
}

impl Uploader {
    /// Uploads one job a seed until the connection breaks. Returns what was
    /// accepted with a 202.
    async fn upload_all(self, seeds: Vec<u64>) -> BTreeMap<u64, JobId> {
        let mut accepted = BTreeMap::new();
        for seed in seeds {
            let request = self.client.post(&self.url).multipart(form(seed));
            let Ok(response) = request.send().await else { break };
            let (status, body) = (response.status(), response.json::<Value>().await);
            let Ok(body) = body else { break };
            assert_eq!(status, StatusCode::ACCEPTED, "{body}");
            accepted.insert(seed, body["id"].as_str().unwrap().parse().unwrap());
        }
        accepted
    }

    async fn is_finished(&self, id: JobId) -> bool {
        let response = self.client.get(format!("{}/{id}", self.url)).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::OK, "job {id} was accepted and is gone");
        let job: Value = response.json().await.unwrap();
        !matches!(job["state"].as_str().unwrap(), "queued" | "running")
    }
}

/// Content hashes of a job's artifacts by name.
type Hashes = BTreeMap<String, String>;

/// What each accepted job ended with, and how many attempts all took together.
/// Checks that each ended once and that the bytes are those listed.
async fn results(folder: &Path, accepted: &BTreeMap<u64, JobId>) -> (BTreeMap<u64, Hashes>, u64) {
    let clock = Arc::new(SystemClock);
    let store = SqliteStore::open(&folder.join("jobs.sqlite"), clock).await.unwrap();
    let bytes = ByteStore::local(&folder.join("bytes")).unwrap();
    let (mut results, mut attempts) = (BTreeMap::new(), 0);
    for (seed, id) in accepted {
        let job = store.get(*id).await.unwrap();
        assert_eq!((job.state, &job.failure), (JobState::Succeeded, &None));
        let events = store.events(*id, 0).await.unwrap();
        assert_eq!(events.iter().filter(|it| it.kind == EventKind::Succeeded).count(), 1);
        assert_eq!(events.last().unwrap().kind, EventKind::Succeeded);
        assert!(events.iter().map(|it| it.number).eq(1..=events.len() as u64));
        let mut hashes = Hashes::new();
        for entry in job.artifacts {
            let key = Key::Artifact { job: *id, attempt: job.attempt, name: &entry.name };
            let stored = bytes.get(&key).await.unwrap();
            assert_eq!(hex::encode(Sha256::digest(&stored)), entry.sha256, "{}", entry.name);
            // The only artifact that may differ from run to run.
            if entry.name != "timings.json" {
                hashes.insert(entry.name, entry.sha256);
            }
        }
        attempts += u64::from(job.attempt);
        results.insert(*seed, hashes);
    }
    (results, attempts)
}

/// The upload of a job: drawings that differ from seed to seed, or the sheet
/// that `CRASH_SHEET` names.
pub(crate) fn form(seed: u64) -> Form {
    let part = |png: Vec<u8>| Part::bytes(png).file_name("view.png").mime_str("image/png").unwrap();
    if let Some(sheet) = env::var_os("CRASH_SHEET") {
        let text = std::fs::read(&sheet).unwrap();
        let document: SheetDocument = serde_json::from_slice(&text).unwrap();
        let folder = Path::new(&sheet).parent().unwrap();
        return document.views.iter().fold(Form::new(), |form, view| {
            let image = std::fs::read(folder.join(&view.image)).unwrap();
            form.part(format!("view[{}]", view.azimuth_deg), part(image))
        });
    }
    [0, 5, 10].into_iter().fold(Form::new(), |form, azimuth_deg| {
        form.part(format!("view[{azimuth_deg}]"), part(drawing(seed, f64::from(azimuth_deg))))
    })
}

/// Small glyphs of random strokes on a turning, bulging drum: points that differ
/// enough to be matched.
fn drawing(seed: u64, azimuth_deg: f64) -> Vec<u8> {
    const SIZE: (u32, u32) = (240, 200);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut image = GrayImage::from_pixel(SIZE.0, SIZE.1, Luma([255]));
    for _ in 0..120 {
        let y: f64 = rng.random_range(-85.0..85.0);
        let around_deg: f64 = rng.random_range(-80.0..80.0);
        let radius = rng.random_range(0.6..1.0) * (110.0 - y * y / 200.0);
        let x = 120.0 + radius * (around_deg + azimuth_deg).to_radians().sin();
        for _ in 0..4 {
            let [from, to] = [(); 2].map(|()| {
                let offset = |rng: &mut ChaCha8Rng| rng.random_range(-8.0..8.0);
                ((x + offset(&mut rng)) as i32, (100.0 + y + offset(&mut rng)) as i32)
            });
            draw_antialiased_line_segment_mut(&mut image, from, to, Luma([0]), interpolate);
        }
    }
    let mut png = Cursor::new(Vec::new());
    image.write_to(&mut png, ImageFormat::Png).unwrap();
    png.into_inner()
}
