//! Built-in models as quads.

use mesh::Mesh;
use mesh::builtin::{ProceduralModel, cuboid, torus};
use mesh::topology::{check_manifold, genus};
use remesh::{QuadOptions, quads};

fn options(faces: usize) -> QuadOptions {
    QuadOptions { faces, crease_angle_deg: 40.0 }
}

#[test]
fn a_torus_keeps_its_handle_and_its_volume() {
    let torus = torus(30.0, 12.0, 60, 30).mesh;
    let found = quads(&torus, &options(1500), &|| false).unwrap();
    let triangles = found.triangulated();
    assert_eq!(check_manifold(&triangles), Ok(()));
    assert_eq!(genus(&triangles), 1);
    assert!((1200..1900).contains(&found.quads.len()), "{}", found.quads.len());
    let volume = triangles.signed_volume() / torus.signed_volume();
    assert!((volume - 1.0).abs() < 0.01, "{volume}");
    // Four quads about nearly every vertex.
    let mut valences = vec![0; found.positions.len()];
    found.quads.as_flattened().iter().for_each(|&corner| valences[corner as usize] += 1);
    assert!(valences.iter().all(|&valence| valence >= 2));
    let regular = valences.iter().filter(|&&valence| valence == 4).count();
    assert!(regular as f64 > 0.9 * valences.len() as f64, "{regular} of {}", valences.len());
    // The same again.
    assert_eq!(quads(&torus, &options(1500), &|| false), Some(found));
}

#[test]
fn a_block_keeps_its_edges() {
    let block = cuboid([30.0, 20.0, 50.0]).mesh;
    assert_eq!(check_manifold(&block), Ok(()));
    let found = quads(&block, &options(800), &|| false).unwrap();
    let volume = found.triangulated().signed_volume() / block.signed_volume();
    assert!((volume - 1.0).abs() < 0.002, "{volume}");
    for corner in &block.positions {
        let near = found.positions.iter().map(|p| (p - corner).norm()).fold(f64::MAX, f64::min);
        assert!(near < 1e-9, "{corner} is {near} off");
    }
}

#[test]
fn closed_models_give_closed_quads() {
    for model in ProceduralModel::ALL {
        let mesh = model.build().mesh;
        let Ok(mesh) = check_manifold(&mesh).map(|()| mesh) else { continue };
        for faces in [300, 3000] {
            let found = quads(&mesh, &options(faces), &|| false).unwrap().triangulated();
            assert_eq!(genus(&found), genus(&mesh), "{} {faces}", model.name());
            assert_eq!(check_manifold(&found), Ok(()), "{} {faces}", model.name());
        }
    }
}

#[test]
fn stops_and_refuses_what_has_no_area() {
    let torus = torus(30.0, 12.0, 60, 30).mesh;
    assert_eq!(quads(&torus, &options(1500), &|| true), None);
    assert_eq!(quads(&Mesh::default(), &options(1500), &|| false), None);
}
