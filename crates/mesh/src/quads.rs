//! Triangles joined to quads.

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

impl Face {
    /// The indices of its vertices.
    pub fn corners(&self) -> &[u32] {
        match self {
            Self::Triangle(corners) => corners,
            Self::Quad(corners) => corners,
        }
    }
}

/// Which triangles may be joined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JoinLimits {
    /// How much they may turn against each other, degrees.
    pub max_turn_deg: f64,
    /// The largest cosine of a quad's corner: how far it may be from a right angle.
    pub max_corner_cosine: f64,
}

/// Triangles that could be one quad.
struct Pair {
    triangles: [usize; 2],
    corners: [u32; 4],
}

/// Joins neighbouring triangles to quads, the squarest and flattest first; then pairs change
/// partners along paths of three where that joins two triangles more.
pub fn joined(mesh: &Mesh, limits: &JoinLimits) -> Vec<Face> {
    let pairs = pairs(mesh, limits);
    let mut of_triangle = vec![Vec::new(); mesh.triangles.len()];
    for (index, pair) in pairs.iter().enumerate() {
        pair.triangles.iter().for_each(|&triangle| of_triangle[triangle].push(index));
    }
    let mut matched: Vec<Option<usize>> = vec![None; mesh.triangles.len()];
    for (index, pair) in pairs.iter().enumerate() {
        if pair.triangles.iter().all(|&triangle| matched[triangle].is_none()) {
            pair.triangles.iter().for_each(|&triangle| matched[triangle] = Some(index));
        }
    }
    let other = |pair: usize, triangle: usize| {
        let [a, b] = pairs[pair].triangles;
        if a == triangle { b } else { a }
    };
    for first in 0..mesh.triangles.len() {
        if matched[first].is_some() {
            continue;
        }
        // first - second = third - last, where the middle ones are a pair and the ends are free.
        let path = of_triangle[first].iter().find_map(|&leading| {
            let second = other(leading, first);
            let third = other(matched[second]?, second);
            let free = |&&pair: &&usize| {
                let last = other(pair, third);
                last != first && matched[last].is_none()
            };
            of_triangle[third].iter().find(free).map(|&trailing| (leading, trailing))
        });
        if let Some((leading, trailing)) = path {
            for pair in [leading, trailing] {
                pairs[pair].triangles.iter().for_each(|&triangle| matched[triangle] = Some(pair));
            }
        }
    }
    let mut faces = Vec::with_capacity(mesh.triangles.len() / 2);
    for (triangle, (pair, corners)) in matched.iter().zip(&mesh.triangles).enumerate() {
        match pair.map(|pair| &pairs[pair]) {
            None => faces.push(Face::Triangle(*corners)),
            Some(pair) if pair.triangles[0] == triangle => faces.push(Face::Quad(pair.corners)),
            Some(_) => {}
        }
    }
    faces
}

/// The squarest and flattest first.
fn pairs(mesh: &Mesh, limits: &JoinLimits) -> Vec<Pair> {
    let mut owner: HashMap<(u32, u32), usize> = HashMap::with_capacity(mesh.triangles.len() * 3);
    for (index, &[a, b, c]) in mesh.triangles.iter().enumerate() {
        owner.extend([((a, b), index), ((b, c), index), ((c, a), index)]);
    }
    let mut found: Vec<(f64, Pair)> = Vec::new();
    for (first, &[a, b, c]) in mesh.triangles.iter().enumerate() {
        for [p, q, r] in [[a, b, c], [b, c, a], [c, a, b]] {
            let Some(&second) = owner.get(&(q, p)).filter(|&&second| second > first) else {
                continue;
            };
            let apex = mesh.triangles[second].into_iter().find(|&v| v != p && v != q);
            let Some(apex) = apex.filter(|&apex| apex != r) else {
                continue;
            };
            let corners = [r, p, apex, q];
            let turn = face_normal(mesh, first).dot(&face_normal(mesh, second));
            let skew = skew(mesh, corners);
            if turn > limits.max_turn_deg.to_radians().cos() && skew < limits.max_corner_cosine {
                found.push((
                    skew + (1.0 - turn) * 4.0,
                    Pair { triangles: [first, second], corners },
                ));
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.triangles.cmp(&b.1.triangles)));
    found.into_iter().map(|(_, pair)| pair).collect()
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

    const FLAT_AND_SQUARE: JoinLimits = JoinLimits { max_turn_deg: 25.0, max_corner_cosine: 0.9 };

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
        let faces = joined(&grid(0.0), &FLAT_AND_SQUARE);
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
        let faces = joined(&mesh, &FLAT_AND_SQUARE);
        let covered: f64 = faces.iter().map(|face| area(face.corners())).sum();
        assert!((covered - 2.0).abs() < 1e-12);
    }
}
