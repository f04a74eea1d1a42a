//! Whatever the triangles, they are drawn or refused.

use super::*;

fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -3.0..3.0_f64,
        // On a grid: shared positions, triangles edge-on, rows through vertices.
        4 => (-2..3_i32).prop_map(f64::from),
        1 => -1e-300..1e-300_f64,
        1 => -1e59..1e59_f64,
    ]
}

/// Up to ten vertices used in any way, unit normals or not at the corners.
fn models() -> impl Strategy<Value = Model> {
    let positions = prop::collection::vec([coordinate(), coordinate(), coordinate()], 3..10);
    let triangle = prop::array::uniform3(any::<prop::sample::Index>());
    let triangles = prop::collection::vec(triangle, 1..16);
    let normal = [coordinate(), coordinate(), coordinate()];
    let normals = prop::option::of(prop::collection::vec(prop::array::uniform3(normal), 16));
    (positions, triangles, normals).prop_map(|(positions, triangles, normals)| {
        let vertex = |index: prop::sample::Index| index.index(positions.len()) as u32;
        let triangles: Vec<_> = triangles.iter().map(|t| t.map(vertex)).collect();
        Model {
            materials: (0..triangles.len() as u32).map(|t| t % 2).collect(),
            corner_normals: normals.map(|normals| {
                let normals = normals.into_iter().take(triangles.len());
                normals.map(|corners| corners.map(Vector3::from)).collect()
            }),
            mesh: Mesh {
                positions: positions.iter().map(|&p| Point3::from(p)).collect(),
                triangles,
            },
            corner_colours: None,
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn any_triangles_are_drawn_or_refused(
        model in models(),
        degrees in 0.0..360.0_f64,
        elevation_deg in prop_oneof![Just(0.0), -85.0..85.0_f64],
        fit in any::<bool>(),
        degraded in any::<bool>(),
        ink in prop::sample::select(vec![Ink::Lines, Ink::Flat, Ink::Shaded]),
        background in prop::sample::select(vec![Background::White, Background::Transparent]),
    ) {
        let preset = degraded.then_some(DegradePreset::Heavy);
        let options = DrawOptions {
            width_px: 64,
            height_px: 36,
            elevation_deg,
            fit,
            ink,
            background,
            degrade: DegradeOptions { preset, ..DegradeOptions::default() },
            ..DrawOptions::default()
        };
        let Ok(prepared) = PreparedModel::new(&model) else { return Ok(()) };
        let placed = prepared.placed(&options);
        let Ok(drawer) = Drawer::new(&placed, &options) else { return Ok(()) };
        let view = drawer.draw_view(options.viewpoint(azimuth(degrees))).unwrap();
        for (depth, mask) in view.truth.depth.pixels().zip(view.truth.mask.pixels()) {
            prop_assert_eq!(depth.0[0].is_finite(), mask.0[0] == 255);
        }
        let mut points = view.strokes.iter().flat_map(|stroke| &stroke.points);
        prop_assert!(points.all(|p| p.x.is_finite() && p.y.is_finite()));
        let again = drawer.draw_view(options.viewpoint(azimuth(degrees))).unwrap();
        prop_assert_eq!(again.image, view.image);
    }
}
