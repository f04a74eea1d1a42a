//! Reads 3D models from bytes.
//!
//! Pure: no files, no network. A model that refers to other files (OBJ material libraries, glTF
//! buffers) is read as far as its own bytes go, or refused with an error that names the reference.

mod error;
mod finish;
mod gltf;
mod limits;
mod obj;
mod ply;
mod polygon;
mod stl;

#[cfg(test)]
mod tests;

use frames::UpAxis;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Mesh;

pub use error::ModelError;
pub use limits::Limits;

/// A 3D model: Z up, front towards -Y, in its own unit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// Vertices and triangles, in the model frame.
    pub mesh: Mesh,
    /// Material of each triangle: equal numbers, equal materials.
    pub materials: Vec<u32>,
    /// Unit normals at each triangle's corners, when the model gives them.
    pub corner_normals: Option<Vec<[Vector3<f64>; 3]>>,
    /// Colours at each triangle's corners, linear RGB in [0, 1], when the model gives them.
    pub corner_colours: Option<Vec<[LinearRgb; 3]>>,
}

/// A colour in linear light with the primaries of sRGB, each channel in [0, 1].
pub type LinearRgb = [f32; 3];

/// The file formats that [`load`] reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ModelFormat {
    /// Binary glTF 2.0.
    Glb,
    /// glTF 2.0 as JSON with embedded buffers.
    Gltf,
    /// Wavefront OBJ.
    Obj,
    /// Stanford polygon format, ASCII or binary.
    Ply,
    /// Stereolithography, ASCII or binary.
    Stl,
}

impl ModelFormat {
    /// The format that a file name's extension stands for, in any case.
    pub fn from_file_name(name: &str) -> Option<Self> {
        let (_, extension) = name.rsplit_once('.')?;
        match extension.to_ascii_lowercase().as_str() {
            "glb" => Some(Self::Glb),
            "gltf" => Some(Self::Gltf),
            "obj" => Some(Self::Obj),
            "ply" => Some(Self::Ply),
            "stl" => Some(Self::Stl),
            _ => None,
        }
    }

    /// The usual ending of such a file's name.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Glb => "glb",
            Self::Gltf => "gltf",
            Self::Obj => "obj",
            Self::Ply => "ply",
            Self::Stl => "stl",
        }
    }

    /// The up axis by convention: glTF prescribes Y; the others prescribe none and are read as Z,
    /// the frame that the sheets' own models are written in.
    pub fn default_up_axis(self) -> UpAxis {
        match self {
            Self::Glb | Self::Gltf => UpAxis::Y,
            Self::Obj | Self::Ply | Self::Stl => UpAxis::Z,
        }
    }
}

/// Reads a model.
///
/// * `up_axis`: overrides [`ModelFormat::default_up_axis`].
/// * `limits`: checked before memory is taken for what the bytes promise.
///
/// Polygons are triangulated and triangles without area left out. Node transforms, instances and
/// the rest pose of skins are applied; morph targets, animations and textures are not. Colours are those
/// of vertices and, in glTF, the base colours of materials.
///
/// ```
/// use mesh::read::{Limits, ModelFormat, load};
///
/// let obj = b"v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n";
/// let model = load(obj, ModelFormat::Obj, None, &Limits::default()).unwrap();
/// assert_eq!(model.mesh.triangles, [[0, 1, 2]]);
/// ```
///
/// # Errors
/// [`ModelError`], which says what is wrong with the bytes.
pub fn load(
    bytes: &[u8],
    format: ModelFormat,
    up_axis: Option<UpAxis>,
    limits: &Limits,
) -> Result<Model, ModelError> {
    limits.check_bytes(bytes.len())?;
    let soup = match format {
        ModelFormat::Glb | ModelFormat::Gltf => gltf::read(bytes, limits)?,
        ModelFormat::Obj => obj::read(bytes, limits)?,
        ModelFormat::Ply => ply::read(bytes, limits)?,
        ModelFormat::Stl => stl::read(bytes, limits)?,
    };
    finish::finish(soup, up_axis.unwrap_or(format.default_up_axis()))
}
