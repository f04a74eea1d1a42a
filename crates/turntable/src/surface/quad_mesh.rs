//! The surface of a field of signed distances as quads.

use nalgebra::{Point2, Point3, Vector3};
use rayon::prelude::*;

use super::occupancy::Occupancy;
use crate::surface::field::Field;

/// A mesh of quads, counter-clockwise seen from outside.
#[derive(Clone, Debug, Default)]
pub struct QuadMesh {
    /// The vertices, turntable frame, px.
    pub positions: Vec<Point3<f64>>,
    /// Per vertex, the cell that it lies in, by its low corner's index in an
    /// [`Occupancy`]; ascending along Z, then Y, then X.
    pub cells: Vec<[u16; 3]>,
    /// Indices of each quad's vertices.
    pub quads: Vec<[u32; 4]>,
    /// Per layer of cells, its first vertex; last, the number of vertices.
    pub layer_vertices: Vec<usize>,
    /// Per layer of cells, the first of the quads that touch it and no higher
    /// one; last, the number of quads.
    pub layer_quads: Vec<usize>,
}

/// Layers of cells that are meshed in one go.
const SLAB_LAYERS: usize = 8;

/// Extracts the zero level of `field` with one vertex per mixed cell.
///
/// `inside` says which nodes are inside and must be well composed: then the
/// surface is the boundary of a union of cubes that only meet in faces, hence
/// a closed 2-manifold. Vertices are the mean of the cell's edge crossings
/// (Gibson 1998, surface nets), or on the crease that runs through the cell.
///
/// # Source
/// Latecki, Eckhardt, Rosenfeld 1995, Well-composed sets.
pub fn quads_of_field(field: &Field, inside: &Occupancy) -> QuadMesh {
    // Cell (i, j, k) spans nodes i-1..=i, j-1..=j, k-1..=k; nodes beyond the
    // lattice are outside.
    let [nx, ny, nz] = field.lattice.nodes;
    let count = nz + 1;
    let layers: Vec<Layer> =
        (0..count).into_par_iter().map(|k| Layer::new(field, inside, k)).collect();
    let layer_vertices = starts(layers.iter().map(|layer| layer.cells.len()));
    let slabs: Vec<usize> = (0..count).step_by(SLAB_LAYERS).collect();
    let quads: Vec<Vec<Vec<[u32; 4]>>> = slabs
        .into_par_iter()
        .map(|from| {
            // Only entries of mixed cells are read, which the layer at hand
            // has written: what others left need not be cleared.
            let [mut below, mut current] = [(); 2].map(|()| vec![0; (nx + 1) * (ny + 1)]);
            if let Some(k) = from.checked_sub(1) {
                layers[k].index(layer_vertices[k], &mut below, nx + 1);
            }
            let slab = from..(from + SLAB_LAYERS).min(count);
            slab.map(|k| {
                layers[k].index(layer_vertices[k], &mut current, nx + 1);
                let quads = quads_of_layer(inside, k, [&below, &current]);
                std::mem::swap(&mut below, &mut current);
                quads
            })
            .collect()
        })
        .collect();
    let layer_quads = starts(quads.iter().flatten().map(Vec::len));
    let (cells, positions): (Vec<_>, Vec<_>) =
        layers.into_iter().map(|layer| (layer.cells, layer.positions)).unzip();
    QuadMesh {
        positions: positions.concat(),
        cells: cells.concat(),
        quads: quads.into_iter().flatten().flatten().collect(),
        layer_vertices,
        layer_quads,
    }
}

/// Where each of several runs starts, and the end of the last.
fn starts(lengths: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut next = 0;
    let ends = lengths.map(|length| {
        next += length;
        next
    });
    std::iter::once(0).chain(ends).collect()
}

/// The vertices of the cells between slices `k - 1` and `k`.
struct Layer {
    cells: Vec<[u16; 3]>,
    positions: Vec<Point3<f64>>,
}

impl Layer {
    fn new(field: &Field, inside: &Occupancy, k: usize) -> Self {
        let creases = creases_of_layer(field, k);
        let mut layer = Self { cells: Vec::new(), positions: Vec::new() };
        for j in 0..=field.lattice.nodes[1] {
            for i in inside.mixed_columns(j, k) {
                // A lattice has at most 513 nodes along an axis.
                layer.cells.push([i, j, k].map(|index| index as u16));
                layer.positions.push(vertex(field, inside, [i, j, k], &creases));
            }
        }
        layer
    }

    /// Writes the vertex of each of the layer's cells, counted from `first`, to
    /// its place in rows of `width` cells.
    fn index(&self, first: usize, vertices: &mut [u32], width: usize) {
        for (&[i, j, _], index) in self.cells.iter().zip(first as u32..) {
            vertices[usize::from(j) * width + usize::from(i)] = index;
        }
    }
}

/// Crease points of a layer by cell column: (j * (nx + 1) + i, point), sorted.
fn creases_of_layer(field: &Field, k: usize) -> Vec<(usize, Point2<f64>)> {
    let lattice = &field.lattice;
    let planes = [k.checked_sub(1), Some(k)];
    let planes = planes.into_iter().flatten().filter_map(|k| field.planes.get(k));
    let mut points: Vec<(usize, Point2<f64>)> = planes
        .flat_map(|plane| &plane.creases)
        .map(|point| {
            let i = ((point.x - lattice.origin.x) / lattice.pitch_px).floor() + 1.0;
            let j = ((point.y - lattice.origin.y) / lattice.pitch_px).floor() + 1.0;
            (j.max(0.0) as usize * (lattice.nodes[0] + 1) + i.max(0.0) as usize, *point)
        })
        .collect();
    points.sort_by_key(|(cell, _)| *cell);
    points
}

fn vertex(
    field: &Field,
    inside: &Occupancy,
    cell: [usize; 3],
    creases: &[(usize, Point2<f64>)],
) -> Point3<f64> {
    let lattice = &field.lattice;
    let mean = mean_crossing(inside.pattern(cell), &values_around(field, cell));
    // A cell's low corner has one index less in the lattice.
    let steps = Vector3::from(cell.map(|index| index as f64 - 1.0)) + mean;
    let mut position = lattice.origin + steps * lattice.pitch_px;
    if creases.is_empty() {
        return position;
    }
    let column = cell[1] * (lattice.nodes[0] + 1) + cell[0];
    let first = creases.partition_point(|(cell, _)| *cell < column);
    let here: Vec<_> = creases[first..].iter().take_while(|(cell, _)| *cell == column).collect();
    if !here.is_empty() {
        let sum = here.iter().fold(nalgebra::Vector2::zeros(), |sum, (_, p)| sum + p.coords);
        let mean = sum / here.len() as f64;
        position.x = mean.x;
        position.y = mean.y;
    }
    position
}

/// The field at a cell's corners.
fn values_around(field: &Field, [i, j, k]: [usize; 3]) -> [f32; 8] {
    let outside = -field.lattice.truncation_px() as f32;
    let mut values = [outside; 8];
    for (above, values) in values.chunks_exact_mut(4).enumerate() {
        let plane = (k + above).checked_sub(1).and_then(|k| field.planes.get(k));
        for (corner, value) in values.iter_mut().enumerate() {
            // The border's index of -1 wraps to one beyond every window.
            let [i, j] = [i + (corner & 1), j + (corner >> 1)].map(|index| index.wrapping_sub(1));
            *value = plane.map_or(outside, |plane| plane.at(i, j, outside));
        }
    }
    values
}

/// The mean of where the surface crosses a cell's edges, from its low corner,
/// in units of its side.
///
/// * `inside`, `values`: of the corners, by bits: 1 along X, 2 along Y, 4 along Z.
fn mean_crossing(inside: u8, values: &[f32; 8]) -> Vector3<f64> {
    let mut sum = Vector3::zeros();
    let mut count = 0.0;
    for (axis, ends) in EDGES.iter().enumerate() {
        for &[from, to] in ends {
            if (inside >> from ^ inside >> to) & 1 == 0 {
                continue;
            }
            let (a, b) = (f64::from(values[from]), f64::from(values[to]));
            // Nodes flipped to keep the set well composed have no crossing of their own.
            let share = if (a > 0.0) == (b > 0.0) { 0.5 } else { (a / (a - b)).clamp(0.02, 0.98) };
            sum += Vector3::new(from & 1, from >> 1 & 1, from >> 2).cast::<f64>();
            sum[axis] += share;
            count += 1.0;
        }
    }
    sum / f64::max(count, 1.0)
}

/// A cell's edges along each axis by their corners' bits.
const EDGES: [[[usize; 2]; 4]; 3] = [
    [[0, 1], [2, 3], [4, 5], [6, 7]],
    [[0, 2], [1, 3], [4, 6], [5, 7]],
    [[0, 4], [1, 5], [2, 6], [3, 7]],
];

/// Emits the quads around lattice edges of slice `k - 1` along X and Y, and
/// around the edges from it to slice `k`.
fn quads_of_layer(inside: &Occupancy, k: usize, [below, current]: [&[u32]; 2]) -> Vec<[u32; 4]> {
    let [nx, ny, _] = inside.nodes();
    let mut quads = Vec::new();
    let at = |cells: &[u32], i: usize, j: usize| cells[j * (nx + 1) + i];
    for j in 0..=ny {
        for i in inside.mixed_columns(j, k) {
            let here = inside.get([i, j, k]);
            // Node indices are one more than the lattice's: node (i, j, k)
            // is the low corner of cell (i, j, k).
            let mut emit = |outward: bool, quad: [u32; 4]| {
                let [a, b, c, d] = quad;
                quads.push(if outward { quad } else { [d, c, b, a] });
            };
            if i > 0 && j > 0 && here != inside.get([i, j, k + 1]) {
                let ring = [(i - 1, j - 1), (i, j - 1), (i, j), (i - 1, j)];
                emit(here, ring.map(|(i, j)| at(current, i, j)));
            }
            if j > 0 && k > 0 && here != inside.get([i + 1, j, k]) {
                let quad = [
                    at(below, i, j - 1),
                    at(below, i, j),
                    at(current, i, j),
                    at(current, i, j - 1),
                ];
                emit(here, quad);
            }
            if i > 0 && k > 0 && here != inside.get([i, j + 1, k]) {
                let quad = [
                    at(below, i - 1, j),
                    at(current, i - 1, j),
                    at(current, i, j),
                    at(below, i, j),
                ];
                emit(here, quad);
            }
        }
    }
    quads
}
