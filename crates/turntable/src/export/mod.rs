//! The draft as files.

mod glb;
mod obj;

use artifacts::{Artifact, ArtifactName, Files, ViewArtifact};
use frames::{FileAxes, Placement};
use mesh::thumbnail;
use mesh::write::{stl, three_mf};
use picture::{EncodeError, FloatImage, normals_png, png, silhouette_png};

use crate::depth::normals_from_depth;
use crate::draft::Draft;
use crate::fit::Redrawn;
use crate::surface::projection::Rig;
use crate::texture::texture;
use glb::{Drawn, no_triangles, relief_glb, solid_glb, textured_glb};
use obj::quad_obj;

/// Disparity is that towards a view this far on, degrees.
pub const DISPARITY_ANGLE_DEG: f64 = 5.0;
const MM_PER_METRE: f32 = 1000.0;
/// Neighbouring depths that differ by more are different surfaces, px.
const MAX_NORMAL_STEP_PX: f32 = 4.0;

/// The maps of the draft's view at `index`.
///
/// * `redrawn`: of that view.
///
/// # Errors
/// [`EncodeError`] for a picture that cannot be written.
pub fn view_files(
    draft: &Draft<'_>,
    redrawn: &Redrawn,
    index: usize,
) -> Result<Files, EncodeError> {
    let (view, silhouette) = (&draft.depths[index], &draft.silhouettes.silhouettes[index]);
    let name = |artifact| ArtifactName::View(view.azimuth, artifact);
    let mut files =
        Files::of_maps(view.azimuth, &disparity(&view.map.depth_px), &view.map.depth_px)?;
    let normals = normals_png(&normals_from_depth(&view.map.depth_px, MAX_NORMAL_STEP_PX))?;
    files.artifacts.push(Artifact::new(name(ViewArtifact::NormalsPng), normals));
    let mask = silhouette_png(silhouette.mask())?;
    files.artifacts.push(Artifact::new(name(ViewArtifact::SilhouettePng), mask));
    let fit = png(&redrawn.over(&draft.views.views()[index].image))?;
    files.artifacts.push(Artifact::new(name(ViewArtifact::FitPng), fit));
    Ok(files)
}

/// How far points lie from where the axis plane's would, towards the view
/// 5 degrees on, px: near is large.
fn disparity(depth_px: &FloatImage) -> FloatImage {
    let sine = DISPARITY_ANGLE_DEG.to_radians().sin() as f32;
    let mut disparity = depth_px.clone();
    disparity.iter_mut().for_each(|value| *value *= -sine);
    disparity
}

/// Which way the model points in files whose format leaves it open.
#[derive(Clone, Copy, Debug)]
pub struct Frames {
    /// OBJ.
    pub obj: FileAxes,
    /// STL and 3MF.
    pub print: FileAxes,
}

/// The solid as models, and its picture.
///
/// * `reference_planes`: whether textured.glb has each drawing as a plane
///   behind the model.
///
/// # Errors
/// [`EncodeError`] for a file that cannot be written.
pub fn model_files(
    draft: &Draft<'_>,
    placement: &Placement,
    frames: &Frames,
    reference_planes: bool,
) -> Result<Files, EncodeError> {
    let solid = &draft.solid;
    let rig = Rig::of_views(&draft.views);
    let drawn = Drawn {
        rig: &rig,
        drawings: draft.views.views().iter().map(|view| &**view).collect(),
        placement,
    };
    let textured = texture(draft).ok_or_else(no_triangles)?;
    let Frames { obj, print } = frames;
    let obj = quad_obj(&solid.mesh, placement, obj);
    let printed_mm: Vec<[f32; 3]> = solid
        .mesh
        .positions
        .iter()
        .map(|point| print.file_from_gltf(placement.gltf_from_turntable(point)))
        .map(|point_m| point_m.map(|value| value * MM_PER_METRE))
        .collect();
    let triangles = &solid.mesh.triangles;
    let encoding = |what| move |error: std::io::Error| EncodeError::new(what, error);
    let artifacts = vec![
        Artifact::new(ArtifactName::Solid, solid_glb(&solid.mesh, &solid.support, &drawn)?),
        Artifact::new(ArtifactName::SolidObj, obj.into_bytes()),
        Artifact::new(
            ArtifactName::SolidStl,
            stl(&printed_mm, triangles).map_err(encoding("solid.stl"))?,
        ),
        Artifact::new(
            ArtifactName::SolidThreeMf,
            three_mf(&printed_mm, triangles).map_err(encoding("solid.3mf"))?,
        ),
        Artifact::new(ArtifactName::Textured, textured_glb(&textured, &drawn, reference_planes)?),
        Artifact::new(ArtifactName::Relief, relief_glb(&textured, &drawn)?),
        Artifact::new(ArtifactName::Thumbnail, thumbnail(&solid.mesh)?),
    ];
    Ok(Files { artifacts, ..Files::default() })
}
