//! Tells other services how jobs ended, after Standard Webhooks
//! (<https://www.standardwebhooks.com>).
//!
//! The store has a message for every job that ended, written with the end; the
//! [`Sender`] takes them from there, signs and sends them until they are taken.

mod message;
mod sender;

pub use sender::{Sender, SenderConfig};
