//! From a page of drawings to the views of one subject on it.
//!
//! [`decode`] reads a page or an animation. [`propose`] finds the whole figures on a decoded page, told from captions,
//! frames, guides, swatches, heads and props, and guesses at which azimuth each
//! is drawn; [`propose_turn`] does so for pictures that hold one view each, such
//! as the frames of an animated turn. [`preview`] draws what was
//! found on the page, [`cut_out`] makes each view a picture of its own,
//! [`cut_box`] one of a box by hand, and
//! [`sheet_document`] names them as a sheet.
//!
//! | module | what it does |
//! |---|---|
//! | `panels` | frames around drawings |
//! | `blobs` | connected parts of ink and colour joined to drawings; lettering |
//! | `joins` | drawings that touch are cut at the neck of the join |
//! | `select` | which drawings are views of one subject; what the others are |
//! | `shape` | a view's mask, outline, row profile and inner detail |
//! | `layouts`, `azimuths` | usual orders of views, and which of them fits |
//!
//! All of it is pure: no files, no clock. Azimuths are degrees, 0 the front,
//! growing so that at 90 the subject's left side is seen and it faces the
//! picture's left.

mod animation;
mod azimuths;
mod blobs;
mod cut_out;
mod error;
mod find;
mod joins;
mod layouts;
mod letters;
mod options;
mod outline;
mod panels;
mod preview;
mod proposal;
mod select;
mod shape;
mod small;

pub use animation::{AnimationError, decode};
pub use cut_out::{cut_box, cut_out, sheet_document, with_margin};
pub use error::PageError;
pub use find::{azimuth_order, propose, propose_all, propose_turn, set_azimuths};
pub use options::PageOptions;
pub use outline::outline_of;
pub use preview::{preview, reduced};
pub use proposal::{Figure, LeftOut, LeftOutKind, PageProposal};
