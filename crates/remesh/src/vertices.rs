//! The vertices that the fields live on, and coarser and coarser versions of them.

use mesh::shading::{crease_edges, face_normal};
use mesh::{Mesh, connected};
use nalgebra::{Point3, Vector3};

/// The vertices at one level of detail; indices of all lists agree.
#[derive(Clone, Debug, Default)]
pub(crate) struct Level {
    pub points: Vec<Point3<f64>>,
    /// Unit vectors.
    pub normals: Vec<Vector3<f64>>,
    /// The area that each stands for.
    pub areas: Vec<f64>,
    /// Where a crease runs through a vertex, its direction.
    pub creases: Vec<Option<Vector3<f64>>>,
    /// Where creases end, meet or turn; only of the finest level.
    pub corners: Vec<bool>,
    /// Per vertex the first of its `links`; last, their number.
    pub starts: Vec<u32>,
    /// Neighbours, and how many edges of the finest level lead there.
    pub links: Vec<(u32, f64)>,
    /// Per vertex the one of the next coarser level that it is part of.
    pub parents: Vec<u32>,
    /// The field of crosses: one of the four directions, a unit vector at a right angle to the
    /// normal.
    pub axes: Vec<Vector3<f64>>,
    /// The field of lattices: a lattice point in the tangent plane.
    pub lattice: Vec<Point3<f64>>,
}

/// Fewer vertices are not merged further.
const COARSEST: usize = 8;
/// Nor if hardly any could be.
const MIN_MERGED: f64 = 0.97;
/// Of a crease that turns more at a vertex, the vertex is a corner: cosine.
const CORNER_COSINE: f64 = 0.8;

/// The finest level first.
pub(crate) fn levels(mesh: &Mesh, crease_angle_deg: f64, shortest_crease: f64) -> Vec<Level> {
    let mut levels = vec![finest(mesh, crease_angle_deg, shortest_crease)];
    loop {
        let last = levels.len() - 1;
        if levels[last].points.len() <= COARSEST {
            return levels;
        }
        let coarser = merged(&mut levels[last]);
        if coarser.points.len() as f64 > MIN_MERGED * levels[last].points.len() as f64 {
            return levels;
        }
        levels.push(coarser);
    }
}

impl Level {
    pub(crate) fn around(&self, vertex: usize) -> &[(u32, f64)] {
        &self.links[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }

    fn set_links(&mut self, mut pairs: Vec<(u32, u32, f64)>) {
        pairs.sort_by_key(|&(from, to, _)| (from, to));
        self.starts = vec![0; self.points.len() + 1];
        let mut last = None;
        for (from, to, weight) in pairs {
            if last == Some((from, to)) {
                if let Some(link) = self.links.last_mut() {
                    link.1 += weight;
                }
                continue;
            }
            last = Some((from, to));
            self.links.push((to, weight));
            self.starts[from as usize + 1] = self.links.len() as u32;
        }
        for vertex in 1..self.starts.len() {
            self.starts[vertex] = self.starts[vertex].max(self.starts[vertex - 1]);
        }
    }
}

fn finest(mesh: &Mesh, crease_angle_deg: f64, shortest_crease: f64) -> Level {
    let count = mesh.positions.len();
    let mut level = Level {
        points: mesh.positions.clone(),
        normals: vec![Vector3::zeros(); count],
        areas: vec![0.0; count],
        creases: vec![None; count],
        ..Level::default()
    };
    let mut pairs = Vec::with_capacity(mesh.triangles.len() * 3);
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = mesh.corners(index);
        let area = (b - a).cross(&(c - a)).norm() / 2.0;
        let normal = face_normal(mesh, index);
        for side in 0..3 {
            let (from, to) = (triangle[side], triangle[(side + 1) % 3]);
            level.normals[from as usize] += normal * area;
            level.areas[from as usize] += area / 3.0;
            pairs.push((from, to, 0.5));
            pairs.push((to, from, 0.5));
        }
    }
    for normal in &mut level.normals {
        *normal = normal.try_normalize(0.0).unwrap_or_else(Vector3::z);
    }
    level.set_links(pairs);
    let ends = crease_ends(mesh, crease_angle_deg, shortest_crease);
    level.creases = directions(mesh, &ends);
    let plain =
        |(ends, direction): (&Vec<u32>, &Option<_>)| !ends.is_empty() && direction.is_none();
    level.corners = ends.iter().zip(&level.creases).map(plain).collect();
    level
}

/// Per vertex where the crease edges at it lead, of creases that are no shorter.
fn crease_ends(mesh: &Mesh, crease_angle_deg: f64, shortest: f64) -> Vec<Vec<u32>> {
    let edges = crease_edges(mesh, crease_angle_deg);
    let links = edges.iter().map(|&[a, b]| (a, b));
    let (labels, count) = connected::components(mesh.positions.len(), links);
    let mut lengths = vec![0.0; count];
    for &[a, b] in &edges {
        let [p, q] = [a, b].map(|vertex| mesh.positions[vertex as usize]);
        lengths[labels[a as usize] as usize] += (q - p).norm();
    }
    let mut ends: Vec<Vec<u32>> = vec![Vec::new(); mesh.positions.len()];
    for &[a, b] in &edges {
        if lengths[labels[a as usize] as usize] >= shortest {
            ends[a as usize].push(b);
            ends[b as usize].push(a);
        }
    }
    ends
}

/// Where two crease edges meet in a line, its direction.
fn directions(mesh: &Mesh, ends: &[Vec<u32>]) -> Vec<Option<Vector3<f64>>> {
    let direction = |(vertex, ends): (usize, &Vec<u32>)| {
        let &[before, after] = ends.as_slice() else {
            return None;
        };
        let way =
            |to: u32| (mesh.positions[to as usize] - mesh.positions[vertex]).try_normalize(0.0);
        let (before, after) = (way(before)?, way(after)?);
        (before.dot(&after) < -CORNER_COSINE).then(|| (after - before).try_normalize(0.0)).flatten()
    };
    ends.iter().enumerate().map(direction).collect()
}

/// Merges vertices in pairs, those that lie flattest and stand for about as much first.
fn merged(level: &mut Level) -> Level {
    let count = level.points.len();
    let mut pairs: Vec<(f64, u32, u32)> = Vec::with_capacity(level.links.len() / 2);
    for from in 0..count {
        for &(to, _) in level.around(from).iter().filter(|(to, _)| *to as usize > from) {
            let to = to as usize;
            let (small, large) =
                (level.areas[from].min(level.areas[to]), level.areas[from].max(level.areas[to]));
            let score =
                level.normals[from].dot(&level.normals[to]) * small / large.max(f64::MIN_POSITIVE);
            pairs.push((score, from as u32, to as u32));
        }
    }
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut parents = vec![u32::MAX; count];
    let mut coarser = Level::default();
    let push = |coarser: &mut Level, parts: &[usize], level: &Level| {
        let area: f64 = parts.iter().map(|&part| level.areas[part]).sum();
        let share = |part: usize| level.areas[part] / area.max(f64::MIN_POSITIVE);
        let point =
            parts.iter().map(|&part| level.points[part].coords * share(part)).sum::<Vector3<f64>>();
        let normal =
            parts.iter().map(|&part| level.normals[part] * share(part)).sum::<Vector3<f64>>();
        coarser.points.push(point.into());
        coarser.normals.push(normal.try_normalize(0.0).unwrap_or(level.normals[parts[0]]));
        coarser.areas.push(area);
        coarser.creases.push(parts.iter().find_map(|&part| level.creases[part]));
    };
    for (_, a, b) in pairs {
        if parents[a as usize] == u32::MAX && parents[b as usize] == u32::MAX {
            let parent = coarser.points.len() as u32;
            (parents[a as usize], parents[b as usize]) = (parent, parent);
            push(&mut coarser, &[a as usize, b as usize], level);
        }
    }
    for (vertex, parent) in parents.iter_mut().enumerate() {
        if *parent == u32::MAX {
            *parent = coarser.points.len() as u32;
            push(&mut coarser, &[vertex], level);
        }
    }
    let mut links = Vec::with_capacity(level.links.len());
    for from in 0..count {
        for &(to, weight) in level.around(from) {
            let (from, to) = (parents[from], parents[to as usize]);
            if from != to {
                links.push((from, to, weight));
            }
        }
    }
    coarser.set_links(links);
    level.parents = parents;
    coarser
}
