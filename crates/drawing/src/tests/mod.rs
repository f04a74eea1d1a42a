//! Drawings of shapes whose lines and depths are known.

mod arbitrary;
mod colours;
mod hidden_lines;
mod lines;
mod sheets;
mod truth;

use nalgebra::{Point2, Point3, Vector3};
use proptest::prelude::*;

use super::*;
use frames::{Azimuth, Viewpoint};
use mesh::Mesh;
use mesh::builtin::{cuboid, torus, uv_sphere};
use mesh::read::Model;

fn azimuth(degrees: f64) -> Azimuth {
    Azimuth::from_degrees(degrees).unwrap()
}

fn draw(model: &Model, degrees: f64, options: &DrawOptions) -> DrawnView {
    let prepared = PreparedModel::new(model).unwrap();
    Drawer::new(&prepared, options).unwrap().draw_view(options.viewpoint(azimuth(degrees))).unwrap()
}

fn exact(model: &Model, degrees: f64) -> DrawnView {
    draw(model, degrees, &DrawOptions::default())
}

/// Smaller pictures for what does not depend on the size.
fn small() -> DrawOptions {
    DrawOptions { width_px: 192, height_px: 108, ..DrawOptions::default() }
}

fn length(view: &DrawnView, kind: Option<LineKind>) -> f64 {
    let wanted = |stroke: &&Stroke| kind.is_none_or(|kind| stroke.kind == kind);
    view.strokes.iter().filter(wanted).map(Stroke::length_px).sum()
}

const PIXELS_PER_UNIT: f64 = 960.0 / 7.3;

/// A rectangle facing the front, at y, around (x, z).
fn plate(x: f64, y: f64, z: f64, half_width: f64, half_height: f64) -> Model {
    let corner = |dx: f64, dz: f64| Point3::new(x + dx * half_width, y, z + dz * half_height);
    Model {
        mesh: Mesh {
            positions: vec![
                corner(-1.0, -1.0),
                corner(1.0, -1.0),
                corner(1.0, 1.0),
                corner(-1.0, 1.0),
            ],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        },
        materials: vec![0, 0],
        ..Model::default()
    }
}

fn joined(mut model: Model, other: Model) -> Model {
    let first = model.mesh.positions.len() as u32;
    model.mesh.positions.extend(other.mesh.positions);
    let triangles = other.mesh.triangles.into_iter();
    model.mesh.triangles.extend(triangles.map(|t| t.map(|v| v + first)));
    model.materials.extend(other.materials);
    model
}
