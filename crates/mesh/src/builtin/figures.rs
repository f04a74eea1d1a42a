//! Built-in models put together from primitives.

use nalgebra::Point3;

use super::primitives::{cone, cuboid, cylinder, lathe, uv_sphere};
use crate::Mesh;
use crate::read::Model;

/// A body of boxes with a round head, a pointed hat and a stick held across: flat and round parts
/// that hide each other differently in every view.
pub fn dude() -> Model {
    let torso = cuboid([1.1, 0.7, 1.2]).translated([0.0, 0.0, -0.35]);
    let leg = |x| cuboid([0.38, 0.55, 1.05]).translated([x, 0.0, -1.475]);
    let head = uv_sphere(0.55, 24, 48).translated([0.0, 0.0, 0.72]);
    let hat = cone(0.62, 0.85, 48).translated([0.0, 0.0, 1.05]);
    let stick = cylinder(0.08, 2.2, 24)
        .translated([0.0, 0.0, -1.1])
        .rotated_about_y(60.0)
        .translated([0.05, -0.55, -0.35]);
    torso.joined(leg(-0.32)).joined(leg(0.32)).joined(head).joined(hat).joined(stick)
}

/// A cone, a box and a sphere that stand apart, so that gaps between them open and close with
/// the angle.
pub fn objects() -> Model {
    cone(0.7, 1.7, 48)
        .translated([-1.6, 0.3, -0.9])
        .joined(cuboid([1.2, 1.0, 1.3]).translated([0.05, -0.45, -0.1]))
        .joined(uv_sphere(0.65, 24, 48).translated([1.65, 0.35, -0.1]))
}

/// A humanoid of rounded limbs with a cape, the kind of subject that model sheets show.
pub fn caped_figure() -> Model {
    let head = uv_sphere(0.3, 24, 48).scaled([0.9, 1.0, 1.2]).translated([0.0, 0.0, 1.45]);
    let neck = cylinder(0.13, 0.3, 32).translated([0.0, 0.0, 0.95]);
    let mut figure = trunk().joined(head).joined(neck).joined(cape());
    for side in [-1.0, 1.0] {
        figure = figure.joined(ear(side)).joined(arm(side)).joined(leg(side));
    }
    figure.scaled([0.93; 3]).translated([0.0, 0.0, 0.02])
}

fn trunk() -> Model {
    let profile = [
        (0.0, -0.52),
        (0.2, -0.5),
        (0.34, -0.38),
        (0.38, -0.2),
        (0.34, 0.02),
        (0.32, 0.12),
        (0.36, 0.35),
        (0.44, 0.62),
        (0.46, 0.76),
        (0.4, 0.9),
        (0.22, 1.0),
        (0.0, 1.04),
    ];
    lathe(&smoothed(&profile), 48).scaled([1.15, 0.68, 1.0])
}

fn ear(side: f64) -> Model {
    cone(0.1, 0.5, 24).rotated_about_y(8.0 * side).translated([0.15 * side, 0.0, 1.52])
}

fn arm(side: f64) -> Model {
    let upper = limb(0.17, 0.13, 0.72).rotated_about_y(-14.0 * side);
    let lower = limb(0.13, 0.09, 0.66)
        .rotated_about_y(-8.0 * side)
        .rotated_about_x(-18.0)
        .translated([0.174 * side, 0.0, -0.698]);
    let hand =
        uv_sphere(0.13, 16, 32).scaled([0.8, 1.0, 1.3]).translated([0.26 * side, -0.21, -1.42]);
    upper.joined(lower).joined(hand).translated([0.56 * side, 0.0, 0.78])
}

fn leg(side: f64) -> Model {
    let thigh = limb(0.23, 0.16, 0.9).rotated_about_y(-3.0 * side);
    let shin = limb(0.16, 0.1, 0.82).translated([0.047 * side, 0.0, -0.9]);
    let foot = cuboid([0.22, 0.48, 0.14]).translated([0.047 * side, -0.12, -1.8]);
    thigh.joined(shin).joined(foot).translated([0.22 * side, 0.0, -0.32])
}

/// A tapering limb with round ends, hanging down from the origin.
fn limb(radius_top: f64, radius_end: f64, length: f64) -> Model {
    const ARC: i32 = 8;
    let arc = |centre: f64, radius: f64, from: i32| {
        (0..=ARC).map(move |step| {
            let angle = f64::from(from + step) * std::f64::consts::FRAC_PI_2 / f64::from(ARC);
            let at_pole = (from + step).abs() == ARC;
            let distance = if at_pole { 0.0 } else { radius * angle.cos() };
            (distance, centre + radius * angle.sin())
        })
    };
    let profile: Vec<_> = arc(-length, radius_end, -ARC).chain(arc(0.0, radius_top, 0)).collect();
    lathe(&profile, 32)
}

/// A sheet with a thickness, wider at the hem, behind the back.
fn cape() -> Model {
    const HALF_ANGLE_DEG: f64 = 62.0;
    let mut mesh = Mesh::default();
    let (columns, rows) = (24_u32, 12_u32);
    for (layer, row, column) in grid(rows, columns) {
        let v = f64::from(row) / f64::from(rows);
        let u = f64::from(column) / f64::from(columns) * 2.0 - 1.0;
        let angle = (u * HALF_ANGLE_DEG).to_radians();
        let radius = 0.62 + 0.42 * v * v + 0.05 * v * (5.0 * angle).cos() + 0.03 * f64::from(layer);
        let (sin, cos) = angle.sin_cos();
        let z = 0.86 - 2.25 * v;
        mesh.positions.push(Point3::new(1.05 * radius * sin, 0.85 * radius * cos - 0.12, z));
    }
    cape_triangles(&mut mesh, rows, columns);
    Model { materials: vec![1; mesh.triangles.len()], mesh, ..Model::default() }
}

fn grid(rows: u32, columns: u32) -> impl Iterator<Item = (u32, u32, u32)> {
    (0..2).flat_map(move |layer| {
        (0..=rows).flat_map(move |row| (0..=columns).map(move |column| (layer, row, column)))
    })
}

/// Inner layer (0), outer layer (1) and the rim between them.
fn cape_triangles(mesh: &mut Mesh, rows: u32, columns: u32) {
    let vertex =
        |layer: u32, row: u32, column: u32| (layer * (rows + 1) + row) * (columns + 1) + column;
    let mut quad = |a, b, c, d| mesh.triangles.extend([[a, b, c], [a, c, d]]);
    for row in 0..rows {
        for column in 0..columns {
            let at = |layer, r, c| vertex(layer, row + r, column + c);
            quad(at(0, 0, 0), at(0, 0, 1), at(0, 1, 1), at(0, 1, 0));
            quad(at(1, 0, 0), at(1, 1, 0), at(1, 1, 1), at(1, 0, 1));
        }
    }
    for row in 0..rows {
        let (v, l) = (row, columns);
        quad(vertex(0, v, 0), vertex(0, v + 1, 0), vertex(1, v + 1, 0), vertex(1, v, 0));
        quad(vertex(0, v, l), vertex(1, v, l), vertex(1, v + 1, l), vertex(0, v + 1, l));
    }
    for column in 0..columns {
        let (u, l) = (column, rows);
        quad(vertex(0, 0, u), vertex(1, 0, u), vertex(1, 0, u + 1), vertex(0, 0, u + 1));
        quad(vertex(0, l, u), vertex(0, l, u + 1), vertex(1, l, u + 1), vertex(1, l, u));
    }
}

/// The profile with three Catmull-Rom points between each two given ones.
fn smoothed(profile: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let last = profile.len() - 1;
    let at = |index: isize| profile[index.clamp(0, last as isize) as usize];
    let mut points = Vec::new();
    for index in 0..last as isize {
        let [p0, p1, p2, p3] = [-1, 0, 1, 2].map(|offset| at(index + offset));
        for step in 0..4 {
            let t = f64::from(step) / 4.0;
            let blend = |a: f64, b: f64, c: f64, d: f64| {
                let cubic = 3.0 * b - a - 3.0 * c + d;
                b + 0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * cubic))
            };
            let distance = blend(p0.0, p1.0, p2.0, p3.0).max(0.0);
            points.push((distance, blend(p0.1, p1.1, p2.1, p3.1)));
        }
    }
    points.push(profile[last]);
    points
}
