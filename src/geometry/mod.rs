//! Shapes that several stages share.

mod mesh;

pub use mesh::Mesh;
