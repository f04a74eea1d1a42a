//! The kinds of work, one file each.

mod reconstruct;

pub use reconstruct::Reconstruct;
