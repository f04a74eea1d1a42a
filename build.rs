//! Watches the built web page, which the program holds inside of itself, and
//! hashes what results depend on, so that no result of another build is taken
//! for one of this.

use std::path::{Path, PathBuf};
use std::{fs, io};

use sha2::{Digest, Sha256};

const WEIGHTS: &str = "crates/prior/weights/prior.safetensors";

fn main() -> io::Result<()> {
    // Watched as a folder, so that the program is built anew when the page is
    // built for the first time too. Without Node it stays empty.
    let folder = "web/dist";
    if let Err(error) = fs::create_dir_all(folder) {
        println!("cargo::warning={folder} cannot be made: {error}");
    }
    println!("cargo::rerun-if-changed={folder}");

    let mut sources = vec![PathBuf::from("src"), PathBuf::from("Cargo.lock"), WEIGHTS.into()];
    for entry in fs::read_dir("crates")? {
        let package = entry?.path();
        sources.extend(["src", "Cargo.toml"].map(|part| package.join(part)));
    }
    sources.sort();
    let mut hasher = Sha256::new();
    for source in &sources {
        println!("cargo::rerun-if-changed={}", source.display());
        add(&mut hasher, source)?;
    }
    let weights = hex::encode(Sha256::digest(fs::read(WEIGHTS)?));
    println!("cargo::rustc-env=TURNAROUND_BUILD={}", hex::encode(hasher.finalize()));
    println!("cargo::rustc-env=TURNAROUND_WEIGHTS_SHA256={weights}");
    Ok(())
}

/// Adds a file, or all below a folder, with names and lengths.
fn add(hasher: &mut Sha256, path: &Path) -> io::Result<()> {
    if path.is_dir() {
        let entries = fs::read_dir(path)?.map(|entry| Ok(entry?.path()));
        let mut entries = entries.collect::<io::Result<Vec<_>>>()?;
        entries.sort();
        return entries.iter().try_for_each(|entry| add(hasher, entry));
    }
    let bytes = fs::read(path)?;
    for part in [path.to_string_lossy().as_bytes(), &bytes] {
        hasher.update((part.len() as u64).to_le_bytes());
        hasher.update(part);
    }
    Ok(())
}
