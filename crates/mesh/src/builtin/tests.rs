//! Tests of the built-in models: closed, outward, of known volume and size.

use super::*;
use crate::Mesh;

/// How often each undirected edge is used, and whether its users run opposite ways.
fn edge_uses(mesh: &Mesh) -> std::collections::HashMap<[u32; 2], (u32, i32)> {
    let mut uses = std::collections::HashMap::new();
    for &[a, b, c] in &mesh.triangles {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            let entry = uses.entry([from.min(to), from.max(to)]).or_insert((0, 0));
            entry.0 += 1;
            entry.1 += if from < to { 1 } else { -1 };
        }
    }
    uses
}

#[test]
fn solids_are_closed_and_face_outward() {
    for model in ProceduralModel::ALL {
        let mesh = model.build().mesh;
        assert!(mesh.signed_volume() > 0.1, "{}: {}", model.name(), mesh.signed_volume());
        if model == ProceduralModel::Teapot {
            continue;
        }
        let open = edge_uses(&mesh).values().filter(|&&uses| uses != (2, 0)).count();
        assert_eq!(open, 0, "{} has open or badly oriented edges", model.name());
    }
}

#[test]
fn volumes_are_those_of_the_shapes() {
    let volume = |model: Model| model.mesh.signed_volume();
    let pi = std::f64::consts::PI;
    assert!((volume(cuboid([2.0, 3.0, 4.0])) - 24.0).abs() < 1e-9);
    // Inscribed polyhedra: a little less than the round solids.
    let close = |found: f64, exact: f64| (0.98..1.0).contains(&(found / exact));
    assert!(close(volume(uv_sphere(1.0, 48, 64)), 4.0 / 3.0 * pi));
    assert!(close(volume(cone(1.0, 3.0, 64)), pi));
    assert!(close(volume(torus(2.0, 0.5, 96, 48)), 2.0 * pi * pi * 2.0 * 0.25));
}

#[test]
fn all_fit_the_default_frame_at_every_azimuth() {
    for model in ProceduralModel::ALL {
        for p in &model.build().mesh.positions {
            assert!(p.xy().coords.norm() < 3.6 && p.z.abs() < 2.03, "{}: {p}", model.name());
        }
    }
}

#[test]
fn the_teapot_has_the_published_size_and_joined_seams() {
    let teapot = teapot(10);
    let (low, high) = teapot.mesh.bounds().unwrap();
    assert!((low.x + 3.0).abs() < 1e-9, "{low}");
    assert!((high.x - 3.43).abs() < 0.01, "{high}");
    assert!((high.z - low.z - 3.15).abs() < 1e-9);
    // Open are the rim's and the lid's edge and the ends of handle and spout.
    let uses = edge_uses(&teapot.mesh);
    let open = uses.values().filter(|(count, _)| *count == 1).count();
    assert!((80..250).contains(&open), "{open} open edges");
    assert!(uses.values().all(|&(count, balance)| count == 1 || (count, balance) == (2, 0)));
}

#[test]
fn names_lead_back_to_their_models() {
    for model in ProceduralModel::ALL {
        assert_eq!(ProceduralModel::from_name(model.name()), Some(model));
    }
    assert_eq!(ProceduralModel::from_name("hero"), None);
}
