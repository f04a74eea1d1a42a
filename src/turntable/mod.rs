//! The turntable method: depth and solids from line drawings at known angles.
//!
//! The frame is the turntable frame: unit sheet pixels, Z up, X right and Y
//! away from the viewer at azimuth 0. In the view at azimuth `a` a point is at
//! column `x = X cos a + Y sin a` from the axis and row `y = -Z` from the
//! origin's row, at depth `d = -X sin a + Y cos a`, which grows away from the
//! camera; in the view at `a + t` the same point is at `x cos t + d sin t`, in
//! the same row.

mod connected;
pub mod depth;
pub mod ink;
pub mod mesh;
mod raster;
pub mod registration;
pub mod silhouette;
pub mod solid;
pub mod views;

pub use views::{View, ViewSet, ViewSetError};
