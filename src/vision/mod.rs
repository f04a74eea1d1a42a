//! Computer vision stages: pure functions from typed data to typed data.
