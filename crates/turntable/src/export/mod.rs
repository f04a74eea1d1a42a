//! The draft as files.

mod glb;
mod obj;

use artifacts::{Artifact, ArtifactName, Files, ViewArtifact};
use frames::{Elevation, FileAxes, Placement};
use mesh::thumbnail;
use mesh::write::{stl, three_mf};
use picture::{EncodeError, FloatImage, normals_png, png, silhouette_png};

use remesh::QuadMesh;

use crate::depth::normals_from_depth;
use crate::draft::{Draft, DraftView};
use crate::fit::Redrawn;
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

/// The material of the OBJ.
const MATERIAL: &str = "drawn";
/// The triangles of the models for where few will do.
const LOW_POLY: [(ArtifactName, usize); 2] =
    [(ArtifactName::LowPoly2000, 2000), (ArtifactName::LowPoly500, 500)];
/// Nothing more is given up than the number of triangles asks for.
const NO_TOLERANCE_PX: f64 = 0.0;

/// The solid as models, and its picture.
///
/// * `quads`: the solid's surface, for the files with quads or textures.
/// * `reference_planes`: whether textured.glb has each drawing as a plane
///   behind the model.
///
/// # Errors
/// [`EncodeError`] for a file that cannot be written.
pub fn model_files(
    draft: &Draft<'_>,
    quads: &QuadMesh,
    placement: &Placement,
    frames: &Frames,
    reference_planes: bool,
) -> Result<Files, EncodeError> {
    let solid = &draft.solid;
    let rig = draft.rig();
    let drawn = Drawn {
        rig: &rig,
        drawings: draft.all_views().iter().map(|found| found.view).collect(),
        placement,
    };
    let textured = texture(draft, quads).ok_or_else(no_triangles)?;
    let Frames { obj, print } = frames;
    let (material_file, texture_file) =
        (ArtifactName::SolidMtl.to_string(), ArtifactName::Texture.to_string());
    let obj = quad_obj(&textured, placement, obj, &material_file, MATERIAL);
    let printed_mm: Vec<[f32; 3]> = solid
        .mesh
        .positions
        .iter()
        .map(|point| print.file_from_gltf(placement.gltf_from_turntable(point)))
        .map(|point_m| point_m.map(|value| value * MM_PER_METRE))
        .collect();
    let triangles = &solid.mesh.triangles;
    let encoding = |what| move |error: std::io::Error| EncodeError::new(what, error);
    let low_poly = LOW_POLY.map(|(name, faces)| {
        let mesh = decimated(&solid.mesh, faces, NO_TOLERANCE_PX);
        Ok(Artifact::new(name, low_poly_glb(&mesh, &drawn)?))
    });
    let texture_png = png(&textured.texture)?;
    let mut artifacts = vec![
        Artifact::new(ArtifactName::Solid, solid_glb(&solid.mesh, &solid.support, &drawn)?),
        Artifact::new(ArtifactName::SolidObj, obj.into_bytes()),
        Artifact::new(ArtifactName::SolidMtl, mtl(MATERIAL, &texture_file).into_bytes()),
        Artifact::new(ArtifactName::Texture, texture_png.clone()),
        Artifact::new(
            ArtifactName::SolidStl,
            stl(&printed_mm, triangles).map_err(encoding("solid.stl"))?,
        ),
        Artifact::new(
            ArtifactName::SolidThreeMf,
            three_mf(&printed_mm, triangles).map_err(encoding("solid.3mf"))?,
        ),
        Artifact::new(
            ArtifactName::Textured,
            textured_glb(&textured, &texture_png, &drawn, reference_planes)?,
        ),
        Artifact::new(ArtifactName::Relief, relief_glb(&textured, &drawn)?),
        Artifact::new(ArtifactName::Thumbnail, thumbnail(&solid.mesh)?),
    ];
    for file in low_poly {
        artifacts.push(file?);
    }
    Ok(Files { artifacts, ..Files::default() })
}
