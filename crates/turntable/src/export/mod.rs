//! The draft as files.

mod glb;
mod obj;

use artifacts::{Artifact, ArtifactName, Files, ViewArtifact};
use frames::{Elevation, FileAxes, Placement};
use mesh::thumbnail;
use mesh::write::{stl, three_mf};
use picture::{EncodeError, FloatImage, normals_png, png, silhouette_png};
use progress::{Cancelled, Observer};
use rayon::prelude::*;
use remesh::QuadMesh;

use crate::depth::normals_from_depth;
use crate::draft::{Draft, DraftView};
use crate::fit::Redrawn;
use crate::solid::Solid;
use crate::surface::decimate::decimated;
use crate::texture::texture;
use glb::{Drawn, low_poly_glb, no_triangles, relief_glb, solid_glb, textured_glb};
use obj::{mtl, quad_obj};

/// Disparity is that towards a view this far on, degrees.
pub const DISPARITY_ANGLE_DEG: f64 = 5.0;
const MM_PER_METRE: f32 = 1000.0;
/// Neighbouring depths that differ by more are different surfaces, px.
const MAX_NORMAL_STEP_PX: f32 = 4.0;

/// The maps of one of the draft's views.
///
/// * `redrawn`: of that view.
///
/// # Errors
/// [`EncodeError`] for a picture that cannot be written.
pub fn view_files(view: &DraftView<'_>, redrawn: &Redrawn) -> Result<Files, EncodeError> {
    let depth_px = &view.depth.map.depth_px;
    let name = |artifact| ArtifactName::View(view.viewpoint(), artifact);
    let disparity = disparity(depth_px, view.view.elevation);
    let mut files = Files::of_maps(view.viewpoint(), &disparity, depth_px)?;
    let normals = normals_png(&normals_from_depth(depth_px, MAX_NORMAL_STEP_PX))?;
    files.artifacts.push(Artifact::new(name(ViewArtifact::NormalsPng), normals));
    let mask = silhouette_png(view.silhouette.mask())?;
    files.artifacts.push(Artifact::new(name(ViewArtifact::SilhouettePng), mask));
    let fit = png(&redrawn.over(&view.view.image))?;
    files.artifacts.push(Artifact::new(name(ViewArtifact::FitPng), fit));
    Ok(files)
}

/// How far points lie from where the axis plane's would, towards the view
/// 5 degrees on, px: near is large. Of views from above or below, to the side.
fn disparity(depth_px: &FloatImage, elevation: Elevation) -> FloatImage {
    let sine = DISPARITY_ANGLE_DEG.to_radians().sin() as f32;
    let (rise, level) = elevation.sin_cos();
    let origin_row = f64::from(depth_px.height()) / 2.0;
    let mut disparity = depth_px.clone();
    for (_, y, value) in disparity.enumerate_pixels_mut() {
        // What is horizontal of the depth; all of it in a level view.
        let up = origin_row - f64::from(y) - 0.5;
        let behind = value.0[0] * level as f32 + (up * rise) as f32;
        value.0[0] = -sine * behind;
    }
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

/// Why there are no files.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// One cannot be written.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// Somebody asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// The material of the OBJ.
const MATERIAL: &str = "drawn";
/// Makes a file.
type Make<'a> = &'a (dyn Fn() -> Result<Vec<u8>, EncodeError> + Sync);
/// Nothing more is given up than the number of triangles asks for.
const NO_TOLERANCE_PX: f64 = 0.0;

/// The solid as models, and its picture, on rayon's current pool.
///
/// * `quads`: the solid's surface, for the files with quads or textures.
/// * `reference_planes`: whether textured.glb has each drawing as a plane
///   behind the model.
///
/// # Errors
/// [`ExportError`] for a file that cannot be written, or if `observer` says stop.
pub fn model_files(
    draft: &Draft<'_>,
    quads: &QuadMesh,
    placement: &Placement,
    frames: &Frames,
    reference_planes: bool,
    observer: &dyn Observer,
) -> Result<Files, ExportError> {
    let rig = draft.rig();
    let drawn = Drawn {
        rig: &rig,
        drawings: draft.all_views().iter().map(|found| found.view).collect(),
        placement,
    };
    let of_texture = || {
        let textured = texture(draft, quads, observer)?.ok_or_else(no_triangles)?;
        let texture_file = ArtifactName::Texture.to_string();
        let material_file = ArtifactName::SolidMtl.to_string();
        let obj = quad_obj(&textured, placement, &frames.obj, &material_file, MATERIAL);
        let of_pictures = || -> Result<_, EncodeError> {
            let picture = png(&textured.texture)?;
            let glb = textured_glb(&textured, &picture, &drawn, reference_planes)?;
            Ok([(ArtifactName::Texture, picture), (ArtifactName::Textured, glb)])
        };
        let (pictures, relief) = rayon::join(of_pictures, || relief_glb(&textured, &drawn));
        let [picture, glb] = pictures?;
        Ok([
            (ArtifactName::SolidObj, obj.into_bytes()),
            (ArtifactName::SolidMtl, mtl(MATERIAL, &texture_file).into_bytes()),
            picture,
            glb,
            (ArtifactName::Relief, relief?),
        ])
    };
    let (plain, textured): (_, Result<_, ExportError>) =
        rayon::join(|| plain_models(&draft.solid, &drawn, &frames.print), of_texture);
    let artifacts = plain?.into_iter().chain(textured?);
    let artifacts = artifacts.map(|(name, bytes)| Artifact::new(name, bytes)).collect();
    Ok(Files { artifacts, ..Files::default() })
}

/// The models without a texture, and the picture.
fn plain_models(
    solid: &Solid,
    drawn: &Drawn<'_>,
    print: &FileAxes,
) -> Result<Vec<(ArtifactName, Vec<u8>)>, EncodeError> {
    let triangles = &solid.mesh.triangles;
    let encoding = |what| move |error: std::io::Error| EncodeError::new(what, error);
    let printed_mm: Vec<[f32; 3]> = solid
        .mesh
        .positions
        .iter()
        .map(|point| print.file_from_gltf(drawn.placement.gltf_from_turntable(point)))
        .map(|point_m| point_m.map(|value| value * MM_PER_METRE))
        .collect();
    let low_poly = |faces| low_poly_glb(&decimated(&solid.mesh, faces, NO_TOLERANCE_PX), drawn);
    let models: [(ArtifactName, Make<'_>); 6] = [
        (ArtifactName::Solid, &|| solid_glb(&solid.mesh, &solid.support, drawn)),
        (ArtifactName::SolidStl, &|| stl(&printed_mm, triangles).map_err(encoding("solid.stl"))),
        (ArtifactName::SolidThreeMf, &|| {
            three_mf(&printed_mm, triangles).map_err(encoding("solid.3mf"))
        }),
        (ArtifactName::Thumbnail, &|| thumbnail(&solid.mesh)),
        (ArtifactName::LowPoly2000, &|| low_poly(2000)),
        (ArtifactName::LowPoly500, &|| low_poly(500)),
    ];
    models.par_iter().map(|&(name, make)| Ok((name, make()?))).collect()
}
