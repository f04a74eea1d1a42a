//! Slices made one: what is decided row by row leaves steps.

use super::fusion;
use super::outline::Outline;
use crate::surface::field::{Field, Lattice, Plane};

/// `field` within `hulls`, the sections of its slices, averaged.
pub(super) fn smoothed(field: &Field, hulls: &[Plane], directions: &[Outline]) -> Field {
    use rayon::prelude::*;
    let lattice = field.lattice;
    let limit = lattice.truncation_px() as f32;
    let within = |(plane, hull): (&Plane, &Plane)| {
        let mut out = Plane { creases: plane.creases.clone(), ..hull.clone() };
        for (index, value) in out.values.iter_mut().enumerate() {
            let (i, j) = hull.node(index);
            *value = plane.at(i, j, -limit).min(*value);
        }
        out
    };
    let planes = field.planes.par_iter().zip(hulls).map(within).collect();
    let mut field = Field { lattice, planes };
    smooth(&mut field, hulls, directions);
    field
}

/// How often the field is averaged: what the outlines bring back makes steps
/// from slice to slice.
const ROUNDS: usize = 2;

/// Averages the field over neighbours within and across slices, but beside
/// creases; silhouettes keep something behind them.
///
/// The planes of `field` take the windows of `hulls`.
pub(super) fn smooth(field: &mut Field, hulls: &[Plane], directions: &[Outline]) {
    use rayon::prelude::*;
    let lattice = field.lattice;
    let restore = |planes: &mut [Plane]| {
        planes.par_iter_mut().zip(hulls).for_each(|(plane, hull)| {
            fusion::restore_silhouettes(plane, hull, &lattice, directions);
        });
    };
    for _ in 0..ROUNDS {
        restore(&mut field.planes);
        field.planes = averaged(&field.planes, &lattice);
    }
    restore(&mut field.planes);
}

fn averaged(planes: &[Plane], lattice: &Lattice) -> Vec<Plane> {
    use rayon::prelude::*;
    let limit = lattice.truncation_px() as f32;
    let within: Vec<Plane> = planes.par_iter().map(fusion::smoothed).collect();
    let last = planes.len().saturating_sub(1);
    let of_slice = |(k, own): (usize, &Plane)| {
        let (below, above) = (&within[k.saturating_sub(1)], &within[(k + 1).min(last)]);
        let mut out = within[k].clone();
        for (index, value) in out.values.iter_mut().enumerate() {
            let (i, j) = own.node(index);
            let (low, high) = (below.at(i, j, -limit), above.at(i, j, -limit));
            *value = 0.25 * low + 0.5 * *value + 0.25 * high;
        }
        for crease in &own.creases {
            keep_near(&mut out, own, lattice, crease);
        }
        out
    };
    planes.par_iter().enumerate().map(of_slice).collect()
}

/// Gives nodes around a crease their value before smoothing.
fn keep_near(out: &mut Plane, own: &Plane, lattice: &Lattice, crease: &nalgebra::Point2<f64>) {
    const REACH: isize = 2;
    let node = |value: f64, low: f64| ((value - low) / lattice.pitch_px).round() as isize;
    let (i, j) = (node(crease.x, lattice.origin.x), node(crease.y, lattice.origin.y));
    for j in j - REACH..=j + REACH {
        for i in i - REACH..=i + REACH {
            let (i, j) = (i - own.first[0] as isize, j - own.first[1] as isize);
            let inside =
                i >= 0 && j >= 0 && (i as usize) < own.size[0] && (j as usize) < own.size[1];
            if inside {
                let index = j as usize * own.size[0] + i as usize;
                out.values[index] = own.values[index];
            }
        }
    }
}
