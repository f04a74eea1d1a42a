//! Edges split until they are short.

use std::collections::HashMap;

use mesh::Mesh;

/// However long edges are, they are not halved more often.
const MAX_HALVINGS: usize = 12;

/// The same surface with edges of at most `longest`.
pub(crate) fn refined(mesh: &Mesh, longest: f64) -> Mesh {
    let mut mesh = mesh.clone();
    for _ in 0..MAX_HALVINGS {
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        let mut triangles = Vec::with_capacity(mesh.triangles.len() * 2);
        for index in 0..mesh.triangles.len() {
            let corners = mesh.triangles[index];
            let middle = [0, 1, 2].map(|side| {
                let (a, b) = (corners[side], corners[(side + 1) % 3]);
                let [p, q] = [a, b].map(|vertex| mesh.positions[vertex as usize]);
                ((q - p).norm() > longest).then(|| {
                    *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                        mesh.positions.push(nalgebra::center(&p, &q));
                        (mesh.positions.len() - 1) as u32
                    })
                })
            });
            split(&mesh, corners, middle, &mut triangles);
        }
        if middles.is_empty() {
            break;
        }
        mesh.triangles = triangles;
    }
    mesh
}

/// The parts of a triangle some of whose sides have a middle; `middles[i]` is of the side that
/// leaves corner i.
fn split(mesh: &Mesh, corners: [u32; 3], middles: [Option<u32>; 3], parts: &mut Vec<[u32; 3]>) {
    let turned = |by: usize| {
        let at = |i: usize| (i + by) % 3;
        (
            [corners[at(0)], corners[at(1)], corners[at(2)]],
            [middles[at(0)], middles[at(1)], middles[at(2)]],
        )
    };
    let first_split = middles.iter().position(Option::is_some);
    let first_whole = middles.iter().position(Option::is_none);
    match (first_split, first_whole, middles.iter().flatten().count()) {
        (Some(split), _, 1) => {
            let ([a, b, c], [m, ..]) = turned(split);
            let m = m.unwrap_or(a);
            parts.extend([[a, m, c], [m, b, c]]);
        }
        (_, Some(whole), 2) => {
            // The whole side leaves a; the others' middles make a quad with it.
            let ([a, b, c], [_, m, n]) = turned(whole);
            let (m, n) = (m.unwrap_or(b), n.unwrap_or(c));
            parts.push([m, c, n]);
            let length = |p: u32, q: u32| {
                (mesh.positions[p as usize] - mesh.positions[q as usize]).norm_squared()
            };
            if length(a, m) < length(b, n) {
                parts.extend([[a, b, m], [a, m, n]]);
            } else {
                parts.extend([[a, b, n], [b, m, n]]);
            }
        }
        (_, _, 3) => {
            let [a, b, c] = corners;
            let [m, n, o] = middles.map(|middle| middle.unwrap_or(a));
            parts.extend([[a, m, o], [m, b, n], [o, n, c], [m, n, o]]);
        }
        _ => parts.push(corners),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mesh::topology;
    use nalgebra::Point3;

    #[test]
    fn the_surface_stays_closed_and_edges_are_short() {
        let tetrahedron = Mesh {
            positions: vec![
                Point3::origin(),
                Point3::new(5.0, 0.0, 0.0),
                Point3::new(0.0, 2.0, 0.0),
                Point3::new(0.0, 0.0, 9.0),
            ],
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        };
        let fine = refined(&tetrahedron, 0.7);
        topology::check_manifold(&fine).unwrap();
        assert!((fine.signed_volume() - tetrahedron.signed_volume()).abs() < 1e-9);
        for triangle in 0..fine.triangles.len() {
            let [a, b, c] = fine.corners(triangle);
            assert!([b - a, c - b, a - c].iter().all(|side| side.norm() <= 0.7));
        }
    }
}
