//! Slices made one: what is decided row by row leaves steps.

use super::coverage;
use super::outline::Outline;
use super::tunnels;
use crate::surface::field::{Field, Lattice, Plane};

/// `field` within `hulls`, the sections of its slices, averaged.
///
/// * `apart`: how far drawings are from agreeing, 0 to 1.
pub(super) fn smoothed(
    field: &Field,
    hulls: &[Plane],
    directions: &[Outline],
    apart: f32,
) -> Field {
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
    smooth(&mut field, hulls, directions, apart);
    field
}

/// How often the field is averaged, and what silhouettes need is then lifted.
const ROUNDS: usize = 2;
const LIFTS: usize = 3;
/// How much of the outlines' edges need not be covered where drawings disagree, nodes: no
/// smooth body reaches into all corners that they leave.
const LOOSE_EDGE: f32 = 2.0;

/// Averages the field over neighbours within and across slices, but beside
/// creases, and fills narrow tunnels; silhouettes keep something behind them.
///
/// The planes of `field` take the windows of `hulls`.
///
/// * `apart`: how far drawings are from agreeing, 0 to 1.
pub(super) fn smooth(field: &mut Field, hulls: &[Plane], directions: &[Outline], apart: f32) {
    use rayon::prelude::*;
    let lattice = field.lattice;
    let edge = (LOOSE_EDGE * apart).round() as usize;
    for _ in 0..ROUNDS {
        coverage::lift(&mut field.planes, hulls, &lattice, directions, edge);
        field.planes = averaged(&field.planes, &lattice);
    }
    for _ in 0..LIFTS {
        coverage::lift(&mut field.planes, hulls, &lattice, directions, edge);
    }
    tunnels::fill(field, hulls);
    field.planes.par_iter_mut().zip(hulls).for_each(|(plane, hull)| {
        coverage::restore(plane, hull, &lattice, directions, edge);
    });
}

fn averaged(planes: &[Plane], lattice: &Lattice) -> Vec<Plane> {
    use rayon::prelude::*;
    let mut averaged = blurred(planes, -lattice.truncation_px() as f32);
    averaged.par_iter_mut().zip(planes).for_each(|(out, own)| {
        for crease in &own.creases {
            keep_near(out, own, lattice, crease);
        }
    });
    averaged
}

/// Averages over neighbours along all axes with binomial weights; `outside` beyond the windows of
/// slices below and above.
pub(super) fn blurred(planes: &[Plane], outside: f32) -> Vec<Plane> {
    use rayon::prelude::*;
    let within: Vec<Plane> = planes.par_iter().map(within_slice).collect();
    let last = planes.len().saturating_sub(1);
    let of_slice = |k: usize| {
        let (below, above) = (&within[k.saturating_sub(1)], &within[(k + 1).min(last)]);
        let mut out = within[k].clone();
        let (columns, [first, first_row]) = (out.size[0], out.first);
        let (mut low, mut high) = (vec![0.0; columns], vec![0.0; columns]);
        for (j, row) in out.values.chunks_exact_mut(columns.max(1)).enumerate() {
            below.copy_row(first, first_row + j, outside, &mut low);
            above.copy_row(first, first_row + j, outside, &mut high);
            for ((value, low), high) in row.iter_mut().zip(&low).zip(&high) {
                *value = binomial(*low, *value, *high);
            }
        }
        out
    };
    (0..planes.len()).into_par_iter().map(of_slice).collect()
}

/// Averages over neighbours along X and Y with binomial weights.
pub(super) fn within_slice(plane: &Plane) -> Plane {
    let columns = plane.size[0].max(1);
    let mut along = plane.clone();
    for (out, row) in along.values.chunks_exact_mut(columns).zip(plane.values.chunks_exact(columns))
    {
        for (value, near) in out.iter_mut().skip(1).zip(row.windows(3)) {
            *value = binomial(near[0], near[1], near[2]);
        }
        if let [first, second, ..] = row {
            let [.., before, last] = row else { continue };
            out[0] = binomial(*first, *first, *second);
            out[columns - 1] = binomial(*before, *last, *last);
        }
    }
    let mut across = along.clone();
    let rows = along.values.len() / columns;
    for (j, out) in across.values.chunks_exact_mut(columns).enumerate() {
        let row = |j: usize| &along.values[j * columns..(j + 1) * columns];
        let (before, own, after) = (row(j.saturating_sub(1)), row(j), row((j + 1).min(rows - 1)));
        for (((out, before), own), after) in out.iter_mut().zip(before).zip(own).zip(after) {
            *out = binomial(*before, *own, *after);
        }
    }
    across
}

pub(super) fn binomial(before: f32, here: f32, after: f32) -> f32 {
    0.25 * before + 0.5 * here + 0.25 * after
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
