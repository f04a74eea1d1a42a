//! The kinds of work, one file each.

mod draw;
mod reconstruct;

pub use draw::Draw;
pub use reconstruct::Reconstruct;
