//! Vertices evened out on the surface.

use nalgebra::{Point3, Vector3};

use super::collapse::Hold;
use super::faces::Faces;
use super::ground::Ground;

/// Rounds of moving each vertex towards the middle of its neighbours, and how far.
const ROUNDS: usize = 4;
const STEP: f64 = 0.5;
/// Rounds of moving vertices out, so that faces' middles lie on the surface as much as corners do.
const FITS: usize = 2;
/// Of the distance of the middles; two thirds keep what a round thing's section holds.
const FIT: f64 = 0.66;

/// Moves vertices along the surface and along its creases. `None` if `stopped` says so.
pub(crate) fn even_out(
    faces: &mut Faces,
    ground: &Ground<'_>,
    stopped: &dyn Fn() -> bool,
) -> Option<()> {
    let around = neighbours(faces);
    for round in 0..=ROUNDS {
        if stopped() {
            return None;
        }
        let before = faces.positions.clone();
        for (vertex, position) in faces.positions.iter_mut().enumerate() {
            let hold = faces.holds[vertex];
            if hold == Hold::Corner {
                continue;
            }
            // Along a crease only its own neighbours count.
            let near = around[vertex].iter().filter(|&&other| faces.holds[other as usize] >= hold);
            let (sum, count) = near.fold((Vector3::zeros(), 0.0), |(sum, count), &other| {
                (sum + before[other as usize].coords, count + 1.0)
            });
            let moves = round > 0 && count >= 2.0 && (hold == Hold::Surface || count == 2.0);
            let target = if moves {
                *position + (Point3::from(sum / count) - *position) * STEP
            } else {
                *position
            };
            *position = match hold {
                Hold::Surface => ground.nearest(&target),
                _ => ground.nearest_crease(&target).unwrap_or(target),
            };
        }
    }
    Some(())
}

/// Moves vertices off the surface so that faces lie on it in the mean. `None` if `stopped` says so.
pub(crate) fn fit(
    faces: &mut Faces,
    ground: &Ground<'_>,
    stopped: &dyn Fn() -> bool,
) -> Option<()> {
    for _ in 0..FITS {
        if stopped() {
            return None;
        }
        let mut offsets = vec![(Vector3::zeros(), 0.0); faces.positions.len()];
        for corners in &faces.corners {
            let sum: Vector3<f64> =
                corners.iter().map(|&corner| faces.positions[corner as usize].coords).sum();
            let middle = Point3::from(sum / corners.len() as f64);
            let off = ground.nearest(&middle) - middle;
            for &corner in corners {
                offsets[corner as usize].0 += off;
                offsets[corner as usize].1 += 1.0;
            }
        }
        for ((position, (sum, count)), hold) in
            faces.positions.iter_mut().zip(offsets).zip(&faces.holds)
        {
            if *hold == Hold::Surface && count > 0.0 {
                *position += sum / count * (FIT / FITS as f64);
            }
        }
    }
    Some(())
}

fn neighbours(faces: &Faces) -> Vec<Vec<u32>> {
    let mut around = vec![Vec::new(); faces.positions.len()];
    for corners in &faces.corners {
        for (index, &corner) in corners.iter().enumerate() {
            // The other way round comes from the face beyond the edge.
            around[corner as usize].push(corners[(index + 1) % corners.len()]);
        }
    }
    around
}
