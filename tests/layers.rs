//! Which module may use which, held against the source (ARCHITECTURE.md).

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Modules of the crate and the modules they may import.
const MAY_USE: &[(&str, &[&str])] = &[
    ("float_image", &[]),
    ("geometry", &[]),
    ("sheet", &["geometry", "model_io", "options"]),
    ("options", &[]),
    ("jobs", &[]),
    ("artifacts", &["jobs"]),
    ("vision", &["float_image", "geometry", "options", "sheet"]),
    ("pipeline", &["float_image", "geometry", "options", "sheet", "vision"]),
    ("turntable", &["float_image", "geometry", "options", "sheet"]),
    (
        "export",
        &[
            "evaluation",
            "float_image",
            "geometry",
            "options",
            "pipeline",
            "sheet",
            "turntable",
            "vision",
        ],
    ),
    ("model_io", &["geometry"]),
    ("models", &["geometry", "model_io"]),
    ("draw", &["export", "float_image", "geometry", "model_io", "models", "options", "sheet"]),
    ("evaluation", &["float_image", "geometry", "sheet"]),
    (
        "draft",
        &[
            "evaluation",
            "export",
            "float_image",
            "geometry",
            "model_io",
            "options",
            "pipeline",
            "sheet",
            "turntable",
        ],
    ),
    ("study", &["evaluation", "float_image", "options", "pipeline", "sheet", "vision"]),
    (
        "worker",
        &[
            "artifacts",
            "draft",
            "draw",
            "export",
            "jobs",
            "model_io",
            "options",
            "pipeline",
            "sheet",
        ],
    ),
    (
        "http",
        &[
            "artifacts",
            "draft",
            "draw",
            "evaluation",
            "jobs",
            "model_io",
            "models",
            "options",
            "pipeline",
            "sheet",
        ],
    ),
];

/// Modules that compute and do nothing else.
const PURE: &[&str] = &[
    "geometry",
    "vision",
    "pipeline",
    "export",
    "options",
    "model_io",
    "models",
    "draw",
    "evaluation",
    "study",
    "turntable",
];

/// What a pure module never names.
const IMPURE: &[&str] = &[
    "std::fs",
    "std::env",
    "std::time",
    "std::net",
    "std::process",
    "tokio",
    "axum",
    "sqlx",
    "object_store",
    "reqwest",
    "jiff",
    "Instant::now",
    "SystemTime",
];

/// Tests in files of their own may use more, as inline ones may.
fn sources(module: &str) -> Vec<PathBuf> {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let file = src.join(module).with_extension("rs");
    let mut found = if file.exists() { vec![file] } else { Vec::new() };
    let mut folders = vec![src.join(module)];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).into_iter().flatten() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs")
                && !path.file_stem().is_some_and(|stem| stem.to_string_lossy().ends_with("tests"))
            {
                found.push(path);
            }
        }
    }
    assert!(!found.is_empty(), "module {module} has no source");
    found
}

/// The source without comments and without its inline tests, which may use more.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    let text = text.split("#[cfg(test)]").next().unwrap();
    text.lines().map(|line| line.split("//").next().unwrap()).collect::<Vec<_>>().join("\n")
}

/// First path segments after `crate::`.
fn used_modules(code: &str) -> BTreeSet<&str> {
    code.match_indices("crate::")
        .map(|(at, prefix)| {
            let rest = &code[at + prefix.len()..];
            let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
            &rest[..end]
        })
        .collect()
}

#[test]
fn modules_use_only_what_lies_below_them() {
    for (module, allowed) in MAY_USE {
        for path in sources(module) {
            let code = code(&path);
            for used in used_modules(&code) {
                assert!(
                    used == *module || allowed.contains(&used),
                    "{} uses crate::{used}; {module} may use {allowed:?}",
                    path.display()
                );
            }
        }
    }
}

#[test]
fn computing_modules_touch_nothing_else() {
    for module in PURE {
        for path in sources(module) {
            let code = code(&path);
            for word in IMPURE {
                assert!(!code.contains(word), "{} names {word}", path.display());
            }
        }
    }
}

#[test]
fn opencv_stays_inside_vision() {
    for (module, _) in MAY_USE.iter().filter(|(module, _)| *module != "vision") {
        for path in sources(module) {
            assert!(!code(&path).contains("opencv::"), "{} names opencv", path.display());
        }
    }
}
