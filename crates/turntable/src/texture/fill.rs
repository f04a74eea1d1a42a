//! Colours of what no drawing sees.

use mesh::Mesh;
use mesh::shading::face_normal;
use nalgebra::Vector3;

use super::blend::{ColourOf, LinearColour};

/// Rounds in which filled colours settle between those around them.
const ROUNDS: usize = 24;
/// Where nothing at all is coloured: paper.
const PAPER: f32 = 1.0;

/// One colour a vertex: its own where it is known, or else that of the nearest known ones along
/// the surface, evened out.
pub(super) fn vertex_colours(mesh: &Mesh, colour: &ColourOf<'_>) -> Vec<LinearColour> {
    use rayon::prelude::*;
    let normals = vertex_normals(mesh);
    let known: Vec<Option<LinearColour>> =
        mesh.positions.par_iter().zip(&normals).map(|(p, n)| colour(p, n)).collect();
    filled(&known, &links(mesh))
}

fn vertex_normals(mesh: &Mesh) -> Vec<Vector3<f64>> {
    let mut normals = vec![Vector3::zeros(); mesh.positions.len()];
    for (face, corners) in mesh.triangles.iter().enumerate() {
        let normal = face_normal(mesh, face);
        corners.iter().for_each(|&corner| normals[corner as usize] += normal);
    }
    normals.into_iter().map(|n| n.try_normalize(1e-9).unwrap_or_default()).collect()
}

/// The vertices around each, ascending.
fn links(mesh: &Mesh) -> Vec<Vec<u32>> {
    let mut links = vec![Vec::new(); mesh.positions.len()];
    for &[a, b, c] in &mesh.triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            links[from as usize].push(to);
            links[to as usize].push(from);
        }
    }
    for around in &mut links {
        around.sort_unstable();
        around.dedup();
    }
    links
}

fn filled(known: &[Option<LinearColour>], links: &[Vec<u32>]) -> Vec<LinearColour> {
    let mut colours = known.to_vec();
    // Layer by layer, each vertex the mean of those of layers before.
    let mut front: Vec<usize> = (0..known.len()).filter(|&v| known[v].is_some()).collect();
    while !front.is_empty() {
        let mut reached: Vec<usize> = front
            .iter()
            .flat_map(|&vertex| &links[vertex])
            .map(|&vertex| vertex as usize)
            .filter(|&vertex| colours[vertex].is_none())
            .collect();
        reached.sort_unstable();
        reached.dedup();
        let found: Vec<_> = reached.iter().map(|&v| mean_around(v, links, &colours)).collect();
        reached.iter().zip(found).for_each(|(&vertex, colour)| colours[vertex] = colour);
        front = reached;
    }
    let unknown: Vec<usize> =
        (0..known.len()).filter(|&v| known[v].is_none() && colours[v].is_some()).collect();
    for _ in 0..ROUNDS {
        let found: Vec<_> = unknown.iter().map(|&v| mean_around(v, links, &colours)).collect();
        unknown.iter().zip(found).for_each(|(&vertex, colour)| colours[vertex] = colour);
    }
    let coloured: Vec<LinearColour> = known.iter().flatten().copied().collect();
    let mean = match coloured.len() {
        0 => LinearColour::repeat(PAPER),
        count => coloured.iter().sum::<LinearColour>() / count as f32,
    };
    // Pieces that no drawing sees at all.
    colours.into_iter().map(|colour| colour.unwrap_or(mean)).collect()
}

fn mean_around(
    vertex: usize,
    links: &[Vec<u32>],
    colours: &[Option<LinearColour>],
) -> Option<LinearColour> {
    let known = links[vertex].iter().filter_map(|&other| colours[other as usize]);
    let (sum, count) =
        known.fold((LinearColour::zeros(), 0.0), |(sum, n), colour| (sum + colour, n + 1.0));
    (count > 0.0).then(|| sum / count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_spread_along_links_and_known_ones_stay() {
        // A chain of five with known ends, and a vertex by itself.
        let links = vec![vec![1], vec![0, 2], vec![1, 3], vec![2, 4], vec![3], vec![]];
        let (red, blue) = (LinearColour::x(), LinearColour::z());
        let known = [Some(red), None, None, None, Some(blue), None];
        let found = filled(&known, &links);
        assert_eq!((found[0], found[4]), (red, blue));
        for (vertex, share) in [(1, 0.75), (2, 0.5), (3, 0.25)] {
            assert!((found[vertex].x - share).abs() < 0.02, "{vertex}: {}", found[vertex]);
        }
        assert_eq!(found[5], LinearColour::new(0.5, 0.0, 0.5));
        assert_eq!(filled(&[None], &[vec![]]), [LinearColour::repeat(1.0)]);
    }
}
