//! The colour of a point of the surface, from all drawings that see it.

use image::{GrayImage, Luma};
use imageproc::distance_transform::Norm::LInf;
use imageproc::distance_transform::distance_transform;
use nalgebra::{Point3, Vector3};

use super::paint::Paint;
use crate::draft::DraftView;
use crate::solid::MirrorPlane;
use crate::surface::projection::{DepthBuffer, Rig, VISIBILITY_SCALE};

/// Linear light, the primaries of sRGB.
pub type LinearColour = Vector3<f32>;

/// The colour of a point with a unit normal, turntable frame; `None` where it is not known.
pub(super) type ColourOf<'a> =
    dyn Fn(&Point3<f64>, &Vector3<f64>) -> Option<LinearColour> + Sync + 'a;

/// Surfaces steeper than this are not coloured by a view, cosine: a pixel would be smeared over
/// seven.
const MIN_FACING: f64 = 0.15;
/// How soon the view that faces a surface more takes over.
const FACING_POWER: i32 = 6;
/// What a view counts right at the edge of a surface, of what it does inside.
const EDGE_WEIGHT: f64 = 0.02;
/// Neighbouring depths that differ by more are the edge of a surface, share of the image's height.
const STEP: f64 = 0.02;

/// A drawing and what the draft hides from it.
pub(super) struct Camera<'a> {
    paint: Paint,
    depth: &'a DepthBuffer,
    /// Distance from the nearest edge of a surface, pixels of the depth buffer.
    inside: GrayImage,
    toward: Vector3<f64>,
}

impl<'a> Camera<'a> {
    /// * `view`: its index in the rig.
    /// * `depth`: of the view.
    pub(super) fn new(
        drawn: &DraftView<'_>,
        rig: &Rig,
        view: usize,
        depth: &'a DepthBuffer,
    ) -> Self {
        let step = STEP * f64::from(rig.height);
        Self {
            paint: Paint::of_view(drawn.view, drawn.silhouette),
            inside: distance_transform(&edges(depth, rig, step as f32), LInf),
            depth,
            toward: rig.toward_camera(view),
        }
    }

    /// What the view says of a point, and how much it counts.
    fn colour(
        &self,
        rig: &Rig,
        view: usize,
        point: &Point3<f64>,
        normal: &Vector3<f64>,
    ) -> Weighed {
        let facing = normal.dot(&self.toward);
        if facing < MIN_FACING {
            return None;
        }
        let pixel = rig.project(view, point);
        if !self.depth.sees(&pixel) {
            return None;
        }
        let colour = self.paint.at(pixel.x, pixel.y)?;
        let at = |place: f64, size: u32| ((place / VISIBILITY_SCALE).max(0.0) as u32).min(size - 1);
        let (x, y) = (at(pixel.x, self.inside.width()), at(pixel.y, self.inside.height()));
        let inside = f64::from(self.inside.get_pixel(x, y).0[0]) * VISIBILITY_SCALE;
        let share = (inside / (2.0 * self.paint.edge_px)).min(1.0);
        let weight =
            facing.powi(FACING_POWER) * (EDGE_WEIGHT + (1.0 - EDGE_WEIGHT) * share * share);
        Some((colour, weight as f32))
    }
}

type Weighed = Option<(LinearColour, f32)>;

/// White where the draft's surface ends or steps.
fn edges(depth: &DepthBuffer, rig: &Rig, step: f32) -> GrayImage {
    let size = |px: u32| (f64::from(px) / VISIBILITY_SCALE).ceil() as u32;
    GrayImage::from_fn(size(rig.width).max(1), size(rig.height).max(1), |x, y| {
        let (x, y) = (x as usize, y as usize);
        let Some(here) = depth.nearest(x, y) else { return Luma([255]) };
        let steps = |x: usize, y: usize| {
            depth.nearest(x, y).is_some_and(|other| (other - here).abs() > step)
        };
        let is_edge = steps(x + 1, y)
            || steps(x, y + 1)
            || x.checked_sub(1).is_some_and(|x| steps(x, y))
            || y.checked_sub(1).is_some_and(|y| steps(x, y));
        Luma([if is_edge { 255 } else { 0 }])
    })
}

/// The colour of a point, from the cameras that see it, or see its mirror image.
pub(super) fn colour(
    cameras: &[Camera<'_>],
    rig: &Rig,
    mirror: Option<MirrorPlane>,
    point: &Point3<f64>,
    normal: &Vector3<f64>,
) -> Option<LinearColour> {
    let seen = |point: &Point3<f64>, normal: &Vector3<f64>| {
        let views = cameras.iter().enumerate();
        weighed(views.filter_map(|(view, camera)| camera.colour(rig, view, point, normal)))
    };
    seen(point, normal).or_else(|| {
        let (point, normal) = mirrored(mirror?, point, normal);
        seen(&point, &normal)
    })
}

fn weighed(colours: impl Iterator<Item = (LinearColour, f32)>) -> Option<LinearColour> {
    let (sum, total) = colours.fold((LinearColour::zeros(), 0.0), |(sum, total), (colour, w)| {
        (sum + colour * w, total + w)
    });
    (total > 0.0).then(|| sum / total)
}

fn mirrored(
    plane: MirrorPlane,
    point: &Point3<f64>,
    normal: &Vector3<f64>,
) -> (Point3<f64>, Vector3<f64>) {
    let axis = usize::from(!plane.left_right);
    let (mut point, mut normal) = (*point, *normal);
    point[axis] = 2.0 * plane.offset_px - point[axis];
    normal[axis] = -normal[axis];
    (point, normal)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_and_normals_are_mirrored_at_the_plane() {
        let plane = |left_right| MirrorPlane {
            left_right,
            offset_px: 2.0,
            silhouette_iou: 1.0,
            ink_agreement: None,
        };
        let (point, normal) = (Point3::new(5.0, 6.0, 7.0), Vector3::new(0.6, 0.8, 0.0));
        let found = mirrored(plane(true), &point, &normal);
        assert_eq!(found, (Point3::new(-1.0, 6.0, 7.0), Vector3::new(-0.6, 0.8, 0.0)));
        let found = mirrored(plane(false), &point, &normal);
        assert_eq!(found, (Point3::new(5.0, -2.0, 7.0), Vector3::new(0.6, -0.8, 0.0)));
    }

    #[test]
    fn weights_are_shares() {
        let (red, blue) = (LinearColour::x(), LinearColour::z());
        let found = weighed([(red, 3.0), (blue, 1.0)].into_iter()).unwrap();
        assert!((found - LinearColour::new(0.75, 0.0, 0.25)).amax() < 1e-6);
        assert_eq!(weighed(std::iter::empty()), None);
    }
}
