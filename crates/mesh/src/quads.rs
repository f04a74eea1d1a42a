//! Triangles joined to quads, as modellers prefer them.

use std::collections::HashMap;

use super::shading::face_normal;
use crate::Mesh;

/// A face of three or four vertices, counter-clockwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Face {
    /// Indices of three vertices.
    Triangle([u32; 3]),
    /// Indices of four vertices.
    Quad([u32; 4]),
}

/// Triangles that turn more than this against each other stay apart, degrees.
const MAX_TURN_DEG: f64 = 25.0;
/// The cosine of a quad's corner that is too far from a right angle.
const MAX_CORNER_COSINE: f64 = 0.9;

/// Joins neighbouring triangles to quads, the squarest and flattest first.
pub fn quad_dominant(mesh: &Mesh) -> Vec<Face> {
    let mut owner: HashMap<(u32, u32), usize> = HashMap::with_capacity(mesh.triangles.len() * 3);
    for (index, &[a, b, c]) in mesh.triangles.iter().enumerate() {
        owner.extend([((a, b), index), ((b, c), index), ((c, a), index)]);
    }
    let mut candidates: Vec<(f64, usize, usize, [u32; 4])> = Vec::new();
    for (first, &[a, b, c]) in mesh.triangles.iter().enumerate() {
        for [p, q, r] in [[a, b, c], [b, c, a], [c, a, b]] {
            let Some(&second) = owner.get(&(q, p)).filter(|&&second| second > first) else {
                continue;
            };
            let apex = mesh.triangles[second].into_iter().find(|&v| v != p && v != q);
            let Some(apex) = apex.filter(|&apex| apex != r) else {
                continue;
            };
            let quad = [r, p, apex, q];
            let turn = face_normal(mesh, first).dot(&face_normal(mesh, second));
            let skew = skew(mesh, quad);
            if turn > MAX_TURN_DEG.to_radians().cos() && skew < MAX_CORNER_COSINE {
                candidates.push((skew + (1.0 - turn) * 4.0, first, second, quad));
            }
        }
    }
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut joined = vec![false; mesh.triangles.len()];
    let mut faces = Vec::new();
    for (_, first, second, quad) in candidates {
        if !joined[first] && !joined[second] {
            joined[first] = true;
            joined[second] = true;
            faces.push(Face::Quad(quad));
        }
    }
    let single = mesh.triangles.iter().zip(&joined).filter(|(_, joined)| !**joined);
    faces.extend(single.map(|(triangle, _)| Face::Triangle(*triangle)));
    faces
}

/// The largest cosine of a corner; 1 for a corner that bends inward.
fn skew(mesh: &Mesh, quad: [u32; 4]) -> f64 {
    let points = quad.map(|vertex| mesh.positions[vertex as usize]);
    let normal = (points[2] - points[0]).cross(&(points[3] - points[1]));
    (0..4)
        .map(|i| {
            let before = points[(i + 3) % 4] - points[i];
            let after = points[(i + 1) % 4] - points[i];
            let convex = after.cross(&before).dot(&normal) > 0.0;
            let cosine = before.dot(&after) / (before.norm() * after.norm()).max(1e-12);
            if convex { cosine.abs() } else { 1.0 }
        })
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    fn grid(bend: f64) -> Mesh {
        let positions = (0..6).map(|i| {
            let (x, y) = (f64::from(i % 3), f64::from(i / 3));
            Point3::new(x, y, if x > 1.5 { bend } else { 0.0 })
        });
        Mesh {
            positions: positions.collect(),
            triangles: vec![[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]],
        }
    }

    #[test]
    fn squares_become_quads() {
        let faces = quad_dominant(&grid(0.0));
        assert_eq!(faces.len(), 2);
        assert!(faces.iter().all(|face| matches!(face, Face::Quad(_))));
    }

    #[test]
    fn quads_keep_the_area_they_cover() {
        let mesh = grid(0.2);
        let area = |corners: &[u32]| {
            let p = |i: usize| mesh.positions[corners[i] as usize];
            (1..corners.len() - 1)
                .map(|i| (p(i) - p(0)).cross(&(p(i + 1) - p(0))).z / 2.0)
                .sum::<f64>()
        };
        let covered: f64 = quad_dominant(&mesh)
            .iter()
            .map(|face| match face {
                Face::Triangle(corners) => area(corners),
                Face::Quad(corners) => area(corners),
            })
            .sum();
        assert!((covered - 2.0).abs() < 1e-12);
    }
}
