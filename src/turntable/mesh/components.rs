//! Separate pieces of a surface.

use crate::geometry::Mesh;

/// What was dropped with small pieces.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Pieces {
    /// Closed surfaces that were kept.
    pub kept: usize,
    /// Pieces below the smallest volume, and hollows inside the solid.
    pub dropped: usize,
}

/// Drops the pieces whose volume is less than `min_share` of the largest one,
/// and inner surfaces around hollows.
pub fn without_floaters(mesh: &Mesh, min_share: f64) -> (Mesh, Pieces) {
    let mut parent: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    for triangle in &mesh.triangles {
        for corner in &triangle[1..] {
            join(&mut parent, triangle[0], *corner);
        }
    }
    let mut volumes = vec![0.0; mesh.positions.len()];
    for triangle in &mesh.triangles {
        let root = find(&mut parent, triangle[0]);
        let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize].coords);
        volumes[root as usize] += a.dot(&b.cross(&c)) / 6.0;
    }
    let largest = volumes.iter().copied().fold(0.0, f64::max);
    let is_kept = |volume: f64| volume > 0.0 && volume >= min_share * largest;
    let kept: Vec<bool> = (0..mesh.positions.len() as u32)
        .map(|vertex| is_kept(volumes[find(&mut parent, vertex) as usize]))
        .collect();
    let pieces = Pieces {
        kept: volumes.iter().filter(|&&volume| is_kept(volume)).count(),
        dropped: volumes.iter().filter(|&&volume| volume != 0.0 && !is_kept(volume)).count(),
    };
    (subset(mesh, &kept), pieces)
}

fn subset(mesh: &Mesh, kept: &[bool]) -> Mesh {
    let mut new_index = vec![u32::MAX; kept.len()];
    let mut positions = Vec::new();
    for (vertex, _) in kept.iter().enumerate().filter(|(_, kept)| **kept) {
        new_index[vertex] = positions.len() as u32;
        positions.push(mesh.positions[vertex]);
    }
    let triangles = mesh.triangles.iter().filter(|triangle| kept[triangle[0] as usize]);
    Mesh {
        positions,
        triangles: triangles
            .map(|triangle| triangle.map(|corner| new_index[corner as usize]))
            .collect(),
    }
}

fn find(parent: &mut [u32], vertex: u32) -> u32 {
    let mut root = vertex;
    while parent[root as usize] != root {
        parent[root as usize] = parent[parent[root as usize] as usize];
        root = parent[root as usize];
    }
    root
}

fn join(parent: &mut [u32], a: u32, b: u32) {
    let (a, b) = (find(parent, a), find(parent, b));
    parent[a.max(b) as usize] = a.min(b);
}
