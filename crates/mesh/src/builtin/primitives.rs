//! Boxes, spheres, cones and the like, and how models are moved and joined.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix3, Point3, Rotation3, Vector3};

use crate::Mesh;
use crate::read::Model;

impl Model {
    /// All of one material, without normals of its own.
    pub(super) fn of_mesh(mesh: Mesh) -> Self {
        Self { materials: vec![0; mesh.triangles.len()], mesh, ..Model::default() }
    }

    pub(super) fn translated(self, by: [f64; 3]) -> Self {
        self.transformed(Matrix3::identity(), Vector3::from(by))
    }

    pub(super) fn scaled(self, by: [f64; 3]) -> Self {
        self.transformed(Matrix3::from_diagonal(&Vector3::from(by)), Vector3::zeros())
    }

    pub(super) fn rotated_about_x(self, angle_deg: f64) -> Self {
        self.rotated(&Rotation3::from_axis_angle(&Vector3::x_axis(), angle_deg.to_radians()))
    }

    pub(super) fn rotated_about_y(self, angle_deg: f64) -> Self {
        self.rotated(&Rotation3::from_axis_angle(&Vector3::y_axis(), angle_deg.to_radians()))
    }

    fn rotated(self, rotation: &Rotation3<f64>) -> Self {
        self.transformed(rotation.into_inner(), Vector3::zeros())
    }

    /// For models without normals and maps that keep the orientation.
    fn transformed(mut self, linear: Matrix3<f64>, offset: Vector3<f64>) -> Self {
        for position in &mut self.mesh.positions {
            *position = Point3::from(linear * position.coords + offset);
        }
        self
    }

    /// Both models in one; each part keeps its vertices, and its materials their numbers.
    pub(super) fn joined(mut self, other: Self) -> Self {
        let first = self.mesh.positions.len() as u32;
        self.mesh.positions.extend(other.mesh.positions);
        let shifted = other.mesh.triangles.into_iter().map(|t| t.map(|v| v + first));
        self.mesh.triangles.extend(shifted);
        self.materials.extend(other.materials);
        self
    }
}

/// A box with sides `size`, centred on the origin.
pub fn cuboid(size: [f64; 3]) -> Model {
    let corner = |index: usize| {
        let sign = |bit: usize| if index >> bit & 1 == 1 { 0.5 } else { -0.5 };
        Point3::new(sign(0) * size[0], sign(1) * size[1], sign(2) * size[2])
    };
    const QUADS: [[u32; 4]; 6] =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [3, 2, 6, 7], [0, 4, 6, 2], [1, 3, 7, 5]];
    let mut mesh = Mesh { positions: (0..8).map(corner).collect(), triangles: Vec::new() };
    QUADS.into_iter().for_each(|q| push_quad(&mut mesh, q));
    Model::of_mesh(mesh)
}

/// A cone on the ground plane: base circle in z = 0, apex at z = `height`.
pub fn cone(radius: f64, height: f64, segments: u32) -> Model {
    frustum(radius, 0.0, height, segments)
}

/// An upright cylinder from z = 0 to z = `height`.
pub fn cylinder(radius: f64, height: f64, segments: u32) -> Model {
    frustum(radius, radius, height, segments)
}

/// A capped cone stump from z = 0 to z = `height`; a radius of 0 gives an apex.
pub fn frustum(radius_low: f64, radius_high: f64, height: f64, segments: u32) -> Model {
    let profile = [(0.0, 0.0), (radius_low, 0.0), (radius_high, height), (0.0, height)];
    lathe(&profile, segments)
}

/// A sphere about the origin of `rings` latitude bands and `segments` meridians.
pub fn uv_sphere(radius: f64, rings: u32, segments: u32) -> Model {
    let profile: Vec<_> = (0..=rings)
        .map(|ring| {
            let angle = PI * f64::from(ring) / f64::from(rings);
            let distance = if ring == 0 || ring == rings { 0.0 } else { angle.sin() };
            (radius * distance, -radius * angle.cos())
        })
        .collect();
    lathe(&profile, segments)
}

/// Turns a profile of (distance from the Z axis, z), rising, about the Z axis. Distances of 0
/// become single vertices.
pub(super) fn lathe(profile: &[(f64, f64)], segments: u32) -> Model {
    let mut mesh = Mesh::default();
    let mut below: Vec<u32> = Vec::new();
    for &(distance, z) in profile {
        let ring = push_ring(&mut mesh, distance, z, segments);
        if !below.is_empty() {
            (0..segments as usize).for_each(|s| push_band(&mut mesh, &below, &ring, s));
        }
        below = ring;
    }
    Model::of_mesh(mesh)
}

/// The vertices of one ring, one index a segment.
fn push_ring(mesh: &mut Mesh, distance: f64, z: f64, segments: u32) -> Vec<u32> {
    let first = mesh.positions.len() as u32;
    if distance == 0.0 {
        mesh.positions.push(Point3::new(0.0, 0.0, z));
        return vec![first; segments as usize];
    }
    for segment in 0..segments {
        let (sin, cos) = (TAU * f64::from(segment) / f64::from(segments)).sin_cos();
        mesh.positions.push(Point3::new(distance * cos, distance * sin, z));
    }
    (first..first + segments).collect()
}

fn push_band(mesh: &mut Mesh, below: &[u32], above: &[u32], segment: usize) {
    let next = (segment + 1) % below.len();
    push_quad(mesh, [below[segment], below[next], above[next], above[segment]]);
}

/// Two triangles; those that have shrunk to a line are left out.
fn push_quad(mesh: &mut Mesh, [a, b, c, d]: [u32; 4]) {
    for triangle in [[a, b, c], [a, c, d]] {
        if triangle[0] != triangle[1] && triangle[1] != triangle[2] && triangle[2] != triangle[0] {
            mesh.triangles.push(triangle);
        }
    }
}

/// A torus about the Z axis: the tube's centre circle has radius `major`, the tube `minor`.
pub fn torus(major: f64, minor: f64, major_segments: u32, minor_segments: u32) -> Model {
    let mut mesh = Mesh::default();
    for i in 0..major_segments {
        let (sin, cos) = (TAU * f64::from(i) / f64::from(major_segments)).sin_cos();
        for j in 0..minor_segments {
            let (tube_sin, tube_cos) = (TAU * f64::from(j) / f64::from(minor_segments)).sin_cos();
            let distance = major + minor * tube_cos;
            mesh.positions.push(Point3::new(distance * cos, distance * sin, minor * tube_sin));
        }
    }
    let vertex = |i: u32, j: u32| (i % major_segments) * minor_segments + j % minor_segments;
    for i in 0..major_segments {
        for j in 0..minor_segments {
            let quad = [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)];
            push_quad(&mut mesh, quad);
        }
    }
    Model::of_mesh(mesh)
}
