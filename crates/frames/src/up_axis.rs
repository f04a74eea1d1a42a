//! Which way is up in a model file.

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which axis of the file points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum UpAxis {
    /// Y up, front towards +Z (glTF).
    Y,
    /// Z up, front towards -Y (Blender).
    Z,
}

impl UpAxis {
    /// Turns a vector of the file's frame into the model frame (Z up, front towards -Y).
    pub fn model_from_file(self, v: Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Y => Vector3::new(v.x, -v.z, v.y),
            Self::Z => v,
        }
    }
}
