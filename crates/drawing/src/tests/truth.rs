//! Depth, disparity, masks and normals.

use super::*;
use picture::FloatImage;

#[test]
fn depth_is_the_distance_from_the_camera_plane() {
    let truth = exact(&plate(0.0, -1.0, 0.0, 1.0, 0.5), 40.0).truth;
    // A point of the plate at x in the picture: X cos a - sin a = x, d = -X sin a - cos a.
    let (sin, cos) = 40.0_f64.to_radians().sin_cos();
    let column = 420_u32;
    // Of the four samples the two on the right are nearer.
    let x = (f64::from(column) + 0.75 - 480.0) / PIXELS_PER_UNIT;
    let plate_x = (x + sin) / cos;
    let depth = 8.0 - plate_x * sin - cos;
    assert!((f64::from(truth.depth.get_pixel(column, 270).0[0]) - depth).abs() < 1e-4);
    assert_eq!(truth.mask.get_pixel(column, 270).0[0], 255);
    assert!(truth.depth.get_pixel(0, 0).0[0].is_nan());
    assert_eq!(truth.mask.get_pixel(0, 0).0[0], 0);
}

#[test]
fn a_pixel_is_covered_by_half_of_its_samples_and_tells_the_nearest() {
    let options = DrawOptions {
        width_px: 16,
        height_px: 16,
        scale: 16.0,
        distance: 20.0,
        ..DrawOptions::default()
    };
    // The near plate covers the left half of pixel column 8, the far one everything.
    let near = plate(-3.75, -2.0, 0.0, 4.25, 4.0);
    let alone = draw(&near, 0.0, &options).truth;
    assert_eq!(alone.depth.get_pixel(8, 8).0[0], 18.0);
    assert!(alone.depth.get_pixel(9, 8).0[0].is_nan());
    let both = draw(&joined(near, plate(0.0, 1.0, 0.0, 7.0, 4.0)), 0.0, &options).truth;
    assert_eq!(both.depth.get_pixel(8, 8).0[0], 18.0);
    assert_eq!(both.depth.get_pixel(9, 8).0[0], 21.0);
    let corner = draw(&plate(-3.75, -2.0, 4.0, 4.25, 3.5), 0.0, &options).truth;
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
    let depth = FloatImage::from_raw(4, 1, vec![f32::NAN, 6.0, 7.0, 8.0]).unwrap();
    assert_eq!(normalised_inverse_depth(&depth).as_raw(), &[0, 255, 128, 1]);
}

#[test]
fn disparity_leads_to_the_same_point_in_the_neighbouring_view() {
    for elevation_deg in [0.0, 25.0] {
        let options = DrawOptions { elevation_deg, ..small() };
        let model = uv_sphere(1.5, 48, 64);
        let view = draw(&model, 20.0, &options);
        let disparity = disparity_towards(&view.truth.depth, &view, &options, 10.0);
        let next = Camera::new(options.viewpoint(azimuth(30.0)), &options);
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
