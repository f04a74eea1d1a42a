//! Stored bytes: uploaded inputs and published artifacts.
//!
//! A job's inputs belong to the job; its artifacts belong to the attempt that
//! wrote them, so that the bytes of an attempt that lost its lease never mix
//! with those of the one that is published. What is written is durable when the
//! call returns.

mod copy;
mod key;
mod s3;
mod store;

pub(crate) use copy::Copied;
pub use key::{BytesOf, Home, InvalidName, Key};
pub use s3::{ResponseHeaders, UrlSigner};
pub use store::{ByteError, ByteRange, ByteStore, ByteWriter};
