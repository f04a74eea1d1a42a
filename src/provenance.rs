//! What made a result.

use serde::Serialize;

/// The program: two of the same build make the same bytes of the same input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Program {
    /// As in the package.
    pub version: &'static str,
    /// SHA-256 of the sources, their dependencies' versions and the weights.
    pub build: &'static str,
    /// SHA-256 of the weights of the learned prior.
    pub weights_sha256: &'static str,
}

/// This one.
pub const PROGRAM: Program = Program {
    version: env!("CARGO_PKG_VERSION"),
    build: env!("TURNAROUND_BUILD"),
    weights_sha256: env!("TURNAROUND_WEIGHTS_SHA256"),
};
