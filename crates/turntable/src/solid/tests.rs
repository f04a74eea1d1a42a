//! Solids drawn from formulas, rebuilt from their drawings.

use std::f64::consts::PI;
use std::sync::Mutex;

use image::{GrayImage, ImageBuffer, Luma};
use nalgebra::Point2;

use super::*;
use crate::depth_map::Confidence;
use crate::silhouette::SilhouetteOptions;
use mesh::topology::check_manifold;
use picture::FloatImage;
use progress::{Cancelled, Observer, Progress, Silent};
use sheet::View;

const WIDTH: u32 = 200;
const HEIGHT: u32 = 160;

/// A body by its section at each height: polygons, or circles about points.
enum Part {
    /// Corners in the horizontal plane and the range of heights.
    Prism(Vec<(f64, f64)>, (f64, f64)),
    /// Centre, radius at the bottom and the top, range of heights.
    Frustum((f64, f64), (f64, f64), (f64, f64)),
}

impl Part {
    fn interval(&self, azimuth: f64, z: f64) -> Option<(f64, f64)> {
        let column = |x: f64, y: f64| x * azimuth.cos() + y * azimuth.sin();
        match self {
            Self::Prism(corners, (bottom, top)) if (*bottom..*top).contains(&z) => {
                let columns = corners.iter().map(|&(x, y)| column(x, y));
                let ends = columns.fold((f64::MAX, f64::MIN), |(l, h), u| (l.min(u), h.max(u)));
                Some(ends)
            }
            Self::Frustum((x, y), (low, high), (bottom, top)) if (*bottom..*top).contains(&z) => {
                let radius = low + (high - low) * (z - bottom) / (top - bottom);
                Some((column(*x, *y) - radius, column(*x, *y) + radius))
            }
            _ => None,
        }
    }

    /// Columns of the prism's vertical edges that face the camera.
    fn edges(&self, azimuth: f64, z: f64) -> Vec<f64> {
        let Self::Prism(corners, (bottom, top)) = self else {
            return Vec::new();
        };
        if !(*bottom..*top).contains(&z) {
            return Vec::new();
        }
        let n = corners.len();
        let toward = (azimuth.sin(), -azimuth.cos());
        let faces = |i: usize| {
            let (a, b) = (corners[i % n], corners[(i + 1) % n]);
            (b.1 - a.1) * toward.0 - (b.0 - a.0) * toward.1 > 0.0
        };
        let visible = (0..n).filter(|&i| faces(i) && faces(i + n - 1));
        visible.map(|i| corners[i].0 * azimuth.cos() + corners[i].1 * azimuth.sin()).collect()
    }
}

fn draw(parts: &[Part], degrees: f64) -> View {
    let azimuth = degrees.to_radians();
    let at = |x: u32, y: u32| {
        (f64::from(x) + 0.5 - f64::from(WIDTH) / 2.0, f64::from(HEIGHT) / 2.0 - f64::from(y) - 0.5)
    };
    let inside = |x: u32, y: u32| {
        let (u, z) = at(x, y);
        let within = |(low, high): (f64, f64)| low <= u && u < high;
        parts.iter().any(|part| part.interval(azimuth, z).is_some_and(within))
    };
    let inked = |x: u32, y: u32| {
        let (u, z) = at(x, y);
        parts.iter().flat_map(|part| part.edges(azimuth, z)).any(|edge| (edge - u).abs() < 0.8)
    };
    View::level(
        Azimuth::from_degrees(degrees).unwrap(),
        GrayImage::from_fn(WIDTH, HEIGHT, |x, y| Luma([if inked(x, y) { 0 } else { 255 }])),
        Some(GrayImage::from_fn(WIDTH, HEIGHT, |x, y| Luma([255 * u8::from(inside(x, y))]))),
    )
}

fn box_at(x: f64, y: f64, half: (f64, f64), degrees: f64, heights: (f64, f64)) -> Part {
    let (sine, cosine) = degrees.to_radians().sin_cos();
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(a, b)| {
        let (a, b) = (a * half.0, b * half.1);
        (x + a * cosine - b * sine, y + a * sine + b * cosine)
    });
    Part::Prism(corners.to_vec(), heights)
}

fn build_with(
    parts: &[Part],
    degrees: &[f64],
    depth_maps: &[(f64, DepthMap)],
    options: &SolidOptions,
) -> Result<Solid, SolidError> {
    let views = degrees.iter().map(|&degrees| draw(parts, degrees)).collect();
    let views = ViewSet::of_owned(views).unwrap();
    let silhouettes = Silhouettes::of_views(&views, &SilhouetteOptions::default()).unwrap();
    let depth_maps: Vec<_> = depth_maps
        .iter()
        .map(|(degrees, map)| ViewDepthMap {
            azimuth: Azimuth::from_degrees(*degrees).unwrap(),
            map,
        })
        .collect();
    let input = SolidInput {
        views: &views,
        silhouettes: &silhouettes,
        elevated: &[],
        depth_maps: &depth_maps,
        hole_hints: &[],
    };
    build(&input, options, &Silent)
}

/// What the drawings alone tell.
fn geometric() -> SolidOptions {
    SolidOptions { prior: Switch::Off, ..SolidOptions::default() }
}

fn built(parts: &[Part], degrees: &[f64]) -> Solid {
    let solid = build_with(parts, degrees, &[], &geometric()).unwrap();
    assert_eq!(check_manifold(&solid.mesh), Ok(()));
    assert_eq!(solid.support.len(), solid.mesh.positions.len());
    solid
}

fn assert_near(found: f64, expected: f64, tolerance: f64) {
    let share = (found / expected - 1.0).abs();
    assert!(share < tolerance, "{found} is {:.1} % off {expected}", share * 100.0);
}

/// The hidden-line drawing of parts that stand apart, without a mask.
fn draw_lines(parts: &[Part], degrees: f64) -> View {
    let azimuth = degrees.to_radians();
    let depth = |part: &Part| match part {
        Part::Prism(corners, _) => corners
            .iter()
            .map(|&(x, y)| y * azimuth.cos() - x * azimuth.sin())
            .fold(f64::MAX, f64::min),
        Part::Frustum((x, y), ..) => y * azimuth.cos() - x * azimuth.sin(),
    };
    let mut order: Vec<&Part> = parts.iter().collect();
    order.sort_by(|a, b| depth(b).total_cmp(&depth(a)));
    let mut image = GrayImage::from_pixel(WIDTH, HEIGHT, Luma([255]));
    for part in order {
        paint(&mut image, |u, z| {
            part.interval(azimuth, z).is_some_and(|(low, high)| low <= u && u < high)
        });
    }
    View::level(Azimuth::from_degrees(degrees).unwrap(), image, None)
}

/// Paints an area white with a line around it.
fn paint(image: &mut GrayImage, inside: impl Fn(f64, f64) -> bool) {
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            let (u, z) = (
                f64::from(x) + 0.5 - f64::from(WIDTH) / 2.0,
                f64::from(HEIGHT) / 2.0 - f64::from(y) - 0.5,
            );
            let around = [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)];
            if inside(u, z) {
                let inner = around.iter().all(|(du, dz)| inside(u + du, z + dz));
                image.put_pixel(x, y, Luma([if inner { 255 } else { 0 }]));
            }
        }
    }
}

fn built_from(views: Vec<View>, options: &SolidOptions) -> Solid {
    let views = ViewSet::of_owned(views).unwrap();
    let silhouettes = Silhouettes::of_views(&views, &SilhouetteOptions::default()).unwrap();
    let input = SolidInput {
        views: &views,
        silhouettes: &silhouettes,
        elevated: &[],
        depth_maps: &[],
        hole_hints: &[],
    };
    let solid = build(&input, options, &Silent).unwrap();
    assert_eq!(check_manifold(&solid.mesh), Ok(()));
    solid
}

const QUARTER_TURN: [f64; 3] = [0.0, 45.0, 90.0];

#[test]
fn a_cylinder_is_round() {
    let cylinder = [Part::Frustum((0.0, 0.0), (40.0, 40.0), (-50.0, 50.0))];
    let solid = built(&cylinder, &QUARTER_TURN);
    assert_eq!(solid.report.directions, 4, "mirroring adds the other diagonal");
    assert_near(solid.mesh.signed_volume(), PI * 40.0 * 40.0 * 100.0, 0.03);
    // No point is inside the octagon's corners.
    let farthest = solid.mesh.positions.iter().map(|p| p.x.hypot(p.y)).fold(0.0, f64::max);
    assert!(farthest < 41.5, "{farthest}");
}

#[test]
fn a_cone_comes_to_a_point() {
    let cone = [Part::Frustum((0.0, 0.0), (50.0, 0.0), (-50.0, 60.0))];
    let solid = built(&cone, &QUARTER_TURN);
    assert_near(solid.mesh.signed_volume(), PI * 50.0 * 50.0 * 110.0 / 3.0, 0.03);
}

#[test]
fn a_box_keeps_its_drawn_edges() {
    let block = [box_at(0.0, 0.0, (50.0, 30.0), 0.0, (-40.0, 40.0))];
    let solid = built(&block, &[0.0, 30.0, 90.0]);
    assert_near(solid.mesh.signed_volume(), 100.0 * 60.0 * 80.0, 0.03);
    assert!(solid.report.sharp_corners * 2 > solid.report.corners, "{:?}", solid.report);
    assert!(!solid.creases.is_empty());
    assert!(solid.report.faces < 200, "flat faces are merged: {}", solid.report.faces);
}

#[test]
fn a_turned_box_keeps_its_drawn_edges() {
    let block = [box_at(5.0, -8.0, (40.0, 30.0), 25.0, (-40.0, 40.0))];
    let solid = built(&block, &[0.0, 25.0, 70.0, 115.0]);
    assert_near(solid.mesh.signed_volume(), 80.0 * 60.0 * 80.0, 0.04);
}

#[test]
fn separate_prisms_stay_apart() {
    let pair = [
        box_at(-45.0, 0.0, (15.0, 15.0), 0.0, (-40.0, 40.0)),
        box_at(45.0, 0.0, (15.0, 15.0), 0.0, (-40.0, 20.0)),
    ];
    let solid = built(&pair, &QUARTER_TURN);
    assert_eq!(solid.report.pieces.kept, 2);
    let (low, high) = solid.mesh.bounds().unwrap();
    assert!((low.x + 60.0).abs() < 1.5 && (high.x - 60.0).abs() < 1.5, "{low} {high}");
}

/// A window frame 100 wide, 80 high and `depth` deep; the panes are 60 by 44.
/// With `painted` they are drawn on the front of a block instead.
fn window(depth: f64, painted: bool, degrees: f64) -> View {
    let (sine, cosine) = degrees.to_radians().sin_cos();
    let half = |width: f64, depth: f64| (width * cosine + depth * sine) / 2.0;
    let mut image = GrayImage::from_pixel(WIDTH, HEIGHT, Luma([255]));
    paint(&mut image, |u, z| u.abs() < half(100.0, depth) && z.abs() < 40.0);
    if painted {
        let shift = depth / 2.0 * sine;
        paint(&mut image, |u, z| {
            (u + shift).abs() < half(60.0, 0.0) && z.abs() < 22.0 && cosine > 0.1
        });
    } else {
        paint(&mut image, |u, z| u.abs() < half(60.0, -depth) && z.abs() < 22.0);
    }
    View::level(Azimuth::from_degrees(degrees).unwrap(), image, None)
}

#[test]
fn a_hole_that_two_views_see_through_is_carved() {
    let views = [0.0, 30.0, 90.0].map(|degrees| window(12.0, false, degrees));
    let solid = built_from(views.to_vec(), &SolidOptions { boxy: Switch::On, ..geometric() });
    assert!(!solid.report.holes.is_empty());
    let expected = (100.0 * 80.0 - 60.0 * 44.0) * 12.0;
    // Lines are drawn inside the edges: all bars are thinner.
    assert_near(solid.mesh.signed_volume(), expected, 0.18);
}

#[test]
fn what_a_painted_drawing_does_not_leave_out_is_no_hole() {
    let views = [0.0, 30.0, 90.0]
        .map(|degrees| View { mask_has_holes: true, ..window(12.0, false, degrees) });
    let solid = built_from(views.to_vec(), &SolidOptions { boxy: Switch::On, ..geometric() });
    assert_eq!(solid.report.holes, []);
    assert_near(solid.mesh.signed_volume(), 100.0 * 80.0 * 12.0, 0.18);
}

/// A plate 80 wide and high in a vertical plane that the front sees edge-on, drawn by strokes of
/// `stroke` px.
fn plate(stroke: f64, degrees: f64) -> View {
    let half = (40.0 * degrees.to_radians().sin()).max(stroke / 2.0);
    let image = GrayImage::from_fn(WIDTH, HEIGHT, |x, y| {
        let (u, z) = (
            f64::from(x) + 0.5 - f64::from(WIDTH) / 2.0,
            f64::from(HEIGHT) / 2.0 - f64::from(y) - 0.5,
        );
        let from_edge = (half - u.abs()).min(40.0 - z.abs());
        Luma([if (0.0..stroke).contains(&from_edge) { 0 } else { 255 }])
    });
    View::level(Azimuth::from_degrees(degrees).unwrap(), image, None)
}

#[test]
fn a_plate_seen_edge_on_is_whole() {
    for stroke in [2.0, 4.0] {
        let views = [0.0, 45.0, 90.0].map(|degrees| plate(stroke, degrees));
        let solid = built_from(views.to_vec(), &geometric());
        assert_eq!(solid.report.holes, [], "{stroke}");
        let (low, high) = solid.mesh.bounds().unwrap();
        let size = high - low;
        assert!(size.z > 70.0 && size.y > 70.0 && size.x < 8.0, "{stroke}: {size}");
        // One sees nothing through it from the side.
        assert!(
            solid.mesh.signed_volume() > 70.0 * 70.0 * 1.0,
            "{stroke}: {}",
            solid.mesh.signed_volume()
        );
    }
}

#[test]
fn a_painted_window_is_no_hole() {
    let views = [0.0, 30.0, 90.0].map(|degrees| window(60.0, true, degrees));
    let solid = built_from(views.to_vec(), &SolidOptions { boxy: Switch::On, ..geometric() });
    assert_eq!(solid.report.holes, []);
    assert_near(solid.mesh.signed_volume(), 100.0 * 80.0 * 60.0, 0.05);
}

#[test]
fn an_arm_before_a_body_is_as_deep_as_its_lines() {
    let scene = [
        box_at(-10.0, 0.0, (25.0, 35.0), 0.0, (-50.0, 50.0)),
        box_at(40.0, 5.0, (8.0, 8.0), 0.0, (-40.0, 30.0)),
    ];
    let views = || vec![draw_lines(&scene, 0.0), draw_lines(&scene, 90.0)];
    let extent = |parts| {
        let options = SolidOptions { parts, boxy: Switch::On, ..geometric() };
        let solid = built_from(views(), &options);
        let arm = solid.mesh.positions.iter().filter(|p| p.x > 25.0).map(|p| p.y);
        (solid.report.parts, arm.fold((f64::MAX, f64::MIN), |(l, h), y| (l.min(y), h.max(y))))
    };
    let (count, (low, high)) = extent(true);
    assert_eq!(count, 1);
    assert!((low + 3.0).abs() < 2.5 && (high - 13.0).abs() < 2.5, "{low} {high}");
    let (count, (low, high)) = extent(false);
    assert_eq!(count, 0);
    assert!(high - low > 65.0, "{low} {high}");
}

fn as_sure_as_lines(depth_px: FloatImage) -> DepthMap {
    let (width, height) = depth_px.dimensions();
    let confidence = GrayImage::from_pixel(width, height, Luma([Confidence::Lines as u8]));
    DepthMap { depth_px, confidence }
}

/// The depth of a prism's faces that face the camera, `shift_px` too far.
fn depth_map(part: &Part, degrees: f64, shift_px: f64) -> (f64, DepthMap) {
    let Part::Prism(corners, (bottom, top)) = part else { panic!("a prism") };
    let (sine, cosine) = degrees.to_radians().sin_cos();
    let seen: Vec<(f64, f64)> =
        corners.iter().map(|&(x, y)| (x * cosine + y * sine, y * cosine - x * sine)).collect();
    let depth = ImageBuffer::from_fn(WIDTH, HEIGHT, |x, y| {
        let (u, z) = (f64::from(x) + 0.5 - 100.0, 80.0 - f64::from(y) - 0.5);
        let edges = (0..seen.len()).map(|i| (seen[i], seen[(i + 1) % seen.len()]));
        let depths = edges
            .filter(|(a, b)| (a.0 <= u) != (b.0 <= u))
            .map(|(a, b)| a.1 + (b.1 - a.1) * (u - a.0) / (b.0 - a.0));
        let nearest = depths.fold(f64::INFINITY, f64::min);
        let inside = nearest.is_finite() && *bottom <= z && z < *top;
        Luma([if inside { (nearest + shift_px) as f32 } else { f32::NAN }])
    });
    (degrees, as_sure_as_lines(depth))
}

#[test]
fn a_depth_map_that_others_contradict_carves_little() {
    let block = box_at(0.0, 0.0, (50.0, 40.0), 0.0, (-40.0, 40.0));
    let views = [0.0, 20.0, 40.0, 60.0, 90.0];
    let options = SolidOptions { boxy: Switch::On, ..geometric() };
    let volume = |shifted: f64| {
        let shift = |degrees: f64| if degrees == 20.0 { shifted } else { 0.0 };
        let maps: Vec<_> = views.iter().map(|&a| depth_map(&block, a, shift(a))).collect();
        let parts = [box_at(0.0, 0.0, (50.0, 40.0), 0.0, (-40.0, 40.0))];
        let solid = build_with(&parts, &views, &maps, &options).unwrap();
        assert_eq!(check_manifold(&solid.mesh), Ok(()));
        solid.mesh.signed_volume()
    };
    let agreeing = volume(0.0);
    assert_near(agreeing, 100.0 * 80.0 * 80.0, 0.04);
    assert_near(volume(25.0), agreeing, 0.04);
}

#[test]
fn depth_maps_carve_what_outlines_cannot_show() {
    // A block with a slot in its front, deeper than the hull can know.
    let block = [box_at(0.0, 0.0, (50.0, 40.0), 0.0, (-40.0, 40.0))];
    let depth = ImageBuffer::from_fn(WIDTH, HEIGHT, |x, y| {
        let (u, z) = (f64::from(x) + 0.5 - 100.0, 80.0 - f64::from(y) - 0.5);
        let slot = u.abs() < 20.0 && z.abs() < 25.0;
        let inside = u.abs() < 50.0 && z.abs() < 40.0;
        Luma([if !inside {
            f32::NAN
        } else if slot {
            0.0
        } else {
            -40.0
        }])
    });
    let map = (0.0, as_sure_as_lines(depth));
    let options = SolidOptions { boxy: Switch::On, ..geometric() };
    let views = [0.0, 90.0];
    let whole = build_with(&block, &views, &[], &options).unwrap().mesh.signed_volume();
    let carved = build_with(&block, &views, &[map], &options).unwrap();
    assert_eq!(check_manifold(&carved.mesh), Ok(()));
    assert_eq!(carved.report.carving_views, 1);
    assert_near(whole - carved.mesh.signed_volume(), 40.0 * 50.0 * 40.0, 0.1);
}

#[test]
fn voxels_agree_with_slices() {
    let cone = [Part::Frustum((10.0, 5.0), (40.0, 10.0), (-50.0, 60.0))];
    let of_kind = |kind| {
        let options = SolidOptions { kind, ..geometric() };
        build_with(&cone, &[0.0, 30.0, 60.0, 90.0], &[], &options).unwrap()
    };
    let (hull, voxel) = (of_kind(SolidKind::Hull), of_kind(SolidKind::Voxel));
    assert_eq!(check_manifold(&voxel.mesh), Ok(()));
    assert_near(voxel.mesh.signed_volume(), hull.mesh.signed_volume(), 0.05);
}

#[test]
fn threads_do_not_change_the_result() {
    let block = [box_at(5.0, -8.0, (40.0, 30.0), 25.0, (-40.0, 40.0))];
    let with_threads = |count: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap();
        pool.install(|| built(&block, &QUARTER_TURN).mesh)
    };
    assert_eq!(with_threads(1), with_threads(3));
}

/// Notes the steps that are done and stops after the creases.
struct StopAfterCreases(Mutex<Vec<usize>>);

impl Observer for StopAfterCreases {
    fn progress(&self, progress: Progress) {
        self.0.lock().unwrap().push(progress.done);
    }

    fn is_cancelled(&self) -> bool {
        self.0.lock().unwrap().contains(&3)
    }
}

#[test]
fn front_and_back_alone_leave_the_depth_to_be_guessed() {
    let parts = [
        Part::Frustum((0.0, 0.0), (30.0, 30.0), (-60.0, 20.0)),
        Part::Frustum((0.0, 0.0), (18.0, 18.0), (20.0, 60.0)),
    ];
    for prior in [Switch::Off, Switch::Auto] {
        let options = SolidOptions { prior, ..SolidOptions::default() };
        let solid = build_with(&parts, &[30.0, 210.0], &[], &options).unwrap();
        assert!(solid.report.depth_guessed);
        assert_eq!(check_manifold(&solid.mesh), Ok(()));
        let along = |degrees: f64| {
            let angle = degrees.to_radians();
            let ends = solid.mesh.positions.iter().map(|p| p.x * angle.cos() + p.y * angle.sin());
            let (low, high) = ends.fold((f64::MAX, f64::MIN), |(l, h), u| (l.min(u), h.max(u)));
            high - low
        };
        assert!((along(30.0) - 60.0).abs() < 4.0, "{}", along(30.0));
        // About as deep as broad, for nothing says otherwise.
        assert!((30.0..110.0).contains(&along(120.0)), "{prior:?}: {}", along(120.0));
    }
    let sides = build_with(&parts, &[0.0, 90.0, 180.0], &[], &geometric()).unwrap();
    assert!(!sides.report.depth_guessed);
}

#[test]
fn a_box_of_front_and_back_keeps_its_walls() {
    let block = [box_at(0.0, 0.0, (50.0, 30.0), 0.0, (-40.0, 40.0))];
    let solid = build_with(&block, &[0.0, 180.0], &[], &geometric()).unwrap();
    let (low, high) = solid.mesh.bounds().unwrap();
    let size = high - low;
    let filled = solid.mesh.signed_volume() / (size.x * size.y * size.z);
    assert!(filled > 0.95, "{filled}");
}

#[test]
fn stops_when_it_is_told_to() {
    let block = [box_at(0.0, 0.0, (50.0, 30.0), 0.0, (-40.0, 40.0))];
    let options = geometric();
    let views = ViewSet::of_owned(vec![draw(&block, 0.0), draw(&block, 90.0)]).unwrap();
    let silhouettes = Silhouettes::of_views(&views, &SilhouetteOptions::default()).unwrap();
    let input = SolidInput {
        views: &views,
        silhouettes: &silhouettes,
        elevated: &[],
        depth_maps: &[],
        hole_hints: &[],
    };
    let log = StopAfterCreases(Mutex::default());
    let error = build(&input, &options, &log).unwrap_err();
    assert_eq!(error, SolidError::Cancelled(Cancelled));
    assert_eq!(*log.0.lock().unwrap(), [0, 1, 2, 3]);
}

#[test]
fn corners_of_rounded_sections_touch_every_edge() {
    let outlines: Vec<_> = [0.0_f64, 1.0, 2.0]
        .iter()
        .map(|&azimuth_rad| outline::Outline { azimuth_rad, rows: Vec::new() })
        .collect();
    let row: [&[(f64, f64)]; 3] = [&[(-30.0, 20.0)], &[(-15.0, 25.0)], &[(-20.0, 22.0)]];
    let section = section::sections_of_row(&outlines, &row, 200.0).remove(0);
    let outline: Vec<Point2<f64>> = rounding::rounded(&section, &vec![false; section.len()]);
    for (view, interval) in outlines.iter().zip(row) {
        let ends = outline.iter().map(|point| view.column(point));
        let (low, high) = ends.fold((f64::MAX, f64::MIN), |(l, h), u| (l.min(u), h.max(u)));
        let hull = section.extent_along(&view.right());
        assert!((low - hull.0).abs() < 1e-9 || hull.0 > interval[0].0 + 1e-9);
        assert!((high - hull.1).abs() < 1e-9 || hull.1 < interval[0].1 - 1e-9);
    }
}

#[test]
fn the_prior_stays_inside_the_hull_and_behind_the_outlines() {
    let parts = [
        Part::Frustum((0.0, 0.0), (30.0, 20.0), (-60.0, 20.0)),
        Part::Frustum((0.0, 0.0), (18.0, 18.0), (20.0, 60.0)),
    ];
    let volume = |prior| {
        let options = SolidOptions { prior, ..SolidOptions::default() };
        let solid = build_with(&parts, &QUARTER_TURN, &[], &options).unwrap();
        assert_eq!(check_manifold(&solid.mesh), Ok(()));
        (solid.mesh.signed_volume(), solid.mesh.bounds().unwrap(), solid.report.prior)
    };
    let hull = SolidOptions { kind: SolidKind::Hull, ..geometric() };
    let hull = build_with(&parts, &QUARTER_TURN, &[], &hull).unwrap().mesh;
    let (found, (low, high), report) = volume(Switch::Auto);
    assert!(found < hull.signed_volume() * 1.01);
    let (hull_low, hull_high) = hull.bounds().unwrap();
    assert!((low - hull_low).abs().max() < 4.0 && (high - hull_high).abs().max() < 4.0);
    assert!(report.is_some_and(|report| report.with.is_some()));
    assert!(volume(Switch::Off).2.is_none());
}
