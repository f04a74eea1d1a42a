//! The first byte picks the format, the rest is the file.
#![no_main]

use libfuzzer_sys::fuzz_target;
use mesh::read::{Limits, ModelFormat, load};

const FORMATS: [ModelFormat; 5] = [
    ModelFormat::Glb,
    ModelFormat::Gltf,
    ModelFormat::Obj,
    ModelFormat::Ply,
    ModelFormat::Stl,
];

const LIMITS: Limits = Limits {
    max_bytes: 1 << 20,
    max_vertices: 100_000,
    max_triangles: 100_000,
};

fuzz_target!(|data: &[u8]| {
    let Some((&choice, bytes)) = data.split_first() else {
        return;
    };
    let format = FORMATS[usize::from(choice) % FORMATS.len()];
    if let Ok(model) = load(bytes, format, None, &LIMITS) {
        assert!(!model.mesh.triangles.is_empty());
        assert_eq!(model.mesh.triangles.len(), model.materials.len());
        let vertices = model.mesh.positions.len();
        for triangle in &model.mesh.triangles {
            assert!(triangle.iter().all(|&vertex| (vertex as usize) < vertices));
            for &vertex in triangle {
                assert!(
                    model.mesh.positions[vertex as usize]
                        .iter()
                        .all(|c| c.is_finite())
                );
            }
        }
    }
});
