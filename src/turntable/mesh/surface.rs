//! The surface of a field of signed distances as quads.

use nalgebra::{Point2, Point3};

use super::super::solid::field::{Field, Lattice};
use super::occupancy::Occupancy;

/// A mesh of quads, counter-clockwise seen from outside.
#[derive(Clone, Debug, Default)]
pub struct QuadMesh {
    pub positions: Vec<Point3<f64>>,
    pub quads: Vec<[u32; 4]>,
}

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
    let [nx, ny, nz] = field.lattice.nodes;
    let mut mesh = QuadMesh::default();
    // Vertex of the cells below and of the layer of cells at the current slice.
    let cells = (nx + 1) * (ny + 1);
    let mut below = vec![u32::MAX; cells];
    // Cell (i, j, k) spans nodes i-1..=i, j-1..=j, k-1..=k; nodes beyond the
    // lattice are outside.
    for k in 0..=nz {
        let current = layer(field, inside, k, &mut mesh.positions);
        horizontal_edges(inside, k, [&below, &current], &mut mesh.quads);
        if k < nz {
            below = current;
        }
    }
    mesh
}

/// Places the vertices of the layer of cells between slices `k - 1` and `k`.
fn layer(
    field: &Field,
    inside: &Occupancy,
    k: usize,
    positions: &mut Vec<Point3<f64>>,
) -> Vec<u32> {
    let [nx, ny, _] = field.lattice.nodes;
    let mut vertices = vec![u32::MAX; (nx + 1) * (ny + 1)];
    let creases = creases_of_layer(field, k);
    for j in 0..=ny {
        for i in inside.mixed_columns(j, k) {
            let cell = [i, j, k];
            vertices[j * (nx + 1) + i] = positions.len() as u32;
            positions.push(vertex(field, inside, cell, &creases));
        }
    }
    vertices
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
    let mut sum = Point3::origin().coords;
    let mut count = 0.0;
    for (a, b) in EDGES {
        let (from, to) = (node(cell, a), node(cell, b));
        if inside.get(from) != inside.get(to) {
            sum += crossing(field, from, to);
            count += 1.0;
        }
    }
    let mut position = Point3::from(sum / f64::max(count, 1.0));
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

/// Corners of a cell by bits: 1 along X, 2 along Y, 4 along Z.
const EDGES: [(u8, u8); 12] = [
    (0, 1),
    (2, 3),
    (4, 5),
    (6, 7),
    (0, 2),
    (1, 3),
    (4, 6),
    (5, 7),
    (0, 4),
    (1, 5),
    (2, 6),
    (3, 7),
];

/// A corner's node, one more than its index on each axis.
fn node(cell: [usize; 3], corner: u8) -> [usize; 3] {
    std::array::from_fn(|axis| cell[axis] + usize::from(corner >> axis & 1))
}

/// Where the surface crosses the edge between two nodes (indices plus one).
fn crossing(field: &Field, from: [usize; 3], to: [usize; 3]) -> nalgebra::Vector3<f64> {
    let value = |node: [usize; 3]| -> f64 {
        match node.map(|index| index.checked_sub(1)) {
            [Some(i), Some(j), Some(k)] => f64::from(field.at(i, j, k)),
            _ => -field.lattice.truncation_px(),
        }
    };
    let (a, b) = (value(from), value(to));
    // Nodes flipped to keep the set well composed have no crossing of their own.
    let share = if (a > 0.0) == (b > 0.0) { 0.5 } else { (a / (a - b)).clamp(0.02, 0.98) };
    let (from, to) = (position(&field.lattice, from), position(&field.lattice, to));
    from.coords + (to - from) * share
}

fn position(lattice: &Lattice, node: [usize; 3]) -> Point3<f64> {
    let offset = node.map(|index| (index as f64 - 1.0) * lattice.pitch_px);
    lattice.origin + nalgebra::Vector3::from(offset)
}

/// Emits the quads around lattice edges of slice `k - 1` along X and Y, and
/// around the edges from it to slice `k`.
fn horizontal_edges(
    inside: &Occupancy,
    k: usize,
    [below, current]: [&[u32]; 2],
    quads: &mut Vec<[u32; 4]>,
) {
    let [nx, ny, _] = inside.nodes();
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
}
