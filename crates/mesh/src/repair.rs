//! Pulls apart what decimation has let touch.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

use super::topology::HalfEdges;
use crate::Mesh;

/// Surfaces that touch are moved this far apart, px.
const NUDGE_PX: f64 = 0.02;

/// Separates parts of a closed mesh that touch in edges or vertices.
///
/// An edge of more than two triangles is split at its middle, once for each
/// pair of triangles that bound one wedge of the solid; a vertex of several
/// fans becomes one vertex a fan. The copies are moved into their own
/// material, so that they stay apart when vertices are merged by position.
/// Orientations must be consistent; pairs of triangles that cancel are dropped.
pub fn without_touching(mesh: &Mesh) -> Mesh {
    let mut mesh = mesh.clone();
    drop_cancelling(&mut mesh.triangles);
    split_edges(&mut mesh);
    split_vertices(&mut mesh);
    mesh
}

/// Drops pairs of triangles with the same corners and opposite directions.
fn drop_cancelling(triangles: &mut Vec<[u32; 3]>) {
    let rotated = |[a, b, c]: [u32; 3]| {
        let smallest = a.min(b).min(c);
        if smallest == a {
            [a, b, c]
        } else if smallest == b {
            [b, c, a]
        } else {
            [c, a, b]
        }
    };
    let mut seen: HashMap<[u32; 3], usize> = HashMap::with_capacity(triangles.len());
    let mut dropped = vec![false; triangles.len()];
    for (index, &triangle) in triangles.iter().enumerate() {
        let [a, b, c] = rotated(triangle);
        match seen.remove(&[a, c, b]) {
            Some(other) => {
                dropped[other] = true;
                dropped[index] = true;
            }
            None => {
                seen.insert([a, b, c], index);
            }
        }
    }
    let mut index = 0;
    triangles.retain(|_| {
        index += 1;
        !dropped[index - 1]
    });
}

/// A triangle at an edge: its third corner and whether it runs the edge forward.
#[derive(Clone, Copy)]
struct Wing {
    triangle: usize,
    forward: bool,
    angle_rad: f64,
}

fn split_edges(mesh: &mut Mesh) {
    let edges = HalfEdges::new(mesh.positions.len(), &mesh.triangles);
    let mut crowded: Vec<(u32, u32)> = Vec::new();
    for from in 0..mesh.positions.len() as u32 {
        let own = edges.from(from);
        // Of three triangles at an edge two run it in one direction.
        for (index, edge) in own.iter().enumerate() {
            if own[..index].iter().any(|other| other.to == edge.to) {
                crowded.push((from.min(edge.to), from.max(edge.to)));
            }
        }
    }
    crowded.sort_unstable();
    crowded.dedup();
    for (from, to) in crowded {
        // Triangles are split as edges are: look again.
        let around = wings_around(mesh, from, to);
        for [first, second] in wedge_pairs(around) {
            let middle = mesh.positions.len() as u32;
            let inward =
                [first, second].map(|wing| direction_from_edge(mesh, wing.triangle, from, to));
            let ends = [from, to].map(|vertex| mesh.positions[vertex as usize]);
            let centre = nalgebra::center(&ends[0], &ends[1]);
            mesh.positions.push(centre + (inward[0] + inward[1]) * (NUDGE_PX / 2.0));
            for wing in [first, second] {
                split_triangle(mesh, wing.triangle, (from, to), middle);
            }
        }
    }
}

fn third_corner(triangle: [u32; 3], from: u32, to: u32) -> u32 {
    triangle.into_iter().find(|&corner| corner != from && corner != to).unwrap_or(from)
}

/// The unit direction from the edge into the triangle, perpendicular to the edge.
fn direction_from_edge(mesh: &Mesh, triangle: usize, from: u32, to: u32) -> Vector3<f64> {
    let third = third_corner(mesh.triangles[triangle], from, to);
    let [a, b, c] = [from, to, third].map(|vertex| mesh.positions[vertex as usize]);
    let along = (b - a).try_normalize(1e-12).unwrap_or_else(Vector3::zeros);
    let across = (c - a) - along * (c - a).dot(&along);
    across.try_normalize(1e-12).unwrap_or_else(Vector3::zeros)
}

fn wings_around(mesh: &Mesh, from: u32, to: u32) -> Vec<Wing> {
    let ends = [from, to].map(|vertex| mesh.positions[vertex as usize]);
    let along = (ends[1] - ends[0]).try_normalize(1e-12).unwrap_or_else(Vector3::x);
    let u = along.cross(&perpendicular_seed(&along)).normalize();
    let v = along.cross(&u);
    let mut wings: Vec<Wing> = (0..mesh.triangles.len())
        .filter_map(|triangle| {
            let [a, b, c] = mesh.triangles[triangle];
            let runs = |p, q| [(a, b), (b, c), (c, a)].contains(&(p, q));
            let forward = runs(from, to);
            (forward || runs(to, from)).then(|| {
                let direction = direction_from_edge(mesh, triangle, from, to);
                let angle_rad = direction.dot(&v).atan2(direction.dot(&u));
                Wing { triangle, forward, angle_rad }
            })
        })
        .collect();
    wings.sort_by(|a, b| a.angle_rad.total_cmp(&b.angle_rad));
    wings
}

fn perpendicular_seed(along: &Vector3<f64>) -> Vector3<f64> {
    if along.x.abs() < 0.8 { Vector3::x() } else { Vector3::y() }
}

/// Pairs every forward wing with the nearest backward one at a lower angle:
/// the solid lies between them, since normals point to growing angles on
/// forward wings and to falling ones on backward wings.
fn wedge_pairs(mut wings: Vec<Wing>) -> Vec<[Wing; 2]> {
    let mut pairs = Vec::new();
    while wings.len() > 1 {
        let count = wings.len();
        let adjacent = (0..count).find(|&i| !wings[i].forward && wings[(i + 1) % count].forward);
        let Some(backward) = adjacent else { break };
        let forward = (backward + 1) % count;
        pairs.push([wings[backward], wings[forward]]);
        wings.remove(backward.max(forward));
        wings.remove(backward.min(forward));
    }
    pairs
}

fn split_triangle(mesh: &mut Mesh, triangle: usize, (from, to): (u32, u32), middle: u32) {
    let corners = mesh.triangles[triangle];
    let replaced = |old: u32| corners.map(|corner| if corner == old { middle } else { corner });
    mesh.triangles[triangle] = replaced(to);
    mesh.triangles.push(replaced(from));
}

fn split_vertices(mesh: &mut Mesh) {
    let mut corners: Vec<Vec<(usize, usize)>> = vec![Vec::new(); mesh.positions.len()];
    for (triangle, vertices) in mesh.triangles.iter().enumerate() {
        for (corner, &vertex) in vertices.iter().enumerate() {
            corners[vertex as usize].push((triangle, corner));
        }
    }
    for (vertex, corners) in corners.iter().enumerate() {
        let fans = fans(&mesh.triangles, corners);
        if fans.len() < 2 {
            continue;
        }
        let position = mesh.positions[vertex];
        for (index, fan) in fans.iter().enumerate() {
            let moved = position + toward_fan(mesh, position, fan) * NUDGE_PX;
            if index == 0 {
                mesh.positions[vertex] = moved;
                continue;
            }
            mesh.positions.push(moved);
            let copy = mesh.positions.len() as u32 - 1;
            for &(triangle, corner) in fan {
                mesh.triangles[triangle][corner] = copy;
            }
        }
    }
}

/// Triangles around a vertex by fan, going from edge to edge.
fn fans(triangles: &[[u32; 3]], corners: &[(usize, usize)]) -> Vec<Vec<(usize, usize)>> {
    let next = |&(triangle, corner): &(usize, usize)| triangles[triangle][(corner + 1) % 3];
    let last = |&(triangle, corner): &(usize, usize)| triangles[triangle][(corner + 2) % 3];
    let mut left: Vec<(usize, usize)> = corners.to_vec();
    let mut fans = Vec::new();
    while let Some(start) = left.pop() {
        let mut fan = vec![start];
        let mut edge = last(&start);
        while let Some(index) = left.iter().position(|corner| next(corner) == edge) {
            let corner = left.swap_remove(index);
            edge = last(&corner);
            fan.push(corner);
        }
        fans.push(fan);
    }
    fans
}

fn toward_fan(mesh: &Mesh, position: Point3<f64>, fan: &[(usize, usize)]) -> Vector3<f64> {
    let sum: Vector3<f64> = fan
        .iter()
        .map(|&(triangle, corner)| {
            let next = mesh.triangles[triangle][(corner + 1) % 3];
            (mesh.positions[next as usize] - position).try_normalize(1e-12).unwrap_or_default()
        })
        .sum();
    sum.try_normalize(1e-12).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology::check_manifold;

    /// Two tetrahedra on the edge from vertex 0 to vertex 1.
    fn sharing_an_edge() -> Mesh {
        let outward = |[a, b, c, d]: [u32; 4]| [[a, c, b], [a, b, d], [b, c, d], [c, a, d]];
        let positions = [
            (0.0, 0.0, 0.0),
            (0.0, 0.0, 4.0),
            (3.0, -1.0, 2.0),
            (3.0, 1.0, 2.0),
            (-3.0, 1.0, 2.0),
            (-3.0, -1.0, 2.0),
        ];
        let mesh = Mesh {
            positions: positions.iter().map(|&(x, y, z)| Point3::new(x, y, z)).collect(),
            triangles: [outward([0, 2, 3, 1]), outward([0, 4, 5, 1])].concat(),
        };
        assert!(mesh.signed_volume() > 0.0);
        mesh
    }

    #[test]
    fn solids_that_share_an_edge_come_apart() {
        let mesh = sharing_an_edge();
        assert!(check_manifold(&mesh).is_err());
        let apart = without_touching(&mesh);
        assert_eq!(check_manifold(&apart), Ok(()));
        assert!((apart.signed_volume() - mesh.signed_volume()).abs() < 0.5);
        let mut positions: Vec<_> = apart.positions.iter().map(|p| [p.x, p.y, p.z]).collect();
        positions.sort_by(|a, b| a.partial_cmp(b).unwrap());
        positions.dedup();
        assert_eq!(positions.len(), apart.positions.len(), "copies stay apart");
    }

    #[test]
    fn triangles_that_cancel_are_dropped() {
        let mut mesh = sharing_an_edge();
        mesh.triangles.truncate(4);
        let closed = mesh.clone();
        mesh.triangles.extend([[0, 1, 3], [3, 1, 0]]);
        assert_eq!(without_touching(&mesh), closed);
    }
}
