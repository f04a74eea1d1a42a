//! What the compiler cannot hold: crates that compute know no clock and do no
//! I/O, and only the crates meant to may link what is heavy.

use std::fs;
use std::path::{Path, PathBuf};

/// Crates that compute and do nothing else.
const PURE: &[&str] = &[
    "artifacts",
    "drawing",
    "evaluation",
    "frames",
    "mesh",
    "options",
    "page",
    "picture",
    "prior",
    "progress",
    "remesh",
    "sheet",
    "study",
    "subject",
    "turntable",
    "uncalibrated",
];

/// What a pure crate never names.
const IMPURE: &[&str] =
    &["std::fs", "std::env", "std::time", "std::net", "std::process", "Instant", "SystemTime"];

/// Heavy dependencies and the crates that may have them.
const HEAVY: &[(&str, &[&str])] = &[
    ("opencv", &["uncalibrated"]),
    ("uncalibrated", &["study"]),
    ("tokio", &["jobs", "testbed"]),
    ("sqlx", &["jobs"]),
    ("rusqlite", &["jobs"]),
    ("object_store", &["jobs"]),
    ("safetensors", &["prior"]),
    ("axum", &[]),
    ("reqwest", &["jobs"]),
];

fn crates() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("crates")
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// A file's code without comments, its tests included.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    text.lines().map(|line| line.split("//").next().unwrap()).collect::<Vec<_>>().join("\n")
}

#[test]
fn computing_crates_know_no_clock_and_do_no_io() {
    for name in PURE {
        let mut files = Vec::new();
        sources(&crates().join(name).join("src"), &mut files);
        assert!(!files.is_empty(), "{name} has no source");
        for path in files {
            let code = code(&path);
            for word in IMPURE {
                assert!(!code.contains(word), "{} names {word}", path.display());
            }
        }
    }
}

#[test]
fn heavy_dependencies_stay_where_they_belong() {
    for entry in fs::read_dir(crates()).unwrap() {
        let folder = entry.unwrap().path();
        let name = folder.file_name().unwrap().to_string_lossy().into_owned();
        let manifest = fs::read_to_string(folder.join("Cargo.toml")).unwrap();
        for (heavy, allowed) in HEAVY {
            let has = manifest.lines().any(|line| line.starts_with(&format!("{heavy}.")));
            assert!(!has || allowed.contains(&name.as_str()), "{name} depends on {heavy}");
        }
    }
}
