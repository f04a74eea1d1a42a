//! Views from above and below cut the solid where their silhouettes end.
//!
//! They do not share the rows of level views, so that they bound the solid's field as a whole:
//! their cameras are orthographic, and a point is as far inside of what the view's outline encloses
//! as its picture is inside of the outline.

use image::{GrayImage, Luma};
use imageproc::distance_transform::euclidean_squared_distance_transform;
use nalgebra::{Point2, Point3};
use rayon::prelude::*;

use super::coverage::{self, DEPTH};
use super::holes::HoleHint;
use super::outline::Outline;
use crate::ink::inked;
use crate::silhouette::Silhouette;
use crate::surface::field::{Field, Lattice, Plane};
use crate::surface::projection::Rig;
use frames::Viewpoint;

/// A view that is not level, moved to agree with those that are.
#[derive(Clone, Copy, Debug)]
pub struct ElevatedInput<'a> {
    /// Where its camera stands.
    pub viewpoint: Viewpoint,
    /// The drawing, of the level views' size.
    pub image: &'a GrayImage,
    /// What it says is the subject.
    pub silhouette: &'a Silhouette,
}

/// What came of a view from above or below.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct CutReport {
    /// Its azimuth, degrees.
    pub azimuth_deg: f64,
    /// Its elevation, degrees.
    pub elevation_deg: f64,
    /// The share of the level views' lines of sight that it leaves nothing on.
    pub uncovered: f64,
    /// Whether it cut the solid: it does not if it contradicts the level views.
    pub used: bool,
}

/// A view that leaves more of the level views' lines of sight empty contradicts them.
const MAX_UNCOVERED: f64 = 0.15;

/// A silhouette as signed distances in its picture.
pub(super) struct Cut {
    rig: Rig,
    /// Per pixel, at its centre, px, positive inside.
    distances: Vec<f32>,
}

impl Cut {
    /// * `rig`: of the level views, whose size the drawing has.
    /// * `hints`: points in holes, of any view.
    pub(super) fn new(view: &ElevatedInput<'_>, rig: &Rig, hints: &[HoleHint]) -> Self {
        let mut mask = view.silhouette.mask().clone();
        for hint in hints.iter().filter(|hint| hint.viewpoint == view.viewpoint) {
            open(&mut mask, view.image, hint);
        }
        let mut paper = mask.clone();
        paper.iter_mut().for_each(|level| *level = 255 - *level);
        let to_subject = euclidean_squared_distance_transform(&mask);
        let to_paper = euclidean_squared_distance_transform(&paper);
        // The outline's middle lies half a stroke inside of the mask.
        let half_line = view.silhouette.half_line_px();
        let signed = |(outside, inside): (&f64, &f64)| {
            let from_edge = if *outside > 0.0 { 0.5 - outside.sqrt() } else { inside.sqrt() - 0.5 };
            (from_edge - half_line) as f32
        };
        let distances = to_subject.iter().zip(to_paper.iter()).map(signed).collect();
        Self { rig: Rig { viewpoints: vec![view.viewpoint], ..rig.clone() }, distances }
    }

    /// How far the picture of a point is inside of the outline, px.
    fn distance_at(&self, x: f64, y: f64) -> f32 {
        let (width, height) = (self.rig.width as usize, self.rig.height as usize);
        let (x, y) = (x - 0.5, y - 0.5);
        let within = |value: f64, size: usize| value.clamp(0.0, (size - 1) as f64);
        let (column, row) = (within(x, width), within(y, height));
        let (left, top) = (column as usize, row as usize);
        let (u, v) = ((column - left as f64) as f32, (row - top as f64) as f32);
        let at = |dx: usize, dy: usize| {
            self.distances[(top + dy).min(height - 1) * width + (left + dx).min(width - 1)]
        };
        let upper = at(0, 0) * (1.0 - u) + at(1, 0) * u;
        let lower = at(0, 1) * (1.0 - u) + at(1, 1) * u;
        // Beyond the picture there is only paper.
        let beyond = (x - column).abs().max((y - row).abs()) as f32;
        (upper * (1.0 - v) + lower * v).min(if beyond > 0.5 { -beyond } else { f32::MAX })
    }

    /// How far inside of the outline points are, px.
    pub(super) fn distance(&self) -> impl Fn(&Point3<f64>) -> f32 {
        let project = self.rig.projection(0);
        move |point| {
            let pixel = project(point);
            self.distance_at(pixel.x, pixel.y)
        }
    }
}

/// Takes the closed region around a hint out of the mask.
fn open(mask: &mut GrayImage, image: &GrayImage, hint: &HoleHint) {
    let (width, height) = mask.dimensions();
    let ink = inked(image);
    if hint.x_px < 0.0 || hint.y_px < 0.0 {
        return;
    }
    // Casts saturate.
    let mut open = vec![(hint.x_px as u32, hint.y_px as u32)];
    while let Some((x, y)) = open.pop() {
        let inside = x < width && y < height && mask.get_pixel(x, y).0[0] != 0;
        if inside && !ink[y as usize * width as usize + x as usize] {
            mask.put_pixel(x, y, Luma([0]));
            let beside = [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
            open.extend(beside);
        }
    }
}

/// What cuts bound: the visual hull of the level views.
pub(super) struct Bounds<'a> {
    cuts: Vec<Cut>,
    directions: &'a [Outline],
    /// Per slice, as the level views leave it.
    hulls: &'a [Plane],
}

impl<'a> Bounds<'a> {
    /// Leaves out cuts that contradict the level views; `None` if none is left.
    pub(super) fn new(
        cuts: Vec<Cut>,
        lattice: &Lattice,
        hulls: &'a [Plane],
        directions: &'a [Outline],
        report: &mut Vec<CutReport>,
    ) -> Option<Self> {
        let mut agrees = |cut: &Cut| {
            let Viewpoint { azimuth, elevation } = cut.rig.viewpoints[0];
            let uncovered = uncovered(cut, lattice, hulls, directions);
            let used = uncovered <= MAX_UNCOVERED;
            let (azimuth_deg, elevation_deg) = (azimuth.degrees(), elevation.degrees());
            report.push(CutReport { azimuth_deg, elevation_deg, uncovered, used });
            used
        };
        let mut cuts = cuts;
        cuts.retain(|cut| agrees(cut));
        (!cuts.is_empty()).then_some(Self { cuts, directions, hulls })
    }

    /// The field within the cuts.
    ///
    /// All lines of sight of elevated and level views that met the hull keep something: what is
    /// deepest there is brought back. Where the views contradict each other, the level ones are
    /// believed.
    pub(super) fn applied(&self, field: &Field) -> Field {
        let lattice = field.lattice;
        let limit = lattice.truncation_px() as f32;
        let hulls: Vec<Plane> = self
            .hulls
            .par_iter()
            .enumerate()
            .map(|(k, hull)| {
                let mut hull = hull.clone();
                self.cuts.iter().for_each(|cut| lower(&mut hull, cut, &lattice, k));
                hull
            })
            .collect();
        let within = |(plane, hull): (&Plane, &Plane)| {
            let mut out = Plane { creases: plane.creases.clone(), ..hull.clone() };
            for (index, value) in out.values.iter_mut().enumerate() {
                let (i, j) = hull.node(index);
                *value = value.min(plane.at(i, j, -limit));
            }
            out
        };
        let mut planes: Vec<Plane> = field.planes.par_iter().zip(&hulls).map(within).collect();
        for cut in &self.cuts {
            restore(&mut planes, &hulls, cut, &lattice);
        }
        for bound in [&hulls, self.hulls] {
            planes.par_iter_mut().zip(bound).for_each(|(plane, hull)| {
                coverage::restore(plane, hull, &lattice, self.directions, 0);
            });
        }
        Field { lattice, planes }
    }
}

/// Calls `visit` with the index and the point of each node of a window.
fn for_nodes(
    plane: &Plane,
    lattice: &Lattice,
    k: usize,
    mut visit: impl FnMut(usize, Point3<f64>),
) {
    for index in 0..plane.values.len() {
        let (i, j) = plane.node(index);
        visit(index, Point3::new(lattice.x(i), lattice.y(j), lattice.z(k)));
    }
}

fn lower(plane: &mut Plane, cut: &Cut, lattice: &Lattice, k: usize) {
    let (distance, limit) = (cut.distance(), lattice.truncation_px() as f32);
    for index in 0..plane.values.len() {
        let (i, j) = plane.node(index);
        let point = Point3::new(lattice.x(i), lattice.y(j), lattice.z(k));
        let value = &mut plane.values[index];
        if *value > -limit {
            *value = value.min(distance(&point)).max(-limit);
        }
    }
}

/// The share of the level views' lines of sight through the hull on which the cut leaves nothing.
fn uncovered(cut: &Cut, lattice: &Lattice, hulls: &[Plane], directions: &[Outline]) -> f64 {
    let half = lattice.origin.x.abs() + lattice.origin.y.abs() + lattice.pitch_px;
    let bins = (2.0 * half / lattice.pitch_px).ceil() as usize + 1;
    let of_slice = |(k, hull): (usize, &Plane)| {
        let distance = cut.distance();
        // Per direction and column: 1 if the hull is met, 3 if something is left of it.
        let mut met = vec![0_u8; bins * directions.len()];
        for_nodes(hull, lattice, k, |index, point| {
            if hull.values[index] > 0.0 {
                let state = if distance(&point) > 0.0 { 3 } else { 1 };
                for (direction, outline) in directions.iter().enumerate() {
                    let column = outline.column(&Point2::new(point.x, point.y));
                    let bin = (((column + half) / lattice.pitch_px) as usize).min(bins - 1);
                    met[direction * bins + bin] |= state;
                }
            }
        });
        let count = |wanted: fn(u8) -> bool| met.iter().filter(|state| wanted(**state)).count();
        [count(|state| state != 0), count(|state| state == 1)]
    };
    let counts: Vec<[usize; 2]> = hulls.par_iter().enumerate().map(of_slice).collect();
    let sum = |which: usize| counts.iter().map(|count| count[which]).sum::<usize>() as f64;
    sum(1) / sum(0).max(1.0)
}

/// Lines of sight of the cut's camera that meet the hull but no longer the solid get back what is
/// deepest there.
///
/// `planes` take the windows of `hulls`.
fn restore(planes: &mut [Plane], hulls: &[Plane], cut: &Cut, lattice: &Lattice) {
    let pitch = lattice.pitch_px;
    let columns = (f64::from(cut.rig.width) / pitch) as usize + 1;
    let rows = (f64::from(cut.rig.height) / pitch) as usize + 1;
    let project = cut.rig.projection(0);
    let bin = |point: &Point3<f64>| {
        let pixel = project(point);
        // Casts saturate at 0.
        let (x, y) = ((pixel.x / pitch) as usize, (pixel.y / pitch) as usize);
        y.min(rows - 1) * columns + x.min(columns - 1)
    };
    let mut best = vec![f32::NEG_INFINITY; columns * rows];
    for (k, (plane, hull)) in planes.iter().zip(hulls).enumerate() {
        for_nodes(hull, lattice, k, |index, point| {
            if hull.values[index] > 0.0 {
                let best = &mut best[bin(&point)];
                *best = best.max(plane.values[index]);
            }
        });
    }
    let depth = DEPTH * pitch as f32;
    planes.par_iter_mut().zip(hulls).enumerate().for_each(|(k, (plane, hull))| {
        for_nodes(hull, lattice, k, |index, point| {
            let best = best[bin(&point)];
            if hull.values[index] > 0.0 && best < depth {
                let lifted = plane.values[index] + depth - best;
                plane.values[index] = lifted.min(hull.values[index]);
            }
        });
    });
}
