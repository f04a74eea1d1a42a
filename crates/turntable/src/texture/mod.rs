//! One texture for the draft, in the drawings' colours.
//!
//! | stage | what it does |
//! |---|---|
//! | `paint` | a drawing's colours without the ink of its outline, spread beyond its edge |
//! | `blend` | the colour of a point of the surface: drawings that see it, weighed by how they do |
//! | `fill` | colours of vertices that no drawing sees, from those around them |
//! | `charts` | which projection each face is laid out in |
//! | `atlas` | islands of faces on one square |
//! | `bake` | the islands' texels |
//! | `relief` | lines inside of outlines as grooves |

mod atlas;
mod bake;
mod blend;
mod charts;
mod fill;
mod paint;
mod relief;

use image::RgbImage;
use mesh::Mesh;
use mesh::shading::ShadedMesh;
use nalgebra::Vector3;
use progress::{Cancelled, Observer};
use rayon::prelude::*;
use remesh::QuadMesh;

use crate::draft::Draft;
use crate::surface::projection::{DepthBuffer, Rig, best_views};
use atlas::{Atlas, Unwrapped};
use blend::Camera;

pub use blend::LinearColour;

/// A mesh laid out on a texture.
#[derive(Clone, Debug)]
pub struct Textured {
    /// Vertices are repeated where islands meet.
    pub mesh: ShadedMesh,
    /// One a position of `mesh`, origin top left.
    pub coordinates: Vec<[f32; 2]>,
    /// The corners of each quad that it was made of, indices into the mesh's positions.
    pub quads: Vec<[u32; 4]>,
    /// sRGB, square, its side a power of two.
    pub texture: RgbImage,
}

impl Textured {
    /// The texture's lines as grooves, a normal map as glTF has them.
    pub fn normal_map(&self) -> RgbImage {
        relief::normal_map(&self.texture)
    }

    /// Per position the normal map's X, a unit vector, and the sign of its Y: the cross product
    /// of normal and X times it.
    pub fn tangents(&self) -> Vec<(Vector3<f64>, f32)> {
        relief::tangents(&self.mesh, &self.coordinates)
    }
}

/// Bakes the drawings' colours into one texture; `None` for a mesh without quads.
///
/// A point takes the colours of all drawings that see it, the more the straighter they face it
/// and the farther it lies from where surfaces hide each other. What none sees is taken from the
/// mirror image if the drawings are symmetric, or else from the nearest surface that has a colour.
/// Outlines' ink stays out; lines inside of them are kept.
///
/// * `quads`: the draft's surface.
///
/// # Errors
/// [`Cancelled`] if `observer` says so.
pub fn texture(
    draft: &Draft<'_>,
    quads: &QuadMesh,
    observer: &dyn Observer,
) -> Result<Option<Textured>, Cancelled> {
    let mesh = &quads.triangulated();
    if mesh.triangles.is_empty() {
        return Ok(None);
    }
    let (rig, views) = (draft.rig(), draft.all_views());
    let buffers = DepthBuffer::of_views(mesh, &rig);
    let cameras: Vec<Camera> = buffers
        .par_iter()
        .enumerate()
        .map(|(view, depth)| Camera::new(&views[view], &rig, view, depth))
        .collect();
    let report = &draft.solid.report;
    let mirror = report.mirror_plane.or(report.symmetric_about);
    let colours = |point: &_, normal: &_| blend::colour(&cameras, &rig, mirror, point, normal);
    textured(mesh, &rig, &best_views(mesh, &rig, &buffers), &colours, observer).map(Some)
}

/// * `mesh`: two triangles a quad.
/// * `labels`: per triangle, the view it is laid out as seen from.
/// * `colour`: of a point with a normal; `None` where it is not known.
fn textured(
    mesh: &Mesh,
    rig: &Rig,
    labels: &[usize],
    colour: &blend::ColourOf<'_>,
    observer: &dyn Observer,
) -> Result<Textured, Cancelled> {
    let shaded = mesh::shading::shaded(mesh, mesh::shading::CREASE_ANGLE_DEG);
    let vertices = fill::vertex_colours(mesh, colour);
    let atlas = Atlas::of(mesh, rig, labels, observer)?;
    let texture = bake::texture(mesh, &shaded, &atlas, &vertices, colour, observer)?;
    let Unwrapped { mesh, coordinates, faces } = atlas.unwrapped(&shaded);
    let mut corners = vec![[0; 3]; faces.len()];
    for (triangle, face) in mesh.triangles.iter().zip(faces) {
        corners[face as usize] = *triangle;
    }
    let halves = corners.as_chunks::<2>().0.iter();
    let quads = halves.map(|&[[a, b, c], [_, _, d]]| [a, b, c, d]).collect();
    Ok(Textured { mesh, coordinates, quads, texture })
}

#[cfg(test)]
mod tests;
