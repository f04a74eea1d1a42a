//! Which lines are drawn, and how.

use super::*;

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
    // Only before the rear plate are the front one's sides no outline; half a pixel is looked
    // beyond the line, so the change is found that far off at most.
    let border = length(&view, Some(LineKind::Border));
    assert!((border - 2.0 * 0.6 * PIXELS_PER_UNIT).abs() < 1.0, "{border}");
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
        ..Model::default()
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
