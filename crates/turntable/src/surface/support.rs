//! What each vertex of the solid rests on.

use image::{ImageBuffer, Luma};
use nalgebra::Vector3;

use super::projection::{DepthBuffer, Rig, VISIBILITY_SCALE};
use crate::silhouette::Silhouette;
use mesh::Mesh;

/// What a vertex rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Support {
    /// Nothing drawn: the rounding's or the fusion's guess.
    Guessed,
    /// The outline of a view.
    Hull,
    /// A line or a depth map of a view that sees it.
    Seen,
}

/// The outline counts for vertices this close to it, px.
const OUTLINE_REACH_PX: f64 = 2.0;
/// A depth map counts for vertices this close to it, px.
const DEPTH_REACH_PX: f64 = 4.0;

/// What one view knows.
pub struct Witness<'a> {
    /// What the view says is the subject.
    pub silhouette: &'a Silhouette,
    /// Per pixel, whether there is ink within two columns and one row.
    pub near_ink: &'a [bool],
    /// px, NaN outside.
    pub depth_px: Option<&'a ImageBuffer<Luma<f32>, Vec<f32>>>,
}

/// Per vertex, the strongest support that any view gives.
///
/// * `witnesses`: one a view of `rig`, in its order.
pub fn vertex_support(mesh: &Mesh, rig: &Rig, witnesses: &[Witness]) -> Vec<Support> {
    use rayon::prelude::*;
    let buffers: Vec<DepthBuffer> = (0..witnesses.len())
        .into_par_iter()
        .map(|view| DepthBuffer::of_view(mesh, rig, view, VISIBILITY_SCALE))
        .collect();
    let projections: Vec<_> = (0..witnesses.len()).map(|view| rig.projection(view)).collect();
    mesh.positions
        .par_iter()
        .map(|point| {
            let views = witnesses.iter().zip(&buffers).zip(&projections);
            views
                .map(|((witness, buffer), project)| support(project(point), rig, witness, buffer))
                .max()
                .unwrap_or(Support::Guessed)
        })
        .collect()
}

fn support(pixel: Vector3<f64>, rig: &Rig, witness: &Witness, buffer: &DepthBuffer) -> Support {
    if pixel.x < 0.0 || pixel.y < 0.0 {
        return Support::Guessed;
    }
    let (x, y) = (pixel.x as usize, pixel.y as usize);
    if buffer.sees(&pixel) {
        let inked = x < rig.width as usize
            && witness.near_ink.get(y * rig.width as usize + x).is_some_and(|&ink| ink);
        let depth = witness.depth_px.and_then(|map| map.get_pixel_checked(x as u32, y as u32));
        let at_depth =
            depth.is_some_and(|depth| (f64::from(depth.0[0]) - pixel.z).abs() < DEPTH_REACH_PX);
        if inked || at_depth {
            return Support::Seen;
        }
    }
    let ends = witness.silhouette.intervals_px(y).iter().flat_map(|&(low, high)| [low, high]);
    let mut distances = ends.map(|end| (end - pixel.x).abs());
    if distances.any(|distance| distance < OUTLINE_REACH_PX) {
        Support::Hull
    } else {
        Support::Guessed
    }
}
