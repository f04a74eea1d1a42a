//! Hidden lines against rays.

use super::*;

/// Whether the segment from a point towards the viewer meets a triangle: Moeller and Trumbore's
/// test, independent of the clipping that it checks.
fn hidden_by_brute_force(triangles: &[[Point3<f64>; 3]], point: Point3<f64>, margin: f64) -> bool {
    let towards_viewer = Vector3::new(0.0, 0.0, -1.0);
    triangles.iter().any(|[a, b, c]| {
        let (ab, ac) = (b - a, c - a);
        let h = towards_viewer.cross(&ac);
        let determinant = ab.dot(&h);
        if determinant.abs() < 1e-12 {
            return false;
        }
        let from_a = point - a;
        let u = from_a.dot(&h) / determinant;
        let q = from_a.cross(&ab);
        let v = towards_viewer.dot(&q) / determinant;
        let distance = ac.dot(&q) / determinant;
        u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > margin
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn visible_parts_are_those_that_rays_reach(
        corners in prop::collection::vec([-1.0..1.0_f64, -1.0..1.0, -1.0..1.0], 9..60),
        degrees in 0.0..360.0_f64,
    ) {
        let count = corners.len() / 3;
        let model = Model {
            mesh: Mesh {
                positions: corners.iter().take(3 * count).map(|&c| Point3::from(c)).collect(),
                triangles: (0..count as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            },
            materials: vec![0; count],
            ..Model::default()
        };
        let prepared = PreparedModel::new(&model).unwrap();
        let options = DrawOptions::default();
        let camera = Camera::new(azimuth(degrees).into(), &options);
        let viewed = features::ViewedModel::new(&prepared, &camera);
        let tree = prepared.triangle_tree();
        let visibility = visibility::Visibility::new(&viewed, &tree);
        let rules = rules::LineRules::new(&prepared, 134.43, ContourStyle::Polygonal);
        for (index, segment) in viewed.segments(&camera, &rules).iter().enumerate() {
            let own = index_of_own_face(&prepared, segment);
            let others: Vec<_> = (0..prepared.mesh.triangles.len())
                .filter(|face| Some(*face) != own)
                .map(|face| viewed.corners(face))
                .collect();
            let parts = visibility.visible_parts(segment);
            let [p, q] = [segment.ends[0].1, segment.ends[1].1];
            for step in 1..20 {
                let t = f64::from(step) / 20.0;
                let point = p + (q - p) * t;
                let seen = parts.iter().any(|[from, to]| (*from..=*to).contains(&t));
                // Near a border or a crossing rounding may decide either way.
                let nearby = [-0.003, 0.003].map(|dt| p + (q - p) * (t + dt));
                let hidden = hidden_by_brute_force(&others, point, 0.02);
                let sure = nearby.iter().all(|&near| {
                    hidden_by_brute_force(&others, near, 0.3) == hidden
                        && hidden_by_brute_force(&others, near, 0.0) == hidden
                });
                prop_assert!(!sure || seen != hidden, "segment {index} at {t}: seen {seen}");
            }
        }
    }
}

fn index_of_own_face(model: &PreparedModel, segment: &features::Segment) -> Option<usize> {
    let features::Host::Edge(edge) = segment.host else {
        return None;
    };
    model.faces_of(&model.edges[edge as usize]).first().map(|side| side.face as usize)
}
