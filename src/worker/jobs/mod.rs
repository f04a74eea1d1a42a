//! The kinds of work, one file each.

mod draw;
mod reconstruct;
mod sink;

pub use draw::Draw;
pub use reconstruct::Reconstruct;
