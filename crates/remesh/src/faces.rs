//! Faces of any number of corners, and quads made of them.

use std::collections::{HashMap, HashSet};

use mesh::quads::Face;
use nalgebra::{Point3, Vector3};

use super::QuadMesh;
use super::collapse::Hold;
use super::ground::Ground;

/// A closed surface of polygons.
pub(crate) struct Faces {
    pub positions: Vec<Point3<f64>>,
    /// One a vertex.
    pub holds: Vec<Hold>,
    /// Of each face, counter-clockwise seen from outside.
    pub corners: Vec<Vec<u32>>,
}

/// The middle of an edge that is no farther from a crease lies on it, cells.
const ON_CREASE: f64 = 0.2;

impl Faces {
    pub(crate) fn new(positions: Vec<Point3<f64>>, holds: Vec<Hold>, faces: &[Face]) -> Self {
        let corners = faces.iter().map(|face| face.corners().to_vec()).collect();
        Self { positions, holds, corners }
    }

    /// Vertices of two faces go, those become one.
    pub(crate) fn without_doublets(mut self) -> Self {
        loop {
            let mut of_vertex = vec![Vec::new(); self.positions.len()];
            for (index, corners) in self.corners.iter().enumerate() {
                corners.iter().for_each(|&corner| of_vertex[corner as usize].push(index));
            }
            let mut changed = vec![false; self.corners.len()];
            let mut any = false;
            for (vertex, faces) in of_vertex.iter().enumerate() {
                let &[first, second] = faces.as_slice() else { continue };
                if changed[first] || changed[second] || self.holds[vertex] != Hold::Surface {
                    continue;
                }
                let after = |face: usize| {
                    let corners = &self.corners[face];
                    let at =
                        corners.iter().position(|&corner| corner as usize == vertex).unwrap_or(0);
                    (1..corners.len())
                        .map(|i| corners[(at + i) % corners.len()])
                        .collect::<Vec<_>>()
                };
                // From one shared neighbour to the other, and back.
                let (way, back) = (after(first), after(second));
                let inner = back.len().saturating_sub(1);
                let merged: Vec<u32> =
                    way.into_iter().chain(back.into_iter().take(inner).skip(1)).collect();
                let mut sorted = merged.clone();
                sorted.sort_unstable();
                sorted.dedup();
                if sorted.len() < merged.len() || merged.len() < 3 {
                    continue;
                }
                (changed[first], changed[second], any) = (true, true, true);
                self.corners[first] = merged;
                self.corners[second].clear();
            }
            self.corners.retain(|corners| !corners.is_empty());
            if !any {
                return self;
            }
        }
    }

    /// Each face divided into as many quads as it has corners.
    pub(crate) fn subdivided(&self, ground: &Ground<'_>, side: f64) -> Self {
        let mut positions = self.positions.clone();
        let mut holds = self.holds.clone();
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        let mut quads = Vec::new();
        for corners in &self.corners {
            let count = corners.len();
            let sum: Vector3<f64> =
                corners.iter().map(|&corner| self.positions[corner as usize].coords).sum();
            let centre = positions.len() as u32;
            positions.push((sum / count as f64).into());
            holds.push(Hold::Surface);
            let middle_of: Vec<u32> = (0..count)
                .map(|index| {
                    let (a, b) = (corners[index], corners[(index + 1) % count]);
                    *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                        let [p, q] = [a, b].map(|vertex| self.positions[vertex as usize]);
                        let middle = nalgebra::center(&p, &q);
                        let held = [a, b].iter().all(|&v| self.holds[v as usize] != Hold::Surface);
                        let near = ground.nearest_crease(&middle);
                        let on = near.is_some_and(|near| (near - middle).norm() < ON_CREASE * side);
                        positions.push(middle);
                        holds.push(if held && on { Hold::Crease } else { Hold::Surface });
                        (positions.len() - 1) as u32
                    })
                })
                .collect();
            for index in 0..count {
                let before = middle_of[(index + count - 1) % count];
                quads.push(vec![corners[index], middle_of[index], centre, before]);
            }
        }
        Self { positions, holds, corners: quads }
    }

    /// The quads, without vertices that no face has any longer.
    pub(crate) fn into_quads(self) -> QuadMesh {
        let mut quads = self.with_shorter_diagonals();
        let mut new_index = vec![u32::MAX; self.positions.len()];
        let mut positions = Vec::with_capacity(self.positions.len());
        for corner in quads.as_flattened_mut() {
            let index = &mut new_index[*corner as usize];
            if *index == u32::MAX {
                *index = positions.len() as u32;
                positions.push(self.positions[*corner as usize]);
            }
            *corner = *index;
        }
        QuadMesh { positions, quads }
    }

    /// Of faces that are quads: the corners of each, from an end of the shorter diagonal; of the
    /// other where that one would be an edge that there is.
    fn with_shorter_diagonals(&self) -> Vec<[u32; 4]> {
        let of_face = |corners: &Vec<u32>| <[u32; 4]>::try_from(corners.as_slice()).ok();
        let quads: Vec<[u32; 4]> = self.corners.iter().filter_map(of_face).collect();
        let sides = quads.iter().flat_map(|&[a, b, c, d]| [(a, b), (b, c), (c, d), (d, a)]);
        let mut edges: HashSet<(u32, u32)> = sides.collect();
        let turned = |[a, b, c, d]: [u32; 4]| {
            let length = |p: u32, q: u32| {
                (self.positions[p as usize] - self.positions[q as usize]).norm_squared()
            };
            let (quad, other) = if length(b, d) < length(a, c) {
                ([b, c, d, a], [a, b, c, d])
            } else {
                ([a, b, c, d], [b, c, d, a])
            };
            let is_edge = |quad: [u32; 4]| edges.contains(&(quad[0], quad[2]));
            let quad = if is_edge(quad) && !is_edge(other) { other } else { quad };
            edges.extend([(quad[0], quad[2]), (quad[2], quad[0])]);
            quad
        };
        quads.into_iter().map(turned).collect()
    }
}
