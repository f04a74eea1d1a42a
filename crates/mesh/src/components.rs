//! Separate pieces of a surface.

use super::connected;
use crate::Mesh;

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
    let links = mesh.triangles.iter().flat_map(|&[a, b, c]| [(a, b), (a, c)]);
    let (labels, count) = connected::components(mesh.positions.len(), links);
    let mut volumes = vec![0.0; count];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize].coords);
        volumes[labels[triangle[0] as usize] as usize] += a.dot(&b.cross(&c)) / 6.0;
    }
    let largest = volumes.iter().copied().fold(0.0, f64::max);
    let is_kept = |volume: f64| volume > 0.0 && volume >= min_share * largest;
    let kept: Vec<bool> = labels.iter().map(|&label| is_kept(volumes[label as usize])).collect();
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
