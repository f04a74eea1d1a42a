//! What fuzzing of the model loaders found, in `fuzz/regressions`.

use std::fs;

use mesh::read::{Limits, ModelFormat, load};

/// Files that once made a loader panic; as for the fuzzer, the first byte picks the format.
#[test]
fn what_fuzzing_found_stays_fixed() {
    const FORMATS: [ModelFormat; 5] =
        [ModelFormat::Glb, ModelFormat::Gltf, ModelFormat::Obj, ModelFormat::Ply, ModelFormat::Stl];
    let dir = concat!(env!("CARGO_MANIFEST_DIR"), "/fuzz/regressions");
    let mut found = 0;
    for entry in fs::read_dir(dir).unwrap() {
        let data = fs::read(entry.unwrap().path()).unwrap();
        let format = FORMATS[usize::from(data[0]) % FORMATS.len()];
        // An error or a model: only a panic fails.
        if let Err(error) = load(&data[1..], format, None, &Limits::default()) {
            assert!(!error.to_string().is_empty());
        }
        found += 1;
    }
    assert!(found > 0);
}
