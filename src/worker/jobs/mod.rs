//! The kinds of work, one file each.

mod draw;
mod reconstruct;
mod sink;
mod watch;

pub use draw::Draw;
pub use reconstruct::Reconstruct;

use jobs::Failure;

use crate::failure_code::FailureCode;

fn failure(code: FailureCode, detail: impl ToString) -> Failure {
    Failure { code: code.name().to_owned(), detail: detail.to_string() }
}
