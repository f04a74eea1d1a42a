//! The angles and coordinate frames that all parts share.
//!
//! | frame | axes | unit |
//! |---|---|---|
//! | sheet | x right, y down, from the picture's top left corner | px |
//! | turntable, model | X right at azimuth 0, Y away from the viewer, Z up | sheet px, or the model's own |
//! | glTF | X right, Y up, Z towards the viewer at azimuth 0 | metres |
//!
//! Azimuths turn the camera about Z: at 90 degrees the subject's left side is
//! seen. Elevations raise it from there; see [`Viewpoint`].

mod axes;
mod azimuth;
mod placement;
mod up_axis;
mod viewpoint;
mod viewpoint_list;

pub use axes::{FileAxes, FileUp, Forward};
pub use azimuth::{Azimuth, NotFinite};
pub use placement::{ExportOptions, Origin, Placement};
pub use up_axis::UpAxis;
pub use viewpoint::{Elevation, NoElevation, Viewpoint};
pub use viewpoint_list::ViewpointList;
