//! The suite that the byte store passes in a folder, in memory and on S3.

use std::fs;
use std::sync::Arc;

use bytes::Bytes;
use futures::TryStreamExt;
use jobs::JobId;
use jobs::bytes::{ByteError, ByteRange, ByteStore, BytesOf, Home, Key};
use object_store::memory::InMemory;
use testbed::{BUCKET, Fault, S3};

fn stores() -> ((tempfile::TempDir, S3), [ByteStore; 3]) {
    let (folder, s3) = (tempfile::tempdir().unwrap(), S3::start());
    let local = ByteStore::local(&folder.path().join("bytes")).unwrap();
    let memory = ByteStore::remote(Arc::new(InMemory::new()));
    let bucket = bucket(&s3);
    ((folder, s3), [local, memory, bucket])
}

fn bucket(s3: &S3) -> ByteStore {
    ByteStore::s3(&format!("s3://{BUCKET}/farm/one"), s3.environment()).unwrap()
}

fn artifact(job: JobId, attempt: u32) -> Key<'static> {
    Key::Artifact { job, attempt, name: "views/22.5/disparity.png" }
}

async fn collect(part: ByteRange) -> Vec<u8> {
    let chunks: Vec<Bytes> = part.chunks.try_collect().await.unwrap();
    chunks.concat()
}

#[tokio::test]
async fn what_is_put_comes_back_whole_or_in_part() {
    let (_services, stores) = stores();
    let content: Vec<u8> = (0..100_000u32).map(|i| (i % 251) as u8).collect();
    for store in stores {
        let key = artifact(JobId::new(), 1);
        store.put(&key, content.clone().into()).await.unwrap();
        assert_eq!(store.get(&key).await.unwrap(), content);
        assert_eq!(store.size(&key).await.unwrap(), 100_000);
        let part = store.stream(&key, Some(9_000..20_001)).await.unwrap();
        assert_eq!((part.size, part.range.clone()), (100_000, 9_000..20_001));
        assert_eq!(collect(part).await, content[9_000..20_001]);
        let tail = store.stream(&key, Some(99_990..200_000)).await.unwrap();
        assert_eq!(tail.range, 99_990..100_000);
        assert_eq!(collect(tail).await, content[99_990..]);
        assert_eq!(collect(store.stream(&key, None).await.unwrap()).await, content);
        for outside in [100_000..100_001, 7..7] {
            let outside = store.stream(&key, Some(outside)).await;
            assert!(matches!(outside, Err(ByteError::Range { size: 100_000, .. })));
        }
        let nothing = store.stream(&artifact(JobId::new(), 1), None).await;
        assert!(matches!(nothing, Err(ByteError::NotFound(_))));
        // Of more than one piece, and of none.
        let long = content.repeat(7);
        let (large, empty) = (artifact(JobId::new(), 1), artifact(JobId::new(), 1));
        store.put(&large, long.clone().into()).await.unwrap();
        store.put(&empty, Bytes::new()).await.unwrap();
        assert_eq!(collect(store.stream(&large, None).await.unwrap()).await, long);
        let part = store.stream(&large, Some(3..600_000)).await.unwrap();
        assert_eq!(collect(part).await, long[3..600_000]);
        assert_eq!(collect(store.stream(&empty, None).await.unwrap()).await, b"");
    }
}

#[tokio::test]
async fn what_is_written_in_pieces_is_there_once_finished() {
    let (_services, stores) = stores();
    let piece: Bytes = (0..3_000_000u32).map(|i| (i % 253) as u8).collect();
    for store in stores {
        let [kept, dropped] = [JobId::new(), JobId::new()].map(|job| artifact(job, 1));
        let mut writer = store.writer(&kept).await.unwrap();
        for _ in 0..5 {
            writer.write(piece.clone()).await.unwrap();
        }
        assert!(matches!(store.get(&kept).await, Err(ByteError::NotFound(_))));
        writer.finish().await.unwrap();
        assert_eq!(store.get(&kept).await.unwrap(), piece.repeat(5));
        let mut writer = store.writer(&dropped).await.unwrap();
        writer.write(piece.clone()).await.unwrap();
        writer.abort().await.unwrap();
        assert!(matches!(store.get(&dropped).await, Err(ByteError::NotFound(_))));
    }
}

#[tokio::test]
async fn deleting_a_job_takes_all_its_bytes_and_no_others() {
    let (_services, stores) = stores();
    for store in stores {
        let [gone, kept] = [JobId::new(), JobId::new()];
        for job in [gone, kept] {
            let input = Key::Input { job, name: "front.png" };
            store.put(&input, Bytes::from_static(b"drawing")).await.unwrap();
            store.put(&artifact(job, 1), Bytes::from_static(b"one")).await.unwrap();
            store.put(&artifact(job, 2), Bytes::from_static(b"two")).await.unwrap();
        }
        assert_eq!(store.jobs().await.unwrap(), [gone, kept]);
        store.delete_attempt(gone, 1).await.unwrap();
        assert_eq!(store.attempts(gone).await.unwrap(), [2]);
        assert!(store.last_written(gone).await.unwrap().is_some());
        store.delete_job(gone).await.unwrap();
        store.delete_job(gone).await.unwrap();
        assert_eq!(store.jobs().await.unwrap(), [kept]);
        assert_eq!(store.attempts(kept).await.unwrap(), [1, 2]);
        assert_eq!(store.last_written(gone).await.unwrap(), None);
        let missing = store.get(&artifact(gone, 2)).await;
        assert!(matches!(missing, Err(ByteError::NotFound(_))));
    }
}

#[tokio::test]
async fn a_copy_outlives_its_source() {
    let (_services, stores) = stores();
    for store in stores {
        let [old, new] = [JobId::new(), JobId::new()];
        let from = Key::Input { job: old, name: "front.png" };
        let to = Key::Input { job: new, name: "front.png" };
        store.put(&from, Bytes::from_static(b"drawing")).await.unwrap();
        store.copy(&Home::Shared, &from, &to).await.unwrap();
        store.delete_job(old).await.unwrap();
        assert_eq!(store.get(&to).await.unwrap(), "drawing");
    }
}

#[tokio::test]
async fn tenants_have_prefixes_of_their_own() {
    let (_services, stores) = stores();
    for store in stores {
        let (old, new) = (JobId::new(), JobId::new());
        let homes = ["a", "show-7"].map(|name| Home::Tenant(name.parse().unwrap()));
        let key = |job| Key::Input { job, name: "front.png" };
        store.put(&key(old), Bytes::from_static(b"shared")).await.unwrap();
        // The same name below both prefixes: neither sees the other.
        for (home, text) in homes.iter().zip(["of a", "of show-7"]) {
            let own = store.of(home);
            own.put(&key(new), Bytes::from(text)).await.unwrap();
            own.copy(&Home::Shared, &key(old), &key(old)).await.unwrap();
            let mut writer = own.writer(&artifact(new, 1)).await.unwrap();
            writer.write(Bytes::from(text)).await.unwrap();
            writer.finish().await.unwrap();
        }
        assert!(matches!(store.get(&key(new)).await, Err(ByteError::NotFound(_))));
        let [a, show] = homes.each_ref().map(|home| store.of(home));
        assert_eq!(a.get(&key(new)).await.unwrap(), "of a");
        assert_eq!(show.get(&key(new)).await.unwrap(), "of show-7");
        assert_eq!(show.get(&key(old)).await.unwrap(), "shared");
        assert_eq!(collect(a.stream(&artifact(new, 1), Some(0..2)).await.unwrap()).await, b"of");
        assert_eq!(a.stored(new).await.unwrap(), 8);
        let all =
            |ids: [(JobId, &Home); 5]| ids.map(|(id, home)| BytesOf { id, home: home.clone() });
        let shared = Home::Shared;
        assert_eq!(
            store.all().await.unwrap(),
            all([
                (old, &shared),
                (old, &homes[0]),
                (new, &homes[0]),
                (old, &homes[1]),
                (new, &homes[1])
            ])
        );
        // From wherever one looks.
        assert_eq!(show.all().await.unwrap(), store.all().await.unwrap());
        a.delete_attempt(new, 1).await.unwrap();
        a.delete_job(old).await.unwrap();
        assert_eq!(a.jobs().await.unwrap(), [new]);
        assert_eq!(show.attempts(new).await.unwrap(), [1]);
        assert_eq!(store.get(&key(old)).await.unwrap(), "shared");
    }
}

#[tokio::test]
async fn partly_written_files_go_with_their_job() {
    let folder = tempfile::tempdir().unwrap();
    let store = ByteStore::local(folder.path()).unwrap();
    let job = JobId::new();
    let directory = folder.path().join("inputs").join(job.to_string());
    fs::create_dir_all(&directory).unwrap();
    fs::write(directory.join("front.png#1"), b"half").unwrap();
    assert_eq!(store.jobs().await.unwrap(), [job]);
    assert_eq!(store.last_written(job).await.unwrap(), None);
    store.delete_job(job).await.unwrap();
    assert!(!directory.exists());
}

/// More than what is sent at once comes and goes in parts.
#[tokio::test]
async fn large_objects_go_to_s3_in_parts() {
    let s3 = S3::start();
    let (store, key) = (bucket(&s3), artifact(JobId::new(), 1));
    let piece: Bytes = (0..7_000_000u32).map(|i| (i % 249) as u8).collect();
    let mut writer = store.writer(&key).await.unwrap();
    for _ in 0..6 {
        writer.write(piece.clone()).await.unwrap();
    }
    writer.finish().await.unwrap();
    assert_eq!(store.size(&key).await.unwrap(), 42_000_000);
    let part = store.stream(&key, Some(20_999_990..21_000_010)).await.unwrap();
    assert_eq!(collect(part).await, [&piece[6_999_990..], &piece[..10]].concat());
    let mut empty = store.writer(&artifact(JobId::new(), 1)).await.unwrap();
    empty.write(Bytes::new()).await.unwrap();
    empty.finish().await.unwrap();
}

/// Two stores below different prefixes of a bucket see nothing of each other.
#[tokio::test]
async fn prefixes_are_kept_apart() {
    let s3 = S3::start();
    let (one, key) = (bucket(&s3), artifact(JobId::new(), 1));
    let other = ByteStore::s3(&format!("s3://{BUCKET}/farm"), s3.environment()).unwrap();
    one.put(&key, Bytes::from_static(b"one")).await.unwrap();
    assert!(matches!(other.get(&key).await, Err(ByteError::NotFound(_))));
    assert_eq!(other.jobs().await.unwrap(), []);
    assert!(s3.objects().join("farm/one").join(key.path().unwrap().as_ref()).exists());
}

#[tokio::test]
async fn an_artifact_is_written_once() {
    let s3 = S3::start();
    let (store, job) = (bucket(&s3), JobId::new());
    let key = artifact(job, 1);
    store.put(&key, Bytes::from_static(b"mine")).await.unwrap();
    // Sent again, for its answer was lost.
    store.put(&key, Bytes::from_static(b"mine")).await.unwrap();
    let other = store.put(&key, Bytes::from_static(b"other")).await;
    assert!(matches!(other, Err(ByteError::Backend(_))), "{other:?}");
    assert_eq!(store.get(&key).await.unwrap(), "mine");
    let input = Key::Input { job, name: "page.json" };
    for content in ["one", "two"] {
        store.put(&input, content.into()).await.unwrap();
        assert_eq!(store.get(&input).await.unwrap(), content);
    }
}

#[tokio::test]
async fn errors_of_s3_that_pass_are_not_noticed() {
    let s3 = Arc::new(S3::start());
    let store = bucket(&s3);
    for fault in [Fault::Error, Fault::LateError] {
        let key = artifact(JobId::new(), 1);
        s3.set_fault(fault);
        let mending = Arc::clone(&s3);
        let mended = tokio::spawn(async move {
            tokio::time::sleep(std::time::Duration::from_millis(700)).await;
            mending.set_fault(Fault::None);
        });
        store.put(&key, Bytes::from_static(b"drawing")).await.unwrap();
        mended.await.unwrap();
        assert_eq!(store.get(&key).await.unwrap(), "drawing");
    }
}

#[tokio::test]
async fn a_key_that_s3_does_not_know_is_refused() {
    let s3 = S3::start();
    let wrong = |(name, value): (String, String)| match name.as_str() {
        "AWS_SECRET_ACCESS_KEY" => (name, "another".to_owned()),
        _ => (name, value),
    };
    let environment = s3.environment().map(wrong);
    let store = ByteStore::s3(&format!("s3://{BUCKET}"), environment).unwrap();
    let refused = store.put(&artifact(JobId::new(), 1), Bytes::new()).await;
    assert!(matches!(refused, Err(ByteError::Backend(_))), "{refused:?}");
}
