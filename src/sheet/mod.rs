//! The model sheet: views of one subject, each drawn at a known angle.

mod azimuth;
mod document;
mod image;
mod view;

pub use self::image::{Drawing, ImageError, ImageLimits, decode, inspect};
pub use azimuth::{Azimuth, NotFinite};
pub use document::{HoleDocument, SheetDocument, TruthDocument, ViewDocument};
pub use view::{Sheet, SheetError, View};
