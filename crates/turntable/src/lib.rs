//! The method `turntable`: depth and one solid from line drawings at known
//! angles.
//!
//! [`reconstruct`] runs the stages in this order, each a pure function of what
//! the ones before it found:
//!
//! | stage | in | out | source |
//! |---|---|---|---|
//! | [`views`] | sheet | views of one size, by azimuth | |
//! | [`silhouette`] | views | the subject's area and row intervals | |
//! | [`registration`] | silhouettes | views moved to agree; those that contradict | Hernández et al. 2007, silhouette coherence |
//! | [`elevated`] | views from above and below | where they belong beside the level ones, to cut the solid and colour it | |
//! | [`depth`] | views, silhouettes | depth maps from lines matched over neighbouring views, row by row | Szeliski & Weiss 1998, turntable epipolar planes |
//! | [`solid`] | silhouettes, lines, depth maps | a field of signed distances: hull, creases, holes, carving | Laurentini 1994, the visual hull; Curless & Levoy 1996, fusion |
//! | [`surface`] | field | a closed mesh, decimated, with what it rests on | Lorensen & Cline 1987; Garland & Heckbert 1997 |
//! | [`depth`] again | solid | depth maps read off the solid where it is better bound than lines are | |
//! | [`texture`] | draft, drawings | one texture in the drawings' colours | |
//! | [`fit`] | draft | how well it, drawn again, matches each drawing | |
//! | [`metrics`], [`export`] | draft | figures, warnings and files | glTF 2.0 |
//!
//! The frame is the turntable frame: unit sheet pixels, Z up, X right and Y
//! away from the viewer at azimuth 0. In the view at azimuth `a` a point is at
//! column `x = X cos a + Y sin a` from the axis and row `y = -Z` from the
//! origin's row, at depth `d = -X sin a + Y cos a`, which grows away from the
//! camera; in the view at `a + t` the same point is at `x cos t + d sin t`, in
//! the same row. From an elevation `e` it is in row `y = -(Z cos e + d sin e)`, at
//! depth `d cos e - Z sin e`; its column is the same.

pub mod depth;
pub mod depth_map;
mod draft;
pub mod elevated;
pub mod export;
pub mod fit;
pub mod ink;
pub mod metrics;
pub mod options;
mod raster;
pub mod registration;
pub mod silhouette;
pub mod solid;
pub mod surface;
pub mod texture;
pub mod views;

pub use draft::{Draft, DraftError, DraftView, reconstruct, working_bytes};
