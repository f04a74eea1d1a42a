//! The orthographic camera of a view on the turntable.

use nalgebra::{Matrix3, Point3, Vector3};

use super::DrawOptions;
use frames::Viewpoint;

/// The orthographic camera of one view.
///
/// View frame: x right and y down in pixels of the drawing (pixel centres at half integers), z
/// away from the viewer in the same unit, 0 in the plane through the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Rotation and scale: view = `view_from_model` · model + (centre, 0).
    view_from_model: Matrix3<f64>,
    centre_px: [f64; 2],
    /// Pixels of the drawing a unit of the model.
    pub pixels_per_unit: f64,
    /// From the camera plane to the origin along the view direction, scene units.
    pub distance_units: f64,
}

impl Camera {
    /// The camera at azimuth a and elevation e stands at E (sin a cos e, -cos a cos e, sin e) and
    /// looks at the origin. E, the distance of all cameras of a sheet, is `options.distance` at the
    /// sheet's own elevation: `options.distance` is horizontal.
    pub fn new(viewpoint: Viewpoint, options: &DrawOptions) -> Self {
        Self::turned(viewpoint, 0.0, options, options.pixels_per_unit())
    }

    /// As [`Self::new`], `ahead_rad` ahead of its azimuth.
    pub(super) fn turned(
        viewpoint: Viewpoint,
        ahead_rad: f64,
        options: &DrawOptions,
        pixels_per_unit: f64,
    ) -> Self {
        let (sin_a, cos_a) = (viewpoint.azimuth.radians() + ahead_rad).sin_cos();
        let (sin_e, cos_e) = viewpoint.elevation.sin_cos();
        let rotation = Matrix3::new(
            cos_a,
            sin_a,
            0.0,
            sin_a * sin_e,
            -cos_a * sin_e,
            -cos_e,
            -sin_a * cos_e,
            cos_a * cos_e,
            -sin_e,
        );
        Self {
            view_from_model: rotation * pixels_per_unit,
            centre_px: [f64::from(options.width_px) / 2.0, f64::from(options.height_px) / 2.0],
            pixels_per_unit,
            distance_units: options.camera_distance(),
        }
    }

    /// The same camera on a picture `factor` times as fine.
    pub(super) fn refined(self, factor: f64) -> Self {
        Self {
            view_from_model: self.view_from_model * factor,
            centre_px: self.centre_px.map(|c| c * factor),
            pixels_per_unit: self.pixels_per_unit * factor,
            ..self
        }
    }

    /// The same camera with the picture moved by `offset_px`.
    pub(super) fn shifted(self, offset_px: [f64; 2]) -> Self {
        Self {
            centre_px: [self.centre_px[0] + offset_px[0], self.centre_px[1] + offset_px[1]],
            ..self
        }
    }

    /// Takes a point of the model frame to the view frame, px.
    pub fn view_from_model(&self, p: Point3<f64>) -> Point3<f64> {
        let v = self.view_from_model * p.coords;
        Point3::new(v.x + self.centre_px[0], v.y + self.centre_px[1], v.z)
    }

    /// Turns a direction into the view frame, without scaling it.
    pub(super) fn rotate(&self, direction: Vector3<f64>) -> Vector3<f64> {
        self.view_from_model * direction / self.pixels_per_unit
    }

    /// Distance from the camera plane in scene units, of a z of the view frame.
    pub fn depth_from_view(&self, z_px: f64) -> f64 {
        self.distance_units + z_px / self.pixels_per_unit
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use frames::{Azimuth, Elevation};

    fn camera(azimuth_deg: f64, elevation_deg: f64) -> Camera {
        let options = DrawOptions { elevation_deg, ..DrawOptions::default() };
        Camera::new(options.viewpoint(Azimuth::from_degrees(azimuth_deg).unwrap()), &options)
    }

    #[test]
    fn projects_a_cube_corner_where_the_geometry_says() {
        let view = camera(30.0, 0.0).view_from_model(Point3::new(1.3, -1.3, 1.3));
        assert!((view.x - 542.58).abs() < 0.01, "{view}");
        assert!((view.y - 99.04).abs() < 0.01, "{view}");
        let depth = camera(30.0, 0.0).depth_from_view(view.z);
        assert!((depth - 6.224).abs() < 0.001, "{depth}");
    }

    #[test]
    fn the_side_view_shows_the_subjects_left() {
        let left = camera(90.0, 0.0).view_from_model(Point3::new(1.0, 0.0, 0.0));
        assert!((left.x - 480.0).abs() < 1e-9 && left.z < 0.0, "{left}");
    }

    #[test]
    fn a_raised_camera_keeps_the_axis_in_the_middle_and_sees_the_top() {
        let camera = camera(0.0, 30.0);
        let origin = camera.view_from_model(Point3::origin());
        assert_eq!((origin.x, origin.y, origin.z), (480.0, 270.0, 0.0));
        assert!((camera.depth_from_view(0.0) - 8.0 / 30.0_f64.to_radians().cos()).abs() < 1e-12);
        let top = camera.rotate(Vector3::z());
        assert!((top.z + 0.5).abs() < 1e-12, "the top faces the viewer: {top}");
        let behind = camera.view_from_model(Point3::new(0.0, 1.0, 0.0));
        assert!(behind.y < 270.0, "what is behind appears higher: {behind}");
    }

    #[test]
    fn from_above_the_front_is_at_the_bottom_and_from_below_at_the_top() {
        let front = Point3::new(0.5, -1.0, 0.25);
        let seen = |azimuth_deg: f64, elevation_deg: f64| {
            let azimuth = Azimuth::from_degrees(azimuth_deg).unwrap();
            let elevation = Elevation::from_degrees(elevation_deg).unwrap();
            let options = DrawOptions::default();
            let camera = Camera::new(Viewpoint { azimuth, elevation }, &options);
            assert_eq!(camera.distance_units, options.distance);
            let p = camera.view_from_model(front);
            let unit = camera.pixels_per_unit;
            [(p.x - 480.0) / unit, (p.y - 270.0) / unit, p.z / unit]
                .map(|value| (value * 1e9).round() / 1e9 + 0.0)
        };
        assert_eq!(seen(0.0, 90.0), [0.5, 1.0, -0.25]);
        assert_eq!(seen(0.0, -90.0), [0.5, -1.0, 0.25]);
        // Another azimuth turns the picture.
        assert_eq!(seen(90.0, 90.0), [-1.0, 0.5, -0.25]);
    }
}
