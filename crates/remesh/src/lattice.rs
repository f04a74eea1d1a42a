//! A smooth field of lattices: at each vertex a point of a square lattice in its tangent plane,
//! along its cross.

use nalgebra::{Point3, Vector3};

use super::orientation::matching;
use super::vertices::Level;

const ROUNDS: usize = 6;
/// Keeps planes that are nearly parallel from meeting far away.
const PARALLEL: f64 = 1e-4;

/// Fills the levels' `lattice`; cells have the side `side`. `None` if `stopped` says so.
pub(crate) fn smooth(levels: &mut [Level], side: f64, stopped: &dyn Fn() -> bool) -> Option<()> {
    for index in (0..levels.len()).rev() {
        let (finer, coarser) = levels.split_at_mut(index + 1);
        let level = &mut finer[index];
        level.lattice = match coarser.first() {
            Some(coarser) => {
                level.parents.iter().map(|&parent| coarser.lattice[parent as usize]).collect()
            }
            None => level.points.clone(),
        };
        for vertex in 0..level.points.len() {
            level.lattice[vertex] = flattened(level, vertex, &level.lattice[vertex]);
        }
        for _ in 0..ROUNDS {
            if stopped() {
                return None;
            }
            for vertex in 0..level.points.len() {
                level.lattice[vertex] = averaged(level, vertex, side);
            }
        }
    }
    Some(())
}

fn flattened(level: &Level, vertex: usize, point: &Point3<f64>) -> Point3<f64> {
    let normal = level.normals[vertex];
    point - normal * normal.dot(&(point - level.points[vertex]))
}

fn averaged(level: &Level, vertex: usize, side: f64) -> Point3<f64> {
    let mut own = Site {
        point: level.points[vertex],
        normal: level.normals[vertex],
        axis: level.axes[vertex],
        lattice: level.lattice[vertex],
    };
    let mut total = 0.0;
    for &(other, weight) in level.around(vertex) {
        let met = meeting(&own, &Site::of(level, other as usize), side);
        let mean =
            (met.points[0].coords * total + met.points[1].coords * weight) / (total + weight);
        own.lattice = flattened(level, vertex, &mean.into());
        total += weight;
    }
    if let Some(crease) = level.creases[vertex] {
        // The crease is a line of the lattice.
        let (along, _) = matching(&own.axis, &own.normal, &crease, &own.normal);
        let off = own.point - own.lattice;
        own.lattice += off - along * along.dot(&off);
        own.lattice = flattened(level, vertex, &own.lattice);
    }
    own.nearest(&own.point, side)
}

/// A vertex with its plane and lattice.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Site {
    pub point: Point3<f64>,
    pub normal: Vector3<f64>,
    pub axis: Vector3<f64>,
    pub lattice: Point3<f64>,
}

impl Site {
    pub(crate) fn of(level: &Level, vertex: usize) -> Self {
        Self {
            point: level.points[vertex],
            normal: level.normals[vertex],
            axis: level.axes[vertex],
            lattice: level.lattice[vertex],
        }
    }

    fn axes(&self) -> [Vector3<f64>; 2] {
        [self.axis, self.normal.cross(&self.axis)]
    }

    /// The lattice point nearest to `point`.
    fn nearest(&self, point: &Point3<f64>, side: f64) -> Point3<f64> {
        self.at(self.step_of(point, side), side)
    }

    /// The steps to the lattice point nearest to `point`.
    fn step_of(&self, point: &Point3<f64>, side: f64) -> [f64; 2] {
        let off = point - self.lattice;
        self.axes().map(|axis| (axis.dot(&off) / side).round())
    }

    fn cell_of(&self, point: &Point3<f64>, side: f64) -> [f64; 2] {
        let off = point - self.lattice;
        self.axes().map(|axis| (axis.dot(&off) / side).floor())
    }

    fn at(&self, [i, j]: [f64; 2], side: f64) -> Point3<f64> {
        let [along, across] = self.axes();
        self.lattice + along * (i * side) + across * (j * side)
    }
}

/// Where the lattices of two vertices come nearest to each other between them.
pub(crate) struct Meeting {
    /// The two lattice points.
    pub points: [Point3<f64>; 2],
    /// Steps of the lattice from the first vertex's lattice point to the second's.
    pub steps: [i32; 2],
    /// The distance of `points`.
    pub error: f64,
}

pub(crate) fn meeting(a: &Site, b: &Site, side: f64) -> Meeting {
    // Both in axes that agree.
    let (own, theirs) = matching(&a.axis, &a.normal, &b.axis, &b.normal);
    let (a, b) = (Site { axis: own, ..*a }, Site { axis: theirs, ..*b });
    let middle = between(&a, &b);
    let low = a.cell_of(&middle, side);
    let mut best = (f64::INFINITY, [0.0; 2], [0.0; 2]);
    for first in [low, [low[0] + 1.0, low[1]], [low[0], low[1] + 1.0], low.map(|step| step + 1.0)] {
        let point = a.at(first, side);
        let second = b.step_of(&point, side);
        let distance = (point - b.at(second, side)).norm_squared();
        if distance < best.0 {
            best = (distance, first, second);
        }
    }
    let (distance, first, second) = best;
    Meeting {
        points: [a.at(first, side), b.at(second, side)],
        steps: [0, 1].map(|axis| (first[axis] - second[axis]) as i32),
        error: distance.sqrt(),
    }
}

/// The point of both tangent planes that is nearest to the middle of the two vertices.
fn between(a: &Site, b: &Site) -> Point3<f64> {
    let middle = nalgebra::center(&a.point, &b.point);
    let cosine = a.normal.dot(&b.normal);
    let (up, other_up) = (a.normal.dot(&(a.point - middle)), b.normal.dot(&(b.point - middle)));
    let scale = 1.0 / (1.0 - cosine * cosine + PARALLEL);
    middle
        + a.normal * ((up - cosine * other_up) * scale)
        + b.normal * ((other_up - cosine * up) * scale)
}
