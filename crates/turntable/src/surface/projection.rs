//! Which drawing colours which face.

use nalgebra::{Point3, Vector3};

use crate::views::ViewSet;
use frames::Viewpoint;
use mesh::Mesh;
use mesh::raster::SampleBuffer;
use mesh::shading::face_normal;
use mesh::topology::HalfEdges;

/// The drawings as a camera rig: all of one size, orthographic.
#[derive(Clone, Debug)]
pub struct Rig {
    /// One a view.
    pub viewpoints: Vec<Viewpoint>,
    /// Of every drawing, px.
    pub width: u32,
    /// Of every drawing, px.
    pub height: u32,
    /// The turntable axis' column, px, sheet frame.
    pub axis_px: f64,
    /// The row of the turntable frame's origin, px, sheet frame.
    pub origin_row_px: f64,
}

/// Depths a face may lie behind the nearest one and still count as seen, px.
const DEPTH_TOLERANCE_PX: f64 = 3.0;
/// Visibility is decided on images this many times smaller.
pub const VISIBILITY_SCALE: f64 = 2.0;
/// How often faces follow most of their neighbours.
const SEAM_ROUNDS: usize = 4;
/// What leaving the best view costs, cosine.
const SEAM_GAIN: f64 = 0.25;
/// Faces steeper than this would smear lines over themselves, cosine.
const MIN_FACING: f64 = 0.2;

impl Rig {
    /// The camera rig that level `views` are drawn with.
    pub fn of_views(views: &ViewSet) -> Self {
        Self {
            viewpoints: views.azimuths().map(Viewpoint::from).collect(),
            width: views.width(),
            height: views.height(),
            axis_px: views.axis_px(),
            origin_row_px: views.origin_row_px(),
        }
    }

    /// Column, row and depth of a point in view `view`, px, sheet frame.
    pub fn project(&self, view: usize, point: &Point3<f64>) -> Vector3<f64> {
        self.projection(view)(point)
    }

    /// [`project`](Self::project) for many points.
    pub fn projection(&self, view: usize) -> impl Fn(&Point3<f64>) -> Vector3<f64> {
        let Turn { azimuth: (sine, cosine), elevation: (rise, level) } = self.turn(view);
        let (axis_px, origin_row_px) = (self.axis_px, self.origin_row_px);
        move |point| {
            let behind = point.y * cosine - point.x * sine;
            Vector3::new(
                point.x * cosine + point.y * sine + axis_px,
                origin_row_px - (point.z * level + behind * rise),
                behind * level - point.z * rise,
            )
        }
    }

    /// The point at a column, row and depth of view `view`: [`project`](Self::project) undone.
    pub fn unproject(&self, view: usize, pixel: &Vector3<f64>) -> Point3<f64> {
        let Turn { azimuth: (sine, cosine), elevation: (rise, level) } = self.turn(view);
        let (right, up) = (pixel.x - self.axis_px, self.origin_row_px - pixel.y);
        let behind = up * rise + pixel.z * level;
        Point3::new(
            right * cosine - behind * sine,
            right * sine + behind * cosine,
            up * level - pixel.z * rise,
        )
    }

    /// Unit vector, turntable frame.
    pub(crate) fn toward_camera(&self, view: usize) -> Vector3<f64> {
        let Turn { azimuth: (sine, cosine), elevation: (rise, level) } = self.turn(view);
        Vector3::new(sine * level, -cosine * level, rise)
    }

    fn turn(&self, view: usize) -> Turn {
        let Viewpoint { azimuth, elevation } = self.viewpoints[view];
        Turn { azimuth: azimuth.radians().sin_cos(), elevation: elevation.sin_cos() }
    }
}

/// Sines and cosines of a camera's angles.
struct Turn {
    azimuth: (f64, f64),
    elevation: (f64, f64),
}

/// Per triangle, the index of the view that sees it best, or the number of
/// views if none sees it.
///
/// The view that it faces most among those that see it. Faces then follow their
/// neighbours where that costs little, so that seams are few. `mesh` is closed;
/// the rig has at least one view.
///
/// * `buffers`: of the rig's views, in their order.
pub fn best_views(mesh: &Mesh, rig: &Rig, buffers: &[DepthBuffer]) -> Vec<usize> {
    let scores = scores(mesh, rig, buffers);
    let best = |scores: &[f64]| {
        let order = scores.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(&a.0)));
        order.map_or(0, |(view, _)| view)
    };
    let mut labels: Vec<usize> = scores.iter().map(|scores| best(scores)).collect();
    let neighbours = neighbours(mesh);
    for _ in 0..SEAM_ROUNDS {
        let previous = labels.clone();
        for (triangle, around) in neighbours.iter().enumerate() {
            let adjusted: Vec<f64> = scores[triangle]
                .iter()
                .enumerate()
                .map(|(view, score)| {
                    let agreeing = around.iter().filter(|&&other| previous[other] == view).count();
                    score + SEAM_GAIN * agreeing as f64
                })
                .collect();
            labels[triangle] = best(&adjusted);
        }
    }
    for (label, scores) in labels.iter_mut().zip(&scores) {
        if scores.get(*label).is_none_or(|&score| score < MIN_FACING) {
            *label = rig.viewpoints.len();
        }
    }
    labels
}

/// Per triangle and view, how well the view sees it: its cosine to the camera,
/// less 2 if something hides it.
fn scores(mesh: &Mesh, rig: &Rig, buffers: &[DepthBuffer]) -> Vec<Vec<f64>> {
    use rayon::prelude::*;
    (0..mesh.triangles.len())
        .into_par_iter()
        .map(|triangle| {
            let normal = face_normal(mesh, triangle);
            let [a, b, c] = mesh.corners(triangle);
            let centre = Point3::from((a.coords + b.coords + c.coords) / 3.0);
            (0..rig.viewpoints.len())
                .map(|view| {
                    let facing = normal.dot(&rig.toward_camera(view));
                    let hidden = facing > 0.0 && !buffers[view].sees(&rig.project(view, &centre));
                    facing - if hidden { 2.0 } else { 0.0 }
                })
                .collect()
        })
        .collect()
}

/// Per triangle, those across its edges.
pub(crate) fn neighbours(mesh: &Mesh) -> Vec<Vec<usize>> {
    let edges = HalfEdges::new(mesh.positions.len(), &mesh.triangles);
    let around = |&[a, b, c]: &[u32; 3]| {
        let back = [(b, a), (c, b), (a, c)];
        let found = back.iter().filter_map(|&(from, to)| edges.find(from, to));
        found.map(|edge| edge.triangle as usize).collect()
    };
    mesh.triangles.iter().map(around).collect()
}

/// The nearest depth per pixel of a smaller image.
pub struct DepthBuffer {
    scale: f64,
    width: usize,
    height: usize,
    depth: Vec<f32>,
}

impl DepthBuffer {
    /// Draws `mesh`, a closed one, as all views see it, to tell what is hidden from them.
    pub fn of_views(mesh: &Mesh, rig: &Rig) -> Vec<Self> {
        use rayon::prelude::*;
        let views = (0..rig.viewpoints.len()).into_par_iter();
        views.map(|view| Self::of_view(mesh, rig, view, VISIBILITY_SCALE)).collect()
    }

    /// Draws `mesh`, a closed one, as view `view` sees it.
    ///
    /// * `scale`: how many times smaller than the view.
    pub fn of_view(mesh: &Mesh, rig: &Rig, view: usize, scale: f64) -> Self {
        let size = |px: u32| (f64::from(px) / scale).ceil() as usize;
        let (width, height) = (size(rig.width), size(rig.height));
        let project = rig.projection(view);
        let scaled = |point: &Point3<f64>| {
            let pixel = project(point);
            Point3::new(pixel.x / scale, pixel.y / scale, pixel.z)
        };
        let pixels: Vec<Point3<f64>> = mesh.positions.iter().map(scaled).collect();
        let corners = |triangle: &[u32; 3]| triangle.map(|vertex| pixels[vertex as usize]);
        // Rows grow downward: what faces the viewer turns the other way.
        let faces_viewer = |[a, b, c]: &[Point3<f64>; 3]| (b - a).xy().perp(&(c - a).xy()) < -1e-9;
        let mut samples = SampleBuffer::new(width, height);
        // Closed meshes of bounded size do not hide themselves too often.
        let _ = samples.draw(mesh.triangles.iter().map(corners).filter(faces_viewer));
        let depth = samples.samples.iter().map(|sample| sample.z).collect();
        Self { scale, width, height, depth }
    }

    /// The depth of the surface at a pixel of the buffer, px, if there is any.
    pub fn nearest(&self, x: usize, y: usize) -> Option<f32> {
        let depth = *self.depth.get(y * self.width + x)?;
        depth.is_finite().then_some(depth)
    }

    /// Whether nothing stands before a projected point.
    pub fn sees(&self, pixel: &Vector3<f64>) -> bool {
        let (x, y) = (pixel.x / self.scale, pixel.y / self.scale);
        if x < 0.0 || y < 0.0 || x >= self.width as f64 || y >= self.height as f64 {
            return false;
        }
        let nearest = self.depth[y as usize * self.width + x as usize];
        pixel.z <= f64::from(nearest) + DEPTH_TOLERANCE_PX
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use frames::{Azimuth, Elevation};

    fn rig(degrees: &[f64]) -> Rig {
        let level = |&degrees: &f64| Azimuth::from_degrees(degrees).unwrap().into();
        Rig {
            viewpoints: degrees.iter().map(level).collect(),
            width: 100,
            height: 80,
            axis_px: 50.0,
            origin_row_px: 40.0,
        }
    }

    /// A box about the axis, `half` wide and deep.
    fn block(half: f64) -> Mesh {
        let positions = (0..8).map(|i: u32| {
            let sign = |bit: u32| if i >> bit & 1 == 1 { half } else { -half };
            Point3::new(sign(0), sign(1), sign(2))
        });
        let quads =
            [[0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6], [4, 5, 7, 6], [0, 2, 3, 1]];
        Mesh {
            positions: positions.collect(),
            triangles: quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        }
    }

    #[test]
    fn faces_take_the_view_they_face() {
        let mesh = block(10.0);
        assert!(mesh.signed_volume() > 0.0);
        let rig = rig(&[0.0, 90.0, 180.0, 270.0]);
        let labels = best_views(&mesh, &rig, &DepthBuffer::of_views(&mesh, &rig));
        // Front (-Y), left (+X), back (+Y), right (-X).
        assert_eq!(&labels[..8], [0, 0, 1, 1, 2, 2, 3, 3]);
        // No level view sees the top and the bottom.
        assert_eq!(&labels[8..], [4; 4]);
    }

    #[test]
    fn a_raised_camera_sees_the_top() {
        let mesh = block(10.0);
        let mut rig = rig(&[0.0, 0.0, 0.0]);
        for (viewpoint, degrees) in rig.viewpoints[1..].iter_mut().zip([90.0, -90.0]) {
            viewpoint.elevation = Elevation::from_degrees(degrees).unwrap();
        }
        let labels = best_views(&mesh, &rig, &DepthBuffer::of_views(&mesh, &rig));
        assert_eq!(&labels[8..], [1, 1, 2, 2]);
        // From above the front is at the bottom, from below at the top.
        let front = Point3::new(3.0, -10.0, 4.0);
        assert_eq!(rig.project(1, &front), Vector3::new(53.0, 50.0, -4.0));
        assert_eq!(rig.project(2, &front), Vector3::new(53.0, 30.0, 4.0));
    }

    #[test]
    fn what_is_projected_comes_back() {
        let mut rig = rig(&[25.0]);
        for degrees in [-90.0, -30.0, 0.0, 55.0, 90.0] {
            rig.viewpoints[0].elevation = Elevation::from_degrees(degrees).unwrap();
            let point = Point3::new(3.0, -7.0, 5.0);
            let back = rig.unproject(0, &rig.project(0, &point));
            assert!((back - point).norm() < 1e-9, "{degrees}: {back}");
            // Depth grows away from the camera.
            let nearer = point + rig.toward_camera(0);
            let step = rig.project(0, &nearer) - rig.project(0, &point);
            assert!((step - Vector3::new(0.0, 0.0, -1.0)).norm() < 1e-9, "{degrees}: {step}");
        }
    }

    #[test]
    fn the_front_hides_the_back() {
        let mesh = block(10.0);
        let rig = rig(&[0.0]);
        let buffer = DepthBuffer::of_view(&mesh, &rig, 0, VISIBILITY_SCALE);
        assert!(buffer.sees(&rig.project(0, &Point3::new(1.0, -10.0, 3.0))));
        assert!(!buffer.sees(&rig.project(0, &Point3::new(1.0, 10.0, 3.0))));
    }
}
