//! A smooth field of crosses: at each vertex four directions at right angles, one of them stored.

use nalgebra::Vector3;

use super::vertices::Level;

/// Rounds of averaging a level.
const ROUNDS: usize = 6;
/// How much of its direction a crease's vertex keeps.
const CREASE_WEIGHT: f64 = 0.95;

/// Fills the levels' `axes`: those of the coarsest level start out level and upright.
///
/// `None` if `stopped` says so.
pub(crate) fn smooth(levels: &mut [Level], stopped: &dyn Fn() -> bool) -> Option<()> {
    for index in (0..levels.len()).rev() {
        let (finer, coarser) = levels.split_at_mut(index + 1);
        let level = &mut finer[index];
        level.axes = (0..level.points.len())
            .map(|vertex| {
                let start = match coarser.first() {
                    Some(coarser) => coarser.axes[level.parents[vertex] as usize],
                    None => Vector3::z(),
                };
                tangent(&start, &level.normals[vertex])
            })
            .collect();
        for _ in 0..ROUNDS {
            if stopped() {
                return None;
            }
            for vertex in 0..level.points.len() {
                level.axes[vertex] = averaged(level, vertex);
            }
        }
    }
    Some(())
}

fn averaged(level: &Level, vertex: usize) -> Vector3<f64> {
    let normal = level.normals[vertex];
    let mut sum = level.axes[vertex];
    let mut total = 0.0;
    for &(other, weight) in level.around(vertex) {
        let other = other as usize;
        let (own, theirs) = matching(&sum, &normal, &level.axes[other], &level.normals[other]);
        let mean = own * total + theirs * weight;
        sum = tangent(&mean, &normal);
        total += weight;
    }
    if let Some(crease) = level.creases[vertex] {
        let (own, along) = matching(&sum, &normal, &crease, &normal);
        sum = tangent(&(own * (1.0 - CREASE_WEIGHT) + along * CREASE_WEIGHT), &normal);
    }
    sum
}

/// The unit vector at a right angle to `normal` that is nearest to `direction`.
pub(crate) fn tangent(direction: &Vector3<f64>, normal: &Vector3<f64>) -> Vector3<f64> {
    let flat = direction - normal * normal.dot(direction);
    flat.try_normalize(1e-6).unwrap_or_else(|| {
        let other = Vector3::ith(normal.iamin(), 1.0);
        (other - normal * normal.dot(&other)).normalize()
    })
}

/// The directions of two crosses that agree best, of either one.
pub(crate) fn matching(
    axis: &Vector3<f64>,
    normal: &Vector3<f64>,
    other: &Vector3<f64>,
    other_normal: &Vector3<f64>,
) -> (Vector3<f64>, Vector3<f64>) {
    let own = [*axis, normal.cross(axis)];
    let theirs = [*other, other_normal.cross(other)];
    let (mut best, mut score) = ((own[0], theirs[0]), -1.0);
    for a in own {
        for b in theirs {
            let cosine = a.dot(&b);
            if cosine.abs() > score {
                score = cosine.abs();
                best = (a, if cosine < 0.0 { -b } else { b });
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crosses_match_by_quarter_turns() {
        let normal = Vector3::z();
        let turned = Vector3::new(-0.2, 0.98, 0.0).normalize();
        let (a, b) = matching(&Vector3::x(), &normal, &turned, &normal);
        assert!(a.dot(&b) > 0.97);
    }
}
