//! How large a model file may be.

use serde::{Deserialize, Serialize};

use super::ModelError;

/// How large a model may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Limits {
    /// Size of the file, bytes.
    pub max_bytes: usize,
    /// Vertices that a file may promise.
    pub max_vertices: usize,
    /// Triangles that a file may promise.
    pub max_triangles: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self { max_bytes: 256 << 20, max_vertices: 4_000_000, max_triangles: 4_000_000 }
    }
}

impl Limits {
    pub(super) fn check_bytes(&self, found: usize) -> Result<(), ModelError> {
        let limit = self.max_bytes;
        (found <= limit).then_some(()).ok_or(ModelError::TooManyBytes { found, limit })
    }

    pub(super) fn check_vertices(&self, found: usize) -> Result<(), ModelError> {
        let limit = self.max_vertices;
        (found <= limit).then_some(()).ok_or(ModelError::TooManyVertices { found, limit })
    }

    pub(super) fn check_triangles(&self, found: usize) -> Result<(), ModelError> {
        let limit = self.max_triangles;
        (found <= limit).then_some(()).ok_or(ModelError::TooManyTriangles { found, limit })
    }
}
