//! Triangle meshes as evenly sized quads that follow the form.
//!
//! | stage | what it does |
//! |---|---|
//! | `refine` | edges split until a lattice cell holds several vertices |
//! | `vertices` | their normals, neighbours and creases, and coarser and coarser versions |
//! | `orientation` | a smooth field of crosses: where a lattice's axes point |
//! | `lattice` | a smooth field of lattice points |
//! | `collapse` | vertices of one lattice point become one, the surface stays closed |
//! | `faces` | each face divided into quads |
//! | `ground` | the surface that vertices stay on |
//! | `relax` | the vertices evened out, on the surface |
//!
//! # Source
//! Jakob, Tarini, Panozzo, Sorkine-Hornung 2015, Instant Field-Aligned Meshes: the two fields and
//! their extrinsic smoothing. Its graph is not used: edges are collapsed where the surface stays a
//! manifold, so that a closed mesh gives a closed mesh of the same genus.

mod collapse;
mod faces;
mod ground;
mod lattice;
mod orientation;
mod refine;
mod relax;
mod vertices;

use mesh::Mesh;
use mesh::quads::{JoinLimits, joined};
use nalgebra::Point3;

/// What is wanted of the quads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuadOptions {
    /// About so many faces.
    pub faces: usize,
    /// Edges at which the surface turns more are creases and stay edges, degrees.
    pub crease_angle_deg: f64,
}

/// A mesh of quads.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct QuadMesh {
    /// The vertices, in the frame and unit of the mesh that it was made of.
    pub positions: Vec<Point3<f64>>,
    /// Corners of each, counter-clockwise seen from outside; the diagonal from the first is the
    /// shorter one, unless that is an edge of others.
    pub quads: Vec<[u32; 4]>,
}

impl QuadMesh {
    /// Each quad cut along the diagonal from its first corner: triangles 2i and 2i + 1 are of
    /// quad i.
    pub fn triangulated(&self) -> Mesh {
        let triangles = self.quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        Mesh { positions: self.positions.clone(), triangles: triangles.collect() }
    }
}

/// A lattice cell's side over the longest edge of the mesh that the fields live on.
const EDGES_A_CELL: f64 = 1.2;
/// Creases of fewer cells' length are none.
const CREASE_CELLS: f64 = 4.0;
/// Two triangles make a face of the lattice if they turn less against each other, and if no corner
/// is sharper.
const LIMITS: JoinLimits = JoinLimits { max_turn_deg: 60.0, max_corner_cosine: 0.94 };

/// Lays a lattice of squares over a closed mesh that follows its curvature and its creases.
///
/// The surface stays closed and of the same genus.
///
/// `stopped` is asked many times a second; `None` if it says so, and for a mesh without area.
pub fn quads(mesh: &Mesh, options: &QuadOptions, stopped: &dyn Fn() -> bool) -> Option<QuadMesh> {
    let area: f64 = (0..mesh.triangles.len())
        .map(|index| {
            let [a, b, c] = mesh.corners(index);
            (b - a).cross(&(c - a)).norm() / 2.0
        })
        .sum();
    // Each face of the lattice becomes four.
    let side = (4.0 * area / options.faces.max(1) as f64).sqrt();
    if !(side.is_finite() && side > 0.0) {
        return None;
    }
    let fine = refine::refined(mesh, side / EDGES_A_CELL);
    let mut levels = vertices::levels(&fine, options.crease_angle_deg, side * CREASE_CELLS);
    orientation::smooth(&mut levels, stopped)?;
    lattice::smooth(&mut levels, side, stopped)?;
    let level = &levels[0];
    let collapsed = collapse::collapsed(&fine, level, side, stopped)?;
    let faces = joined(&collapsed.mesh, &LIMITS);
    let coarse = faces::Faces::new(collapsed.mesh.positions, collapsed.holds, &faces);
    let ground = ground::Ground::new(&fine, level);
    let mut coarse = coarse.without_doublets();
    relax::even_out(&mut coarse, &ground, stopped)?;
    let mut quads = coarse.subdivided(&ground, side);
    relax::even_out(&mut quads, &ground, stopped)?;
    relax::fit(&mut quads, &ground, stopped)?;
    Some(quads.into_quads())
}
