//! Triangle meshes.
//!
//! | module | what it does | source |
//! |---|---|---|
//! | [`read`] | GLB, glTF, OBJ, PLY and STL from untrusted bytes | the formats' specifications |
//! | [`builtin`] | models made by code | |
//! | [`topology`], [`components`], [`repair`] | whether a mesh bounds a solid, its pieces, and what to mend | |
//! | [`colour`] | the transfer function of sRGB | IEC 61966-2-1 |
//! | [`shading`] | normals that break at creases | |
//! | [`quads`] | triangles joined to quads | |
//! | [`mod@write`] | GLB and PLY | glTF 2.0 |
//! | [`raster`], [`thumbnail`] | the nearest triangle at each sample; a shaded picture | |

pub mod builtin;
pub mod colour;
pub mod components;
pub mod connected;
pub mod quads;
pub mod raster;
pub mod read;
pub mod repair;
pub mod shading;
mod thumbnail;
pub mod topology;
mod triangle_mesh;
pub mod write;

pub use thumbnail::thumbnail;
pub use triangle_mesh::Mesh;
