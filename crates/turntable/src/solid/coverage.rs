//! Silhouettes keep something behind them: lines of sight that meet the hull and
//! no longer the solid get back what is most likely there.

use std::ops::Range;

use nalgebra::Point2;

use super::outline::Outline;
use super::smoothing::blurred;
use crate::surface::field::{Lattice, Plane};

/// How far inside the best node of a covered line of sight is, share of the pitch.
pub(super) const DEPTH: f32 = 0.3;
/// How often what is lifted is averaged over neighbours.
const SPREAD: usize = 4;

/// An edge may be left beside a body so many times as broad: thin limbs are all edge.
const BODY: usize = 6;

/// The lines of sight through a slice, one a node's width.
struct Sights {
    /// Index in the window and place of each node inside the hull.
    inside: Vec<(usize, Point2<f64>)>,
    half_px: f64,
    pitch_px: f64,
    count: usize,
}

impl Sights {
    fn new(hull: &Plane, lattice: &Lattice) -> Self {
        let inside = |index: usize| {
            let (i, j) = hull.node(index);
            (index, Point2::new(lattice.x(i), lattice.y(j)))
        };
        let half_px = lattice.origin.x.abs() + lattice.origin.y.abs() + lattice.pitch_px;
        Self {
            inside: (0..hull.values.len())
                .filter(|&index| hull.values[index] > 0.0)
                .map(inside)
                .collect(),
            half_px,
            pitch_px: lattice.pitch_px,
            count: (2.0 * half_px / lattice.pitch_px).ceil() as usize + 1,
        }
    }

    /// Which line of sight of the view a point lies on.
    fn of(&self, point: &Point2<f64>, view: &Outline) -> usize {
        (((view.column(point) + self.half_px) / self.pitch_px) as usize).min(self.count - 1)
    }

    /// The deepest value on each line of sight, and where it is.
    fn deepest(&self, values: &[f32], view: &Outline) -> Vec<(f32, Option<usize>)> {
        let mut deepest = vec![(f32::NEG_INFINITY, None); self.count];
        for (index, point) in &self.inside {
            let deepest = &mut deepest[self.of(point, view)];
            if values[*index] > deepest.0 {
                *deepest = (values[*index], Some(*index));
            }
        }
        deepest
    }
}

/// Lifts whole lines of sight until their deepest nodes are inside.
///
/// `plane` takes the window of `hull`, and stays within it.
///
/// * `edge`: so many uncovered lines of sight beside covered ones are left, nodes.
pub(super) fn restore(
    plane: &mut Plane,
    hull: &Plane,
    lattice: &Lattice,
    directions: &[Outline],
    edge: usize,
) {
    let sights = Sights::new(hull, lattice);
    let depth = DEPTH * lattice.pitch_px as f32;
    for view in directions {
        let deepest = sights.deepest(&plane.values, view);
        let mut lifts = vec![false; deepest.len()];
        uncovered(&deepest, depth, edge).for_each(|run| lifts[run].fill(true));
        for (index, point) in &sights.inside {
            let sight = sights.of(point, view);
            if lifts[sight] {
                let (deepest, _) = deepest[sight];
                let lifted = plane.values[*index] + depth - deepest;
                plane.values[*index] = lifted.min(hull.values[*index]);
            }
        }
    }
}

/// Lifts the surroundings of the deepest nodes of uncovered lines of sight, in
/// this slice and its neighbours: the surface swells instead of growing fins.
///
/// `planes` take the windows of `hulls`, and stay within them.
///
/// * `edge`: so many uncovered lines of sight beside covered ones are left, nodes.
pub(super) fn lift(
    planes: &mut [Plane],
    hulls: &[Plane],
    lattice: &Lattice,
    directions: &[Outline],
    edge: usize,
) {
    use rayon::prelude::*;
    let missing: Vec<(Plane, Plane)> = planes
        .par_iter()
        .zip(hulls)
        .map(|(plane, hull)| missing(plane, hull, lattice, directions, edge))
        .collect();
    let (mut lifts, mut marks): (Vec<Plane>, Vec<Plane>) = missing.into_iter().unzip();
    for _ in 0..SPREAD {
        lifts = blurred(&lifts, 0.0);
        marks = blurred(&marks, 0.0);
    }
    // Each round's variance is half a node: what is left in the middle of a line.
    let gain = std::f32::consts::PI * SPREAD as f32;
    let of_slice = |((plane, hull), (lift, mark)): ((&mut Plane, &Plane), (&Plane, &Plane))| {
        let lifted = plane.values.iter_mut().zip(&hull.values);
        for ((value, bound), (lift, mark)) in lifted.zip(lift.values.iter().zip(&mark.values)) {
            if *mark > f32::EPSILON && *bound > 0.0 {
                *value = (*value + lift / mark * (mark * gain).min(1.0)).min(*bound);
            }
        }
    };
    planes.par_iter_mut().zip(hulls).zip(lifts.par_iter().zip(&marks)).for_each(of_slice);
}

/// How much the deepest nodes of uncovered lines of sight lack, px, and where
/// they are: 1.
fn missing(
    plane: &Plane,
    hull: &Plane,
    lattice: &Lattice,
    directions: &[Outline],
    edge: usize,
) -> (Plane, Plane) {
    let sights = Sights::new(hull, lattice);
    let depth = DEPTH * lattice.pitch_px as f32;
    let nothing = Plane {
        first: hull.first,
        size: hull.size,
        values: vec![0.0; hull.values.len()],
        creases: Vec::new(),
    };
    let (mut lacks, mut marks) = (nothing.clone(), nothing);
    for view in directions {
        let deepest = sights.deepest(&plane.values, view);
        for run in uncovered(&deepest, depth, edge) {
            for (value, index) in &deepest[run] {
                let Some(index) = *index else { continue };
                lacks.values[index] = lacks.values[index].max(depth - value);
                marks.values[index] = 1.0;
            }
        }
    }
    (lacks, marks)
}

/// Runs of lines of sight that are less than `depth` inside, but for those of at
/// most `edge` beside many more that are covered.
fn uncovered(
    deepest: &[(f32, Option<usize>)],
    depth: f32,
    edge: usize,
) -> impl Iterator<Item = Range<usize>> {
    let state = |(value, index): &(f32, Option<usize>)| index.map(|_| *value < depth);
    let mut runs: Vec<(Range<usize>, Option<bool>)> = Vec::new();
    for run in deepest.chunk_by(|a, b| state(a) == state(b)) {
        let from = runs.last().map_or(0, |(before, _)| before.end);
        runs.push((from..from + run.len(), run.first().and_then(state)));
    }
    let covered = |at: Option<usize>| {
        let run = at.and_then(|at| runs.get(at));
        run.filter(|(_, lacks)| *lacks == Some(false)).map_or(0, |(run, _)| run.len())
    };
    let is_left = |k: usize, run: &Range<usize>| {
        let beside = covered(k.checked_sub(1)).max(covered(Some(k + 1)));
        run.len() <= edge && beside >= BODY * run.len()
    };
    let counted = runs.iter().enumerate();
    let found: Vec<_> = counted
        .filter(|(k, (run, lacks))| *lacks == Some(true) && !is_left(*k, run))
        .map(|(_, (run, _))| run.clone())
        .collect();
    found.into_iter()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    const SIZE: usize = 21;

    fn lattice() -> Lattice {
        Lattice { origin: Point3::new(-10.0, -10.0, 0.0), pitch_px: 1.0, nodes: [SIZE; 3] }
    }

    fn plane(value: impl Fn(f64, f64) -> f64) -> Plane {
        let lattice = lattice();
        let values = (0..SIZE * SIZE)
            .map(|index| value(lattice.x(index % SIZE), lattice.y(index / SIZE)) as f32);
        Plane { first: [0, 0], size: [SIZE; 2], values: values.collect(), creases: Vec::new() }
    }

    fn views() -> Vec<Outline> {
        [0.0, std::f64::consts::FRAC_PI_2]
            .map(|azimuth_rad| Outline { azimuth_rad, rows: Vec::new() })
            .to_vec()
    }

    fn covered(plane: &Plane, hull: &Plane) -> bool {
        let sights = Sights::new(hull, &lattice());
        views().iter().all(|view| {
            let met = sights.deepest(&hull.values, view);
            let own = sights.deepest(&plane.values, view);
            met.iter().zip(own).all(|(met, own)| met.1.is_none() || own.0 > 0.0)
        })
    }

    #[test]
    fn every_line_of_sight_through_the_hull_is_covered_again() {
        let hull = plane(|x, y| 8.0 - x.abs().max(y.abs()));
        let mut shrunk = plane(|x, y| 5.0 - x.hypot(y));
        assert!(!covered(&shrunk, &hull));
        restore(&mut shrunk, &hull, &lattice(), &views(), 0);
        assert!(covered(&shrunk, &hull));
        assert!(shrunk.values.iter().zip(&hull.values).all(|(value, bound)| value <= bound));
    }

    #[test]
    fn narrow_edges_beside_what_is_covered_may_be_left() {
        let sight = |value: f32| (value, Some(0));
        let body = [sight(2.0); BODY];
        let line = [&[(-1.0, None), sight(-1.0)], &body[..], &[sight(-1.0); 3]].concat();
        let runs = |line: &[(f32, Option<usize>)], edge: usize| {
            let runs = uncovered(line, 0.3, edge);
            runs.map(|run| (run.start, run.end)).collect::<Vec<_>>()
        };
        assert_eq!(runs(&line, 0), [(1, 2), (8, 11)]);
        assert_eq!(runs(&line, 2), [(8, 11)]);
        // Three are many beside six, and what stands alone is no edge.
        assert_eq!(runs(&line, 3), [(8, 11)]);
        assert_eq!(runs(&[(-1.0, None), sight(-1.0), (-1.0, None)], 2), [(1, 2)]);
    }

    #[test]
    fn what_is_lifted_is_smooth_and_within_the_hull() {
        let hulls = vec![plane(|x, y| 8.0 - x.abs().max(y.abs())); SIZE];
        let mut planes = vec![plane(|x, y| 6.0 - x.hypot(y)); SIZE];
        let before = planes.clone();
        lift(&mut planes, &hulls, &lattice(), &views(), 0);
        let step = |planes: &[Plane], k: usize| {
            let rows = planes[k].values.chunks_exact(SIZE);
            let steps = rows.flat_map(|row| row.windows(2).map(|pair| (pair[0] - pair[1]).abs()));
            steps.fold(0.0_f32, f32::max)
        };
        let middle = SIZE / 2;
        let rises = |index: usize| planes[middle].values[index] - before[middle].values[index];
        assert!((0..SIZE * SIZE).all(|index| rises(index) >= 0.0));
        assert!((0..SIZE * SIZE).any(|index| rises(index) > 0.5));
        let mut restored = before.clone();
        restore(&mut restored[middle], &hulls[middle], &lattice(), &views(), 0);
        assert!(step(&planes, middle) < 0.8 * step(&restored, middle));
        let within = |(plane, hull): (&Plane, &Plane)| {
            plane.values.iter().zip(&hull.values).all(|(value, bound)| value <= bound)
        };
        assert!(planes.iter().zip(&hulls).all(within));
        // Slices are alike, and stay so away from the ends.
        assert_eq!(planes[middle].values, planes[middle + 1].values);
    }
}
