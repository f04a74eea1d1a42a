//! What the database's errors mean for those who called.

use sqlx::error::DatabaseError;

use crate::StoreError;

/// SQLSTATEs of a transaction that the server ended and that may go well when it
/// is tried again: serialisation failure, deadlock, shutdown, crash, start.
const PASSING: [&str; 5] = ["40001", "40P01", "57P01", "57P02", "57P03"];
/// No room on the server's disk, or the memory that it may use.
const FULL: [&str; 1] = ["53100"];

/// A commit whose answer was lost: it may have been done.
#[derive(Debug, thiserror::Error)]
#[error("whether it was committed is not known: {0}")]
struct Uncertain(#[source] sqlx::Error);

pub(super) fn backend<E: std::error::Error + Send + Sync + 'static>(error: E) -> StoreError {
    let error: Box<dyn std::error::Error + Send + Sync> = Box::new(error);
    match error.downcast_ref::<sqlx::Error>().and_then(state) {
        Some(state) if FULL.contains(&&*state) => StoreError::Full,
        _ => StoreError::Backend(error),
    }
}

/// The error of a COMMIT. One that the server refused came to nothing; of one
/// whose connection broke, or whose server was stopped, nobody knows.
pub(super) fn commit_error(error: sqlx::Error) -> StoreError {
    match state(&error) {
        Some(state) if !state.starts_with("57") => backend(error),
        _ => backend(Uncertain(error)),
    }
}

/// Whether the transaction surely was not committed, and may go well next time.
pub(super) fn came_to_nothing(error: &StoreError) -> bool {
    let StoreError::Backend(cause) = error else { return false };
    let Some(error) = cause.downcast_ref::<sqlx::Error>() else { return false };
    match error {
        sqlx::Error::Io(_) => true,
        _ => state(error).is_some_and(|state| PASSING.contains(&&*state)),
    }
}

fn state(error: &sqlx::Error) -> Option<String> {
    let error: &dyn DatabaseError = error.as_database_error()?;
    error.code().map(|code| code.into_owned())
}
