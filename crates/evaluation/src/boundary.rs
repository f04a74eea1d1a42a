//! Random points on the boundary of a solid `|w| > ½`.
//!
//! Where the mesh separates inside from outside, the boundary is the mesh;
//! parts of it that lie within the solid or enclose nothing are not. Where an
//! open mesh's winding number passes ½ in free space, the boundary is that
//! level set, found on the grid.

use nalgebra::{Point3, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::occupancy::{Grid, is_inside};
use super::winding::WindingField;
use mesh::Mesh;

/// How far to either side of a triangle is looked, in longest sides.
const SIDE_STEP: f64 = 1e-6;

/// Candidates that estimate how much of the mesh is boundary.
const PILOT: usize = 20_000;

/// Candidates tested at a time.
const BATCH: usize = 20_000;

/// Candidates a wanted point before giving up on a mesh that bounds nothing.
const MOST_TRIES: usize = 50;

#[derive(Clone, Copy, Debug)]
pub(super) struct SurfacePoint {
    pub(super) position: Point3<f64>,
    /// Unit, pointing out of the solid.
    pub(super) normal: Vector3<f64>,
}

/// `count` points spread evenly by area; fewer only if there is no boundary.
///
/// * `level_set`: where the boundary is not on the mesh; empty for closed ones.
pub(super) fn sample_boundary(
    mesh: &Mesh,
    field: &WindingField,
    level_set: &[LevelPoint],
    count: usize,
    random: &mut ChaCha8Rng,
) -> Vec<SurfacePoint> {
    let level_area: f64 = level_set.iter().map(|point| point.area).sum();
    let on_mesh = MeshSampler::new(mesh, field);
    let mesh_area = on_mesh.boundary_area(random);
    if mesh_area + level_area <= 0.0 {
        return Vec::new();
    }
    let of_mesh = (count as f64 * mesh_area / (mesh_area + level_area)).round() as usize;
    let mut points = on_mesh.sample(of_mesh, random);
    points.extend(sample_level_set(level_set, count - of_mesh, random));
    points
}

/// Draws points of a mesh by area and keeps those between inside and outside.
struct MeshSampler<'a> {
    mesh: &'a Mesh,
    field: &'a WindingField,
    /// Areas of the triangles up to and with each, summed.
    areas: Vec<f64>,
    step: f64,
}

impl<'a> MeshSampler<'a> {
    fn new(mesh: &'a Mesh, field: &'a WindingField) -> Self {
        let mut sum = 0.0;
        let areas = (0..mesh.triangles.len())
            .map(|index| {
                let [a, b, c] = mesh.corners(index);
                sum += (b - a).cross(&(c - a)).norm() / 2.0;
                sum
            })
            .collect();
        let longest = mesh.bounds().map_or(0.0, |(low, high)| (high - low).max());
        Self { mesh, field, areas, step: SIDE_STEP * longest }
    }

    fn total_area(&self) -> f64 {
        self.areas.last().copied().unwrap_or(0.0)
    }

    /// The area of the mesh that bounds the solid, by a pilot sample.
    fn boundary_area(&self, random: &mut ChaCha8Rng) -> f64 {
        if self.total_area() <= 0.0 {
            return 0.0;
        }
        let kept = self.batch(PILOT, random).len();
        self.total_area() * kept as f64 / PILOT as f64
    }

    fn sample(&self, count: usize, random: &mut ChaCha8Rng) -> Vec<SurfacePoint> {
        let mut points = Vec::with_capacity(count);
        let mut tries = 0;
        while points.len() < count && tries < MOST_TRIES * count.max(BATCH) {
            points.extend(self.batch(BATCH, random));
            tries += BATCH;
        }
        points.truncate(count);
        points
    }

    fn batch(&self, count: usize, random: &mut ChaCha8Rng) -> Vec<SurfacePoint> {
        let candidates: Vec<[f64; 3]> =
            (0..count).map(|_| [random.random(), random.random(), random.random()]).collect();
        candidates.into_par_iter().filter_map(|numbers| self.boundary_point(numbers)).collect()
    }

    /// The point that three numbers in [0, 1) choose, if it is on the boundary.
    fn boundary_point(&self, [triangle, one, other]: [f64; 3]) -> Option<SurfacePoint> {
        let area = triangle * self.total_area();
        let index = self.areas.partition_point(|&sum| sum <= area).min(self.areas.len() - 1);
        let [a, b, c] = self.mesh.corners(index);
        let normal = (b - a).cross(&(c - a)).try_normalize(0.0)?;
        // Uniform on the triangle (Osada et al. 2002).
        let root = one.sqrt();
        let position = a + (b - a) * (root * (1.0 - other)) + (c - a) * (root * other);
        let ahead = self.field.is_inside(&(position + normal * self.step));
        let behind = self.field.is_inside(&(position - normal * self.step));
        (ahead != behind)
            .then(|| SurfacePoint { position, normal: if ahead { -normal } else { normal } })
    }
}

/// A crossing of the level set `|w| = ½` with a grid line, and the area it
/// stands for.
#[derive(Clone, Copy, Debug)]
pub(super) struct LevelPoint {
    point: SurfacePoint,
    area: f64,
    cell: f64,
}

/// Where `|w|` passes ½ without a jump between neighbouring cells.
///
/// A surface element with normal `n` is crossed by `|n_k|/h²` grid lines of
/// axis `k` an area; giving each crossing `h² |n_k|` makes all three axes add
/// up to the area once (`Σ n_k² = 1`).
pub(super) fn level_set(windings: &[f32], grid: &Grid) -> Vec<LevelPoint> {
    let cells = grid.cells;
    (0..cells)
        .into_par_iter()
        .flat_map_iter(|x| {
            (0..cells * cells).flat_map(move |yz| {
                let cell = [x, yz / cells, yz % cells];
                (0..3).filter_map(move |axis| level_point(windings, grid, cell, axis))
            })
        })
        .collect()
}

/// The crossing between `cell` and the next one along `axis`.
fn level_point(windings: &[f32], grid: &Grid, cell: [usize; 3], axis: usize) -> Option<LevelPoint> {
    let mut next = cell;
    next[axis] += 1;
    if next[axis] >= grid.cells {
        return None;
    }
    let (here, there) = (windings[grid.at(cell)], windings[grid.at(next)]);
    let jumps = (here - there).abs() >= 0.5;
    if jumps || is_inside(here) == is_inside(there) {
        return None;
    }
    let (here, there) = (f64::from(here.abs()), f64::from(there.abs()));
    let along = ((0.5 - here) / (there - here)).clamp(0.0, 1.0);
    let mut position = Point3::from([0, 1, 2].map(|axis| grid.centre(axis, cell[axis])));
    position[axis] += along * grid.cell;
    let normal = outward(windings, grid, if along < 0.5 { cell } else { next })?;
    let area = grid.cell * grid.cell * normal[axis].abs();
    Some(LevelPoint { point: SurfacePoint { position, normal }, area, cell: grid.cell })
}

/// Down the gradient of `|w|` at a cell; jumps by whole numbers, where the
/// mesh is, are taken out.
fn outward(windings: &[f32], grid: &Grid, cell: [usize; 3]) -> Option<Vector3<f64>> {
    let here = windings[grid.at(cell)];
    let slope = |axis: usize| {
        let (mut before, mut after) = (cell, cell);
        before[axis] = cell[axis].saturating_sub(1);
        after[axis] = (cell[axis] + 1).min(grid.cells - 1);
        let rise = f64::from(windings[grid.at(after)]) - f64::from(windings[grid.at(before)]);
        rise - rise.round()
    };
    let gradient = Vector3::new(slope(0), slope(1), slope(2)) * f64::from(here.signum());
    (-gradient).try_normalize(1e-9)
}

/// Picks crossings by area and shifts each at random in its tangent plane, so
/// that points do not line up on the grid.
fn sample_level_set(
    level_set: &[LevelPoint],
    count: usize,
    random: &mut ChaCha8Rng,
) -> Vec<SurfacePoint> {
    let mut sum = 0.0;
    let areas: Vec<f64> = level_set
        .iter()
        .map(|point| {
            sum += point.area;
            sum
        })
        .collect();
    if sum <= 0.0 {
        return Vec::new();
    }
    (0..count)
        .map(|_| {
            let area = random.random::<f64>() * sum;
            let index = areas.partition_point(|&sum| sum <= area).min(areas.len() - 1);
            let LevelPoint { point, cell, .. } = level_set[index];
            let mut shift = || (random.random::<f64>() - 0.5) * cell;
            let shift = Vector3::new(shift(), shift(), shift());
            let in_plane = shift - point.normal * shift.dot(&point.normal);
            SurfacePoint { position: point.position + in_plane, normal: point.normal }
        })
        .collect()
}

/// The generator of one solid's points: the seed's `stream`.
pub(super) fn generator(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(stream);
    random
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::occupancy::sample_winding;
    use crate::solid::shapes::{cuboid, merged, sphere};

    fn boundary_of(mesh: &Mesh, count: usize) -> Vec<SurfacePoint> {
        let field = WindingField::new(mesh).unwrap();
        let grid = Grid::around(Point3::origin(), 2.4, 60);
        let level = level_set(&sample_winding(&field, &grid), &grid);
        sample_boundary(mesh, &field, &level, count, &mut generator(3, 0))
    }

    #[test]
    fn points_of_a_cube_lie_evenly_on_its_faces_facing_out() {
        let points = boundary_of(&cuboid([-1.0; 3], [1.0; 3]), 6000);
        assert_eq!(points.len(), 6000);
        let mut on_face = [0; 6];
        for SurfacePoint { position, normal } in points {
            let axis = position.coords.abs().imax();
            assert!((position[axis].abs() - 1.0).abs() < 1e-9);
            assert!((normal[axis] * position[axis].signum() - 1.0).abs() < 1e-9);
            on_face[2 * axis + usize::from(position[axis] > 0.0)] += 1;
        }
        assert!(on_face.iter().all(|&count| (850..1150).contains(&count)), "{on_face:?}");
    }

    #[test]
    fn what_lies_inside_the_solid_is_no_boundary() {
        let parts = [cuboid([-1.0; 3], [0.5; 3]), cuboid([-0.5; 3], [1.0; 3])];
        for SurfacePoint { position, .. } in boundary_of(&merged(&parts), 3000) {
            let within = |low: f64, high: f64| {
                position.iter().all(|&value| value > low + 1e-6 && value < high - 1e-6)
            };
            assert!(!within(-1.0, 0.5) && !within(-0.5, 1.0), "{position}");
        }
    }

    #[test]
    fn an_inverted_mesh_has_the_same_outside() {
        let mut mesh = cuboid([-1.0; 3], [1.0; 3]);
        mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        for SurfacePoint { position, normal } in boundary_of(&mesh, 500) {
            assert!(normal.dot(&position.coords) > 0.0);
        }
    }

    /// A hemisphere's bowl closes somewhere across its mouth, where `|w| = ½`.
    #[test]
    fn an_open_mesh_is_closed_by_the_level_set() {
        let mut bowl = sphere(1.0, 32);
        bowl.triangles.retain(|triangle| {
            triangle.iter().all(|&vertex| bowl.positions[vertex as usize].z < 0.25)
        });
        let points = boundary_of(&bowl, 20_000);
        assert_eq!(points.len(), 20_000);
        let field = WindingField::new(&bowl).unwrap();
        let lid: Vec<_> = points.iter().filter(|p| p.position.coords.norm() < 0.9).collect();
        assert!(lid.len() > 1500, "{}", lid.len());
        for point in lid {
            let winding = field.at(&point.position).abs();
            assert!((winding - 0.5).abs() < 0.05, "{winding} at {}", point.position);
            assert!(!field.is_inside(&(point.position + point.normal * 0.1)));
            assert!(field.is_inside(&(point.position - point.normal * 0.1)));
        }
    }

    /// The weights of the level set alone: a sphere from its distances.
    #[test]
    fn weights_of_crossings_add_up_to_the_area() {
        let grid = Grid::around(Point3::origin(), 2.4, 48);
        let mut values = vec![0.0; 48 * 48 * 48];
        for x in 0..48 {
            for y in 0..48 {
                for z in 0..48 {
                    let centre =
                        Vector3::new(grid.centre(0, x), grid.centre(1, y), grid.centre(2, z));
                    values[grid.at([x, y, z])] = (0.5 + 0.4 * (1.0 - centre.norm())) as f32;
                }
            }
        }
        let area: f64 = level_set(&values, &grid).iter().map(|point| point.area).sum();
        let expected = 4.0 * std::f64::consts::PI;
        assert!((area / expected - 1.0).abs() < 0.01, "{area} of {expected}");
    }

    #[test]
    fn a_mesh_that_encloses_nothing_has_no_boundary() {
        let sheet = Mesh {
            positions: vec![
                Point3::new(0.0, 0.0, 0.0),
                Point3::new(1.0, 0.0, 0.0),
                Point3::new(0.0, 1.0, 0.0),
            ],
            triangles: vec![[0, 1, 2], [0, 2, 1]],
        };
        assert!(boundary_of(&sheet, 100).is_empty());
    }
}
