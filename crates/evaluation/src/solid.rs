//! A mesh against the true model: volume overlap and surface distance.

use nalgebra::Point3;
use serde::Serialize;

use super::boundary::{LevelPoint, SurfacePoint, generator, level_set, sample_boundary};
use super::occupancy::{Grid, intersection_over_union, is_inside, sample_winding};
use super::surface::{SurfaceReport, compare_surfaces};
use super::winding::WindingField;
use mesh::Mesh;

/// How solids are compared; the default is what reports state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComparisonOptions {
    /// Cells a side of the grid for the intersection over union.
    pub grid_cells: usize,
    /// The grid's side over the truth's longest side.
    pub grid_extent: f64,
    /// Points on either surface.
    pub samples: usize,
    /// Distance that the F-score allows, over the truth's longest side.
    pub f_score_tolerance: f64,
    /// Seed of the sample points: the same seed gives the same figures.
    pub seed: u64,
}

impl Default for ComparisonOptions {
    fn default() -> Self {
        Self {
            grid_cells: 192,
            grid_extent: 1.1,
            samples: 100_000,
            f_score_tolerance: 0.01,
            seed: 0,
        }
    }
}

/// A solid against the true one; no alignment. Lengths are shares of the
/// truth's longest side.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SolidComparison {
    /// Intersection over union of the insides, `|winding number| > ½`.
    pub iou: f64,
    /// Distances between the two surfaces.
    #[serde(flatten)]
    pub surface: SurfaceReport,
    /// Our volume over the true one, counted on the grid.
    pub volume_ratio: f64,
    /// Ours reaches beyond the grid; what lies there is not in `iou`.
    pub exceeds_grid: bool,
}

/// Why a solid cannot be measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SolidError {
    /// The mesh has no extent, is not finite or refers to vertices it lacks.
    #[error(
        "the mesh is not usable: it has {vertices} vertices and {triangles} triangles, and is without extent, not finite or refers to vertices it lacks"
    )]
    UnusableMesh {
        /// How many vertices it has.
        vertices: usize,
        /// How many triangles it has.
        triangles: usize,
    },
    /// No point of the grid is inside the mesh.
    #[error("the mesh encloses nothing: no point has a winding number over one half")]
    EnclosesNothing,
}

/// A true solid, prepared for comparing many with it.
#[derive(Debug)]
pub struct SolidTruth {
    options: ComparisonOptions,
    grid: Grid,
    longest_side: f64,
    inside: Vec<bool>,
    surface: Vec<SurfacePoint>,
}

impl SolidTruth {
    /// Prepares the truth: its inside on the grid and points on its surface.
    ///
    /// The surface is the boundary of the inside, as open or self-crossing
    /// models have no better one.
    ///
    /// # Errors
    /// [`SolidError`] if `mesh` is unusable or bounds nothing.
    pub fn new(mesh: &Mesh, options: ComparisonOptions) -> Result<Self, SolidError> {
        let (low, high) = mesh.bounds().ok_or_else(|| unusable(mesh))?;
        let longest_side = (high - low).max();
        let middle = nalgebra::center(&low, &high);
        let grid = Grid::around(middle, longest_side * options.grid_extent, options.grid_cells);
        let (inside, surface) = sampled(mesh, &grid, &options, 0)?;
        Ok(Self { options, grid, longest_side, inside, surface })
    }

    /// The longest side of the truth's box, the unit of reports.
    pub fn longest_side(&self) -> f64 {
        self.longest_side
    }

    /// Measures `mesh`, in the truth's frame and unit.
    ///
    /// # Errors
    /// [`SolidError`] if `mesh` is unusable or bounds nothing.
    pub fn evaluate(&self, mesh: &Mesh) -> Result<SolidComparison, SolidError> {
        let (inside, surface) = sampled(mesh, &self.grid, &self.options, 1)?;
        let tolerance = self.options.f_score_tolerance;
        let surface = compare_surfaces(&surface, &self.surface, self.longest_side, tolerance)
            .ok_or(SolidError::EnclosesNothing)?;
        let volume = |inside: &[bool]| inside.iter().filter(|&&inside| inside).count() as f64;
        Ok(SolidComparison {
            iou: intersection_over_union(&inside, &self.inside),
            surface,
            volume_ratio: volume(&inside) / volume(&self.inside),
            exceeds_grid: self.exceeds_grid(mesh),
        })
    }

    fn exceeds_grid(&self, mesh: &Mesh) -> bool {
        let (low, high) = (self.grid.low, self.grid.high());
        let beyond =
            |p: &Point3<f64>| (0..3).any(|axis| p[axis] < low[axis] || p[axis] > high[axis]);
        mesh.bounds().is_some_and(|(lowest, highest)| beyond(&lowest) || beyond(&highest))
    }
}

/// Scales `mesh` to the truth's height and moves the middle of its box to that of the truth's, for
/// drafts of drawings that keep neither scale nor place. Leaves meshes without points as they are.
pub fn lay_on(mesh: &mut Mesh, truth: &Mesh) {
    let (Some((low, high)), Some((true_low, true_high))) = (mesh.bounds(), truth.bounds()) else {
        return;
    };
    let scale = (true_high.z - true_low.z) / (high.z - low.z);
    let (centre, true_centre) =
        (nalgebra::center(&low, &high), nalgebra::center(&true_low, &true_high));
    for point in &mut mesh.positions {
        *point = true_centre + (*point - centre) * scale;
    }
}

fn unusable(mesh: &Mesh) -> SolidError {
    SolidError::UnusableMesh { vertices: mesh.positions.len(), triangles: mesh.triangles.len() }
}

/// The inside on `grid`, and points on the boundary.
fn sampled(
    mesh: &Mesh,
    grid: &Grid,
    options: &ComparisonOptions,
    stream: u64,
) -> Result<(Vec<bool>, Vec<SurfacePoint>), SolidError> {
    let field = WindingField::new(mesh).ok_or_else(|| unusable(mesh))?;
    let windings = sample_winding(&field, grid);
    let level: Vec<LevelPoint> =
        if field.is_closed() { Vec::new() } else { level_set(&windings, grid) };
    let inside: Vec<bool> = windings.into_iter().map(is_inside).collect();
    let mut random = generator(options.seed, stream);
    let surface = sample_boundary(mesh, &field, &level, options.samples, &mut random);
    let bounds_something = stream != 0 || inside.contains(&true);
    if surface.is_empty() || !bounds_something {
        return Err(SolidError::EnclosesNothing);
    }
    Ok((inside, surface))
}

#[cfg(test)]
pub(super) mod shapes {
    use super::*;

    /// A box from `low` to `high`, faces outward.
    pub(crate) fn cuboid(low: [f64; 3], high: [f64; 3]) -> Mesh {
        let corner =
            |bits: usize| Point3::from([0, 1, 2].map(|axis| [low, high][(bits >> axis) & 1][axis]));
        let quads =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        Mesh {
            positions: (0..8).map(corner).collect(),
            triangles: quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        }
    }

    /// A sphere of `rings` by twice as many segments, faces outward.
    pub(crate) fn sphere(radius: f64, rings: u32) -> Mesh {
        let segments = 2 * rings;
        let mut mesh = Mesh::default();
        for ring in 0..=rings {
            for segment in 0..segments {
                let polar = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
                let around = std::f64::consts::PI * f64::from(segment) / f64::from(rings);
                // Exact poles, so that the rings there are one point.
                let width = if ring % rings == 0 { 0.0 } else { radius * polar.sin() };
                mesh.positions.push(Point3::new(
                    width * around.cos(),
                    width * around.sin(),
                    radius * polar.cos(),
                ));
            }
        }
        for ring in 0..rings {
            for segment in 0..segments {
                let next = (segment + 1) % segments;
                let [a, b] = [segment, next].map(|s| ring * segments + s);
                let [c, d] = [segment, next].map(|s| (ring + 1) * segments + s);
                mesh.triangles.extend([[a, c, d], [a, d, b]]);
            }
        }
        mesh
    }

    pub(crate) fn merged(meshes: &[Mesh]) -> Mesh {
        let mut all = Mesh::default();
        for mesh in meshes {
            let offset = all.positions.len() as u32;
            all.positions.extend(&mesh.positions);
            all.triangles.extend(mesh.triangles.iter().map(|t| t.map(|v| v + offset)));
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::shapes::{cuboid, merged, sphere};
    use super::*;

    fn coarse() -> ComparisonOptions {
        ComparisonOptions { grid_cells: 88, samples: 20_000, ..ComparisonOptions::default() }
    }

    fn compare(ours: &Mesh, truth: &Mesh) -> SolidComparison {
        SolidTruth::new(truth, coarse()).unwrap().evaluate(ours).unwrap()
    }

    #[test]
    fn the_truth_itself_is_perfect_but_for_the_spacing_of_points() {
        let cube = cuboid([0.0; 3], [2.0; 3]);
        let found = compare(&cube, &cube);
        assert_eq!((found.iou, found.volume_ratio, found.exceeds_grid), (1.0, 1.0, false));
        // Points 1/√density apart: half of √(6/20000) of the side on average.
        assert!((found.surface.chamfer_l1 - 0.5 * (6.0_f64 / 20_000.0).sqrt()).abs() < 3e-4);
        assert!(found.surface.hausdorff < 0.05);
        assert!(found.surface.normal_consistency > 0.97);
    }

    /// Boxes of 80 cells a side, the second shifted by 20: 60 over 100.
    #[test]
    fn overlapping_boxes() {
        let truth = cuboid([0.0; 3], [1.0; 3]);
        let found = compare(&cuboid([0.25, 0.0, 0.0], [1.25, 1.0, 1.0]), &truth);
        assert!(found.exceeds_grid);
        // The grid ends 0.05 beyond the truth: 60 of 84 layers are counted.
        assert!((found.iou - 60.0 / 84.0).abs() < 1e-12, "{}", found.iou);
        let half = compare(&cuboid([0.0; 3], [0.5, 1.0, 1.0]), &truth);
        assert!((half.iou - 0.5).abs() < 1e-12);
        assert!((half.volume_ratio - 0.5).abs() < 1e-12);
    }

    /// A cube shifted by 5 % of its side, the F-score's tolerance being 2 %.
    #[test]
    fn shifted_cubes() {
        let options = ComparisonOptions { samples: 40_000, f_score_tolerance: 0.02, ..coarse() };
        let truth = SolidTruth::new(&cuboid([0.0; 3], [10.0; 3]), options).unwrap();
        let shifted = cuboid([0.5, 0.0, 0.0], [10.5, 10.0, 10.0]);
        let found = truth.evaluate(&shifted).unwrap().surface;
        assert!((found.hausdorff - 0.05).abs() < 0.01, "{}", found.hausdorff);
        // Points apart add up to half of 1/√density to every distance.
        let excess = found.chamfer_l1 - shifted_cube_chamfer(0.05);
        assert!((0.0..0.5 * (6.0_f64 / 40_000.0).sqrt()).contains(&excess), "{excess}");
        // Good: four side faces but for 3 of the 5 % that stick out, and the
        // rim of the end face that lies inside the other cube.
        let rim = 1.0 - 0.96_f64.powi(2);
        let good = (4.0 * 0.97 + rim) / 6.0;
        assert!((found.f_score - good).abs() < 0.01, "{} for {good}", found.f_score);
    }

    /// By integration: the face that sticks out is `shift` from the other's
    /// face; the one inside is nearest to the side faces or `shift` away; the
    /// strips of the sides that stick out are up to `shift` away.
    fn shifted_cube_chamfer(shift: f64) -> f64 {
        let steps = 1000;
        let inside: f64 = (0..steps * steps)
            .map(|cell| {
                let to_edge = |i: usize| {
                    let at = (i as f64 + 0.5) / steps as f64;
                    at.min(1.0 - at)
                };
                to_edge(cell / steps).min(to_edge(cell % steps)).min(shift)
            })
            .sum::<f64>()
            / (steps * steps) as f64;
        (shift + inside + 4.0 * shift * shift / 2.0) / 6.0
    }

    #[test]
    fn a_hidden_part_changes_nothing() {
        let cube = cuboid([-1.0; 3], [1.0; 3]);
        let with_core = merged(&[cube.clone(), sphere(0.5, 12)]);
        let found = compare(&with_core, &cube);
        assert_eq!(found.iou, 1.0);
        assert!(found.surface.hausdorff < 0.05);
    }

    #[test]
    fn a_sphere_with_a_hole_is_nearly_the_sphere() {
        let whole = sphere(1.0, 32);
        let mut open = whole.clone();
        open.triangles.drain(500..520);
        let (found, best) = (compare(&open, &whole), compare(&whole, &whole));
        assert!(found.iou > 0.99, "{}", found.iou);
        let lost = best.surface.f_score - found.surface.f_score;
        assert!(lost < 0.02, "{lost}");
    }

    #[test]
    fn same_input_same_figures_whatever_the_threads() {
        let (ours, truth) = (sphere(1.0, 16), cuboid([-0.8; 3], [0.8; 3]));
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| compare(&ours, &truth))
        };
        assert_eq!(on(1), on(3));
    }

    #[test]
    fn what_is_no_solid_is_refused() {
        let flat = Mesh { positions: cuboid([0.0; 3], [1.0; 3]).positions, triangles: vec![] };
        let error = SolidTruth::new(&flat, coarse()).unwrap_err();
        assert_eq!(error, SolidError::EnclosesNothing);
        let error = SolidTruth::new(&Mesh::default(), coarse()).unwrap_err();
        assert_eq!(error, SolidError::UnusableMesh { vertices: 0, triangles: 0 });
        let dangling = Mesh { triangles: vec![[0, 1, 99]], ..flat };
        let truth = SolidTruth::new(&sphere(1.0, 8), coarse()).unwrap();
        assert!(matches!(truth.evaluate(&dangling), Err(SolidError::UnusableMesh { .. })));
    }
}
