//! Drawings of shapes whose lines and depths are known.

use std::ops::ControlFlow;

use nalgebra::{Point2, Point3, Vector3};
use proptest::prelude::*;

use super::*;
use crate::geometry::Mesh;
use crate::model_io::Model;
use crate::models::{cuboid, torus, uv_sphere};
use crate::sheet::Azimuth;

fn azimuth(degrees: f64) -> Azimuth {
    Azimuth::from_degrees(degrees).unwrap()
}

fn draw(model: &Model, degrees: f64, options: &DrawOptions) -> DrawnView {
    let prepared = PreparedModel::new(model).unwrap();
    Drawer::new(&prepared, options).unwrap().draw_view(azimuth(degrees)).unwrap()
}

fn exact(model: &Model, degrees: f64) -> DrawnView {
    draw(model, degrees, &DrawOptions::default())
}

/// Smaller pictures for what does not depend on the size.
fn small() -> DrawOptions {
    DrawOptions { width_px: 192, height_px: 108, ..DrawOptions::default() }
}

fn length(view: &DrawnView, kind: Option<LineKind>) -> f64 {
    let wanted = |stroke: &&Stroke| kind.is_none_or(|kind| stroke.kind == kind);
    view.strokes.iter().filter(wanted).map(Stroke::length_px).sum()
}

const PIXELS_PER_UNIT: f64 = 960.0 / 7.3;

/// A rectangle facing the front, at y, around (x, z).
fn plate(x: f64, y: f64, z: f64, half_width: f64, half_height: f64) -> Model {
    let corner = |dx: f64, dz: f64| Point3::new(x + dx * half_width, y, z + dz * half_height);
    Model {
        mesh: Mesh {
            positions: vec![
                corner(-1.0, -1.0),
                corner(1.0, -1.0),
                corner(1.0, 1.0),
                corner(-1.0, 1.0),
            ],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        },
        materials: vec![0, 0],
        corner_normals: None,
    }
}

fn joined(mut model: Model, other: Model) -> Model {
    let first = model.mesh.positions.len() as u32;
    model.mesh.positions.extend(other.mesh.positions);
    let triangles = other.mesh.triangles.into_iter();
    model.mesh.triangles.extend(triangles.map(|t| t.map(|v| v + first)));
    model.materials.extend(other.materials);
    model
}

#[test]
fn a_cube_shows_its_outline_and_one_edge() {
    let view = exact(&cuboid([2.6; 3]), 30.0);
    let side = 2.6 * PIXELS_PER_UNIT;
    let (sin, cos) = 30.0_f64.to_radians().sin_cos();
    let outline = 2.0 * side + 2.0 * side * (sin + cos);
    // Rear edges lie exactly behind front ones in a level view and must not be drawn again.
    assert!((length(&view, None) - outline - side).abs() < 0.5, "{}", length(&view, None));
    assert!((length(&view, Some(LineKind::Crease)) - side).abs() < 0.01);
    assert!((length(&view, Some(LineKind::Silhouette)) - outline).abs() < 0.5);
}

#[test]
fn a_spheres_outline_is_one_closed_circle() {
    for contours in [ContourStyle::Polygonal, ContourStyle::Smooth] {
        let options = DrawOptions { contours, ..DrawOptions::default() };
        let view = draw(&uv_sphere(1.5, 48, 64), 20.0, &options);
        assert_eq!(view.strokes.len(), 1, "{contours:?}");
        let stroke = &view.strokes[0];
        assert_eq!(stroke.kind, LineKind::Silhouette);
        let gap = stroke.points[0] - stroke.points[stroke.points.len() - 1];
        assert!(gap.norm() < 1e-6, "{contours:?} leaves {gap}");
        for p in &stroke.points {
            let radius = (p - Point2::new(480.0, 270.0)).norm() / (1.5 * PIXELS_PER_UNIT);
            assert!((0.99..1.001).contains(&radius), "{contours:?}: {radius}");
        }
    }
}

#[test]
fn what_is_behind_is_not_drawn() {
    let front = plate(0.0, -1.0, 0.0, 1.0, 1.0);
    let alone = exact(&front, 0.0);
    let hiding = exact(&joined(front, cuboid([1.5; 3])), 0.0);
    assert!((length(&alone, None) - length(&hiding, None)).abs() < 1e-6);
}

#[test]
fn lines_end_where_they_pass_behind_something() {
    let model = joined(plate(0.0, -1.0, 0.0, 0.5, 1.0), plate(0.0, 0.0, 0.0, 1.5, 0.3));
    let view = exact(&model, 0.0);
    // Of the rear plate's long sides a unit remains on either side, with the short ends.
    let rear = (2.0 * 2.0 + 2.0 * 0.6) * PIXELS_PER_UNIT;
    let front = 2.0 * (1.0 + 2.0) * PIXELS_PER_UNIT;
    assert!((length(&view, None) - rear - front).abs() < 0.01);
    let edge = 480.0 + 0.5 * PIXELS_PER_UNIT;
    let emerges =
        view.strokes.iter().flat_map(|stroke| [stroke.points[0], *stroke.points.last().unwrap()]);
    assert!(emerges.into_iter().any(|p| (p.x - edge).abs() < 1e-3));
    // Before the rear plate the front one's sides are no outline.
    let border = length(&view, Some(LineKind::Border));
    assert!((border - 2.0 * 0.6 * PIXELS_PER_UNIT).abs() < 1.0 || border == 0.0, "{border}");
}

/// Two rectangles that share an edge, at `interior_deg` to each other.
fn roof(interior_deg: f64) -> Model {
    let half = (interior_deg / 2.0).to_radians();
    let (sin, cos) = half.sin_cos();
    let wing = |side: f64, z: f64| Point3::new(side * sin, cos, z);
    Model {
        mesh: Mesh {
            positions: vec![
                Point3::new(0.0, 0.0, -0.5),
                Point3::new(0.0, 0.0, 0.5),
                wing(1.0, -0.5),
                wing(1.0, 0.5),
                wing(-1.0, -0.5),
                wing(-1.0, 0.5),
            ],
            triangles: vec![[0, 2, 3], [0, 3, 1], [4, 0, 1], [4, 1, 5]],
        },
        materials: vec![0; 4],
        corner_normals: None,
    }
}

#[test]
fn creases_are_edges_sharper_than_the_crease_angle() {
    let crease =
        |interior_deg: f64| length(&exact(&roof(interior_deg), 0.0), Some(LineKind::Crease));
    assert!((crease(134.0) - PIXELS_PER_UNIT).abs() < 0.01);
    assert_eq!(crease(135.0), 0.0);
    let mut reversed = roof(134.0);
    reversed.mesh.triangles[2..].iter_mut().for_each(|t| t.swap(0, 1));
    let view = exact(&reversed, 0.0);
    assert!((length(&view, Some(LineKind::Crease)) - PIXELS_PER_UNIT).abs() < 0.01);
    assert_eq!(length(&view, Some(LineKind::Contour)), 0.0, "orientation makes no contour");
}

#[test]
fn materials_part_at_a_line() {
    let mut flat = roof(180.0);
    assert_eq!(length(&exact(&flat, 0.0), Some(LineKind::Material)), 0.0);
    flat.materials = vec![1, 1, 2, 2];
    let line = length(&exact(&flat, 0.0), Some(LineKind::Material));
    assert!((line - PIXELS_PER_UNIT).abs() < 0.01);
}

#[test]
fn a_line_is_as_wide_as_asked() {
    for width in [1.0, 1.5, 3.0] {
        let options = DrawOptions { line_width_px: width, ..DrawOptions::default() };
        let view = draw(&plate(0.013, 0.0, 0.0, 1.0, 1.0), 0.0, &options).image.into_luma8();
        let ink: f64 =
            (300..400).map(|x| 1.0 - f64::from(view.get_pixel(x, 270).0[0]) / 255.0).sum();
        assert!((ink - width).abs() < 0.05, "{ink} px of ink for {width}");
    }
}

#[test]
fn transparent_drawings_are_black_with_the_ink_as_alpha() {
    let white = draw(&cuboid([1.0; 3]), 10.0, &small()).image.into_luma8();
    let options = DrawOptions { background: Background::Transparent, ..small() };
    let transparent = draw(&cuboid([1.0; 3]), 10.0, &options).image.into_luma_alpha8();
    for (grey, inked) in white.pixels().zip(transparent.pixels()) {
        assert_eq!(inked.0, [0, 255 - grey.0[0]]);
    }
}

#[test]
fn depth_is_the_distance_from_the_camera_plane() {
    let truth = exact(&plate(0.0, -1.0, 0.0, 1.0, 0.5), 40.0).truth;
    // A point of the plate at x in the picture: X cos a - sin a = x, d = -X sin a - cos a.
    let (sin, cos) = 40.0_f64.to_radians().sin_cos();
    let column = 420_u32;
    let x = (f64::from(column) + 0.5 - 480.0) / PIXELS_PER_UNIT;
    let plate_x = (x + sin) / cos;
    let depth = 8.0 - plate_x * sin - cos;
    assert!((f64::from(truth.depth.get_pixel(column, 270).0[0]) - depth).abs() < 1e-4);
    assert_eq!(truth.mask.get_pixel(column, 270).0[0], 255);
    assert!(truth.depth.get_pixel(0, 0).0[0].is_nan());
    assert_eq!(truth.mask.get_pixel(0, 0).0[0], 0);
}

#[test]
fn a_pixel_is_covered_by_half_of_its_samples_and_tells_the_nearest() {
    let options =
        DrawOptions { width_px: 16, height_px: 16, scale: 16.0, ..DrawOptions::default() };
    // The near plate covers the left half of pixel column 8, the far one everything.
    let near = plate(-3.75, -2.0, 0.0, 4.25, 4.0);
    let alone = draw(&near, 0.0, &options).truth;
    assert_eq!(alone.depth.get_pixel(8, 8).0[0], 6.0);
    assert!(alone.depth.get_pixel(9, 8).0[0].is_nan());
    let both = draw(&joined(near, plate(0.0, 1.0, 0.0, 7.0, 4.0)), 0.0, &options).truth;
    assert_eq!(both.depth.get_pixel(8, 8).0[0], 6.0);
    assert_eq!(both.depth.get_pixel(9, 8).0[0], 9.0);
    let corner = draw(&plate(-3.75, -2.0, 3.75, 4.25, 3.5), 0.0, &options).truth;
    assert!(corner.depth.get_pixel(8, 7).0[0].is_nan(), "one sample of four is not enough");
}

#[test]
fn normals_point_at_the_viewer() {
    let truth = exact(&plate(0.0, 0.0, 0.0, 1.0, 1.0), 0.0).truth;
    assert_eq!(truth.normals.get_pixel(480, 270).0, [128, 128, 255]);
    let from_behind = exact(&plate(0.0, 0.0, 0.0, 1.0, 1.0), 180.0).truth;
    assert_eq!(from_behind.normals.get_pixel(480, 270).0, [128, 128, 255]);
    let turned = exact(&plate(0.0, 0.0, 0.0, 1.0, 1.0), 45.0).truth;
    let [x, y, z] = turned.normals.get_pixel(480, 270).0;
    assert!(x < 40 && y == 128 && z > 215, "towards the viewer's left: {x} {y} {z}");
}

#[test]
fn inverse_depth_is_a_ramp_from_near_white() {
    let depth = FloatMap::from_raw(4, 1, vec![f32::NAN, 6.0, 7.0, 8.0]).unwrap();
    assert_eq!(normalised_inverse_depth(&depth).as_raw(), &[0, 255, 128, 1]);
}

#[test]
fn disparity_leads_to_the_same_point_in_the_neighbouring_view() {
    for elevation_deg in [0.0, 25.0] {
        let options = DrawOptions { elevation_deg, ..small() };
        let model = uv_sphere(1.5, 48, 64);
        let view = draw(&model, 20.0, &options);
        let disparity = disparity_towards(&view.truth.depth, &view.camera, &options, 10.0);
        let next = Camera::new(azimuth(30.0), &options);
        let mut checked = 0;
        for (column, row, depth) in
            view.truth.depth.enumerate_pixels().filter(|p| p.2.0[0].is_finite())
        {
            let point = model_point(&view.camera, column, row, f64::from(depth.0[0]));
            let expected = f64::from(column) + 0.5 - next.view_from_model(point).x;
            let found = f64::from(disparity.get_pixel(column, row).0[0]);
            assert!((found - expected).abs() < 1e-3, "{found} instead of {expected}");
            checked += 1;
        }
        assert!(checked > 1000);
    }
}

/// The model point seen at a pixel's centre, found by solving the camera's linear map.
fn model_point(camera: &Camera, column: u32, row: u32, depth: f64) -> Point3<f64> {
    let origin = camera.view_from_model(Point3::origin());
    let columns = [Vector3::x(), Vector3::y(), Vector3::z()]
        .map(|axis| camera.view_from_model(Point3::from(axis)) - origin);
    let matrix = nalgebra::Matrix3::from_columns(&columns);
    let z = (depth - camera.distance_units) * camera.pixels_per_unit;
    let target = Vector3::new(f64::from(column) + 0.5, f64::from(row) + 0.5, z) - origin.coords;
    Point3::from(matrix.try_inverse().unwrap() * target)
}

#[test]
fn refuses_what_cannot_be_drawn() {
    let model = PreparedModel::new(&cuboid([40.0; 3])).unwrap();
    let error = Drawer::new(&model, &DrawOptions::default()).err().unwrap();
    assert!(matches!(error, DrawError::CameraInsideModel { .. }), "{error}");
    assert_eq!(PreparedModel::new(&Model::default()).unwrap_err(), DrawError::NoTriangles);
    let mut broken = cuboid([1.0; 3]);
    broken.mesh.positions[3].y = f64::NAN;
    let error = PreparedModel::new(&broken).unwrap_err();
    assert!(matches!(error, DrawError::InvalidModel { .. }), "{error}");
    let options = DrawOptions { scale: f64::NAN, ..DrawOptions::default() };
    let cube = PreparedModel::new(&cuboid([1.0; 3])).unwrap();
    let error = Drawer::new(&cube, &options).err().unwrap();
    assert!(matches!(error, DrawError::OptionOutOfRange { option: "scale", .. }), "{error}");
}

#[test]
fn a_fitted_model_fills_the_frame_without_leaving_it() {
    let model = PreparedModel::new(&cuboid([400.0, 100.0, 900.0])).unwrap();
    for elevation_deg in [0.0, 40.0] {
        let options = DrawOptions { fit: true, elevation_deg, ..small() };
        let azimuths = [0.0, 37.0, 90.0].map(azimuth);
        let files =
            draw_sheet(&model, &azimuths, &options, &|_| ControlFlow::Continue(())).unwrap();
        let mask = files.iter().find(|file| file.name == "mask_000.png").unwrap();
        let mask = image::load_from_memory(&mask.bytes).unwrap().into_luma8();
        let covered: Vec<_> = mask.enumerate_pixels().filter(|p| p.2.0[0] > 0).collect();
        assert!(covered.iter().all(|(x, y, _)| (1..191).contains(x) && (1..107).contains(y)));
        let rows = covered.iter().map(|p| p.1).max().unwrap() - covered[0].1;
        assert!(rows > 60, "{rows} rows");
    }
}

fn progress_through(_: usize) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

#[test]
fn a_sheet_has_every_file_and_a_document_that_names_them() {
    let model = PreparedModel::new(&torus(1.2, 0.5, 24, 12)).unwrap();
    let azimuths = [90.0, 0.0, 22.5].map(azimuth);
    let files = draw_sheet(&model, &azimuths, &small(), &progress_through).unwrap();
    let names: Vec<_> = files.iter().map(|file| file.name.as_str()).collect();
    for stem in ["000", "022.5", "090"] {
        for kind in ["view_S.png", "view_S.svg", "depth_S.png", "depth_S.pfm", "mask_S.png"] {
            assert!(names.contains(&kind.replace('S', stem).as_str()), "{kind} {stem}");
        }
    }
    assert!(names.contains(&"disparity_000_022.5.pfm"));
    assert!(names.contains(&"disparity_022.5_000.pfm"));
    assert!(!names.iter().any(|name| name.starts_with("disparity_090")), "too far apart");
    assert!(!names.contains(&"degradation.json"));
    let sheet = &files.last().unwrap();
    assert_eq!(sheet.name, "sheet.json");
    let document: serde_json::Value = serde_json::from_slice(&sheet.bytes).unwrap();
    assert_eq!(document["truth"]["camera_distance"], 8.0);
    assert_eq!(document["truth"]["depth_counts_per_unit"], 4096.0);
    assert_eq!(document["views"][1]["azimuth_deg"], 22.5);
    for view in document["views"].as_array().unwrap() {
        assert!(names.contains(&view["image"].as_str().unwrap()));
        assert!(names.contains(&view["depth"].as_str().unwrap()));
    }
    assert!(names.contains(&document["truth"]["model"].as_str().unwrap()));
}

#[test]
fn the_same_bytes_whatever_the_number_of_threads() {
    let model = PreparedModel::new(&torus(1.2, 0.5, 24, 12)).unwrap();
    let options =
        DrawOptions { degrade: DegradeOptions::preset(DegradePreset::Middle, 7), ..small() };
    let azimuths = [0.0, 15.0, 30.0, 45.0].map(azimuth);
    let with_threads = |count: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap();
        pool.install(|| draw_sheet(&model, &azimuths, &options, &progress_through).unwrap())
    };
    assert_eq!(with_threads(1), with_threads(3));
}

#[test]
fn drawing_stops_when_cancelled_and_refuses_bad_lists() {
    let model = PreparedModel::new(&cuboid([1.0; 3])).unwrap();
    let draw = |azimuths: &[Azimuth], progress: &(dyn Fn(usize) -> ControlFlow<()> + Sync)| {
        draw_sheet(&model, azimuths, &small(), progress).map(|files| files.len())
    };
    let many: Vec<_> = (0..90).map(|step| azimuth(4.0 * f64::from(step))).collect();
    let cancelled = draw(&many, &|_| ControlFlow::Break(()));
    assert_eq!(cancelled, Err(DrawError::Cancelled));
    assert_eq!(draw(&[], &progress_through), Err(DrawError::NoViews));
    let twice = draw(&[azimuth(0.0), azimuth(360.0)], &progress_through);
    assert_eq!(twice, Err(DrawError::DuplicateView { azimuth_deg: 0.0 }));
}

#[test]
fn the_page_holds_all_views_with_labels() {
    let model = PreparedModel::new(&cuboid([1.0; 3])).unwrap();
    let azimuths: Vec<_> = (0..9).map(|step| azimuth(40.0 * f64::from(step))).collect();
    let files = draw_sheet(&model, &azimuths, &small(), &progress_through).unwrap();
    let page = files.iter().find(|file| file.name == "page.png").unwrap();
    let page = image::load_from_memory(&page.bytes).unwrap().into_luma8();
    let cell = page.width() / 8;
    let ink_in = |left: u32, top: u32| {
        let inside = |x: u32, y: u32| x / cell == left && y / (page.height() / 2) == top;
        page.enumerate_pixels().filter(|(x, y, p)| inside(*x, *y) && p.0[0] < 128).count()
    };
    assert!((0..8).all(|column| ink_in(column, 0) > 50));
    assert!(ink_in(0, 1) > 50 && ink_in(1, 1) == 0, "the ninth view begins a row");
}

#[test]
fn options_have_ranges_and_refuse_unknown_names() {
    let schema = serde_json::to_value(schemars::schema_for!(DrawOptions)).unwrap();
    assert_eq!(schema["properties"]["supersampling"]["maximum"], 4);
    assert_eq!(schema["properties"]["scale"]["default"], 7.3);
    let parsed: Result<DrawOptions, _> = serde_json::from_str(r#"{"line_width": 2}"#);
    assert!(parsed.is_err());
    let parsed: DrawOptions = serde_json::from_str(r#"{"degrade": {"preset": "heavy"}}"#).unwrap();
    assert_eq!(parsed.degrade.preset, Some(DegradePreset::Heavy));
}

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
            corner_normals: None,
        };
        let prepared = PreparedModel::new(&model).unwrap();
        let options = DrawOptions::default();
        let camera = Camera::new(azimuth(degrees), &options);
        let viewed = features::ViewedModel::new(&prepared, &camera);
        let tree = prepared.triangle_tree();
        let visibility = visibility::Visibility::new(&viewed, &tree);
        let rules = features::LineRules::new(&prepared, 134.43, ContourStyle::Polygonal);
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
