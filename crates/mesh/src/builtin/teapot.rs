//! The Utah teapot from its published Bezier patches (Newell 1975; the bottom is Crow's, 1987).
//!
//! Rim, body, lid and bottom are surfaces of revolution given by four control points a quarter
//! turn; handle and spout are tubes, symmetric about y = 0.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

use crate::Mesh;
use crate::read::Model;

type Patch = [[Vector3<f64>; 4]; 4];

/// A profile's control points: (distance from the axis, z).
type Profile = [(f64, f64); 4];

const RIM: Profile = [(1.4, 2.4), (1.3375, 2.53125), (1.4375, 2.53125), (1.5, 2.4)];
const BODY: [Profile; 2] = [
    [(1.5, 2.4), (1.75, 1.875), (2.0, 1.35), (2.0, 0.9)],
    [(2.0, 0.9), (2.0, 0.45), (1.5, 0.225), (1.5, 0.15)],
];
const LID: [Profile; 2] = [
    [(0.0, 3.15), (0.8, 3.15), (0.0, 2.85), (0.2, 2.7)],
    [(0.2, 2.7), (0.4, 2.55), (1.3, 2.55), (1.3, 2.4)],
];
const BOTTOM: Profile = [(1.5, 0.15), (1.5, 0.075), (1.425, 0.0), (0.0, 0.0)];

/// The tangent length that the data uses for a quarter circle of radius 1; the lid's knob has
/// 0.45 / 0.8 instead.
const QUARTER_CIRCLE: f64 = 0.56;
const KNOB_QUARTER_CIRCLE: f64 = 0.5625;

/// A tube's control points across it: inner edge (x, z), outer edge (x, z), half width.
type TubeRow = [f64; 5];

const HANDLE: [TubeRow; 7] = [
    [-1.6, 2.025, -1.5, 2.25, 0.3],
    [-2.3, 2.025, -2.5, 2.25, 0.3],
    [-2.7, 2.025, -3.0, 2.25, 0.3],
    [-2.7, 1.8, -3.0, 1.8, 0.3],
    [-2.7, 1.575, -3.0, 1.35, 0.3],
    [-2.5, 1.125, -2.65, 0.9375, 0.3],
    [-2.0, 0.9, -1.9, 0.6, 0.3],
];
const SPOUT: [TubeRow; 7] = [
    [1.7, 1.425, 1.7, 0.6, 0.66],
    [2.6, 1.425, 3.1, 0.825, 0.66],
    [2.3, 2.1, 2.4, 2.025, 0.25],
    [2.7, 2.4, 3.3, 2.4, 0.25],
    [2.8, 2.475, 3.525, 2.49375, 0.25],
    [2.9, 2.475, 3.45, 2.5125, 0.15],
    [2.8, 2.4, 3.2, 2.4, 0.15],
];

/// Half of the teapot's height: the model is centred on it.
const CENTRE_Z: f64 = 1.575;

/// The teapot with each of its 32 patches cut into `segments` × `segments` quads, its patches
/// joined at their seams. It is not watertight: the lid does not touch the rim, and the spout's
/// walls have no thickness.
pub fn teapot(segments: u32) -> Model {
    let mut builder = Builder::default();
    for patch in patches() {
        builder.add(&patch, segments.max(1));
    }
    Model::of_mesh(builder.mesh).translated([0.0, 0.0, -CENTRE_Z])
}

fn patches() -> Vec<Patch> {
    let mut patches = Vec::with_capacity(32);
    for profile in [RIM, BODY[0], BODY[1], LID[0], LID[1], BOTTOM] {
        patches.extend((0..4).map(|quarter| revolved(&profile, quarter)));
    }
    for tube in [HANDLE, SPOUT] {
        for part in [0, 3] {
            for side in [-1.0, 1.0] {
                patches.push(tube_half(&tube[part..part + 4], side));
            }
        }
    }
    patches
}

fn revolved(profile: &Profile, quarter: usize) -> Patch {
    profile.map(|(distance, z)| {
        let factor = if z > 3.0 { KNOB_QUARTER_CIRCLE } else { QUARTER_CIRCLE };
        let near = distance * factor;
        [(distance, 0.0), (distance, near), (near, distance), (0.0, distance)].map(|(x, y)| {
            let (x, y) = (0..quarter).fold((x, y), |(x, y), _| (-y, x));
            Vector3::new(x, y, z)
        })
    })
}

fn tube_half(rows: &[TubeRow], side: f64) -> Patch {
    let row = |index: usize| {
        let [inner_x, inner_z, outer_x, outer_z, half_width] = rows[index];
        let y = side * half_width;
        let across = [
            Vector3::new(inner_x, 0.0, inner_z),
            Vector3::new(inner_x, y, inner_z),
            Vector3::new(outer_x, y, outer_z),
            Vector3::new(outer_x, 0.0, outer_z),
        ];
        let [a, b, c, d] = across;
        if side > 0.0 { [a, b, c, d] } else { [d, c, b, a] }
    };
    [row(0), row(1), row(2), row(3)]
}

#[derive(Default)]
struct Builder {
    mesh: Mesh,
    vertex_at: HashMap<[i64; 3], u32>,
}

impl Builder {
    fn add(&mut self, patch: &Patch, segments: u32) {
        let at = |i: u32, j: u32| {
            point(patch, f64::from(i) / f64::from(segments), f64::from(j) / f64::from(segments))
        };
        for i in 0..segments {
            for j in 0..segments {
                let corners = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
                let [a, b, c, d] = corners.map(|corner| self.vertex(corner));
                self.triangle([a, c, b]);
                self.triangle([a, d, c]);
            }
        }
    }

    fn triangle(&mut self, triangle: [u32; 3]) {
        let [a, b, c] = triangle;
        if a != b && b != c && c != a {
            self.mesh.triangles.push(triangle);
        }
    }

    /// One vertex for all patches that meet there, whatever their rounding.
    fn vertex(&mut self, p: Vector3<f64>) -> u32 {
        let key = [p.x, p.y, p.z].map(|c| (c * 1e9).round() as i64);
        *self.vertex_at.entry(key).or_insert_with(|| {
            self.mesh.positions.push(Point3::from(p));
            self.mesh.positions.len() as u32 - 1
        })
    }
}

/// The bicubic Bezier surface at (u, v): u along the rows, v across them.
fn point(patch: &Patch, u: f64, v: f64) -> Vector3<f64> {
    let rows = patch.map(|row| curve(&row, v));
    curve(&rows, u)
}

fn curve(points: &[Vector3<f64>; 4], t: f64) -> Vector3<f64> {
    let s = 1.0 - t;
    points[0] * (s * s * s)
        + points[1] * (3.0 * s * s * t)
        + points[2] * (3.0 * s * t * t)
        + points[3] * (t * t * t)
}
