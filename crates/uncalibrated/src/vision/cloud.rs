//! Depth from disparity, and points from depth.

use nalgebra::{Point3, Vector3};

use picture::FloatImage;

/// Depth as the inverse of disparity, px: `scale_px2 / disparity`; NaN where
/// disparity is missing or not positive.
///
/// # Source
/// Arys 2020, §3.7.
pub fn inverse_depth(disparity: &FloatImage, scale_px2: f64) -> FloatImage {
    let mut depth = disparity.clone();
    for value in depth.iter_mut() {
        *value = if *value > 0.0 { (scale_px2 / f64::from(*value)) as f32 } else { f32::NAN };
    }
    depth
}

/// One view's disparity map and where its partner stood.
#[derive(Clone, Copy, Debug)]
pub struct PartneredMap<'a> {
    /// `x_left - x_right`, px, at this view's pixels.
    pub disparity: &'a FloatImage,
    /// From this view to its partner, radians; positive if this is the left
    /// view of the pair.
    pub to_partner_rad: f64,
}

/// Depth from the axis plane, growing away from the camera, px, as orthography
/// has it; the mean where a view has several maps, NaN where it has none.
///
/// A point at column x (from the axis, which is the picture's centre column)
/// and depth d is at `x cos t + d sin t` in the view that is t ahead, so that a
/// left view's disparity is `x (1 - cos t) - d sin t` and a right view's its
/// mirror image in x.
pub fn affine_depth(maps: &[PartneredMap<'_>]) -> FloatImage {
    let (width, height) = maps.first().map_or((0, 0), |map| map.disparity.dimensions());
    let column_of_axis = f64::from(width) / 2.0;
    FloatImage::from_fn(width, height, |column, row| {
        let x = f64::from(column) + 0.5 - column_of_axis;
        let (sum, count) = maps
            .iter()
            .filter_map(|map| depth_at(map, x, map.disparity.get_pixel_checked(column, row)?.0[0]))
            .fold((0.0, 0_u32), |(sum, count), depth| (sum + depth, count + 1));
        image::Luma([if count > 0 { (sum / f64::from(count)) as f32 } else { f32::NAN }])
    })
}

fn depth_at(map: &PartneredMap<'_>, x: f64, disparity: f32) -> Option<f64> {
    let angle = map.to_partner_rad;
    let along_x = angle.signum() * x * (1.0 - angle.cos());
    (!disparity.is_nan()).then(|| (along_x - f64::from(disparity)) / angle.sin().abs())
}

/// A view's depth map as points of the view's own frame: X right and Z up from
/// the picture's centre, Y away from the camera, px.
#[derive(Clone, Copy, Debug)]
pub struct ViewCloud<'a> {
    depth: &'a FloatImage,
}

impl<'a> ViewCloud<'a> {
    /// The cloud of a depth map, px, growing away from the camera; NaN where there is none.
    pub fn new(depth: &'a FloatImage) -> Self {
        Self { depth }
    }

    /// The point seen by a pixel; `None` outside the map and where depth is
    /// missing.
    pub fn point(&self, column: u32, row: u32) -> Option<Point3<f64>> {
        let depth = self.depth.get_pixel_checked(column, row)?.0[0];
        depth.is_finite().then(|| self.at(column, row, depth))
    }

    /// The point seen at continuous pixel coordinates (pixel centres at
    /// integers), at the depth of the nearest pixel.
    pub fn point_at(&self, x: f64, y: f64) -> Option<Point3<f64>> {
        if !(x > -0.5 && y > -0.5) {
            return None;
        }
        let pixel = self.point(x.round() as u32, y.round() as u32)?;
        Some(pixel + Vector3::new(x - x.round(), 0.0, y.round() - y))
    }

    /// All points of one row, by rising column.
    pub fn row(self, row: u32) -> impl Iterator<Item = Point3<f64>> + use<'a> {
        (0..self.depth.width()).filter_map(move |column| self.point(column, row))
    }

    /// All points of every `stride`-th pixel of every `stride`-th row.
    pub fn points(self, stride: u32) -> impl Iterator<Item = Point3<f64>> + use<'a> {
        let step = stride.max(1) as usize;
        (0..self.depth.height()).step_by(step).flat_map(move |row| {
            (0..self.depth.width()).step_by(step).filter_map(move |column| self.point(column, row))
        })
    }

    /// How many rows the map has.
    pub fn rows(&self) -> u32 {
        self.depth.height()
    }

    fn at(&self, column: u32, row: u32, depth: f32) -> Point3<f64> {
        let (width, height) = self.depth.dimensions();
        Point3::new(
            f64::from(column) + 0.5 - f64::from(width) / 2.0,
            f64::from(depth),
            f64::from(height) / 2.0 - (f64::from(row) + 0.5),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_drops_what_is_not_in_front() {
        let disparity = FloatImage::from_raw(4, 1, vec![4.0, 0.0, -2.0, f32::NAN]).unwrap();
        let depth = inverse_depth(&disparity, 100.0);
        assert_eq!(depth.get_pixel(0, 0).0, [25.0]);
        assert_eq!(ViewCloud::new(&depth).points(1).count(), 1);
    }

    /// A plane d = 10 + x/4 seen from three views of a turntable.
    #[test]
    fn affine_recovers_depth_from_either_partner() {
        let (width, angle) = (20, 0.1_f64);
        let truth = |x: f64| 10.0 + x / 4.0;
        let disparity = |side: f64| {
            FloatImage::from_fn(width, 1, |column, _| {
                let x = f64::from(column) + 0.5 - 10.0;
                let seen = x * (side * angle).cos() + truth(x) * (side * angle).sin();
                image::Luma([(side * (x - seen)) as f32])
            })
        };
        let (next, previous) = (disparity(1.0), disparity(-1.0));
        let as_left = PartneredMap { disparity: &next, to_partner_rad: angle };
        let as_right = PartneredMap { disparity: &previous, to_partner_rad: -angle };
        for maps in [vec![as_left], vec![as_right], vec![as_left, as_right]] {
            let depth = affine_depth(&maps);
            for column in 0..width {
                let x = f64::from(column) + 0.5 - 10.0;
                let error = f64::from(depth.get_pixel(column, 0).0[0]) - truth(x);
                assert!(error.abs() < 1e-4, "off by {error} at {x}");
            }
        }
    }

    #[test]
    fn points_are_centred_with_z_up() {
        let depth = FloatImage::from_raw(2, 2, vec![1.0, 2.0, 3.0, f32::INFINITY]).unwrap();
        let points: Vec<_> = ViewCloud::new(&depth).points(1).collect();
        let expected =
            [Point3::new(-0.5, 1.0, 0.5), Point3::new(0.5, 2.0, 0.5), Point3::new(-0.5, 3.0, -0.5)];
        assert_eq!(points, expected);
        assert_eq!(
            ViewCloud::new(&depth).point_at(0.25, 0.25),
            Some(Point3::new(-0.25, 1.0, 0.25))
        );
        assert_eq!(ViewCloud::new(&depth).point_at(-1.0, f64::NAN), None);
    }
}
