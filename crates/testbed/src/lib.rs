//! The services of a farm for tests and measurements: PostgreSQL and an S3 server
//! on loopback ports and in temporary folders of their own. They end with the
//! value that stands for them, and with the process in any case.
//!
//! Whoever tests cannot go on without them: what fails panics and says why.

mod farm;
mod postgres;
mod s3;

pub use farm::Farm;
pub use postgres::{Durability, Postgres};
pub use s3::{BUCKET, Fault, KEY_ID, S3, SECRET_KEY};
