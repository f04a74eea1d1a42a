//! The tables and figures of Arys 2020, chapter 4, on sheets with known truth.
//!
//! Pure: decoded sheets in, typed rows and the text of files out. Which views
//! are used, what is varied and what is counted is in [`Protocol`]; nothing is
//! chosen by its result but what the dissertation chooses so (block size and
//! least disparity, by the truth), and every row is kept.

mod dense;
mod document;
mod figures;
mod input;
mod plots;
mod protocol;
mod published;
mod ranking;
mod report;
mod run;
mod sparse;
mod table;

pub use input::{StudySheet, TripleError, choose_triple};
pub use protocol::Protocol;
pub use run::{Study, StudyFile, units};
